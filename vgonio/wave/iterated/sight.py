"""What the points of a profile see: each other, and far directions, from running maxima of slopes along the curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..quadrature import Floats
from .curve import Curve

Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]
BLOCK = 2_000_000  # pairs looked at together
GRAZING = 1e-6  # cosine below which a pair or a direction counts as along the surface


@dataclass(frozen=True, eq=False)
class Sight:
    """Mutual visibility of points `rows` (first … last − 1) with all points of a curve, and their horizons.

    row, source : (p,) pairs that see each other: index counted from `first`, index into the curve
    right, left : (rows,) slope of the highest line of sight towards +x and −x; −∞ where nothing stands there
    """

    row: Ints
    source: Ints
    right: Floats
    left: Floats

    def seen(self, curve: Curve, theta: Floats) -> Bools:
        """(len(theta), rows) which points of `curve` (the rows alone) see the direction θ, signed, in radians."""
        s, c = np.sin(theta)[:, None], np.cos(theta)[:, None]
        facing = s * curve.nx + c * curve.nz > 0
        horizon = np.where(s > 0, self.right, self.left)
        # the line of sight rises by cos θ on |sin θ|
        with np.errstate(invalid="ignore"):
            free = c >= np.where(np.abs(s) > 0, horizon * np.abs(s), -np.inf)
        return facing & free


def mean_height(x: Floats, z: Floats, weight: Floats, theta: float) -> float:
    """Mean height at which parallel light from θ (signed, radians) meets the line through points, x never falling.

    weight : (n,) of the light at the points. Edges of shadows are found between the points, so that the mean hardly
    depends on their spacing.
    """
    if theta < 0:
        x, z, weight, theta = -x[::-1], z[::-1], weight[::-1], -theta
    across = x - z * np.tan(theta)  # one ray has one of these
    reach = np.minimum.accumulate(across[::-1])[::-1][1:]  # rays beyond have met the line further towards the source
    step = np.diff(across)
    lit = reach > across[:-1]
    share = np.where(lit, (reach - across[:-1]) / np.where(lit, step, 1.0), 0.0)
    amount = share * np.where(lit, step, 0.0) * (weight[1:] + weight[:-1]) / 2
    height = z[:-1] + share * np.diff(z) / 2
    return float(amount @ height / max(float(amount.sum()), 1e-300))


def look(curve: Curve, first: int = 0, last: int | None = None) -> Sight:
    """Who sees whom among the points of `curve`, for the rows from `first` to `last` − 1.

    Seen from a point, a later one is visible where no point between stands above the line between them: a running
    maximum of slopes. Points see each other only with both normals turned towards the other.
    """
    last = len(curve) if last is None else last
    rows, sources = [], []
    right, left = np.empty(last - first), np.empty(last - first)
    step = max(1, BLOCK // len(curve))
    flipped = Curve(-curve.x[::-1], curve.z[::-1], -curve.nx[::-1], curve.nz[::-1], curve.ds[::-1])
    n = len(curve)
    for a in range(first, last, step):
        b = min(a + step, last)
        i, j, right[a - first : b - first] = _ahead(curve, a, b)
        rows.append(i)
        sources.append(j)
        i, j, horizon = _ahead(flipped, n - b, n - a)
        left[a - first : b - first] = horizon[::-1]
        rows.append(n - 1 - i)
        sources.append(n - 1 - j)
    row, source = np.concatenate(rows), np.concatenate(sources)
    order = np.lexsort((source, row))
    return Sight(row[order] - first, source[order], right, left)


def _ahead(curve: Curve, a: int, b: int) -> tuple[Ints, Ints, Floats]:
    """Pairs (i, j), i in a … b − 1 and j > i, that see each other, and the horizon of the i."""
    x, z = curve.x, curve.z
    dx, dz = x[None, a + 1 :] - x[a:b, None], z[None, a + 1 :] - z[a:b, None]
    behind = np.arange(a + 1, len(x))[None] <= np.arange(a, b)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(behind, -np.inf, dz / dx)  # ±∞ along a wall
    slope = np.nan_to_num(slope, nan=-np.inf, posinf=np.inf, neginf=-np.inf)
    top = np.maximum.accumulate(slope, axis=1) if slope.size else slope
    before = np.concatenate([np.full((b - a, 1), -np.inf), top[:, :-1]], axis=1) if slope.size else slope
    i, j = np.nonzero((slope >= before) & ~behind)
    horizon = top[:, -1] if slope.size else np.full(b - a, -np.inf)
    ux, uz = dx[i, j], dz[i, j]
    i, j = i + a, j + a + 1
    length = np.hypot(ux, uz)
    facing = (ux * curve.nx[i] + uz * curve.nz[i] > GRAZING * length) & (
        ux * curve.nx[j] + uz * curve.nz[j] < -GRAZING * length
    )
    return i[facing], j[facing], horizon
