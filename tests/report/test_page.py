"""The page: well-formed, loads nothing, leaves out what is missing and says why, and warns where energy is wrong."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio.errors import FileFormatError
from vgonio.report import page, render

VOID = {"meta", "link", "br", "img", "hr", "input"}
SECTIONS = (
    ("surface", "reflections", "lobes", "colour", "spectra")
    + ("energy", "agreement", "errors", "plan", "provenance")
)  # fmt: skip


class Checker(HTMLParser):
    """Collects what is opened and not closed, ids, and what is referred to."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.faults: list[str] = []
        self.ids: list[str] = []
        self.loads: list[str] = []
        self.inner: list[str] = []
        self.words: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.open += [] if tag in VOID else [tag]
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            if name in ("src", "href", "xlink:href", "data", "srcset", "poster", "action"):
                (self.inner if (value or "").startswith("#") else self.loads).append(value or "")
            self.inner += re.findall(r"url\((#[^)]*)\)", value or "")

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        if not self.open or self.open[-1] != tag:
            self.faults.append(f"</{tag}> closes {self.open[-3:]} at line {self.getpos()[0]}")
        else:
            self.open.pop()

    def handle_data(self, data):
        if not {"style", "svg", "pre"} & set(self.open):
            self.words.append(data)


def checked(text: str) -> Checker:
    found = Checker()
    found.feed(text)
    found.close()
    assert not found.faults
    assert not found.open
    return found


def words(text: str) -> str:
    """The visible text outside figures, with single spaces."""
    return re.sub(r"\s+", " ", "".join(checked(text).words).replace("\u00a0", " "))


def section(text: str, key: str) -> str:
    """The source of one section."""
    return re.search(rf'<section id="{key}">(.*?)</section>', text, re.S).group(1)


@pytest.fixture(scope="module")
def whole(full_result) -> str:
    return render(full_result)


def test_page_is_well_formed_and_its_ids_are_unique(whole):
    found = checked(whole)
    assert whole.startswith("<!DOCTYPE html>") or whole.lstrip().startswith("<!DOCTYPE html>")
    assert len(found.ids) == len(set(found.ids))
    assert {i[1:] for i in found.inner} <= set(found.ids)


def test_page_loads_nothing_from_elsewhere(whole):
    found = checked(whole)
    assert all(load.startswith("data:image/") for load in found.loads)
    assert found.loads  # the height map is one
    css = re.search(r"<style>(.*?)</style>", whole, re.S).group(1)
    assert not re.search(r"@import|url\(|@font-face", css)
    assert "<script" not in whole
    # namespaces of SVG are names, not addresses to load
    assert set(re.findall(r"https?://[^\"'\s<)]+", whole)) <= {
        "http://www.w3.org/2000/svg",
        "http://www.w3.org/1999/xlink",
    }


def test_all_sections_are_there_with_their_figures(whole):
    for key in SECTIONS:
        assert "Left out" not in section(whole, key), key
    for key, figures in (
        ("surface", 4),
        ("reflections", 1),
        ("lobes", 1),
        ("colour", 4),
        ("spectra", 2),
        ("energy", 2),
    ):
        assert section(whole, key).count("<svg ") == figures, key
    assert len(whole.encode()) < 5e6


def test_page_is_the_same_twice(ray_result):
    tree = tree_of(rays=ray_result.isel(wavelength=[0], theta_i=[2]))
    assert render(tree) == render(tree)


def test_tables_hold_error_seconds_and_plan(whole):
    errors = words(section(whole, "errors"))
    for wanted in ("Rays", "Waves (Kirchhoff)", "Measured", "4.20", "All parts", "from a few outputs", "embree, CPU"):
        assert wanted in errors
    plan = section(whole, "plan")
    assert "left out" in plan
    assert "no filter asked for" in plan
    assert "Expect speckle" in words(section(whole, "verdict"))
    assert "a1b2c3" in section(whole, "provenance")
    assert "theta_i_deg" in section(whole, "provenance")


def test_verdict_speaks_of_reflections_agreement_shift_and_error(whole):
    verdict = words(section(whole, "verdict"))
    for wanted in (
        "Multiple reflections make",
        "NRMSE",
        "Colour shift of the waves (Kirchhoff): +",
        "(towards red,",
        "To be wary of",
        "says of itself: made by a test",
        "The largest known error is",
        "sum is 1 within",
    ):
        assert wanted in verdict


def test_verdict_gives_the_share_that_was_put_in(whole, full_result):
    """The synthetic rays at 40° in the mirror direction: share from their own by-bounce parts, two digits."""
    parts = full_result["rays"]["brdf_by_bounce"].sel(theta_i=40, theta_o=-40, wavelength=540)
    share = float(parts[1:].sum() / parts.sum())
    said = rf"{100 * share:.1f} % \(± [\d.]+ %\) of the light in the mirror direction"
    assert re.search(said, words(section(whole, "verdict")))


def test_waves_that_reflect_too_much_are_said_first(whole, full_result):
    alarm = words(re.search(r'<p class="alarm".*?</p>', whole, re.S).group(0))
    worst = 100 * (float(full_result["waves"]["energy_reflected"].max()) - 1)
    assert f"by up to {worst:.0f} %" in alarm
    assert "80°" in alarm


