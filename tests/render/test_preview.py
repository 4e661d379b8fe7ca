"""Previews: closed forms, errors, files, the command."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from vgonio import models, simulate
from vgonio.cli import main
from vgonio.cli.render import gather
from vgonio.compare import colour, fit_model, save_fit
from vgonio.errors import FileFormatError, InputError
from vgonio.render import Preview, delta_e, of_dataset, of_fit, of_model, of_table, preview, rgb, use
from vgonio.render.images import write_exr, write_png

W = np.arange(400.0, 721.0, 80.0)
PLAIN = {"alpha": 0.3, "material": "Al"}
SHIFTED = {**PLAIN, "h": 8e-4, "w": 2.2}


def pair(**parameters):
    return [
        of_model("cook-torrance-1982", PLAIN | parameters, name="plain"),
        of_model("clausen-2022", SHIFTED | parameters, name="shifted"),
    ]


@pytest.fixture(scope="module")
def small():
    if use("auto").variant().startswith("scalar"):
        pytest.skip("no LLVM: the previews of these tests would take a minute")
    return preview(pair(), Preview(size=48, wavelength_nm=W, samples=2, passes=4))


def test_floor_in_closed_form(mi):
    """Radiance of the sunlit floor: ρ/π · E cos θ, at a corner that the sphere's shadow and the spot do not reach."""
    options = Preview(size=8, wavelength_nm=W, samples=2, passes=2, max_depth=2)
    data = preview(pair()[:1], options, "scalar" if mi.variant().startswith("scalar") else "llvm")
    cos = 0.75 / np.linalg.norm([0.55, 0.7, -0.75])
    np.testing.assert_allclose(data["radiance"].values[0, 0, 0], 0.2 / np.pi * cos, rtol=1e-5)
    assert data.attrs["variant"] == mi.variant()


def test_white_light_is_white(small):
    """The floor is grey: D65 with the Y of its radiance."""
    floor = small["tristimulus"].values[0, 0, 0]
    np.testing.assert_allclose(floor / floor[1], [0.95046, 1.0, 1.08906], rtol=2e-4)
    np.testing.assert_allclose(np.ptp(rgb(small)[0, 0, 0]), 0, atol=1e-3)


def test_difference_is_where_the_shift_is(small):
    difference = delta_e(small)
    assert difference.attrs["reference"] == "plain"
    assert difference.sel(material="plain").values.max() == 0
    assert difference.sel(material="shifted").values[0, 0] < 0.2  # the floor differs by reflected light alone
    assert difference.sel(material="shifted").values.max() > 2
    other = delta_e(small, "shifted")
    np.testing.assert_allclose(other.sel(material="plain"), difference.sel(material="shifted"), rtol=1e-9)


def test_shift_reddens_the_mirror_direction(small):
    ratio = small["radiance"].sel(material="shifted") / small["radiance"].sel(material="plain")
    bright = small["tristimulus"].sel(material="plain", xyz="Y")
    y, x = np.unravel_index(bright.values.argmax(), bright.shape)
    spectrum = ratio.isel(y=y, x=x).values
    assert np.all(np.diff(spectrum) > 0)
    np.testing.assert_allclose(np.interp(600, W, spectrum), 1, atol=0.01)


def test_a_fitted_metal_is_its_model(small):
    """Fits of conductors say k_d = 0, which is no spectrum that Mitsuba takes."""
    data = models.evaluate("clausen-2022", [0, 30, 60], range(-80, 81, 20), W, **SHIFTED)
    fit = of_fit(fit_model(data, "clausen-2022", errors="none"), "shifted")
    picture = preview([fit], Preview(size=48, wavelength_nm=W, samples=2, passes=4))
    np.testing.assert_allclose(picture["radiance"][0], small["radiance"].sel(material="shifted"), rtol=1e-3)


def test_error_is_that_of_further_passes(small):
    """Stated error against the difference to an independent picture of many more paths, within a factor 1.5."""
    many = preview(pair()[:1], Preview(size=48, wavelength_nm=W, samples=16, passes=8, seed=99))
    a, b = (d["tristimulus"].sel(xyz="Y").values[0] for d in (small, many))
    actual = np.sqrt(np.mean((a - b) ** 2) / np.mean(b**2))
    stated = np.hypot(float(small["error"][0]), float(many["error"][0]))
    assert stated / 1.5 < actual < stated * 1.5


