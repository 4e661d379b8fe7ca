"""The surface between its samples: what each kind of interpolation reproduces, up to the edge of the field."""

from __future__ import annotations

import numpy as np
import pytest

import vgonio as vg

PITCH = (0.5, 0.25)
SHAPE = (9, 13)


def _field(f, kind):
    y, x = ((np.arange(n) + 0.5) * h for n, h in zip(SHAPE, PITCH))
    return vg.surface.Heightfield(f(y[:, None], x[None, :]), PITCH, interpolation=kind)


@pytest.mark.parametrize(("dy", "dx"), [(0, 0), (0, 1), (1, 0), (0, 2), (2, 0), (1, 1)])
def test_cubic_reproduces_cubics_up_to_the_edge(dy, dx):
    """Not-a-knot ends: (y³ − 2 y)(x³ + x² − 1) and its derivatives, the outer half cells included."""
    fy, fx = np.polynomial.Polynomial([0, -2, 0, 1]), np.polynomial.Polynomial([-1, 0, 1, 1])
    at = _field(lambda y, x: fy(y) * fx(x), "cubic").interpolant
    y, x = (np.linspace(0, n * h, 31) for n, h in zip(SHAPE, PITCH))
    wanted = (fy.deriv(dy) if dy else fy)(y)[:, None] * (fx.deriv(dx) if dx else fx)(x)
    np.testing.assert_allclose(at.grid(y, x, dy=dy, dx=dx), wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())


def test_linear_reproduces_bilinear_fields_up_to_the_edge():
    at = _field(lambda y, x: (1 + 2 * y) * (3 - x), "linear").interpolant
    y, x = (np.linspace(0, n * h, 31) for n, h in zip(SHAPE, PITCH))
    np.testing.assert_allclose(at.grid(y, x), (1 + 2 * y)[:, None] * (3 - x), atol=1e-12)
    np.testing.assert_allclose(at.grid(y, x, dx=1), -np.broadcast_to((1 + 2 * y)[:, None], (31, 31)), atol=1e-11)


def test_nearest_is_the_sample_of_the_cell():
    field = _field(lambda y, x: 10 * y + x, "nearest")
    y, x = np.array([0.01, 0.49, 0.51, 4.49]), np.array([0.01, 0.24, 0.26, 3.24])
    np.testing.assert_array_equal(field.interpolant.grid(y, x), field.z[np.ix_([0, 0, 1, 8], [0, 0, 1, 12])])


def test_periodic_cubic_damps_a_sinusoid_by_the_known_factor():
    """Midway between samples the spline gives (23 cos(kh/2) + cos(3kh/2))/24 · 6/(4 + 2 cos kh) of sin(kx): follows
    from the weights 1/48, 23/48, 23/48, 1/48 midway and 1/6, 4/6, 1/6 at the samples."""
    n, h = 12, 0.25
    k = 2 * np.pi * 2 / (n * h)
    x = (np.arange(n) + 0.5) * h
    at = vg.surface.Heightfield(np.sin(k * x)[None].repeat(4, 0), h, periodic=True).interpolant
    midway = np.arange(1, n) * h
    half = k * h / 2
    factor = (23 * np.cos(half) + np.cos(3 * half)) / 24 / ((4 + 2 * np.cos(2 * half)) / 6)
    assert abs(factor - 1) > 1e-4
    np.testing.assert_allclose(at.grid([0.3], midway)[0], factor * np.sin(k * midway), atol=1e-12)
