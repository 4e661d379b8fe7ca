"""The quasi-periodic Green's function against its spectral series, near Wood's anomaly and inside a metal too."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

from vgonio.wave.full_wave import lattice


def spectral(k, alpha, period, dx, dz):
    """Sum over orders; converges exponentially for |dz| > 0."""
    a = alpha + 2 * np.pi * np.arange(-3000, 3001) / period
    g = lattice.gammas(k, a)
    return np.array([0.5j / period * np.sum(np.exp(1j * (a * x + g * abs(z))) / g) for x, z in zip(dx, dz)])


def summed(k, alpha, period, dx, dz, height):
    m = np.arange(-lattice.NEAR, lattice.NEAR + 1)
    r = np.hypot(dx[:, None] - m * period, dz[:, None])
    near = 0.25j * special.hankel1(0, k * r) @ np.exp(1j * alpha * m * period)
    return near + lattice.far_images(k, alpha, period, height).value(dx, dz)


@pytest.mark.parametrize("k", [2 * np.pi / 0.55, (1.5 + 0.01j) * 2 * np.pi / 0.55])
@pytest.mark.parametrize(("period", "height"), [(2.0, 0.1), (2.0, 8.0), (0.3, 2.0), (20.0, 1.0)])
def test_against_the_spectral_series(k, period, height, rng):
    for alpha in (0.0, 1.234, -7.0):
        dx = rng.uniform(-period, period, 30)
        dz = rng.uniform(0.1, 1, 30) * height * rng.choice([-1, 1], 30)
        expected = spectral(k, alpha, period, dx, dz)
        assert np.abs(summed(k, alpha, period, dx, dz, height) - expected).max() < 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize("away", [1e-3, 1e-6, 1e-9])
def test_close_to_an_anomaly(away, rng):
    """An order at grazing to 1e-9 rad/µm: still ten digits of a function that grows as 1/γ."""
    k, period = 2 * np.pi / 0.55, 2.0
    alpha = k - 2 * 2 * np.pi / period + away
    dx, dz = rng.uniform(-period, period, 20), rng.uniform(0.1, 1, 20)
    expected = spectral(k, alpha, period, dx, dz)
    assert np.abs(summed(k, alpha, period, dx, dz, 1.0) - expected).max() < 1e-9 * np.abs(expected).max()


def test_a_metal_needs_no_far_images():
    assert lattice.far_images((0.79 + 5.85j) * 2 * np.pi / 0.55, 0.3, 2.0, 1.0).c.size == 0
