"""Visibility of height fields against closed forms, a slow search along the line of sight, and the ray tracer."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio.directions import unit_vectors
from vgonio.errors import InputError
from vgonio.surface import Heightfield, gaussian, sinusoid
from vgonio.surface.visibility import visible


def towards(theta_deg: float, phi_deg: float = 0.0) -> np.ndarray:
    return unit_vectors(np.deg2rad(theta_deg), np.deg2rad(phi_deg))


def v_groove() -> Heightfield:
    """Facets of ±45°, crests 2 µm apart, 1 µm deep."""
    return Heightfield(np.tile([0.0, 1.0], (4, 8)), 1.0, periodic=True, interpolation="linear")


@pytest.mark.parametrize("theta", [30.0, 50.0, 70.0, 85.0, -70.0])
def test_v_groove(theta):
    """Up to 45° all is seen; beyond, the facet facing away is hidden, and the lower part of the one opposite."""
    seen = visible(v_groove(), towards(theta), refine=64).mean()
    t = np.tan(np.deg2rad(abs(theta)))
    # line from the crest falls 1/t a micrometre; it meets the facing facet, that rises 1 a micrometre from the bottom
    # one micrometre on, at s: 1 − (1 + s)/t = s
    expected = 1.0 if t <= 1 else (1 - (1 - 1 / t) / (1 + 1 / t)) / 2
    assert seen == pytest.approx(expected, abs=1.5 / 64)


@pytest.mark.parametrize(("theta", "phi"), [(75.0, 0.0), (75.0, 30.0), (80.0, 60.0), (75.0, 100.0), (85.0, 89.0)])
def test_sinusoid_at_any_azimuth(theta, phi):
    """A corrugation seen obliquely is one seen in plane under tan θ' = tan θ |cos φ|, as a profile and as a field."""
    wave = sinusoid(period_um=8, amplitude_um=1.0, shape=(32, 64), pitch_um=0.25)
    bump = wave.replace(z=wave.z + 1e-13 * np.arange(32)[:, None])  # the same, but no longer one profile
    inplane = np.rad2deg(np.arctan(np.tan(np.deg2rad(theta)) * np.cos(np.deg2rad(phi))))
    expected = visible(wave, towards(inplane), refine=8).mean()
    assert visible(wave, towards(theta, phi), refine=8).mean() == pytest.approx(expected, abs=1e-12)
    assert visible(bump, towards(theta, phi), refine=8).mean() == pytest.approx(expected, abs=4 / 256)
    # the hidden stretch begins where the slope is cot θ' and ends on the tangent line, found by bisection
    assert expected == pytest.approx(1 - hidden_share(2 * np.pi / 8, 1.0, 1 / np.tan(np.deg2rad(inplane))), abs=4 / 256)


def hidden_share(k: float, a: float, cot: float) -> float:
    from scipy.optimize import brentq

    cot = abs(cot)
    if cot >= k * a:
        return 0.0
    # h = a cos(k u) − cot u has its maximum at the terminator sin(k u) = −cot/(k a), u in (−π/k, 0) past the crest
    top = -np.arcsin(cot / (k * a)) / k
    level = a * np.cos(k * top) - cot * top
    # going away from the source (towards smaller u) the surface comes back to that level after the trough
    end = brentq(lambda u: a * np.cos(k * u) - cot * u - level, -2 * np.pi / k + top, top - 1e-6)
    return (top - end) * k / (2 * np.pi)


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("phi", [0.0, 90.0, 180.0, 33.0, 215.0, -60.0])
def test_against_a_walk_along_the_line_of_sight(periodic, phi):
    surface = gaussian(rms_um=1.0, correlation_um=3.0, shape=(48, 64), pitch_um=0.5, seed=4).replace(periodic=periodic)
    theta = 70.0
    d = towards(theta, phi)
    seen = visible(surface, d, refine=2)
    y, x = (np.arange(96) + 0.5) * 0.25, (np.arange(128) + 0.5) * 0.25
    rng = np.random.default_rng(0)
    iy, ix = rng.integers(0, 96, 400), rng.integers(0, 128, 400)
    ip = surface.interpolant
    clear = np.ones(400, bool)
    start = ip.at(x[ix], y[iy])
    for t in np.arange(1, 2400) * 0.01:
        px, py = x[ix] + t * d[0], y[iy] + t * d[1]
        inside = periodic | ((px > 0) & (px < 32) & (py > 0) & (py < 24))
        clear &= ~inside | (ip.at(px, py) <= start + t * d[2] + 1e-9)
    # points within a step of an edge of a shadow may differ: edges are a few per cent of all points
    assert np.mean(seen[iy, ix] != clear) < 0.04
    assert 0.2 < clear.mean() < 0.9


def test_rays_see_the_same():
    """Rays from just above the surface towards the source: what is free is what is seen, but for points at edges."""
    pytest.importorskip("embreex")
    from vgonio.geometric.beam import Scene

    surface = gaussian(rms_um=1.0, correlation_um=3.0, shape=(64, 64), pitch_um=0.5, seed=2).replace(periodic=False)
    d = towards(70, 25)
    scene = Scene.of(surface, 4, "embree")
    y, x = np.meshgrid((np.arange(128) + 0.5) * 0.25, (np.arange(128) + 0.5) * 0.25, indexing="ij")
    start = np.stack([x, y, surface.interpolant.grid(y[:, 0], x[0]) + 0.01], axis=-1)[4:-4, 4:-4].reshape(-1, 3)
    free = scene.tracer.facet(start, np.tile(d, (len(start), 1))) < 0
    assert np.mean(free != visible(surface, d, 2)[4:-4, 4:-4].ravel()) < 0.03
    assert 0.2 < free.mean() < 0.9


def test_the_normal_and_planes_are_seen_whole():
    surface = gaussian(rms_um=1.0, correlation_um=3.0, shape=(16, 16), pitch_um=0.5, seed=2)
    assert visible(surface, [0, 0, 1]).all()
    assert visible(Heightfield(np.zeros((4, 4)), 1.0, periodic=True), towards(89.9)).all()
    # a plane of 30° is seen under 59° from behind, not under 61°
    tilted = Heightfield(np.tile(np.arange(16) * 1.0, (16, 1)) * np.tan(np.pi / 6), 1.0)
    assert visible(tilted, towards(-89.9)).all()
    assert visible(tilted, towards(59)).all()
    assert visible(tilted, towards(61))[:, :-1].sum() == 0


def test_what_is_seen_grows_less_with_the_angle():
    surface = gaussian(rms_um=1.0, correlation_um=3.0, shape=(64, 64), pitch_um=0.5, seed=2)
    masks = [visible(surface, towards(t, 20), 2) for t in (20, 50, 70, 85, 89.9)]
    shares = [m.mean() for m in masks]
    assert shares == sorted(shares, reverse=True)
    assert shares[-1] > 0


def test_bad_input():
    surface = Heightfield(np.zeros((4, 4)), 1.0)
    for direction in ([1, 0, 0], [0, 0], [np.nan, 0, 1]):
        with pytest.raises(InputError, match="above the horizon"):
            visible(surface, direction)
    with pytest.raises(InputError, match="refine"):
        visible(surface, [0, 0, 1], refine=0)
