"""What the plan warns of: a coherence length that is cut, slopes that are turned round; and how it words a range."""

import warnings

import numpy as np
import pytest

import vgonio as vg
from vgonio.planning.plans import between


@pytest.mark.parametrize(("coherence", "cut"), [(8, False), (100, True)])
def test_the_plan_tells_a_coherence_length_that_is_cut(coherence, cut):
    scene = {
        "surface": {
            "generate": {"kind": "sinusoid", "period_um": 5, "amplitude_um": 1, "shape": [4, 300], "pitch_um": 0.1}
        },
        "light": {"theta_i_deg": [30], "wavelength_nm": [550], "coherence_um": coherence},
        "detector": {"theta_o_deg": [0], "aperture_deg": 2},
        "material": {"name": "Al"},
        "wave": {"theory": ["iterated-kirchhoff", "full-wave"]},
    }
    said = [w for w in vg.plan(scene).warnings if "instead of the light's" in w]
    assert len(said) == cut
    if cut:
        assert said[0].startswith("iterated-kirchhoff: the coherence length is 33.3 µm instead of the light's 100 µm")


@pytest.mark.parametrize(("theta_i", "warned"), [([0, 60], False), ([0, 85], True)])
def test_the_plan_tells_the_angles_at_which_mirror_images_turn_slopes_round(tmp_path, theta_i, warned):
    """Steep ridges of a finite sample: what the plan says is what the run says, once, and the verdict."""
    phase = (np.arange(120) * 0.3 / 4) % 1
    z = np.tile(3 * np.where(phase < 0.8, phase / 0.8, (1 - phase) / 0.2), (120, 1))
    np.savez(tmp_path / "ridges.npz", z=z, pitch_um=0.3)
    scene = {
        "surface": {"file": str(tmp_path / "ridges.npz"), "level": "none"},
        "light": {"theta_i_deg": theta_i, "wavelength_nm": [550], "coherence_um": 10},
        "detector": {"theta_o_deg": list(range(-80, 81, 10)), "aperture_deg": 8},
        "material": {"name": "Al"},
        "geometric": {"rays": 2000},
    }
    said = [w for w in vg.plan(scene).warnings if "mirror images" in w]
    assert len(said) == warned
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        tree = vg.simulate(scene)
    assert {str(w.message) for w in caught if "mirror images" in str(w.message)} == set(said)
    told = [c for c in tree.vgonio.verdict().cautions if "mirror images" in c]
    assert [c.lower().rstrip(".") for c in told] == [s.lower() for s in said]


def test_a_range_of_errors_has_no_powers_of_ten_and_says_when_it_tells_nothing():
    assert [between(*r) for r in ((0.02, 1.0), (0.3, 30.0), (0.97, 3.0), (0.001, 0.01), (2e-7, 3e-4), (2e-5, 0.4))] == [
        "2 % or more",
        "30 % or more",
        "100 %",
        "0.1 … 1 %",
        "up to 0.03 %",
        "0.002 … 40 %",
    ]
