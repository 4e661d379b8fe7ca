"""The beam that falls on a mesh: where rays start, where they go, and what each facet does to parallel light."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..directions import Incoming, frames, s_axes
from ..errors import InputError, VgonioWarning
from ..surface.heightfield import Heightfield
from ..surface.mesh import KEPT_FACETS, Mesh, mesh, profile_once
from .threads import in_order
from .trace import Paths, Tracer, ahead, dot, next_facet, trace
from .tracers import TRACERS

Floats = NDArray[np.float64]
Area = tuple[float, float, float, float]
BEHIND, FREE, OPEN = 0, 1, 2  # fates of a facet in parallel light
CHUNK = 1 << 16


@dataclass(frozen=True)
class Scene:
    """A mesh with its tracer."""

    mesh: Mesh
    tracer: Tracer

    @staticmethod
    def of(surface: Heightfield, refinement: int, tracer: str) -> Scene:
        m = mesh(profile_once(surface), refinement)
        return Scene(m, TRACERS[tracer](m))

    def start_area(self, incoming: Incoming, i: int) -> Area | None:
        """(x0, x1, y0, y1) at the top of the mesh where rays start.

        Periodic: one period. Finite: so far inside that the first hit is real, and a margin for the way out, a
        quarter of what is left. None where nothing is left.
        """
        x0, x1, y0, y1 = self.mesh.box
        if self.mesh.period is not None:
            return x0, x1, y0, y1
        bottom, top = self.mesh.z_range
        w = incoming.vectors[i]
        reach = -(top - bottom) * w[:2] / w[2] * 1.001
        lo = np.array([x0, y0]) - np.minimum(reach, 0)
        hi = np.array([x1, y1]) - np.maximum(reach, 0)
        margin = 0.25 * (hi - lo)
        lo, hi = lo + margin, hi - margin
        return None if np.any(hi - lo < 0.05 * np.array([x1 - x0, y1 - y0])) else (lo[0], hi[0], lo[1], hi[1])

    def required_area(self, incoming: Incoming, i: int) -> Area:
        area = self.start_area(incoming, i)
        if area is None:
            raise InputError(
                f"θ_i = {incoming.theta_deg[i]:g}°: the sample is too small for a guard band, "
                "use edges = 'auto' or 'mirror'"
            )
        return area

    def paths(
        self, incoming: Incoming, i: int, n: int, rng: np.random.Generator, max_bounces: int, at_once: int = CHUNK
    ) -> Iterator[Paths]:
        """Trace n rays of incidence i, `at_once` at a time: starts stratified, directions over the source's cone."""
        position = Starts(self.required_area(incoming, i), self.mesh.z_range[1], n).draw(rng)
        direction, s = rays_of_source(incoming, i, n, rng)
        for a in range(0, n, at_once):
            part = slice(a, a + at_once)
            yield trace(self.mesh, self.tracer, position[part], direction[part], s[part], max_bounces)


def warn_of_fine_relief(m: Mesh) -> None:
    """VgonioWarning where the relief is so small against the sample that a reflected ray starts above most of it."""
    relief = m.z_range[1] - m.z_range[0]
    if 1e-12 < relief < 10 * m.lift:
        warnings.warn(
            f"the relief of {relief:.2g} µm is too fine for single precision over a sample of this size (rays start "
            f"{m.lift:.2g} µm above their facets): slopes are right, shadows and multiple reflections are missed; "
            "trace a smaller piece of the sample",
            VgonioWarning,
            stacklevel=3,
        )


