"""The page of a display and its figures."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from vgonio import display as vd
from vgonio.report import display_figures as figures
from vgonio.report.display_document import display_page, render_display

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def two_eyes(emissive) -> list[vd.Examined]:
    right = vd.virtual_display("wide-gamut", tone=2.6, white_cd_m2=120, crosstalk=0.05)
    return [
        vd.Examined(with_eye(emissive.model, "left"), emissive.check, emissive.calibration),
        vd.examine_virtual(right, vd.patches("cie-224"), eye="right")[0],
    ]


def with_eye(model, eye):
    from dataclasses import replace

    return replace(model, eye=eye)


def test_page_of_two_eyes(two_eyes, tmp_path):
    path = display_page(two_eyes, tmp_path / "page.html", "A headset")
    text = path.read_text(encoding="utf-8")
    assert text.count("<svg") == 8
    for svg in re.findall(r"<svg.*?</svg>", text, flags=re.S):
        ElementTree.fromstring(svg)
    for part in ("A headset", "Framework 1", "Framework 2", "left eye", "right eye", "As thesis table 5.1", "the lens"):
        assert part in text
    assert not re.search(r"\bnan\b", text)
    # the verdict: the left eye obeys, the right one does not, and it says where
    assert re.search(r"Left: The display obeys the model", text)
    assert re.search(r"Right: The display departs from the model: independence fails.*changes by \+", text)
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    assert "http" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", text)


def test_numbers_of_the_page_are_those_of_the_check(two_eyes):
    text = render_display(two_eyes)
    for one in two_eyes:
        s = one.check.statistics()
        assert f"{s['mean']:.2f}" in text
        assert f"{s['max']:.2f}" in text
        for profile in one.calibration.statistics().values():
            assert f"{profile['mean']:.2f}" in text
        assert f"{one.model.white_xyz[1]:.0f}" in text


def test_a_page_without_test_colours_says_why(model):
    text = render_display([vd.Examined(model)])
    assert "Left out: no test colours" in text
    assert "Left out: no reproductions of patches" in text


def test_notes_of_the_fit_are_on_the_page():
    from vgonio.errors import VgonioWarning

    display = vd.virtual_display("wide-gamut")
    with pytest.warns(VgonioWarning, match="levels"):
        model = vd.fit(display.measure(vd.ramp_colours(6)))
    text = render_display([vd.Examined(model)])
    assert "To be wary of" in text
    assert "10 or more are better" in text


def test_figures_show_what_they_say(two_eyes):
    models = {d.model.eye: d.model for d in two_eyes}
    white = figures.white_spectra(models)
    for ax, model in zip(white.axes, models.values()):
        measured, simulated = (line.get_ydata() for line in ax.lines)
        np.testing.assert_allclose(measured, 1e3 * model.white)
        np.testing.assert_allclose(simulated, 1e3 * model.spectra(np.ones(3)))
    checks = {d.model.eye: d.check for d in two_eyes}
    for ax, check in zip(figures.delta_e_histogram(checks).axes, checks.values()):
        assert sum(bar.get_height() for bar in ax.patches) == len(check.delta_e)
    patches = figures.patches(two_eyes[1].calibration)
    assert len(patches.axes) == 6
    outer, inner = patches.axes[0].collections
    assert len(outer.get_paths()) == len(inner.get_paths()) == 99
    diagram = figures.chromaticity_diagram({"left": models["left"]})
    labels = [t.get_text() for t in diagram.axes[0].get_legend().get_texts()]
    assert labels == ["sRGB", "Adobe RGB", "this display", "its white", "D65"]


def test_histogram_gathers_what_is_beyond(two_eyes):
    from dataclasses import replace

    calibration = two_eyes[0].calibration
    wild = replace(calibration, delta_e={k: d * 10 for k, d in calibration.delta_e.items()})
    lower = figures.patches(wild).axes[3:]
    assert len(lower) == 3
    for ax, d in zip(lower, wild.delta_e.values()):
        assert sum(bar.get_height() for bar in ax.patches) == len(d)


def test_coverage_in_closed_form(model):
    """A display of a standard's own primaries covers it, and half a triangle covers half."""
    from dataclasses import replace

    from vgonio.display.summary import _area, _clipped

    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    half = np.array([[0.0, 0], [1, 0], [1, 1]])
    assert _area(_clipped(square, half)) == pytest.approx(0.5)
    assert _area(_clipped(half, square)) == pytest.approx(0.5)
    assert _area(_clipped(square + 5, half)) == 0
    small = replace(model, primaries=model.primaries * 0.5 + 0.5 * model.primaries.mean(axis=0))
    assert vd.coverage(small, "sRGB") < vd.coverage(model, "sRGB")


@pytest.mark.parametrize("width", [1280, 500])
def test_page_in_a_browser(browser, two_eyes, tmp_path, width):
    """As the page of results is looked at: all pictures there, nothing fetched, nothing outside window or figure."""
    spec = importlib.util.spec_from_file_location("probe", ROOT / "tests" / "report" / "test_browser.py")
    probe = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(probe)
    page = display_page(two_eyes, tmp_path / "page.html")
    text = page.read_text(encoding="utf-8")
    page.write_text(text.replace("</head>", probe.PROBE, 1), encoding="utf-8")
    embedded = probe.embedded_pictures(text)
    assert len(embedded) >= 2
    command = [*browser, f"--user-data-dir={tmp_path}", f"--window-size={width},900", page.as_uri()]
    run = subprocess.run(command, capture_output=True, text=True, timeout=600, check=True)
    assert [line for line in run.stderr.splitlines() if "CONSOLE" in line] == []
    seen = json.loads(re.search(r"<title>(\{.*?\})</title>", run.stdout, re.S).group(1).replace("&amp;", "&"))
    assert len(seen["figures"]) == 8
    assert all(w > 200 and h > 150 and marks > 5 for w, h, marks in seen["figures"])
    assert seen["pictures"] == [len(p) for p in embedded]
    assert seen["requests"] == []
    assert seen["wide"] <= seen["window"]
    assert seen["outside"] == []