def test_errors_of_passes_and_their_random_numbers(monkeypatch):
    """Made-up passes: mean, s/√n with s² of n − 1, the error of Y over the picture; other seeds share no pass."""
    previews = sys.modules[preview.__module__]  # the name in the package is the function
    seeds: list[int] = []

    def passed(mi, scene, integrator, wavelength, samples, seed, **_):
        seeds.append(seed)
        return np.random.default_rng([seed, scene]).random((8, 8, W.size))

    monkeypatch.setattr(previews, "radiance", passed)
    monkeypatch.setattr(previews, "scenes_of", lambda *_: [0, 1])
    renderer, matrix = SimpleNamespace(load_dict=lambda _: None), colour.weights(W)[0]
    found = {}
    for seed in (0, 1, 2):
        options = Preview(size=8, wavelength_nm=W, samples=3, passes=5, seed=seed)
        found[seed] = previews._one(renderer, pair()[0], options, matrix, None)
    used = np.reshape(seeds, (3, 5, 2))
    assert np.all(used[..., 0] == used[..., 1])  # both lights of a pass
    assert np.unique(used).size == 15
    each = np.array([sum(passed(None, s, None, W, 3, n) for s in (0, 1)) @ matrix for n in used[1, :, 0]])
    np.testing.assert_allclose(found[1]["tristimulus"], each.mean(axis=0), rtol=1e-12)
    stderr = each.std(axis=0, ddof=1) / np.sqrt(5)
    np.testing.assert_allclose(found[1]["tristimulus_stderr"], stderr, rtol=1e-6)
    y = each.mean(axis=0)[..., 1]
    assert float(found[1]["error"]) == pytest.approx(np.sqrt(np.mean(stderr[..., 1] ** 2) / np.mean(y**2)), rel=1e-6)


def test_target_error_and_time(small, monkeypatch):
    first = float(small["error"][0])
    data = preview(pair()[:1], Preview(size=48, wavelength_nm=W, samples=2, passes=4, target_error=first / 2))
    assert float(data["error"][0]) <= first / 2
    assert int(data["samples"][0]) > 3 * int(small["samples"][0])
    # a clock that goes on by a second whenever it is looked at: twice a pass, once in a pass before the least of two
    previews, ticks = sys.modules[preview.__module__], itertools.count()
    monkeypatch.setattr(previews, "time", SimpleNamespace(perf_counter=lambda: float(next(ticks))))
    for max_seconds, passes in ((1, 2), (3, 2), (4, 3), (6, 4)):
        options = Preview(size=8, wavelength_nm=W, samples=1, passes=2, target_error=1e-9, max_seconds=max_seconds)
        assert int(preview(pair()[:1], options)["samples"][0]) == passes


def test_progress_reaches_the_end():
    seen: list[tuple[str, float]] = []
    options = Preview(size=8, wavelength_nm=W, samples=1, passes=2)
    preview(pair(), options, progress=lambda part, share: seen.append((part, share)))
    assert [s for p, s in seen if p == "plain"][-1] == 1
    assert [p for p, _ in seen] == sorted((p for p, _ in seen), key=["plain", "shifted"].index)


def test_scalar_and_llvm_agree(small):
    """Different random numbers, the same picture: every pixel within 5 standard errors of the two."""
    options = Preview(size=8, wavelength_nm=W, samples=8, passes=4, max_depth=3)
    a, b = (preview(pair()[1:], options, v) for v in ("scalar", "llvm"))
    error = np.hypot(a["tristimulus_stderr"], b["tristimulus_stderr"]) + 1e-4
    assert float((abs(a["tristimulus"] - b["tristimulus"]) / error).max()) < 7


