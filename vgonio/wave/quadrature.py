"""Points and weights that turn the surface integral into a sum, and the spacing that a tolerance asks for.

Three rules. "uniform": midpoints, exact to all orders for what is smooth and vanishes (or repeats) at the ends, limited
by the kinks of the spline's third derivative to fourth order.  "gauss": Gauss–Legendre between the knots of the
interpolant, for domains that end abruptly and for bilinear surfaces.  "cells": one point a cell with the closed form of
the cell, exact for "nearest".
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..errors import ToleranceError
from ..surface.heightfield import Heightfield
from ..surface.interpolant import Axis

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]
MOST_POINTS = 100_000_000  # of one grid: 1.6 GB with weights
MAX_NODES = 24  # Gauss nodes of one panel; longer panels are divided


@dataclass(frozen=True, eq=False)
class Points:
    """A sum Σ weight exp(−i q · r) over a tensor grid: x (nx,), y (ny,), z and weight (ny, nx), µm and µm².

    cell : (dy, dx) over which each point stands for a constant height, or 0 where the weight says it all
    across : for one profile repeated along y, the positions and weights of the y integral, which then is a factor
    """

    x: Floats
    y: Floats
    z: Floats
    weight: Floats
    cell: tuple[float, float] = (0.0, 0.0)
    across: tuple[Floats, Floats] | None = None

    @property
    def size(self) -> int:
        return self.z.size

    def strip(self, first: int, last: int) -> Points:
        """The rows first … last − 1."""
        return replace(self, y=self.y[first:last], z=self.z[first:last], weight=self.weight[first:last])

    def factor(self, q: Floats) -> NDArray:
        """(m,) closed form of the integral over one cell, divided by its area, times what stands for the y integral."""
        if self.across is not None:
            levels, index = np.unique(q[:, 1], return_inverse=True)
            y, weight = self.across
            along_y = np.array([np.sum(weight * np.exp(-1j * level * y)) for level in levels])
            return along_y[index] * np.sinc(q[:, 0] * self.cell[1] / (2 * np.pi))
        return np.sinc(q[:, 1] * self.cell[0] / (2 * np.pi)) * np.sinc(q[:, 0] * self.cell[1] / (2 * np.pi))


def require_affordable(rows: float, columns: float) -> None:
    """Raise ToleranceError, before memory is asked for, where a grid of points would be out of all proportion."""
    if rows * columns > MOST_POINTS:
        raise ToleranceError(
            f"the integral needs {rows * columns:.1e} points ({rows:.3g} × {columns:.3g}), at most {MOST_POINTS:.0e}: "
            "take a smaller coherence_um or surface, a longer wavelength or a larger tol"
        )


def fewest(axis: Axis, length: float, spacing: float, rule: str) -> float:
    """Points over a length (µm) of an axis that a rule takes at the least: cells and panels go by the pitch as well."""
    by_pitch = {"uniform": 0.0, "gauss": 2.0, "cells": 1.0}[rule] * length / axis.h
    return by_pitch if rule == "cells" else max(length / spacing, by_pitch)


@lru_cache(maxsize=64)
def _legendre(n: int) -> tuple[Floats, Floats]:
    return np.polynomial.legendre.leggauss(n)


def gauss_rule(knots: Floats, spacing: float) -> tuple[Floats, Floats]:
    """Positions and weights of Gauss–Legendre panels between `knots`, on average no wider apart than `spacing`."""
    width = np.diff(knots)
    knots, width = knots[np.concatenate([[True], width > 1e-12 * knots[-1]])], width[width > 1e-12 * knots[-1]]
    nodes = int(np.clip(np.ceil(width.max() / spacing) + 1, 2, MAX_NODES))
    pieces = np.maximum(1, np.ceil(width / (spacing * (nodes - 1)) - 1e-9)).astype(int)
    edges = np.concatenate([a + w * np.arange(p) / p for a, w, p in zip(knots[:-1], width, pieces)] + [knots[-1:]])
    t, w = _legendre(nodes)
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (1 + t)).ravel(), (half * w).ravel()


def finer(surface: Heightfield, spacing: Floats, rule: str) -> Floats:
    """(2,) a spacing that checks the rule at `spacing`: 1.5 times finer, and for panels between samples one node or one
    piece more, since these numbers are whole and 1.5 times finer may round to the same."""
    if rule != "gauss":
        return spacing / 1.5
    share = np.array(surface.pitch_um) / spacing
    longest = MAX_NODES - 1
    more = np.where(share <= longest - 1, np.ceil(share) + 1, longest * np.ceil(share / longest) + 0.5)
    return np.minimum(spacing / 1.5, np.array(surface.pitch_um) / more)


def axis_rule(axis: Axis, lo: float, hi: float, spacing: float, rule: str) -> tuple[Floats, Floats]:
    """Positions and weights (µm) over [lo, hi] of one axis; a periodic axis may be asked for beyond its domain."""
    if rule == "uniform":
        n = max(1, int(np.ceil((hi - lo) / spacing - 1e-9)))
        return lo + (np.arange(n) + 0.5) * (hi - lo) / n, np.full(n, (hi - lo) / n)
    if rule == "cells":
        first, last = int(np.floor(lo / axis.h + 1e-9)), int(np.ceil(hi / axis.h - 1e-9))
        cells = np.arange(first, last, dtype=np.float64)
        return (cells + 0.5) * axis.h, np.full(cells.shape, axis.h)
    knots = axis.knots()
    if axis.periodic and (lo < 0 or hi > axis.n * axis.h):
        length = axis.n * axis.h
        turns = np.arange(np.floor(lo / length), np.ceil(hi / length))
        knots = np.unique((knots + turns[:, None] * length).ravel())
    inside = knots[(knots > lo) & (knots < hi)]
    return gauss_rule(np.concatenate([[lo], inside, [hi]]), spacing)


def rates(surface: Heightfield, q: Floats) -> tuple[float, float]:
    """Fastest change of phase (rad/µm) along y and x that matters at the scattering vectors q (m, 3).

    Slopes count up to 3.5 of their standard deviations: what lies beyond shows in the error estimate, which decides.
    """
    if surface.interpolation == "nearest":
        slope = np.zeros(2)
    else:
        ip = surface.interpolant
        gy, gx = ip.grid(surface.y, surface.x, dy=1), ip.grid(surface.y, surface.x, dx=1)
        slope = np.array([min(3.5 * np.sqrt(np.mean(g**2)), np.abs(g).max()) for g in (gy, gx)])
    top = np.abs(q).max(axis=0)
    return (
        float(np.max(np.abs(q[:, 1]) + np.abs(q[:, 2]) * slope[0], initial=0.1 * top[2])),
        float(np.max(np.abs(q[:, 0]) + np.abs(q[:, 2]) * slope[1], initial=0.1 * top[2])),
    )


def choose_rule(surface: Heightfield, vanishes: bool, repeats: bool, tol: float = 1e-3) -> str:
    """The rule for a surface whose integrand vanishes at the ends of the domain, or repeats there.

    Below 1e-7 the kinks of the spline make midpoints (fourth order) dearer than panels between them.
    """
    if surface.interpolation == "nearest":
        return "cells"
    ip = surface.interpolant
    smooth = 1 not in (ip.x_axis.degree, ip.y_axis.degree)  # a few samples alone are joined by straight lines
    return "uniform" if smooth and (vanishes or repeats) and tol >= 1e-7 else "gauss"