def test_tallies_that_do_not_close_raise_an_alarm(ray_result):
    one = ray_result.sel(wavelength=[540])
    assert "alarm" not in section(render(tree_of(rays=one)), "verdict")
    bad = one.copy(deep=True)
    bad["energy_absorbed"][3] += 1e-4
    text = render(tree_of(rays=bad))
    alarm = words(re.search(r'<p class="alarm".*?</p>', text, re.S).group(0))
    assert "do not close" in alarm
    assert "60°" in alarm
    assert "100.0100 %" in alarm
    bad.attrs["material"] = "perfect"
    assert "white furnace of the rays fails" in words(section(render(tree_of(rays=bad)), "verdict"))


def tree_of(**groups: xr.Dataset) -> xr.DataTree:
    tree = xr.DataTree.from_dict(groups)
    tree.attrs["title"] = "a test"
    stages = [{"name": "trace", "needed": False, "why": "the scene has no [geometric]"}]
    stages.append({"name": "compare", "needed": False, "why": "only one result (waves): nothing to compare with"})
    tree.attrs["plan"] = json.dumps({"stages": stages})
    return tree


@pytest.mark.parametrize("kept", [(), ("rays",), ("waves",), ("measured",), ("rays", "measured"), ("surface",)])
def test_missing_groups_are_left_out_with_the_reason(full_result, kept):
    groups = {name: full_result[name].to_dataset() for name in kept}
    groups = {name: data.isel(theta_i=[0, 2]) if "theta_i" in data.dims else data for name, data in groups.items()}
    text = render(tree_of(**groups))
    checked(text)
    absent = {key for key in SECTIONS if "Left out" in section(text, key)}
    expected = {"provenance"} | (set() if "surface" in kept else {"surface"})
    expected |= set() if "rays" in kept else {"reflections"}
    expected |= set() if {"rays", "waves"} & set(kept) else {"energy"}
    results = [name for name in kept if name != "surface"]
    expected |= set() if results else {"lobes", "colour", "spectra", "errors"}
    expected |= set() if len(results) > 1 else {"agreement"}
    assert absent == expected
    if "rays" not in kept:
        assert "the scene has no [geometric]." in section(text, "reflections")


def test_one_wavelength_leaves_colour_out(full_result):
    groups = {name: full_result[name].to_dataset().sel(wavelength=[540]) for name in ("rays", "waves", "measured")}
    text = render(tree_of(**groups))
    for key in ("colour", "spectra"):
        assert "there is one wavelength" in section(text, key)
    assert "NRMSE" in section(text, "verdict")
    assert section(text, "lobes").count("<svg ") == 1


def test_hemisphere_has_polar_maps(hemisphere_rays, hemisphere_waves):
    text = render(tree_of(rays=hemisphere_rays, waves=hemisphere_waves))
    checked(text)
    for key in ("reflections", "lobes"):
        assert section(text, key).count("<svg ") == 1
    assert "hemisphere" in section(text, "colour")
    assert "NRMSE" in section(text, "verdict")


def test_single_angles_work(full_result):
    groups = {name: full_result[name].to_dataset().sel(theta_i=[0.0]) for name in ("rays", "waves")}
    checked(render(tree_of(**groups)))
    groups = {name: data.sel(theta_o=[0.0]) for name, data in groups.items()}
    checked(render(tree_of(**groups)))


def test_further_theories_are_shown_under_their_names(wave_result):
    first = wave_result.sel(wavelength=[540])
    other = first.assign_attrs(theory="generalized-harvey-shack")
    text = words(render(tree_of(waves=first, waves_generalized_harvey_shack=other)))
    assert "Waves (generalized Harvey–Shack) against the waves (Kirchhoff)" in text  # the more trusted is the reference


def test_user_text_is_escaped(wave_result):
    tree = tree_of(
        waves=wave_result.isel(wavelength=[0], theta_i=[0]).assign_attrs(material="<script>alert(1)</script>")
    )
    tree.attrs["title"] = "a <b> & c"
    text = render(tree)
    checked(text)
    assert "<script" not in text
    assert "a &lt;b&gt; &amp; c" in text


def test_page_is_written_whole_or_not_at_all(tmp_path, wave_result):
    tree = tree_of(waves=wave_result.isel(wavelength=[0], theta_i=[0]))
    path = page(tree, tmp_path / "page.html")
    assert path.read_text(encoding="utf-8").rstrip().endswith("</html>")
    with pytest.raises(FileFormatError, match="cannot write"):
        page(tree, tmp_path / "absent" / "page.html")
    (tmp_path / "folder.html").mkdir()
    with pytest.raises(FileFormatError, match="cannot write"):
        page(tree, tmp_path / "folder.html")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder.html", "page.html"]


