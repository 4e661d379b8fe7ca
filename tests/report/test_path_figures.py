"""Mueller matrices and ways between reflections on the page: the numbers of the dataset, only where there are any."""

from __future__ import annotations

import numpy as np
import pytest

import vgonio as vg
from vgonio.errors import InputError
from vgonio.report import figures, render

SCENE = {
    "surface": {
        "generate": {"kind": "gaussian", "rms_um": 1.0, "correlation_um": 3.0, "shape": [32, 32], "pitch_um": 0.5}
    },
    "material": {"name": "Al", "film": [{"name": "Al2O3", "thickness_nm": 4}]},
    "light": {"wavelength_nm": [550], "theta_i_deg": [0, 40]},
    "detector": {"theta_o_deg": [-60, -30, 0, 30, 60], "aperture_deg": 10},
}


@pytest.fixture(scope="module")
def tree():
    return vg.simulate(SCENE | {"geometric": {"rays": 4000, "polarised": True, "statistics": True}})


def test_panels_hold_the_elements(tree):
    rays = tree["rays"].to_dataset()
    axes = figures.mueller({"rays": rays}, 40).axes
    m = rays["mueller"].sel(theta_i=40).isel(wavelength=0).transpose("theta_o", "stokes_out", "stokes_in").values
    for k, ax in enumerate(axes):
        i, j = divmod(k, 4)
        expected = m[:, i, j] / (m[:, 0, 0] if k else m[:, 0, 0].max())
        assert np.allclose(ax.get_lines()[0].get_ydata(), expected)
    assert axes[7].get_title("left") == "Q from V"


def test_ways_hold_the_statistics(tree):
    rays = tree["rays"].to_dataset()
    length, slope, beyond = figures.ways(rays).axes
    seen = rays["paths_followed"].isel(bounce=1) > 0
    assert np.allclose(
        length.get_lines()[0].get_ydata(), rays["path_length"].isel(bounce=1).where(seen), equal_nan=True
    )
    assert np.allclose(slope.get_lines()[0].get_ydata(), rays["last_facet_slope_rms"].isel(bounce=0))
    assert np.allclose(beyond.get_lines()[1].get_ydata(), 100 * rays["second_hit_beyond"].sel(theta_i=40))


def test_the_page_has_them_and_names_the_film(tree):
    text = render(tree)
    assert 'id="polarisation"' in text
    assert 'id="ways"' in text
    assert "Al2O3 4 nm on Al" in text


def test_a_page_without_them_does_not_mention_them():
    text = render(vg.simulate(SCENE | {"geometric": {"rays": 200}}))
    assert 'id="polarisation"' not in text
    assert 'id="ways"' not in text


def test_matrices_over_a_hemisphere_are_not_drawn_in_plane():
    scene = SCENE | {"detector": {"kind": "hemisphere", "resolution_deg": 45}}
    tree = vg.simulate(scene | {"geometric": {"rays": 200, "polarised": True}})
    with pytest.raises(InputError, match="hemisphere"):
        figures.mueller({"rays": tree["rays"].to_dataset()}, 40)
    assert "drawn in the plane of incidence only" in render(tree)


def test_the_plan_says_what_they_cost():
    plain, dear = (
        str(vg.plan(SCENE | {"geometric": {"rays": 4000, "polarised": flag, "statistics": flag}}))
        for flag in (False, True)
    )
    assert "Mueller matrices of 160 elements" in dear
    assert "statistics of 8,000 rays more" in dear
    assert "Mueller" not in plain
