"""What the plan says of a coherence length that iterated Kirchhoff cannot take."""

import pytest

import vgonio as vg


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
