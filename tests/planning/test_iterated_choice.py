"""What a choice may vary of iterated Kirchhoff: reflections and patches, each judged by the light that is left out."""

from __future__ import annotations

import numpy as np
import pytest

import vgonio as vg
from vgonio.assembly import gather
from vgonio.errors import ToleranceError
from vgonio.planning.iterated_choice import changed_by, variants
from vgonio.scene import load_scene


@pytest.fixture(autouse=True)
def known_machine(monkeypatch):
    """Its built-in figures, and no library loaded, whatever tests ran before in this process."""
    monkeypatch.setenv("VGONIO_CALIBRATION", "off")
    monkeypatch.setattr("vgonio.planning.loading.already", lambda: {"Python"})


def scene(shape, pitch_um, slope=0.85, **wave) -> dict:
    made = {"kind": "gaussian", "rms_um": slope, "correlation_um": 2, "shape": shape, "pitch_um": pitch_um, "seed": 1}
    return {
        "surface": {"generate": made},
        "material": {"name": "Al"},
        "light": {"wavelength_nm": [550], "theta_i_deg": [0, 40], "coherence_um": 3},
        "detector": {"theta_o_deg": list(range(-60, 61, 10))},
        "wave": {"theory": "iterated-kirchhoff", **wave},
    }


PROFILE, PATCH = ([1, 400], 0.1), ([64, 64], 0.2)


def largest_change(a, b) -> float:
    """Of the brdf, relative to its largest value at each angle of incidence."""
    return float((abs(a.brdf - b.brdf).max("theta_o") / b.brdf.max("theta_o")).max())


@pytest.mark.parametrize("tol", [0.6, 0.2])
def test_reflections_of_a_profile_are_as_many_as_the_tolerance_needs(tol):
    """Run as chosen, beside eight reflections of the same windows."""
    tree = vg.simulate(scene(*PROFILE, slope=0.6), tol=tol)
    many = vg.simulate(scene(*PROFILE, slope=0.6, bounces=8, tol=0.01, window_um=tree["waves"].attrs["window_um"]))
    assert largest_change(tree["waves"], many["waves"]) <= tol
    assert tree["waves"].attrs["error_achieved"] <= tol


def test_reflections_of_a_patch_are_as_many_as_the_tolerance_needs():
    """The patch is named and stays; a single window has speckle, in which a small share of the light changes much."""
    given = scene(*PATCH, slope=0.5, window_um=4.0)
    tree = vg.simulate(given, tol=0.3)
    made = vg.plan(given, tol=0.3)
    assert made.chosen["wave.bounces"] == 2
    assert "wave.window_um" not in made.chosen
    many = vg.simulate(scene(*PATCH, slope=0.5, window_um=4.0, bounces=8, tol=0.01))
    assert largest_change(tree["waves"], many["waves"]) <= 0.3


def test_a_coarser_tolerance_takes_fewer_reflections_and_less_time():
    coarse, fine = (vg.plan(scene(*PATCH, slope=0.5, window_um=4.0), tol=t) for t in (0.9, 0.1))
    assert coarse.chosen["wave.bounces"] < fine.chosen["wave.bounces"]
    assert coarse.seconds < fine.seconds
    assert coarse.error <= 0.9


def test_what_the_scene_names_stays_and_a_refusal_says_what_is_left_out():
    with pytest.raises(ToleranceError, match="of the light that is reflected more than 1 time") as refused:
        vg.plan(scene(*PROFILE, bounces=1), tol=0.05)
    assert "the waves reach" in str(refused.value)
    assert "bounces" not in vg.plan(scene(*PROFILE, bounces=2), tol=0.5).chosen


def test_a_patch_that_misses_second_hits_gets_larger():
    """The smallest that meets the tolerance; and the result's own rays find the share that was judged by."""
    plain = scene(*PATCH, slope=0.5, bounces=4)
    plain["light"]["coherence_um"] = 0.5
    given = load_scene(plain)
    found = variants(given, gather(given).surface)
    assert "wave.window_um" not in found[0].settings
    good = next(v for v in found if v.error < 0.8 * found[0].error)
    made = vg.plan(given, tol=good.error * 1.01)
    assert made.chosen["wave.window_um"] == good.settings["wave.window_um"]
    data = vg.simulate(given, tol=good.error * 1.01)["waves"]
    missed = float((data.second_hits * data.second_hits_outside).max())
    assert changed_by(missed, data.attrs["windows"]) <= good.error * 1.01


def test_the_error_of_what_is_left_out_stands_in_the_plan():
    made = vg.plan(scene(*PROFILE, slope=0.6, bounces=1), max_seconds=30)
    bounces = next(s for s in made.stages if s.part == "waves")
    assert "left out is" in bounces.why
    assert made.error == pytest.approx(bounces.error)


def test_a_share_left_out_bounds_what_two_sums_differ_by():
    """Speckle fields of n windows, a share p of their power left out: the RMS change over 200 trials."""
    rng = np.random.default_rng(0)
    for p in (0.3, 0.01):
        for n in (1, 16):
            a, b = rng.normal(size=(2, 200, n, 2))
            whole = np.sqrt(1 - p) * a + np.sqrt(p) * b
            change = np.abs((whole**2).sum(-1).mean(1) - (1 - p) * (a**2).sum(-1).mean(1)) / 2
            assert np.sqrt(np.mean(change**2)) <= changed_by(p, n)
            assert np.sqrt(np.mean(change**2)) >= 0.2 * changed_by(p, n)


def test_speckle_that_stays_is_told():
    with pytest.raises(ToleranceError, match=r"Speckle of \d+ % stays at that: more surface, not more effort"):
        vg.plan(scene(*PROFILE), tol=0.3, max_seconds=0.6)
