"""Patches against an exact solution in three dimensions: a hemisphere on a plane, perfect conductors.

The series (benchmarks/boss.py) is checked by itself first: energy, small spheres, no field along either conductor.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from vgonio.errors import BackendError
from vgonio.wave import opencl

FILE = Path(__file__).resolve().parents[3] / "benchmarks" / "boss.py"
SPEC = importlib.util.spec_from_file_location("boss", FILE)
boss = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(boss)
K = 2 * np.pi


@pytest.fixture
def waves(rng):
    """An oblique direction downwards and a field across it that is neither s nor p; unit vectors (30, 3)."""
    d = np.array([0.5, 0.2, -0.8])
    e = np.cross(d, [0.3, 0.2, 1.0])
    o = rng.normal(size=(30, 3))
    return *(v / np.linalg.norm(v) for v in (d, e)), o / np.linalg.norm(o, axis=1, keepdims=True)


@pytest.mark.parametrize("a", [0.1, 1.0, 4.0])
def test_series_keeps_energy(a):
    """What a loss-free sphere takes from the wave (optical theorem) it sends out: the integral of |A|², and the sum."""
    c, weight = np.polynomial.legendre.leggauss(int(60 * a) + 20)
    phi = np.arange(4) * np.pi / 2 + 0.3  # |A|² has no more than cos 2φ
    s = np.sqrt(1 - c**2)[:, None]
    o = np.stack(np.broadcast_arrays(s * np.cos(phi), s * np.sin(phi), c[:, None]), -1).reshape(-1, 3)
    d, e = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    sent = np.pi / 2 * weight @ np.sum(np.abs(boss.sphere(K, a, d, e, o)) ** 2, axis=1).reshape(-1, 4).sum(axis=1)
    taken = 4 * np.pi / K * np.imag(boss.sphere(K, a, d, e, d[None])[0] @ e)
    n, electric, magnetic = boss.coefficients(K * a)
    summed = 2 * np.pi / K**2 * np.sum((2 * n + 1) * (np.abs(electric) ** 2 + np.abs(magnetic) ** 2))
    assert sent == pytest.approx(taken, rel=1e-9)
    assert summed == pytest.approx(taken, rel=1e-9)


def test_small_spheres_are_two_dipoles(waves):
    """Electric and magnetic, of moments 4πε₀a³ E and −2πa³ H, to (ka)²."""
    d, e, o = waves
    a = 1e-3
    dipoles = K**2 * a**3 * (e - (o @ e)[:, None] * o + 0.5 * np.cross(o, np.cross(d, e)))
    assert np.abs(boss.sphere(K, a, d, e, o) - dipoles).max() < (K * a) ** 2 * np.abs(dipoles).max()


@pytest.mark.parametrize("a", [0.3, 1.0, 4.0])
def test_no_field_along_boss_and_plane(waves, a, rng, agreement):
    """Both waves and what the sphere makes of them: what is along the conductors cancels to 1e-7 of the incident."""
    d, e, o = waves
    upper = a * o * np.sign(o[:, 2:]) ** np.array([0, 0, 1])
    angle, far = rng.uniform(0, 2 * np.pi, 30), a * rng.uniform(1.001, 5, 30)
    plane = np.stack([far * np.cos(angle), far * np.sin(angle), np.zeros(30)], axis=1)
    for r, normal in ((upper, upper / a), (plane, np.array([[0.0, 0.0, 1.0]]))):
        field = sum(f * np.exp(1j * K * (r @ w))[:, None] + boss.near(K, a, w, f, r) for w, f in boss.images(d, e))
        along = np.abs(np.cross(normal, field)).max()
        agreement("series of a boss on a plane: field along both conductors over the incident one", "0", along, 1e-7)


def test_two_reflections_from_a_boss_on_a_plane(agreement):
    """Radius 2 λ, 40°, four planes of observation, 30° off the mirror direction: second reflections take off a third of
    the error, with the sign that they have. What is left is that of tangent planes (0.29 s, 0.41 p) and that of the
    foot of the wall, where two points are up to 0.6 λ of height apart."""
    try:
        opencl.device()
    except BackendError as e:
        pytest.skip(f"no OpenCL device: {e}")
    found = boss.compared(2.0, 40.0)
    error = float(np.sqrt(np.mean(found["error 2"] ** 2)))
    agreement(
        "iterated Kirchhoff, hemisphere of 2 λ on a plane, 40°, two reflections, amplitudes", "exact series", error, 0.6
    )
    single = float(np.sqrt(np.mean(found["error 1"] ** 2)))
    assert single > 0.7
    assert np.all(found["error 2"] < 0.68 * found["error 1"])
    assert np.all(found["wrong sign"] > 1.1)
    assert np.all((0.8 < found["factor"]) & (found["factor"] < 1.4))
    assert np.all(np.abs(found["phase"]) < 35)
    assert abs(found["phase"][0]) < 8
    assert found["power 2"].mean() == pytest.approx(1, abs=0.2)
    assert np.all(found["theory"] < [0.35, 0.45])
