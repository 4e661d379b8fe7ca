"""Paths of rays over a mesh: hits, reflections, what escapes upward and what is lost.

Positions and normals are kept in double precision; a tracer (in single precision) only says which facet is hit first,
the point itself is where the ray meets that facet's plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..surface.mesh import Mesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Step = tuple[Ints, Floats, NDArray[np.bool_]]  # facet (−1: none), point, escaped upward

# a ray that has crossed so many periods without meeting anything is as good as horizontal
MAX_WRAPS = 2000


class Tracer(Protocol):
    """What finds the first facet on a ray: (n, 3) positions and directions -> (n,) index, −1 for none."""

    name: str
    device: str

    def facet(self, position: Floats, direction: Floats) -> NDArray[np.int32]: ...


@dataclass
class Hits:
    """The k-th reflection of those rays that have one."""

    ray: Ints  # (m,) which ray
    cos_i: Floats  # (m,) cosine of the local angle of incidence
    cos_2psi: Floats  # (m,) rotation of the s axis from the last frame to this one, about the direction of travel
    sin_2psi: Floats


@dataclass
class Paths:
    """All paths of a batch of n rays."""

    bounces: Ints  # (n,) number of reflections
    escaped: NDArray[np.bool_]  # (n,) left upward; the others were lost
    direction: Floats  # (n, 3) last direction of travel
    s_axis: Floats  # (n, 3) s axis of the frame that the light has after its last reflection (p = d × s)
    hits: list[Hits] = field(default_factory=list)
    weight: Floats | None = None  # (n,) how many rays took this path; None: one each
    variance: Floats | None = None  # (n,) variance of that number; None: independent rays
    counted: NDArray[np.bool_] | None = None  # (n,) counts for the detector; None: all
    of_rays: int | None = None  # out of how many independent rays these are, where the others are counted elsewhere

    @property
    def times(self) -> Floats:
        """(n,) how many rays took each path."""
        return np.ones(len(self.bounces)) if self.weight is None else self.weight


def trace(
    mesh: Mesh,
    tracer: Tracer,
    position: Floats,
    direction: Floats,
    s_axis: Floats,
    max_bounces: int,
    known: Sequence[Step] = (),
) -> Paths:
    """Follow rays from `position` along `direction` until they escape upward, leave sideways or reach the limit.

    position, direction : (n, 3), starting at or above the top of the mesh and going down
    s_axis : (n, 3) unit vectors across the direction, the s axis of the incident light
    known : what the first intersections find (as `next_facet`), each for the rays that are still on their way
    """
    n = len(position)
    paths = Paths(np.zeros(n, np.int64), np.zeros(n, bool), direction.copy(), s_axis.copy())
    ray = np.arange(n)
    position, direction, s = position.copy(), direction.copy(), s_axis.copy()
    for k in range(max_bounces + 1):
        facet, position, escaped = known[k] if k < len(known) else next_facet(mesh, tracer, position, direction)
        paths.escaped[ray[escaped]] = True
        go = np.flatnonzero(facet >= 0)
        if k == max_bounces or len(go) == 0:
            break  # what would be reflected once more stays unescaped: lost
        ray, facet = ray[go], facet[go]
        position, direction, s = (np.take(a, go, axis=0) for a in (position, direction, s))
        normal = mesh.planes(facet)[0]
        cos_i = -dot(direction, normal)
        s, c2, s2 = _next_frame(direction, normal, s)
        direction = ahead(direction, 2 * cos_i, normal)
        direction /= np.sqrt(dot(direction, direction))[:, None]
        position = ahead(position, mesh.lift, normal)
        paths.hits.append(Hits(ray, np.clip(cos_i, 0.0, 1.0), c2, s2))
        paths.bounces[ray] += 1
        paths.direction[ray] = direction
        paths.s_axis[ray] = s
    return paths


def dot(a: Floats, b: Floats) -> Floats:
    """(n,) scalar products of (n, 3) and (n, 3) or (3,) vectors; by columns, as rows of three numbers are slow."""
    return a[:, 0] * b[..., 0] + a[:, 1] * b[..., 1] + a[:, 2] * b[..., 2]


def ahead(start: Floats, t: Floats | float, along: Floats) -> Floats:
    """(n, 3) start + t · along, of (n, 3) or (3,) vectors; by columns, as in `dot`."""
    out = np.empty(np.broadcast_shapes(start.shape, along.shape))
    for axis in range(3):
        np.multiply(along[..., axis], t, out=out[:, axis])
        out[:, axis] += start[..., axis]
    return out


def _next_frame(direction: Floats, normal: Floats, s: Floats) -> tuple[Floats, Floats, Floats]:
    """The s axis of a facet, d × n / |d × n|, and cos 2ψ, sin 2ψ of the turn from the old s axis to it (p = d × s)."""
    new = np.cross(direction, normal)
    length = np.sqrt(dot(new, new))
    head_on = length < 1e-9  # no plane of incidence: keep the frame
    new = np.where(head_on[:, None], s, new / np.where(head_on, 1.0, length)[:, None])
    cos = dot(s, new)
    sin = dot(np.cross(direction, s), new)
    return new, cos * cos - sin * sin, 2 * sin * cos


def next_facet(mesh: Mesh, tracer: Tracer, position: Floats, direction: Floats, may_be_free: bool = True) -> Step:
    """First facet (−1: none), the point on it, and whether the ray escaped upward, over as many periods as it takes.

    Rays that the steepest facet can no longer stop are not cast at all (`may_be_free`: unless that is known).
    """
    n = len(position)
    facet = np.full(n, -1, np.int64)
    point = _in_the_box(mesh, position)
    top = mesh.z_range[1]
    escaped = (position[:, 2] >= top) & (direction[:, 2] > 0)
    if may_be_free:
        escaped |= mesh.unstoppable(direction)
    todo = np.flatnonzero(~escaped)
    for _ in range(MAX_WRAPS):
        if len(todo) == 0:
            break
        p, d = (point, direction) if len(todo) == n else (np.take(a, todo, axis=0) for a in (point, direction))
        found = tracer.facet(p, d)
        hit = np.flatnonzero(found >= 0)
        out = (found < 0) & _leaves_through_the_top(mesh, p, d)
        escaped[todo[out]] = True
        ok, where = meet(mesh, found[hit].astype(np.int64), np.take(p, hit, axis=0), np.take(d, hit, axis=0))
        point[todo[hit[ok]]] = where[ok]
        facet[todo[hit[ok]]] = found[hit[ok]]
        todo = todo[(found < 0) & ~out]
        if mesh.period is None:
            break  # lost through the sides
        stay, back = _beyond_the_border(mesh, point[todo], direction[todo])
        todo = todo[stay]
        point[todo] = back[stay]
    return facet, point, escaped


def _in_the_box(mesh: Mesh, position: Floats) -> Floats:
    """A copy of positions (n, 3): a point in the overlap of a periodic mesh belongs to the other side."""
    point = position.copy()
    if mesh.period is not None:
        for axis in (0, 1):
            low, high = mesh.box[2 * axis : 2 * axis + 2]
            across = point[:, axis]
            off = np.flatnonzero((across < low) | (across >= high))
            across[off] -= (high - low) * np.floor((across[off] - low) / (high - low))
    return point


def _leaves_through_the_top(mesh: Mesh, p: Floats, d: Floats) -> NDArray[np.bool_]:
    """(n,) whether rays from p along d that meet nothing in the box reach its top before its sides."""
    x0, x1, y0, y1 = mesh.box
    up = d[:, 2] > 0
    t = np.maximum(mesh.z_range[1] - p[:, 2], 0) / np.where(up, d[:, 2], 1.0)
    x, y = p[:, 0] + t * d[:, 0], p[:, 1] + t * d[:, 1]
    return up & (x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)


def _beyond_the_border(mesh: Mesh, p: Floats, d: Floats) -> tuple[NDArray[np.bool_], Floats]:
    """Rays that leave a period through its sides come back on the other one, unless they are below everything."""
    box = np.array(mesh.box).reshape(2, 2)
    bottom, top = mesh.z_range
    with np.errstate(divide="ignore", invalid="ignore"):
        wall = np.where(d[:, :2] > 0, box[:, 1], box[:, 0])
        to_side = np.where(d[:, :2] != 0, (wall - p[:, :2]) / d[:, :2], np.inf)
    axis = np.argmin(to_side, axis=1)
    row = np.arange(len(p))
    side = np.maximum(to_side[row, axis], 0.0)
    back = p + np.where(np.isfinite(side), side, 0.0)[:, None] * d
    back[row, axis] = np.where(d[row, axis] > 0, box[axis, 0], box[axis, 1])
    return np.isfinite(side) & (back[:, 2] >= bottom - 1e-6 * (top - bottom) - 1e-9), back


def meet(mesh: Mesh, facet: Ints, position: Floats, direction: Floats) -> tuple[NDArray[np.bool_], Floats]:
    """Where rays meet the planes of their facets, (n, 3), and whether that is from above.

    A facet seen from below is a ray that slipped through an edge: it is neither hit nor escaped, so it is lost.
    """
    normal, offset = mesh.planes(facet)
    against = dot(direction, normal)
    front = against < 0
    t = (offset - dot(position, normal)) / np.where(front, against, -1.0)
    return front, ahead(position, t, direction)
