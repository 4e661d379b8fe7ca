"""Sources and detectors against their geometry: solid angles up to the horizon, the spread of a divergent source."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio.directions import Detector, Incoming, cone_projected_solid_angle, frames, unit_vectors


@pytest.mark.parametrize("half_deg", [0.5, 5.0, 30.0])
def test_a_cone_at_the_horizon_is_half_of_one(half_deg):
    """∫ cos θ dω over the upper half of a cone about a horizontal axis is a − sin a cos a; of a whole one π sin²a."""
    a = np.deg2rad(half_deg)
    assert cone_projected_solid_angle(np.pi / 2, a)[0] == pytest.approx(a - np.sin(a) * np.cos(a), rel=1e-5)
    assert cone_projected_solid_angle(0.3, a)[0] == pytest.approx(np.pi * np.sin(a) ** 2 * np.cos(0.3), rel=1e-14)
    assert cone_projected_solid_angle(np.pi / 2 - a, a)[0] == pytest.approx(np.pi * np.sin(a) ** 3, rel=1e-5)


@pytest.mark.parametrize("theta_deg", [86.0, 88.0, -89.0])
def test_a_cone_across_the_horizon_ends_there(theta_deg):
    """Against directions of equal solid angle within the cone, those below the horizon left out."""
    a, n = np.deg2rad(5.0), 400
    r = np.arccos(1 - (np.arange(n) + 0.5) / n * (1 - np.cos(a)))
    psi = (np.arange(n) + 0.5) / n * 2 * np.pi
    axis = unit_vectors(np.deg2rad([theta_deg]))
    z = (unit_vectors(r[:, None], psi).reshape(-1, 3) @ frames(axis)[0].T)[:, 2]
    expected = 2 * np.pi * (1 - np.cos(a)) * np.maximum(z, 0).mean()
    found = Detector.in_plane([theta_deg], 10.0).projected_solid_angle[0]
    assert found == pytest.approx(expected, rel=1e-4)
    assert found > 1.004 * np.pi * np.sin(a) ** 2 * np.cos(np.deg2rad(theta_deg))


def test_cells_fill_the_hemisphere():
    for resolution in (2.0, 5.0, 20.0):
        cells = Detector.hemisphere(resolution)
        assert cells.solid_angle.sum() == pytest.approx(2 * np.pi, rel=1e-12)
        assert cells.projected_solid_angle.sum() == pytest.approx(np.pi, rel=1e-12)
        assert np.array_equal(cells.catch(cells.directions)[1], np.arange(len(cells)))


@pytest.mark.parametrize("rings", [1, 2, 5])
def test_a_divergent_source_fills_its_cone(rings):
    """`divergence_deg` is the full angle; over solid angle the mean of cos r is (1 + cos a)/2, about the axis."""
    theta, divergence = [0.0, 40.0, -70.0], 12.0
    light = Incoming(theta, phi_deg=25.0, divergence_deg=divergence)
    directions, share = light.spread(rings)
    a = np.deg2rad(divergence / 2)
    assert share.sum() == pytest.approx(1, rel=1e-14)
    mean = np.einsum("nmi,m->ni", directions, share)
    assert np.allclose(mean, light.vectors * (1 + np.cos(a)) / 2, atol=1e-14)
    along = np.einsum("nmi,ni->nm", directions, light.vectors)
    assert along.min() > np.cos(a)
    assert np.allclose(Incoming(theta, 25.0).spread()[0][:, 0], light.vectors, rtol=0, atol=1e-15)