class Starts:
    """n start positions at the height `top`: two in each cell of a grid over the area, row by row, the two of a cell
    side by side in the list; what does not fill a grid lies anywhere."""

    def __init__(self, area: Area, top: float, n: int) -> None:
        x0, x1, y0, y1 = area
        cells = max(n // 2, 1)
        nx = int(np.clip(np.ceil(np.sqrt(cells * (x1 - x0) / (y1 - y0))), 1, cells))
        ny = cells // nx if n > 1 else 0
        self.pairs = 2 * nx * ny
        self.size, self.cell = (x1 - x0, y1 - y0), ((x1 - x0) / nx, (y1 - y0) / max(ny, 1))
        self.corner = np.empty((n, 3))
        self.corner[:] = (x0, y0, top)
        grid = self.corner[: self.pairs].reshape(ny, nx, 2, 3)
        grid[..., 0] += self.cell[0] * np.arange(nx)[:, None]
        grid[..., 1] += self.cell[1] * np.arange(ny)[:, None, None]

    def draw(self, rng: np.random.Generator) -> Floats:
        """(n, 3) positions."""
        position = self.corner.copy()
        for axis in (0, 1):
            unit = rng.random(len(position))
            position[: self.pairs, axis] += self.cell[axis] * unit[: self.pairs]
            position[self.pairs :, axis] += self.size[axis] * unit[self.pairs :]
        return position


def rays_of_source(incoming: Incoming, i: int, n: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """(n, 3) directions of travel and s axes of the light that comes from direction i, within the source's cone."""
    w = np.broadcast_to(incoming.vectors[i], (n, 3)).copy()
    if incoming.divergence_deg > 0:
        half = np.deg2rad(incoming.divergence_deg / 2)
        cos = 1 - rng.random(n) * (1 - np.cos(half))
        psi = 2 * np.pi * rng.random(n)
        sin = np.sqrt(1 - cos**2)
        w = np.stack([sin * np.cos(psi), sin * np.sin(psi), cos], axis=1) @ frames(incoming.vectors[i : i + 1])[0].T
        w[:, 2] = np.maximum(w[:, 2], 1e-6)  # a source cone that dips below the horizon is cut there
        w /= np.linalg.norm(w, axis=1, keepdims=True)
    # one polariser for the whole cone: its axis, as far as it lies across each ray
    axis = s_axes(incoming.vectors[i : i + 1], incoming.phi_deg)[0]
    s = axis - (w @ axis)[:, None] * w
    return -w, s / np.linalg.norm(s, axis=1, keepdims=True)


class Strip(NamedTuple):
    """`rays` of `all` rays, those from `first` on: the same part of the area, along y."""

    rays: int
    first: int
    all: int


class ParallelBeam:
    """Parallel light on a mesh: every facet reflects it into one direction, known before any ray is cast."""

    def __init__(self, scene: Scene, incoming: Incoming, i: int) -> None:
        direction, s = rays_of_source(incoming, i, 1, np.random.default_rng(0))
        self.scene, self.direction, self.s_axis = scene, direction[0], s[0]
        self.area = scene.required_area(incoming, i)
        self.facets = len(scene.mesh.faces)
        self._fates: NDArray[np.uint8] | None = None
        self._starts: dict[tuple[int, int], Starts] = {}

    def starts(self, strip: Strip, rng: np.random.Generator) -> Floats:
        """(n, 3) start positions in a strip along x; the grid of its size is kept.

        A strip touches few facets, which the tracer then has in its cache.
        """
        x0, x1, y0, y1 = self.area
        scale = (y1 - y0) / strip.all
        starts = self._starts.get((strip.rays, strip.all))
        if starts is None:
            area = x0, x1, y0, y0 + strip.rays * scale
            starts = self._starts[strip.rays, strip.all] = Starts(area, self.scene.mesh.z_range[1], strip.rays)
        position = starts.draw(rng)
        position[:, 1] += strip.first * scale
        return position

    def reflected(self, facet: NDArray) -> tuple[Floats, Floats, Floats]:
        """Normals (n, 3), directions after the reflection (n, 3) and cosines of incidence (n,) of facets (n,)."""
        normal, _ = self.scene.mesh.planes(facet)
        cos_i = -dot(normal, self.direction)
        return normal, ahead(self.direction, 2 * cos_i, normal), cos_i

    def _fate(self, facet: NDArray) -> NDArray[np.uint8]:
        _, away, cos_i = self.reflected(facet)
        fate = np.where(self.scene.mesh.unstoppable(away), FREE, OPEN)
        return np.where(cos_i > 0, fate, BEHIND).astype(np.uint8)

    def fate(self, facet: NDArray) -> NDArray[np.uint8]:
        """(n,) whether light on facets (n,) is reflected where nothing can stop it (FREE), perhaps not (OPEN), or
        comes from behind (BEHIND)."""
        return self._fate(facet) if self._fates is None else np.take(self._fates, facet)

    def prepare(self, pool: Executor) -> None:
        """Work out the fates of all facets, once; of a mesh that is too big they are worked out when asked for."""
        if self.facets <= KEPT_FACETS:
            mesh = self.scene.mesh
            mesh.planes(np.zeros(1, np.int64)), mesh.steepest  # before several threads ask for them
            chunks = [(np.arange(a, min(a + CHUNK, self.facets)),) for a in range(0, self.facets, CHUNK)]
            self._fates = np.concatenate(list(in_order(pool, self._fate, chunks)))

    def footprint(self, facet: NDArray) -> Floats:
        """(n,) areas of facets (n,) as the light sees them, over the beam's cross-section."""
        x0, x1, y0, y1 = self.area
        corner, second, third = self.scene.mesh.corners(facet)
        # the flat area vector: half the cross product points along the normal
        across = -dot(np.cross(second - corner, third - corner), self.direction) / 2
        return across / -self.direction[2] / ((x1 - x0) * (y1 - y0))

    def points_on(self, facet: NDArray, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """(n, 3) points drawn uniformly on facets (n,), and where a ray that leaves them starts."""
        a, b, c = self.scene.mesh.corners(facet)
        u, v = rng.random((2, len(facet), 1))
        over = u + v > 1
        u, v = np.where(over, 1 - u, u), np.where(over, 1 - v, v)
        point = a + u * (b - a) + v * (c - a)
        return point, ahead(point, self.scene.mesh.lift, self.scene.mesh.planes(facet)[0])

    def lit(self, point: Floats) -> NDArray[np.bool_]:
        """(n,) whether light gets to points (n, 3) that lie a little above the surface."""
        ok = self.in_area(point)
        at = np.flatnonzero(ok)
        back = np.broadcast_to(-self.direction, (len(at), 3))
        ok[at] = next_facet(self.scene.mesh, self.scene.tracer, point[at], back)[2]
        return ok

    def in_area(self, point: Floats) -> NDArray[np.bool_]:
        """(n,) whether light through the points (n, 3) started inside the beam's area at the top of the mesh."""
        if self.scene.mesh.period is not None:
            return np.ones(len(point), bool)
        x0, x1, y0, y1 = self.area
        up = (self.scene.mesh.z_range[1] - point[:, 2]) / self.direction[2]
        x, y = point[:, 0] + up * self.direction[0], point[:, 1] + up * self.direction[1]
        return (x >= x0) & (x < x1) & (y >= y0) & (y < y1)

    def lies_inside(self, facet: NDArray) -> NDArray[np.bool_]:
        """(n,) facets that lie in the beam as a whole."""
        return np.logical_and.reduce([self.in_area(corner) for corner in self.scene.mesh.corners(facet)])

    def covers(self, facet: NDArray) -> NDArray[np.bool_]:
        """(n,) facets that count: of a periodic mesh those in its box, of a finite one all."""
        mesh = self.scene.mesh
        return np.ones(len(facet), bool) if mesh.period is None else mesh.in_box(facet)
