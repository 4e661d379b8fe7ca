"""Scenes that ask for iterated Kirchhoff: what is planned, what is simulated, what is refused."""

from __future__ import annotations

import pytest

import vgonio as vg
from vgonio.errors import InputError


def scene(**wave) -> dict:
    return {
        "surface": {"generate": {"kind": "sinusoid", "period_um": 8, "amplitude_um": 0.4, "shape": [2, 320]}},
        "material": {"name": "Al"},
        "light": {"wavelength_nm": [600], "theta_i_deg": [0, 60], "coherence_um": 1.2},
        "detector": {"theta_o_deg": [-60, 0, 30]},
        "wave": {"theory": "iterated-kirchhoff", **wave},
    }


def test_plan_says_for_which_angles_light_can_come_back():
    """Steepest slope 0.314, 17.4°: no second reflection at 0°, possibly one at 60°."""
    stage = next(s for s in vg.plan(scene()).stages if s.name == "iterate")
    assert stage.needed
    assert "3 reflections at θ_i = 60°" in stage.why
    assert "one at 0°" in stage.why
    assert "window_um = 7.2" in stage.cost
    assert not vg.plan(scene()).needs("transform")


def test_plan_says_how_a_patch_is_summed_and_why():
    rough = {"kind": "gaussian", "rms_um": 1.0, "correlation_um": 2.0, "shape": [64, 64], "pitch_um": 0.2, "seed": 1}
    asked = scene(window_um=8, windows=1) | {"surface": {"generate": rough}}
    stage = next(s for s in vg.plan(asked).stages if s.name == "iterate")
    assert "pairs: " in stage.cost
    assert "of the pairs see each other" in stage.cost


def test_simulated_with_its_options():
    data = vg.simulate(scene(bounces=2, window_um=12, windows=1))["waves"]
    assert data.brdf_by_bounce.sizes["bounce"] == 2
    assert data.attrs["window_um"] == 12
    assert data.energy_by_bounce.sel(theta_i=0, bounce=2).item() == 0


def test_together_with_kirchhoff():
    tree = vg.simulate(scene(theory=["kirchhoff", "iterated-kirchhoff"], bounces=1))
    assert set(tree.children) >= {"waves", "waves_iterated_kirchhoff"}


@pytest.mark.parametrize("wave", [{"shadowing": True}, {"fresnel": "local"}, {"bounces": 0}, {"window_um": -1}])
def test_options_that_it_does_not_have_are_refused(wave):
    with pytest.raises(InputError):
        vg.plan(scene(**wave))
