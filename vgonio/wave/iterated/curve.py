"""A profile as points along its length: equal arcs of the interpolated surface, walls included, with normals.

Points sit in the middle of their arcs, so that sums over them are midpoint rules in arc length.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import ToleranceError
from ...surface.heightfield import Heightfield
from ..quadrature import Floats

MOST_POINTS = 12_000  # of one curve: visibility of all pairs of them is looked at
FINER = 8  # steps along x in one arc, on which arc length is measured


@dataclass(frozen=True, eq=False)
class Curve:
    """Points of a profile from left to right, x never falling.

    x, z : (n,) µm;  nx, nz : (n,) unit normals, pointing into the air;  ds : (n,) arc lengths in µm
    """

    x: Floats
    z: Floats
    nx: Floats
    nz: Floats
    ds: Floats

    def __len__(self) -> int:
        return self.x.size

    def cut(self, which: Any) -> Curve:
        """The points `which` (indices, mask or slice) alone."""
        return Curve(*(getattr(self, name)[which] for name in ("x", "z", "nx", "nz", "ds")))

    def moved(self, dx: float) -> Curve:
        """The same curve shifted by dx µm."""
        return Curve(self.x + dx, self.z, self.nx, self.nz, self.ds)


def joined(parts: list[Curve]) -> Curve:
    """Curves one after the other, from left to right."""
    return Curve(*(np.concatenate([getattr(p, n) for p in parts]) for n in ("x", "z", "nx", "nz", "ds")))


def sample_curve(surface: Heightfield, lo: float, hi: float, spacing: float) -> Curve:
    """The first row of `surface` between x = lo and hi (µm), points at most `spacing` µm of arc apart.

    Smooth interpolants get arcs of one length; "linear" and "nearest" get whole arcs on every straight piece and every
    wall, so that no arc runs around an edge. Raises ToleranceError beyond MOST_POINTS.
    """
    smooth = surface.interpolant.x_axis.degree == 3
    made = _smooth(surface, lo, hi, spacing) if smooth else _pieces(*_vertices(surface, lo, hi), spacing)
    return made


def _affordable(count: float) -> None:
    if count > MOST_POINTS:
        raise ToleranceError(
            f"the profile needs {count:.3g} points, at most {MOST_POINTS}: take a smaller window_um, fewer "
            "points_per_wavelength or a longer wavelength"
        )


def _smooth(surface: Heightfield, lo: float, hi: float, spacing: float) -> Curve:
    ip, row = surface.interpolant, surface.y[:1]
    _affordable((hi - lo) / spacing)
    steps = FINER * int(np.ceil((hi - lo) / spacing))
    edges = np.linspace(lo, hi, steps + 1)
    middle = (edges[1:] + edges[:-1]) / 2
    length = np.concatenate([[0.0], np.cumsum(np.hypot(1, ip.grid(row, middle, dx=1)[0]) * np.diff(edges))])
    count = int(np.ceil(length[-1] / spacing))
    _affordable(count)
    x = np.interp((np.arange(count) + 0.5) * length[-1] / count, length, edges)
    slope = ip.grid(row, x, dx=1)[0]
    norm = np.hypot(1, slope)
    return Curve(x, ip.grid(row, x)[0], -slope / norm, 1 / norm, np.full(count, length[-1] / count))


def _vertices(surface: Heightfield, lo: float, hi: float) -> tuple[Floats, Floats]:
    """Corners of a profile of straight pieces or of steps, (x, z)."""
    ip, h = surface.interpolant, surface.dx
    row = surface.y[:1]
    shift = 0.0 if ip.x_axis.degree == 0 else 0.5  # steps change between cells, straight pieces at cell centres
    knots = (np.arange(np.floor(lo / h) - 1, np.ceil(hi / h) + 2) + shift) * h
    knots = knots[(knots > lo + 1e-9 * h) & (knots < hi - 1e-9 * h)]
    ends = np.concatenate([[lo], knots, [hi]])
    if ip.x_axis.degree == 1:
        return ends, ip.grid(row, ends)[0]
    level = ip.grid(row, (ends[1:] + ends[:-1]) / 2)[0]
    return np.repeat(ends, 2)[1:-1], np.repeat(level, 2)


def _pieces(x: Floats, z: Floats, spacing: float) -> Curve:
    dx, dz = np.diff(x), np.diff(z)
    length = np.hypot(dx, dz)
    keep = length > 1e-12 * max(float(length.max()), 1e-300)
    x, z, dx, dz, length = x[:-1][keep], z[:-1][keep], dx[keep], dz[keep], length[keep]
    count = np.ceil(length / spacing * (1 - 1e-9)).astype(int)
    _affordable(float(count.sum()))
    piece = np.repeat(np.arange(len(length)), count)
    share = (np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[piece]
    arc = length / count
    return Curve(
        x[piece] + share * dx[piece],
        z[piece] + share * dz[piece],
        (-dz / length)[piece],
        (dx / length)[piece],
        arc[piece],
    )
