"""A curve cut into Gauss–Legendre panels: nodes, normals and weights of a Nyström method.

A curve is walked so that the outside (air) lies to its left: a profile from small to large x. Panels follow arc length,
are halved until their polynomials resolve the curve, and shrink in fixed ratio towards corners, where the field is
singular (Guo and Babuška 1986: geometric grading converges exponentially there).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

RATIO = 0.25  # of neighbouring panels towards a corner
MOST = 20_000  # panels, far more than are ever solved, from which on none is halved: no memory is spent on them
Curve = Callable[[Floats], tuple[Floats, Floats, Floats, Floats]]  # t -> x, z, dx/dt, dz/dt


@lru_cache(maxsize=32)
def legendre(p: int) -> tuple[Floats, Floats, Floats]:
    """Gauss–Legendre nodes and weights (p,) on [−1, 1] and the matrix (p, p) from values to Legendre coefficients."""
    s, w = (np.asarray(a, np.float64) for a in np.polynomial.legendre.leggauss(p))
    inverse: Floats = np.asarray(np.linalg.inv(np.polynomial.legendre.legvander(s, p - 1)))
    return s, w, inverse


def composite(n: float) -> tuple[Floats, Floats]:
    """At least n nodes and weights on [−1, 1]: Gauss–Legendre of 16 nodes on equal pieces."""
    s, w, _ = legendre(16)
    pieces = max(1, int(np.ceil(n / 16)))
    middle = (2 * np.arange(pieces) + 1) / pieces - 1
    return (middle[:, None] + s / pieces).ravel(), np.tile(w / pieces, pieces)


@dataclass(frozen=True, eq=False)
class Panels:
    """Q panels of p nodes each: positions and their derivatives by the panel's own parameter s in [−1, 1].

    x, z, dx, dz : (Q, p) µm
    """

    x: Floats
    z: Floats
    dx: Floats
    dz: Floats

    @property
    def order(self) -> int:
        return self.x.shape[1]

    @property
    def count(self) -> int:
        return self.x.shape[0]

    @property
    def size(self) -> int:
        return self.x.size

    @cached_property
    def speed(self) -> Floats:
        """(Q, p) |dr/ds| in µm."""
        return np.hypot(self.dx, self.dz)

    @cached_property
    def length(self) -> Floats:
        """(Q,) arc lengths in µm."""
        return np.asarray(self.speed @ legendre(self.order)[1])

    @cached_property
    def point(self) -> tuple[Floats, Floats]:
        """Positions (N,), (N,) in µm."""
        return self.x.ravel(), self.z.ravel()

    @cached_property
    def normal(self) -> tuple[Floats, Floats]:
        """Unit normals (N,), (N,), out of the material."""
        return (-self.dz / self.speed).ravel(), (self.dx / self.speed).ravel()

    @cached_property
    def weight(self) -> Floats:
        """(N,) weights of ∫ ds, µm."""
        return (legendre(self.order)[1] * self.speed).ravel()

    def shifted(self, by: float) -> Panels:
        """The same panels further along x by `by` µm."""
        return Panels(self.x + by, self.z, self.dx, self.dz)


def on_curve(curve: Curve, edges: Floats, p: int) -> Panels:
    """Panels between the parameters `edges` (Q + 1,) of a curve."""
    s = legendre(p)[0]
    half = np.diff(edges)[:, None] / 2
    t = edges[:-1, None] + half * (1 + s)
    x, z, dx, dz = (a.reshape(t.shape) for a in curve(t.ravel()))
    return Panels(x, z, dx * half, dz * half)


def joined(parts: list[Panels]) -> Panels:
    """All panels of several curves, in order."""
    return Panels(*(np.concatenate([getattr(a, n) for a in parts]) for n in ("x", "z", "dx", "dz")))


def smooth_edges(curve: Curve, start: float, stop: float, longest: float, p: int, resolution: float) -> Floats:
    """Parameters between panels of a smooth curve, none longer than `longest` µm, halved until the last two Legendre
    coefficients of the curve within each are below `resolution` µm."""
    fine = np.linspace(start, stop, 4097)
    _, _, dx, dz = curve(fine)
    speed = np.hypot(dx, dz)
    arc = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(fine))])
    count = max(1, int(np.ceil(arc[-1] / longest - 1e-9)))
    edges = np.interp(np.linspace(0, arc[-1], count + 1), arc, fine)
    for _ in range(12):
        panels = on_curve(curve, edges, p)
        tail = [np.abs(a @ legendre(p)[2].T)[:, -2:].max(axis=1) for a in (panels.x, panels.z)]
        rough = np.maximum(*tail) > resolution
        if not rough.any() or len(edges) > MOST:
            break
        edges = np.sort(np.concatenate([edges, (edges[:-1] + edges[1:])[rough] / 2]))
    return edges


def graded_edges(length: float, longest: float, levels: tuple[int, int]) -> Floats:
    """Positions in [0, length] between panels no longer than `longest`, shrinking `levels` times towards each end."""
    count = max(1 if levels == (0, 0) else 2, int(np.ceil(length / longest - 1e-9)))
    edges = np.linspace(0, length, count + 1)
    step = length / count
    left = step * RATIO ** np.arange(levels[0], 0, -1.0)
    right = length - step * RATIO ** np.arange(1.0, levels[1] + 1)
    return np.concatenate([edges[:1], left, edges[1:-1], right, edges[-1:]])


def polygon(x: Floats, z: Floats, longest: float, levels: NDArray[np.int64], p: int) -> Panels:
    """Panels on straight lines from vertex to vertex (V,), graded `levels` (V,) times towards each vertex."""
    parts = []
    for i in range(len(x) - 1):
        length = float(np.hypot(x[i + 1] - x[i], z[i + 1] - z[i]))
        edges = graded_edges(length, longest, (int(levels[i]), int(levels[i + 1]))) / length
        parts.append(on_curve(_line(x[i], z[i], x[i + 1], z[i + 1]), edges, p))
    return joined(parts)


def _line(xa: float, za: float, xb: float, zb: float) -> Curve:
    def curve(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        one = np.ones_like(t)
        return xa + (xb - xa) * t, za + (zb - za) * t, (xb - xa) * one, (zb - za) * one

    return curve
