"""Which points of a height field a far source or detector can see.

Towards a direction of polar angle θ the height above the line of sight is h = z − u cot θ, u counted horizontally
towards the direction: a point is seen where no point further on has a larger h. A running maximum along lines of the
azimuth does for all points at once. Facets that face away are hidden by what follows at once and need no rule.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from .heightfield import Heightfield
from .interpolant import Axis

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
MOST_PERIODS = 64  # of an oblique line on a periodic field; reached beyond 89.9° for Sq = 1 % of the side
LOWEST = -1e300


def visible(surface: Heightfield, direction: ArrayLike, refine: int = 1) -> Bools:
    """(refine·ny, refine·nx) bool: which points, the centres of `refine`² parts of each sample's cell, see `direction`.

    direction : (3,) pointing away from the surface, not necessarily a unit vector, z > 0
    A shadow's edge is right to about one step of that grid. A periodic field shadows itself across its edges; nothing
    stands beyond the edges of a finite one. One profile repeated along y counts as endless along y: (1, refine·nx).

    Raises InputError for missing points, a direction at or below the horizon, or a bad `refine`.
    """
    d = np.asarray(direction, dtype=np.float64)
    if d.shape != (3,) or not np.isfinite(d).all() or d[2] <= 0:
        raise InputError(f"direction {direction!r}: three finite numbers with z > 0 (above the horizon) are needed")
    if int(refine) != refine or refine < 1:
        raise InputError(f"refine = {refine!r}: a whole number of at least 1 is needed")
    surface.require_complete()
    ip, n = surface.interpolant, int(refine)
    x, y = _centres(ip.x_axis, n), _centres(ip.y_axis, n)
    dx, dy = surface.dx / n, surface.dy / n
    rows = surface.z[:1] if surface.is_profile else None
    if np.hypot(d[0], d[1]) < 1e-12 * d[2] or np.ptp(surface.z) == 0:
        return np.ones((1 if rows is not None else len(y), len(x)), bool)
    if rows is not None:
        if abs(d[0]) < 1e-12 * d[2]:
            return np.ones((1, len(x)), bool)
        return _along_axis(ip.grid(surface.y[:1], x), dx, d[0], d[2], surface.periodic)
    if abs(d[1]) < 1e-12 * abs(d[0]):
        return _along_axis(ip.grid(y, x), dx, d[0], d[2], surface.periodic)
    if abs(d[0]) < 1e-12 * abs(d[1]):
        return _along_axis(ip.grid(y, x).T, dy, d[1], d[2], surface.periodic).T
    if abs(d[0]) >= abs(d[1]):
        return _oblique(ip.grid(y, x), ip.y_axis, y, x, (d[0], d[1], d[2]), surface.periodic)
    return _oblique(ip.grid(y, x).T, ip.x_axis, x, y, (d[1], d[0], d[2]), surface.periodic).T


def single_reflections(surface: Heightfield, theta_i_deg: ArrayLike) -> Bools:
    """(n,) angles of incidence at which no mirrored ray meets the surface again: |θ_i| + 3 × the steepest slope < 90°.

    A facet of slope α sends light from θ_i at most to θ_i + 2α; to meet another it has to stay below that one's slope.
    Walls ("nearest") are as steep as can be.
    """
    theta = np.abs(np.atleast_1d(np.asarray(theta_i_deg, float)))
    if np.ptp(surface.z) == 0:
        return np.ones(theta.shape, bool)
    if surface.interpolation == "nearest":
        return np.zeros(theta.shape, bool)
    steepest = np.rad2deg(np.arctan(np.hypot(*surface.interpolant.max_slope)))
    return theta + 3 * steepest < 90.0


def _centres(axis: Axis, refine: int) -> Floats:
    n = axis.n * refine
    return (np.arange(n) + 0.5) * axis.h / refine


def _along_axis(z: Floats, step: float, along: float, up: float, periodic: bool) -> Bools:
    """Sight along the second axis of z, towards its end for along > 0. A period on, h is lower by the same amount
    everywhere, so that one period ahead is enough."""
    if along < 0:
        return _along_axis(z[:, ::-1], step, -along, up, periodic)[:, ::-1]
    n = z.shape[1]
    h = z - np.arange(n) * (step * up / along)
    beyond = h.max(axis=1) - n * step * up / along if periodic else np.full(len(z), LOWEST)
    return _not_below(h, beyond)[0]


def _not_below(h: Floats, beyond: Floats) -> tuple[Bools, Floats]:
    """Where h (lines, n) is at least the maximum of what follows on its line, `beyond` (lines,) included; and the
    maximum over all of it."""
    top = np.maximum.accumulate(np.concatenate([h, beyond[:, None]], axis=1)[:, ::-1], axis=1)[:, ::-1]
    return h >= top[:, 1:], top[:, 0]


def _oblique(
    z: Floats, across: Axis, y: Floats, x: Floats, direction: tuple[float, float, float], periodic: bool
) -> Bools:
    """Sight along lines y = y_j + (x − x_0) d_y/d_x, |d_y| ≤ |d_x|, on heights sheared so that lines become rows.

    z : (len(y), len(x));  across : the axis of y, whose interpolation moves the heights by parts of a step
    """
    dx, dy, up = direction
    if dx < 0:
        return _oblique(z[:, ::-1], across, y, x, (-dx, dy, up), periodic)[:, ::-1]
    step = 2 * x[0]  # the first centre is half a step from the side: right for a single column as well
    length = len(x) * step
    fine = Axis(len(y), 2 * y[0], periodic, across.kind)
    columns = fine.coefficients(np.ascontiguousarray(z))
    slope, fall = dy / dx, up / dx
    margin = 0 if periodic else int(np.ceil(length * abs(slope) / fine.h))
    lines = (np.arange(-margin, len(y) + margin) + 0.5) * fine.h if not periodic else y
    height = fine.n * fine.h

    def sheared(turn: int) -> Floats:
        """h on the lines over the period `turn` ahead."""
        h = np.empty((len(lines), len(x)))
        for i in range(len(x)):
            run = turn * length + i * step
            at = lines + run * slope
            value = fine.matrix(np.clip(at, 0, height) if not periodic else at) @ columns[:, i] - run * fall
            h[:, i] = value if periodic else np.where((at >= 0) & (at <= height), value, LOWEST)
        return h

    beyond = np.full(len(lines), LOWEST)
    if periodic:
        ahead = int(min(np.ceil(np.ptp(z) / (fall * length)), MOST_PERIODS))
        for turn in range(ahead, 0, -1):
            beyond = np.maximum(beyond, sheared(turn).max(axis=1))
    seen = _not_below(sheared(0), beyond)[0]
    out = np.empty(z.shape, bool)
    for i in range(len(x)):
        # the line through each point, to the nearest
        j = np.rint((y - i * step * slope) / fine.h - 0.5).astype(int) + margin
        out[:, i] = seen[j % len(y) if periodic else np.clip(j, 0, len(lines) - 1), i]
    return out