def test_page_from_a_file_and_from_a_surface(tmp_path, wave_result):
    """What went through NetCDF gives the same page; a Heightfield takes the place of a missing group."""
    tree = tree_of(waves=wave_result.isel(wavelength=[0], theta_i=[0, 4]))
    again = vg.open(vg.save(tree, tmp_path / "r.nc"))
    surface = vg.surface.gaussian(rms_um=0.5, correlation_um=4.0, shape=(64, 80), pitch_um=0.5, seed=4)
    text = render(again, surface=surface)
    assert render(tree, surface=surface) == text
    assert "Left out" not in section(text, "surface")
    assert "64" in section(text, "surface")


def test_agreement_of_results_that_differ_by_known_factors(wave_result):
    """A fifth more light on the source's side only: medians 0 and 20 %, and NRMSE in closed form; to rounding."""
    from vgonio.compare import compare
    from vgonio.report.agreement import pairs

    side = wave_result["theta_o"] * wave_result["theta_i"] > 0
    brighter = wave_result.copy(deep=True)
    brighter["brdf"] = wave_result["brdf"] * (1 + 0.2 * side)
    results = {name: d.drop_attrs(deep=False) for name, d in {"a": brighter, "b": wave_result}.items()}
    (found,) = pairs(compare(results), results)
    assert found.mirror_side.value == pytest.approx(0.0, abs=1e-12)
    assert found.source_side.value == pytest.approx(0.2, rel=1e-9)
    reference = wave_result["brdf"]
    difference = 0.2 * reference.where(side, 0.0)
    assert found.nrmse.value == pytest.approx(float(np.sqrt((difference**2).mean()) / reference.mean()), rel=1e-9)
    expected = np.sqrt(2 * float((wave_result["brdf_stderr"] ** 2).mean())) / float(reference.mean())
    assert found.noise == pytest.approx(expected, rel=1e-9)


def test_mean_shift_takes_bright_directions_near_mirror_and_back():
    """Slopes +1 within 15° of the mirror direction, −2 near back-scattering, rubbish elsewhere and where it is dark."""
    from vgonio.report.shifts import in_words, mean_shift

    theta_i, theta_o = np.arange(0.0, 81, 20), np.arange(-80.0, 81, 10)
    i, o = np.meshgrid(theta_i, theta_o, indexing="ij")
    slope = np.where(np.abs(o + i) <= 15, 1e-3, np.where(np.abs(o - i) <= 15, -2e-3, 77.0))
    slope[0] = 5.0  # at normal incidence both sides are one
    bright = np.ones(slope.shape, bool)
    dark = (i == 40) & (o == -40)
    slope[dark], bright[dark] = 99.0, False
    dims = ("theta_i", "theta_o")
    data = xr.Dataset({"slope": (dims, slope), "bright": (dims, bright)}, {"theta_i": theta_i, "theta_o": theta_o})
    mirror, back = mean_shift(data, "mirror"), mean_shift(data, "back")
    assert (mirror.slope, mirror.stderr) == pytest.approx((1e-3, 0.0))
    assert (back.slope, back.stderr) == pytest.approx((-2e-3, 0.0))
    assert (mirror.directions, back.directions) == (3 * 4 - 2, 3 * 4 - 1)  # at 80° one of three is beyond the grid
    assert mean_shift(data.isel(theta_i=[0]), "mirror") is None
    assert in_words(None) == "too little light to tell"


@pytest.mark.parametrize(
    ("slope", "stderr", "said"),
    [(1e-3, 1e-4, "towards red, 10 σ"), (-1e-3, 1e-4, "towards blue"), (1e-3, 5e-4, "not significant, 2.0 σ")]
    + [(2e-5, 1e-6, "practically none"), (8e-5, 1e-5, "hardly any")],
)
def test_shift_is_called_what_it_is(slope, stderr, said):
    from vgonio.report.shifts import MeanShift, in_words

    assert said in in_words(MeanShift(slope, stderr, 9))


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [(9.123, 0.31, "9.1 ± 0.3"), (17.55, 0.157, "17.55 ± 0.16"), (-26.12, 0.99, "−26.1 ± 1.0"), (1234, 56, "1234 ± 56")]
    + [(3.0, np.nan, "3.00"), (2e-7, 1e-7, "2.0·10⁻⁷ ± 1·10⁻⁷")],
)
def test_errors_decide_on_the_digits(value, error, text):
    from vgonio.report.tables import plus_minus

    assert plus_minus(value, error) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.12345, "12 %"), (1.5, "150 %"), (0.001, "0.10 %"), (-0.034, "−3.4 %"), (0.0, "0 %"), (2e-7, "2.0·10⁻⁵ %")]
    + [(np.nan, "–"), (9.994, "999 %"), (0.0999, "10 %")],
)
def test_percentages(value, text):
    from vgonio.report.tables import percent

    assert percent(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (3.14159, "3.14"),
        (12345.6, "12\u202f300"),
        (0.00012, "1.20·10⁻⁴"),
        (-2.0, "−2.00"),
        (None, "–"),
        ("auto", "auto"),
    ]
    + [(560.0, "560"), (0, "0"), (np.inf, "∞"), (999.9, "1000"), (9.999, "10.0")],
)
def test_numbers(value, text):
    from vgonio.report.tables import number

    assert number(value) == text
