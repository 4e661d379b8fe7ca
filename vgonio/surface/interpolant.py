"""The surface between its samples: one object that waves integrate, meshes approach and statistics differentiate.

Samples sit at cell centres x = (ix + ½)·dx. Three kinds:

- "cubic":   tensor-product cubic spline, periodic where the field is, not-a-knot ends otherwise (so that planes and
             cubics are reproduced up to the edge, the outer half cell included);
- "linear":  bilinear, the outer half cell continues the last slope;
- "nearest": constant in each cell, with vertical walls between cells.

Along each axis the value at a set of positions is a sparse matrix (positions × coefficients), so that evaluation on a
tensor grid is two sparse products.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
KINDS = ("cubic", "linear", "nearest")


@dataclass(frozen=True)
class Axis:
    """One axis of the field: n samples of pitch h, periodic or not, with its kind of interpolation."""

    n: int
    h: float
    periodic: bool
    kind: str

    @property
    def degree(self) -> int:
        """0, 1 or 3; an axis with too few samples for a spline with free ends falls back to linear or constant."""
        if self.kind == "nearest" or self.n == 1:
            return 0
        if self.kind == "linear" or (not self.periodic and self.n < 4):
            return 1
        return 3

    def coefficients(self, values: Floats) -> Floats:
        """Spline coefficients along axis 0 of (n, …) values: (n, …) when periodic or not cubic, else (n + 2, …)."""
        if self.degree < 3:
            return values
        if self.periodic:
            from scipy.ndimage import spline_filter1d

            return spline_filter1d(values, order=3, axis=0, mode="grid-wrap") if self.n > 1 else values
        n = self.n
        # interpolation rows (1/6, 4/6, 1/6) between two not-a-knot rows: the fourth difference of coefficients is 0
        rows = sp.diags_array([1 / 6, 4 / 6, 1 / 6], offsets=[0, 1, 2], shape=(n, n + 2))  # type: ignore[call-overload]
        ends = np.zeros((2, n + 2))
        ends[0, :5] = ends[1, -5:] = (1, -4, 6, -4, 1)
        system = sp.vstack([ends[:1], rows, ends[1:]], format="csc")
        rhs = np.concatenate([np.zeros((1, *values.shape[1:])), values, np.zeros((1, *values.shape[1:]))])
        return sp.linalg.splu(system).solve(np.ascontiguousarray(rhs.reshape(n + 2, -1))).reshape(rhs.shape)

    def matrix(self, x: ArrayLike, derivative: int = 0) -> sp.csr_array:
        """(len(x), coefficients) sparse matrix: value or derivative at positions x (µm)."""
        x = np.asarray(x, dtype=np.float64)
        u = x / self.h - 0.5
        if self.degree == 0:
            i = np.floor(x / self.h).astype(np.int64)
            taps, weights = i[:, None], np.full((x.size, 1), 1.0 if derivative == 0 else 0.0)
        elif self.degree == 1:
            i = np.floor(u).astype(np.int64)
            if not self.periodic:
                i = np.clip(i, 0, self.n - 2)
            t = u - i
            taps = i[:, None] + np.arange(2)
            one = np.ones_like(t)
            weights = np.stack([(1 - t, t), (-one, one), (0 * one, 0 * one)][min(derivative, 2)], axis=1)
        else:
            i = np.floor(u).astype(np.int64)
            if not self.periodic:
                i = np.clip(i, 0, self.n - 2)
            t = u - i
            taps = i[:, None] + np.arange(-1, 3) + (0 if self.periodic else 1)
            weights = _cubic(t, derivative)
        taps = taps % self.n if self.periodic else np.clip(taps, 0, self.columns - 1)
        weights = weights / self.h**derivative
        pointer = np.arange(x.size + 1) * taps.shape[1]
        return sp.csr_array((weights.ravel(), taps.ravel(), pointer), shape=(x.size, self.columns))

    @property
    def columns(self) -> int:
        return self.n + 2 if self.degree == 3 and not self.periodic else self.n

    def knots(self) -> Floats:
        """Ends of the pieces on which the interpolant is smooth, over the domain [0, n·h]."""
        if self.degree == 0:
            return np.arange(self.n + 1, dtype=np.float64) * self.h
        inner = (np.arange(self.n) + 0.5) * self.h
        if self.degree == 3 and not self.periodic:
            inner = inner[2:-2]  # not-a-knot: one cubic over the first two and the last two intervals
        elif self.degree == 1 and not self.periodic:
            inner = inner[1:-1]
        return np.concatenate([[0.0], inner, [self.n * self.h]])


def _cubic(t: Floats, derivative: int) -> Floats:
    """Uniform cubic B-spline weights of the four coefficients around the interval, t in [0, 1]."""
    s = 1 - t
    if derivative == 0:
        w = (s**3 / 6, (4 - 6 * t**2 + 3 * t**3) / 6, (4 - 6 * s**2 + 3 * s**3) / 6, t**3 / 6)
    elif derivative == 1:
        w = (-(s**2) / 2, (-4 * t + 3 * t**2) / 2, (4 * s - 3 * s**2) / 2, t**2 / 2)
    elif derivative == 2:
        w = (s, 3 * t - 2, 3 * s - 2, t)
    else:
        one = np.ones_like(t)
        w = (-one, 3 * one, -3 * one, one)
    return np.stack(w, axis=1)


class Interpolant:
    """Values (ny, nx) at cell centres continued to the whole domain [0, ny·dy] × [0, nx·dx].

    values : (ny, nx) float64, no NaN;  pitch_um : (dy, dx)
    """

    def __init__(self, values: Floats, pitch_um: tuple[float, float], periodic: bool, kind: str) -> None:
        ny, nx = values.shape
        self.values = values
        self.y_axis = Axis(ny, pitch_um[0], periodic, kind)
        self.x_axis = Axis(nx, pitch_um[1], periodic, kind)

    @cached_property
    def coefficients(self) -> Floats:
        """Spline coefficients along both axes, (ny, nx), two more along cubic axes that do not wrap."""
        c = self.y_axis.coefficients(self.values)
        return np.ascontiguousarray(self.x_axis.coefficients(c.T).T)

    def grid(self, y: ArrayLike, x: ArrayLike, dy: int = 0, dx: int = 0) -> Floats:
        """(len(y), len(x)) values, or derivatives of orders dy, dx, on the tensor grid of positions in µm."""
        rows = self.y_axis.matrix(y, dy) @ self.coefficients
        return np.ascontiguousarray((self.x_axis.matrix(x, dx) @ rows.T).T)

    def at(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """(m,) values at scattered positions (x, y) in µm."""
        bx, by = self.x_axis.matrix(x), self.y_axis.matrix(y)
        tx, ty = (b.indices.reshape(b.shape[0], -1) for b in (bx, by))
        wx, wy = (b.data.reshape(b.shape[0], -1) for b in (bx, by))
        return np.einsum("ma,mb,mab->m", wy, wx, self.coefficients[ty[:, :, None], tx[:, None, :]])

    @cached_property
    def max_slope(self) -> tuple[float, float]:
        """Largest |∂z/∂y| and |∂z/∂x|, from samples and the midpoints between them (0 for "nearest")."""
        steepest = []
        for axis in (0, 1):
            a = (self.y_axis, self.x_axis)[axis]
            where = (np.arange(2 * a.n) + 0.5) * a.h / 2
            other = (np.arange((self.x_axis, self.y_axis)[axis].n) + 0.5) * (self.x_axis, self.y_axis)[axis].h
            g = self.grid(where, other, dy=1) if axis == 0 else self.grid(other, where, dx=1)
            steepest.append(float(np.abs(g).max()))
        return steepest[0], steepest[1]