def test_table_of_a_model_looks_like_its_formula(small, tmp_path):
    """The way through RGL's layout and `measured`: the same picture but for interpolation, 2 % RMS."""
    w = np.arange(400.0, 721.0, 40.0)
    hemisphere = models.evaluate("cook-torrance-1982", range(0, 86, 5), range(-88, 89, 2), w, **PLAIN)
    hemisphere.attrs["method"] = "measured"  # as if nobody knew the formula
    table = of_dataset(hemisphere, "table", folder=tmp_path)
    assert table.route == "measured"
    assert [p.suffix for p in tmp_path.iterdir()] == [".bsdf"]
    # direct light alone has no noise here
    data = preview([pair()[0], table], Preview(size=48, wavelength_nm=W, samples=2, passes=4, max_depth=2))
    a, b = data["tristimulus"].sel(xyz="Y").values
    assert np.sqrt(np.mean((a - b) ** 2) / np.mean(a**2)) < 0.02
    assert of_table(next(tmp_path.iterdir())).bsdf["type"] == "measured"


def test_dataset_of_a_model_goes_by_formula():
    given = {**SHIFTED, "eta": 1.5, "k_d": [0.2, 0.3], "clamp": True}
    given.pop("material")
    data = models.evaluate("clausen-2022", [0], [0, 10], [400, 700], **given)
    made = of_dataset(data, "m")
    assert made.route == "formula"
    assert made.bsdf["eta"] == 1.5
    assert "material" not in made.bsdf
    assert made.range_nm == (400.0, 700.0)


def test_files(small, tmp_path, mi):
    path = write_exr(tmp_path / "a.exr", small, "shifted")
    bitmap = mi.Bitmap(str(path))
    names = [field.name for field in bitmap.struct_()]
    assert names[:4] == ["R", "G", "B", "S0.400,000000nm"]
    pixels = np.array(bitmap)
    np.testing.assert_allclose(pixels[..., 3:], small["radiance"].sel(material="shifted"), rtol=1e-6)
    write_png(tmp_path / "a.png", small, "shifted")
    from matplotlib.image import imread

    np.testing.assert_allclose(imread(tmp_path / "a.png")[..., :3], rgb(small)[1], atol=0.5 / 255 + 1e-6)


def test_figure(small):
    from vgonio.report.render_figures import previews

    figure = previews(small)
    assert [ax.get_title("left") for ax in figure.axes[:3]] == ["plain", "shifted", "ΔE₀₀ from plain"]
    assert "ΔE₀₀" in figure.axes[-1].get_ylabel()


