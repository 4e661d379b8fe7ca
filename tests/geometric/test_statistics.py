"""Path statistics against grooves in closed form, and against the same surface written over several periods."""

from __future__ import annotations

import numpy as np
import pytest

import vgonio as vg
from vgonio.geometric import RayOptics
from vgonio.measure import Gonioreflectometer
from vgonio.surface import Heightfield

RAYS = 20_000


def statistics(surface, theta, phi=0.0, rays=RAYS, **more):
    gonio = Gonioreflectometer([theta], [0], phi_i_deg=phi)
    data = gonio.measure(surface, RayOptics("perfect", rays=rays, statistics=True, **more))
    return data.isel(theta_i=0)


def groove(periods: int) -> Heightfield:
    """90° V-groove of period 2 µm and depth 1 µm."""
    return Heightfield(np.tile([0.0, 1.0], (2, periods)), 1.0, periodic=True, interpolation="linear")


@pytest.mark.parametrize("periods", [1, 4])
def test_retroreflecting_groove(periods):
    """Normal incidence at u from the valley: level to the other wall, 2u on; u is even over 0 … 1."""
    data = statistics(groove(periods), 0)
    assert data.paths_followed[1] >= RAYS - 2  # one may fall into the valley's edge
    error = 4 * 2 / np.sqrt(12 * RAYS)
    assert abs(data.path_length[1] - 1) < error
    assert abs(data.horizontal_distance[1] - 1) < error
    assert np.isclose(data.path_length_rms[1], np.sqrt(4 / 3), atol=error)
    assert np.isclose(data.last_facet_slope_rms[1], 1)
    assert abs(data.last_facet_slope_mean[1]) < 4 / np.sqrt(RAYS)
    expected = np.clip(1 - data.distance / 2, 0, 1)
    assert np.abs(data.second_hit_beyond - expected).max() < 4 * 0.5 / np.sqrt(RAYS)


def test_single_reflections_have_no_way_between():
    """Beyond 45° only the wall that faces the light is lit: slope −1 towards the source, no second hit."""
    data = statistics(groove(4), 60)
    assert data.path_length[0] == 0
    assert np.isclose(data.last_facet_slope_mean[0], -1)
    assert np.all(data.second_hit_beyond == 0)
    turned = Heightfield(np.tile([[0.0], [1.0]], (4, 2)), 1.0, periodic=True, interpolation="linear")
    assert np.isclose(statistics(turned, 60, phi=90).last_facet_slope_mean[0], -1)


def test_double_reflections_at_oblique_incidence():
    """θ = 20°: a double path goes down the first wall and up the other; its length follows from the two points."""
    data = statistics(groove(2), 20)
    t = np.deg2rad(20)
    # after a wall of slope ±1 light from θ travels at 20° to the horizontal: length = horizontal distance / cos 20°
    assert np.isclose(data.path_length[1], data.horizontal_distance[1] / np.cos(t), rtol=1e-9)
    # of the rays that are reflected twice, a third is not, the distance is even between 0 and twice its mean
    single, double = data.paths_followed.values[:2]
    assert single > 0.3 * RAYS
    expected = np.clip(1 - data.distance / (2 * data.horizontal_distance[1]), 0, 1)
    assert np.abs(data.second_hit_beyond - expected).max() < 5 * 0.5 / np.sqrt(double)


def test_ways_over_many_periods():
    """Grazing light on steep walls: one period, or the same one written nine times, within 5 standard errors."""
    rng = np.random.default_rng(2)
    f = np.fft.fftfreq(24)
    z = np.fft.ifft2(np.fft.fft2(rng.normal(size=(24, 24))) * np.exp(-150 * (f**2 + f[:, None] ** 2))).real
    z *= 1.4 / np.std(np.diff(z, axis=1))
    one, nine = (statistics(Heightfield(np.tile(z, (k, k)), 1.0, periodic=True), 80, phi=25) for k in (1, 3))
    assert one.path_length_rms[1] > 24 / 4  # ways that cross a border are common
    n = one.paths_followed[1]
    assert n > 2000
    for name in ("path_length", "horizontal_distance"):
        assert abs(one[name][1] - nine[name][1]) < 5 * one.path_length_rms[1] * np.sqrt(2 / n)
    share = np.interp(one.distance, nine.distance, nine.second_hit_beyond)
    # 5 standard errors are 0.08; linear interpolation between the other grid's distances adds some per cent
    assert np.abs(one.second_hit_beyond - share).max() < 0.1


def test_labels_scene_and_default():
    data = statistics(groove(2), 10, rays=500)
    for name in data.variables:
        assert data[name].attrs["units"]
        assert data[name].attrs["long_name"]
    plain = Gonioreflectometer([0], [0]).measure(groove(2), RayOptics("perfect", rays=500))
    assert "path_length" not in plain
    scene = {
        "surface": {"generate": {"kind": "flat", "shape": [16, 16], "pitch_um": 1.0}},
        "material": {"name": "Al"},
        "light": {"wavelength_nm": [550], "theta_i_deg": [30]},
        "detector": {"theta_o_deg": [-30]},
        "geometric": {"rays": 200, "statistics": True},
    }
    assert vg.simulate(scene)["rays"]["paths_followed"].values.tolist() == [[200, 0, 0, 0]]
