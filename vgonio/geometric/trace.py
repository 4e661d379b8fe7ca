"""Paths of rays over a mesh: hits, reflections, what escapes upward and what is lost.

Positions and normals are kept in double precision; Embree (single precision) only says which facet is hit first, the
point itself is where the ray meets that facet's plane.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..errors import BackendError
from ..surface.mesh import Mesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# a ray that has crossed so many periods without meeting anything is as good as horizontal
MAX_WRAPS = 2000


class Embree:
    """Closest-hit queries on a mesh by Embree 4 (Wald 2014), watertight mode."""

    name = "embree"

    def __init__(self, mesh: Mesh) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError as e:
            raise BackendError(f"embreex cannot be loaded ({e}): pip install embreex") from None
        # single precision counts from the middle of the mesh
        lo, hi = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        self.origin = (lo + hi) / 2
        self.scene = EmbreeScene(robust=True)
        self.geometry = TriangleMesh(self.scene, (mesh.vertices - self.origin).astype(np.float32), mesh.faces)

    def facet(self, position: Floats, direction: Floats) -> NDArray[np.int32]:
        """(n,) index of the first facet hit, −1 for none."""
        if len(position) == 0:
            return np.zeros(0, np.int32)
        return self.scene.run((position - self.origin).astype(np.float32), direction.astype(np.float32))


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


def trace(mesh: Mesh, tracer: Embree, position: Floats, direction: Floats, s_axis: Floats, max_bounces: int) -> Paths:
    """Follow rays from `position` along `direction` until they escape upward, leave sideways or reach the limit.

    position, direction : (n, 3), starting at or above the top of the mesh and going down
    s_axis : (n, 3) unit vectors across the direction, the s axis of the incident light
    """
    n = len(position)
    paths = Paths(np.zeros(n, np.int64), np.zeros(n, bool), direction.copy(), s_axis.copy())
    ray = np.arange(n)
    position, direction, s = position.copy(), direction.copy(), s_axis.copy()
    # off the facet by a few units in the last place of the largest single-precision coordinate
    lift = 8 * np.finfo(np.float32).eps * max(np.abs(mesh.vertices - mesh.vertices.mean(axis=0)).max(), 1e-12)
    for k in range(max_bounces + 1):
        facet, position, escaped = next_facet(mesh, tracer, position, direction)
        paths.escaped[ray[escaped]] = True
        go = facet >= 0
        if k == max_bounces:
            break  # what would be reflected once more stays unescaped: lost
        ray, position, direction, s, facet = ray[go], position[go], direction[go], s[go], facet[go]
        if len(ray) == 0:
            break
        normal = mesh.normals[facet]
        cos_i = -np.einsum("ij,ij->i", direction, normal)
        s, c2, s2 = _next_frame(direction, normal, s)
        direction = direction + (2 * cos_i)[:, None] * normal
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        position = position + lift * normal
        paths.hits.append(Hits(ray, np.clip(cos_i, 0.0, 1.0), c2, s2))
        paths.bounces[ray] += 1
        paths.direction[ray] = direction
        paths.s_axis[ray] = s
    return paths


def _next_frame(direction: Floats, normal: Floats, s: Floats) -> tuple[Floats, Floats, Floats]:
    """The s axis of a facet, d × n / |d × n|, and cos 2ψ, sin 2ψ of the turn from the old s axis to it (p = d × s)."""
    new = np.cross(direction, normal)
    length = np.linalg.norm(new, axis=1)
    head_on = length < 1e-9  # no plane of incidence: keep the frame
    new = np.where(head_on[:, None], s, new / np.where(head_on, 1.0, length)[:, None])
    cos = np.einsum("ij,ij->i", s, new)
    sin = np.einsum("ij,ij->i", np.cross(direction, s), new)
    return new, cos * cos - sin * sin, 2 * sin * cos


def next_facet(
    mesh: Mesh, tracer: Embree, position: Floats, direction: Floats
) -> tuple[Ints, Floats, NDArray[np.bool_]]:
    """First facet (−1: none), the point on it, and whether the ray escaped upward, over as many periods as it takes."""
    n = len(position)
    facet = np.full(n, -1, np.int64)
    escaped = np.zeros(n, bool)
    point = position.copy()
    bottom, top = mesh.z_range
    box = np.array(mesh.box).reshape(2, 2)
    if mesh.period is not None:
        # a hit in the overlap belongs to the other side
        size = box[:, 1] - box[:, 0]
        point[:, :2] -= size * np.floor((point[:, :2] - box[:, 0]) / size)
    todo = np.flatnonzero(~((position[:, 2] >= top) & (direction[:, 2] > 0)))
    escaped[(position[:, 2] >= top) & (direction[:, 2] > 0)] = True
    for _ in range(MAX_WRAPS):
        if len(todo) == 0:
            break
        p, d = point[todo], direction[todo]
        found = tracer.facet(p, d)
        hit = found >= 0
        # a facet seen from below is a ray that slipped through an edge: it is neither hit nor escaped, so it is lost
        normal = mesh.normals[found[hit]]
        against = np.einsum("ij,ij->i", d[hit], normal)
        front = against < 0
        index = np.flatnonzero(hit)[front]
        t = (mesh.offsets[found[index]] - np.einsum("ij,ij->i", p[index], normal[front])) / against[front]
        point[todo[index]] = p[index] + t[:, None] * d[index]
        facet[todo[index]] = found[index]
        miss = np.flatnonzero(~hit)
        todo, p, d = todo[miss], p[miss], d[miss]
        with np.errstate(divide="ignore", invalid="ignore"):
            to_top = np.where(d[:, 2] > 0, (top - p[:, 2]) / d[:, 2], np.inf)
            wall = np.where(d[:, :2] > 0, box[:, 1], box[:, 0])
            to_side = np.where(d[:, :2] != 0, (wall - p[:, :2]) / d[:, :2], np.inf)
        axis = np.argmin(to_side, axis=1)
        side = np.maximum(to_side[np.arange(len(todo)), axis], 0.0)
        escaped[todo[to_top <= side]] = True
        # finite: the others are lost; periodic: they come back on the other side unless they are below everything
        stay = to_top > side
        if mesh.period is None:
            break
        stay &= np.isfinite(side) & (p[:, 2] + side * d[:, 2] >= bottom - 1e-6 * (top - bottom) - 1e-9)
        todo, p, d, axis, side = todo[stay], p[stay], d[stay], axis[stay], side[stay]
        p = p + side[:, None] * d
        p[np.arange(len(todo)), axis] = np.where(d[np.arange(len(todo)), axis] > 0, box[axis, 0], box[axis, 1])
        point[todo] = p
    return facet, point, escaped
