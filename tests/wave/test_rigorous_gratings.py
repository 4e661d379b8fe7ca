"""The scalar theories against rigorous efficiencies of aluminium gratings: where each may be trusted.

Reference: RCWA and the coordinate method, `reference/gratings_rigorous.json` of the shared folder; the table in the
package is made from it. The scalar theories know no polarisation: they are compared with the mean of TE and TM.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import vgonio as vg
from vgonio import validity
from vgonio.surface import Heightfield
from vgonio.wave import trust
from vgonio.wave.theories import THEORIES

ROOT = Path(__file__).resolve().parents[2]
SINUSOIDS = [c for c in trust.cases() if c.shape == "sinusoidal"]


def script():
    spec = importlib.util.spec_from_file_location("rigorous", ROOT / "benchmarks" / "rigorous_gratings.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def light(theta=(0.0,), wavelength=(550.0,)):
    return SimpleNamespace(theta_i_deg=list(theta), wavelength_nm=list(wavelength))


def test_the_table_is_what_the_solver_makes_of_the_reference(shared, agreement):
    """Every efficiency again from the reference: to the six digits that are written (3e-6 for the transform)."""
    file = shared / "reference" / "gratings_rigorous.json"
    if not file.is_file():
        pytest.skip(f"no rigorous reference at {file}")
    new, old = (
        [line.split(",") for line in text.splitlines()[1:]] for text in (script().table(file), trust.FILE.read_text())
    )
    assert [line[0] for line in new] == [line[0] for line in old]
    a, b = (np.array([line[1:] for line in t], float) for t in (new, old))
    agreement(
        "table of rigorous and scalar efficiencies that `vgonio plan` warns with",
        "RCWA and coordinate method, evaluated anew",
        np.abs(a - b).max(),
        3e-6 + 1e-5 * np.abs(b).max(),
    )


def test_the_page_holds_the_table():
    assert script().page() in (ROOT / "docs" / "trust.md").read_text(encoding="utf-8")


def test_sinusoids(agreement):
    """Depth 0.1 µm, periods 2 and 5 µm, 3 … 58°: Kirchhoff and GHS within 6 % and 1.5 %; OHS near the normal only."""
    for case in SINUSOIDS:
        limit = 0.06 if case.slope > 0.1 else 0.015
        agreement(
            "Kirchhoff and GHS on aluminium sinusoids, depth 0.1 µm, period 2 and 5 µm, 3 … 58°, Σ|Δ|/Σ",
            "rigorous (coordinate method), mean of TE and TM",
            [100 * case.error[t] for t in ("kirchhoff", "generalized-harvey-shack")],
            100 * limit,
            "%",
        )
        if case.theta_i_deg <= 3:
            assert case.error["harvey-shack"] < 0.02
        if case.theta_i_deg >= 30:
            agreement(
                "OHS on the same sinusoids from 30° on, where it does not hold, Σ|Δ|/Σ",
                "rigorous (coordinate method), mean of TE and TM",
                100 * case.error["harvey-shack"],
                (15, np.inf),
                "%",
            )  # q_z = 2k at every angle is wrong there, and this shows it


def test_lamellar(agreement):
    """Vertical walls a few wavelengths apart: scalar theory is off by 4 … 20 %."""
    found = [c.error["kirchhoff"] for c in trust.cases() if c.shape == "lamellar"]
    assert len(found) == 6
    agreement(
        "Kirchhoff on aluminium lamellar gratings 3 … 5 wavelengths wide, Σ|Δ|/Σ",
        "rigorous (RCWA), mean of TE and TM",
        100 * np.array(found),
        (4, 20),
        "%",
    )


def test_figures_of_a_grating_by_hand():
    """Two orders: rigorous is the mean of TE and TM, errors Σ|Δ| over its sum, polarisation Σ|TE − TM|/Σ(TE + TM)."""
    rows = [("0.5", "0.3", "0.5"), ("0.1", "0.3", "0.1")]
    lines = [{"TE": te, "TM": tm} | dict.fromkeys(THEORIES, found) for te, tm, found in rows]
    case = trust._case(["sinusoidal", "0.1", "2.0", "0.5", "30"], lines)
    assert case.polarisation == pytest.approx((0.2 + 0.2) / 1.2)
    assert case.error == pytest.approx(dict.fromkeys(THEORIES, (0.1 + 0.1) / 0.6))
    assert (case.depth, case.period, case.theta_i_deg) == pytest.approx((0.2, 4.0, 30.0))
    assert case.slope == pytest.approx(np.pi * 0.1 / (np.sqrt(2) * 2.0))


def test_a_grating_stands_for_itself():
    """Depth and period come back from Sq and slope; on a line of the table the expectation is that line."""
    surface = vg.surface.sinusoid(period_um=2, amplitude_um=0.05, shape=(4, 1000), pitch_um=0.02)
    shape, depth, period = trust.equivalent_grating(surface)
    assert shape == "sinusoidal"
    assert depth == pytest.approx(0.1, rel=1e-3)
    assert period == pytest.approx(2, rel=1e-3)
    case = next(c for c in SINUSOIDS if c.theta_i_deg == 31 and abs(c.depth - 0.2) < 1e-9 and c.period < 5)
    found = trust.expected("kirchhoff", "sinusoidal", 0.1, 2.0, 31.0, 500.0)
    assert found.error[1] == pytest.approx(case.error["kirchhoff"], rel=1e-2)
    assert found.error[0] <= found.error[1] <= found.error[2]
    assert (found.basis, found.beyond) == ("alike", ())


def test_lamellar_and_gaussian_surfaces_have_their_gratings():
    walls = vg.surface.lamellar(depth_um=0.1, duty=0.5, period_um=2, shape=(4, 200), pitch_um=0.05)
    assert trust.equivalent_grating(walls) == ("lamellar", pytest.approx(0.1), pytest.approx(2.0))
    rough = vg.surface.gaussian(rms_um=0.1, correlation_um=2.0, shape=(256, 256), pitch_um=0.2, seed=1)
    _, depth, period = trust.equivalent_grating(rough)
    assert depth == pytest.approx(2 * np.sqrt(2) * 0.1, rel=1e-6)
    assert period == pytest.approx(np.sqrt(2) * np.pi * 2.0, rel=0.1)  # slope √2 Sq/T; a sample of 25² correlations


def test_plan_warns_with_the_table():
    walls = vg.surface.lamellar(depth_um=0.1, duty=0.5, period_um=2, shape=(4, 200), pitch_um=0.05)
    (line,) = validity.rigorous_warnings(walls, ["kirchhoff"], light([30]))
    assert "kirchhoff is likely off by 14.9%" in line
    gentle = vg.surface.sinusoid(period_um=5, amplitude_um=0.05, shape=(4, 1000), pitch_um=0.05)
    assert validity.rigorous_warnings(gentle, ["kirchhoff", "generalized-harvey-shack"], light([0, 30])) == []
    (line,) = validity.rigorous_warnings(gentle, ["kirchhoff", "harvey-shack"], light([0, 58]))
    assert line.startswith("harvey-shack is likely off by ")
    assert "58°" in line
    assert "of the light" in line  # errors say relative to what


def test_beyond_the_tables_no_error_is_told():
    """80°, and a slope of 3.6: why, and no number; a nearer angle has its own."""
    gentle = vg.surface.sinusoid(period_um=5, amplitude_um=0.05, shape=(4, 1000), pitch_um=0.05)
    (line,) = validity.rigorous_warnings(gentle, ["kirchhoff"], light([58, 80]))
    assert "no test is like this surface at θ_i = 80°" in line
    assert "θ_i 80° is beyond the tested 70°" in line
    steep = vg.surface.sinusoid(period_um=5, amplitude_um=4, shape=(4, 300), pitch_um=0.1)
    (line,) = validity.rigorous_warnings(steep, ["kirchhoff"], light([0]))
    assert "slope 3.6 is 3.5 times beyond the tested" in line
    (worst,) = validity.expectations(steep, ["kirchhoff"], light([0]))
    assert worst.basis == "none"
    assert np.isnan(worst.off)
    assert "no test" in worst.short


def test_a_plane_is_like_nothing():
    flat = Heightfield(np.zeros((8, 8)), 1.0)
    assert validity.rigorous_warnings(flat, ["kirchhoff"], light()) == []
    assert validity.expectations(flat, ["kirchhoff"], light()) == []


def test_the_plan_has_a_line_for_it():
    scene = {
        "surface": {"generate": {"kind": "sinusoid", "period_um": 5, "amplitude_um": 0.05, "shape": [8, 400],
                                 "pitch_um": 0.05}},
        "material": {"name": "Al"},
        "light": {"wavelength_nm": [500], "theta_i_deg": [0], "coherence_um": 4},
        "detector": {"theta_o_deg": [0]},
        "wave": {},
    }  # fmt: skip
    stage = next(s for s in vg.plan(scene).stages if s.name == "expected error")
    assert stage.needed
    assert "kirchhoff likely 0.0% of the light" in stage.why