@pytest.mark.parametrize(
    "options, said",
    [
        ({"size": 4}, "size"),
        ({"passes": 1}, "passes"),
        ({"target_error": 0.0}, "target_error"),
        ({"wavelength_nm": [500, 520]}, "450 to 650"),
        ({"mesh": "ball.stl"}, ".ply"),
    ],
)
def test_bad_options(options, said):
    with pytest.raises(InputError, match=said):
        Preview(**options)


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["clausen-2022:alpha=0.3,h=1e-3"], "needs w"),
        (["clausen-2022:alpha=0.3,h=1e-3,w=2,x=1"], "no parameter 'x'"),
        (["cook-torrance-1982:alpha=-1"], "alpha"),
        (["cook-torrance-1982:alpha"], "name=value"),
        (["cook-torrance-1982:alpha=0.3", "cook-torrance-1982:alpha=0.3", "--reference", "x"], "--reference"),
        (["cook-torrance-1982:alpha=0.3", "--wavelengths", "300:800:20"], "known from"),
        (["cook-torrance-1982:alpha=0.3", "--variant", "lvm"], "did you mean 'llvm'"),
        (["nowhere.bsdf"], "no such file"),
        (["nowhere.json"], "no such file"),
        (["cook-torrance-1982:alpha=0.3", "-o", "a.jpg"], "a.jpg"),
        (["junk.bsdf"], "no tensor file"),
        (["cook-torrance-1982:alpha=0.3", "--mesh", "junk.ply"], "Mitsuba cannot read junk.ply: "),
        (["cook-torrance-1982:alpha=0.3", "--wavelengths", "500:600"], "START:STOP:STEP"),
    ],
)
def test_bad_input_is_one_line(arguments, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("junk.bsdf", "junk.ply"):
        (tmp_path / name).write_text("junk")
    assert main(["render", *arguments, "--size", "8"]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["junk.bsdf", "junk.ply"]


def test_command(capsys, tmp_path):
    arguments = ["cook-torrance-1982:alpha=0.3", "clausen-2022:alpha=0.3,h=8e-4,w=2.2", "--name", "plain", "--json"]
    sizes = ["--size", "16", "--samples", "1", "--passes", "2", "--wavelengths", "400:700:60"]
    figure, folder = tmp_path / "new" / "f.png", tmp_path / "pictures"
    assert main(["render", *arguments, *sizes, "-o", str(figure), "--images", str(folder), "-q"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [m["material"] for m in found["materials"]] == ["plain", "clausen-2022:alpha=0.3,h=8e-4,w=2.2"]
    assert found["materials"][1]["ΔE₀₀ mean"] > 0
    assert figure.stat().st_size > 5000
    assert sorted(p.suffix for p in folder.iterdir()) == [".exr", ".exr", ".png", ".png"]


def test_without_mitsuba_the_extra_is_named():
    code = (
        "import sys; sys.modules['mitsuba'] = None\n"
        "from vgonio.cli import main\n"
        "sys.exit(main(['render', 'cook-torrance-1982:alpha=0.3']))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.strip() == 'vgonio: error: the Python package mitsuba is missing: pip install "vgonio[render]"'


def test_a_missing_table(tmp_path):
    with pytest.raises(FileFormatError, match="no such file"):
        of_table(tmp_path / "none.bsdf")


def test_a_simulated_result_in_a_fresh_process(tmp_path):
    """A result's group as a table, with nothing imported before: rays over the hemisphere beside a formula."""
    needed = {
        "surface": {"generate": {"kind": "gaussian", "rms_um": 0.5, "correlation_um": 5.0, "shape": [64, 64],
                                 "pitch_um": 0.5, "seed": 1}},
        "material": {"name": "Al"},
        "light": {"wavelength_nm": [400, 500, 600, 700], "theta_i_deg": [0, 30, 60]},
        "detector": {"kind": "hemisphere", "resolution_deg": 15},
        "geometric": {"rays": 20_000},
    }  # fmt: skip
    simulate(needed, output=tmp_path / "r.nc")
    command = ["render", f"{tmp_path}/r.nc:rays", "cook-torrance-1982:alpha=0.2", "-o", f"{tmp_path}/f.png", "--json"]
    sizes = ["--size", "16", "--samples", "1", "--passes", "2", "--wavelengths", "400:700:100", "-q"]
    code = f"import sys; from vgonio.cli import main; sys.exit(main({[*command, *sizes]!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)["materials"]
    assert [m["route"] for m in found] == ["measured", "formula"]
    assert 0 < found[1]["ΔE₀₀ mean"] < 40


def test_fits_by_formula_with_their_spectra(tmp_path):
    """A fitted dielectric from its file: roughness, index and k_d(λ) are those of the fit."""
    w = np.arange(400.0, 701.0, 50.0)
    k_d = np.linspace(0.2, 0.6, w.size)
    data = models.evaluate("cook-torrance-1982", range(0, 81, 20), range(-80, 81, 10), w, alpha=0.4, eta=1.5, k_d=k_d)
    save_fit(fit_model(data, "cook-torrance-1982", material=None, errors="none", starts=1), tmp_path / "fit.json")
    made = gather([str(tmp_path / "fit.json")], "half-angle", W, ["paint"])[0]
    assert made.route == "formula"
    assert made.name == "paint"
    np.testing.assert_allclose([made.bsdf["alpha"], made.bsdf["eta"]], [0.4, 1.5], rtol=1e-3)
    found = [float(v) for v in made.bsdf["k_d"]["values"].split(",")]
    np.testing.assert_allclose(found, np.pad(k_d, 1, "edge"), rtol=2e-3)


def test_error_of_passes_is_that_of_their_mean():
    """Each pass has its own random numbers and an equal share of the samples; s/√n with s² of n − 1."""
    from vgonio.render import in_passes

    asked = []

    def render(samples, seed):
        asked.append((samples, seed))
        return np.array([1.0, 10.0]) * np.sin(seed)

    mean, error = in_passes(render, 40, 4, seed=3)
    values = np.outer(np.sin([seed for _, seed in asked]), [1.0, 10.0])
    assert [samples for samples, _ in asked] == [10] * 4
    assert len({seed for _, seed in asked}) == 4
    np.testing.assert_allclose(mean, values.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(error, values.std(axis=0, ddof=1) / 2, rtol=1e-12)
    in_passes(render, 40, 4, seed=4)
    assert len({seed for _, seed in asked}) == 8
