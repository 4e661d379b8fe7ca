"""One more reflection of the points of a patch on each other in double precision, slowly: what the kernels give."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...materials import fresnel
from ..quadrature import Floats
from .pairs import Grid
from .propagate import near_grazing


def seen_from(grid: Grid, iy: int, ix: int) -> NDArray[np.bool_]:
    """(ny, nx) what one point sees by the kernel's rule, column by column of four wedges; facing not yet asked for."""
    seen = np.zeros(grid.shape, bool)
    for turned in range(4):
        z = np.rot90(grid.z, turned)
        where = np.zeros(grid.shape, bool)
        where[iy, ix] = True
        y, x = (int(i) for i in np.argwhere(np.rot90(where, turned))[0])
        found = _wedge(z, y, x, grid.pitch, diagonals=turned % 2 == 0)
        seen |= np.rot90(found, -turned)
    return seen


def _wedge(z: Floats, y: int, x: int, pitch: float, diagonals: bool) -> NDArray[np.bool_]:
    """Sight towards larger x within 45°."""
    seen = np.zeros(z.shape, bool)
    rows = np.arange(len(z)) - y
    horizon = np.full(len(z), -np.inf)
    for a in range(1, z.shape[1] - x):
        b = rows[np.abs(rows) <= a]
        share, at = np.abs(b) / a, b + y
        inner = horizon[at - np.sign(b)]
        with np.errstate(invalid="ignore"):
            line = np.where(share > 0, inner * share, 0) + np.where(share < 1, horizon[at] * (1 - share), 0)
        rise = (z[at, x + a] - z[y, x]) / (pitch * a)
        seen[at, x + a] = (rise >= line) & (diagonals | (np.abs(b) < a))
        horizon = horizon.copy()
        horizon[at] = np.maximum(line, rise)
    return seen


def reflect_reference(grid: Grid, source: Floats, k: float, index: complex | None, observers: Any) -> Floats:
    """(sides, 12, len(observers)) what `reflect_opencl` gives at a few observers (iy, ix), in double precision."""
    ny, nx = grid.shape
    x, y = np.meshgrid(np.arange(nx) * grid.pitch, np.arange(ny) * grid.pitch)
    fields = (source[:, 0::2] + 1j * source[:, 1::2]).reshape(len(source), 2, 3, ny, nx)
    out = np.zeros((len(source), 12, len(observers)))
    for n, (iy, ix) in enumerate(observers):
        r = np.stack([x[iy, ix] - x, y[iy, ix] - y, grid.z[iy, ix] - grid.z])
        d = np.linalg.norm(r, axis=0)
        u = r / np.where(d > 0, d, 1)
        own = grid.normal[:, iy, ix]
        c = -np.einsum("iyx,i->yx", u, own)
        pair = seen_from(grid, iy, ix) & (np.sum(u * grid.normal, axis=0) > 1e-6) & (c > 1e-6)
        u, c, d = u[:, pair], c[pair], d[pair]
        front = (1j * k - 1 / d) * np.exp(1j * k * d) / (4 * np.pi * d) * grid.pitch**2
        a, b = fields[:, 0][..., pair], fields[:, 1][..., pair]
        parts = front * _cross(u, a), -front * _cross(u, _cross(u, b))
        found = _tangent_plane(u, c, own, *parts, k * d, index)
        out[:, 0::2, n], out[:, 1::2, n] = found.real, found.imag
    return out


def _cross(u: Floats, a: NDArray) -> NDArray:
    """u (3, n) × a (sides, 3, n)."""
    return np.cross(np.broadcast_to(u, a.shape), a, axis=1)


def _tangent_plane(
    u: Floats, c: Floats, own: Floats, from_a: NDArray, from_b: NDArray, kd: Floats, index: complex | None
) -> NDArray:
    """(sides, 6) sums of n × E and n × H of waves along u (3, n), whose fields (sides, 3, n) come from A and from B."""
    one = np.ones(c.shape, np.complex128)
    rs, rp = (-one, one) if index is None else fresnel(c, index)
    s = np.cross(u, own, axisb=0, axisa=0).T
    s /= np.sqrt(np.sum(s**2, axis=0) + 1e-14)
    p, t = np.cross(u, s, axis=0), np.cross(own[:, None], s, axis=0)
    admittance = c * (1 - rp) / (1 + rp)
    metal = 1.0 if index is None else abs((index - 1) / (index + 1))
    q = near_grazing(rp, c, admittance, kd, metal)
    on_s = np.sum((from_a + from_b) * s, axis=1)
    along = (1 + rp) * np.sum(from_a * p, axis=1) + (1 + q) * np.sum(from_b * p, axis=1)
    electric = (admittance * along)[:, None] * s + ((1 + rs) * on_s)[:, None] * t
    magnetic = ((1 - rs) * c * on_s)[:, None] * s - along[:, None] * t
    return np.concatenate([electric.sum(axis=-1), magnetic.sum(axis=-1)], axis=1)
