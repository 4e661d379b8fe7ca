"""The triangle mesh that rays see: facets of the interpolated surface, in one period or up to the outer samples."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .heightfield import Heightfield

Floats = NDArray[np.float64]
KEPT_FACETS = 4_000_000  # beyond, planes are worked out for the facets that are hit only
AZIMUTHS = 16
LEAST_WALL = 1e-100  # µm: lower ones have areas that double precision does not hold, and stop no ray


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, anticlockwise seen from above (walls: seen from the open side).

    vertices : (nv, 3) µm;  faces : (nf, 3) int32
    box : (x0, x1, y0, y1) in µm, the part of the plane that the mesh covers; with `period` the mesh overlaps
          its box by one facet on every side, so that a ray that crosses the border finds no gap
    period : (Lx, Ly) in µm, or None for a finite piece
    """

    vertices: Floats
    faces: NDArray[np.int32]
    box: tuple[float, float, float, float]
    period: tuple[float, float] | None

    @cached_property
    def z_range(self) -> tuple[float, float]:
        return float(self.vertices[:, 2].min()), float(self.vertices[:, 2].max())

    @cached_property
    def middle(self) -> Floats:
        """(3,) middle of the bounding box: single precision counts from there."""
        return (self.vertices.min(axis=0) + self.vertices.max(axis=0)) / 2

    @cached_property
    def lift(self) -> float:
        """µm by which a reflected ray starts above its facet: a few units in the last place of the largest
        single-precision coordinate, counted from the middle of the mesh."""
        reach = (self.vertices.max(axis=0) - self.vertices.min(axis=0)).max() / 2
        return float(8 * np.finfo(np.float32).eps * max(reach, 1e-12))

    def corners(self, facet: NDArray | slice) -> tuple[Floats, Floats, Floats]:
        """The three corners (n, 3) of facets (n,)."""
        a, b, c = (self.vertices[self.faces[facet, i]] for i in range(3))
        return a, b, c

    def in_box(self, facet: NDArray) -> NDArray[np.bool_]:
        """(n,) whether facets (n,) lie in the box, as their middle does; what overlaps it belongs to the other side."""
        x0, x1, y0, y1 = self.box
        corners = np.stack(self.corners(facet))[..., :2]
        x, y = ((corners.min(axis=0) + corners.max(axis=0)) / 2).T
        return (x >= x0) & (x < x1) & (y >= y0) & (y < y1)

    def _planes(self, facet: NDArray | slice) -> tuple[Floats, Floats]:
        a, b, c = self.corners(facet)
        u, v = (b - a).T, (c - a).T
        n = np.stack([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]], axis=1)
        n /= np.sqrt(np.einsum("ij,ij->i", n, n))[:, None]
        return n, np.einsum("ij,ij->i", n, a)

    @cached_property
    def _all_planes(self) -> tuple[Floats, Floats]:
        return self._planes(slice(None))

    def planes(self, facet: NDArray) -> tuple[Floats, Floats]:
        """(n, 3) unit normals of facets (n,), n_z ≥ 0, and the distances n · r of their planes from the origin."""
        if len(self.faces) > KEPT_FACETS:
            return self._planes(facet)
        normal, offset = self._all_planes
        return np.take(normal, facet, axis=0), np.take(offset, facet)

    @cached_property
    def normals(self) -> Floats:
        """(nf, 3) unit normals of the facets in double precision, n_z ≥ 0."""
        return self._all_planes[0]

    @cached_property
    def areas(self) -> Floats:
        """(nf,) areas of the facets in µm²."""
        a, b, c = self.corners(slice(None))
        return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)

    @cached_property
    def offsets(self) -> Floats:
        """(nf,) distances of the facets' planes from the origin: n · r = offset."""
        return self._all_planes[1]

    @cached_property
    def steepest(self) -> Floats:
        """(AZIMUTHS,) largest slope of any facet towards azimuths 2πk/AZIMUTHS; infinite towards a wall."""
        azimuth = 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
        towards = np.stack([np.cos(azimuth), np.sin(azimuth)])
        steepest = np.full(AZIMUTHS, -np.inf)
        for start in range(0, len(self.faces), 1 << 18):
            part = slice(start, start + (1 << 18))
            n = self._planes(part)[0] if len(self.faces) > KEPT_FACETS else self.normals[part]
            wall = n[:, 2] <= 1e-9
            if wall.any():
                faced = (-n[wall, :2] @ towards > 1e-9).any(axis=0)
                steepest[faced] = np.inf
            if not wall.all():
                slope = -n[~wall, :2] / n[~wall, 2:]
                steepest = np.maximum(steepest, (slope @ towards).max(axis=0))
        return np.maximum(steepest, 0.0)

    def unstoppable(self, direction: Floats) -> NDArray[np.bool_]:
        """(n,) whether a ray that starts on or above the surface is steeper than any facet in its azimuth.

        The greatest slope h(u) towards u is sublinear, so h(a u₁ + b u₂) ≤ a h(u₁) + b h(u₂) between two azimuths.
        """
        sector = 2 * np.pi / AZIMUTHS
        x, y, z = direction[:, 0], direction[:, 1], direction[:, 2]
        k = np.floor(np.arctan2(y, x) / sector).astype(np.int64)
        first, second = self.steepest[k % AZIMUTHS], self.steepest[(k + 1) % AZIMUTHS]
        c, s = np.cos(k * sector), np.sin(k * sector)
        along, across = np.maximum(x * c + y * s, 0), np.maximum(y * c - x * s, 0)
        b = across / np.sin(sector)
        a = np.maximum(along - b * np.cos(sector), 0)
        # along a wall: no share of an infinite slope
        bound = np.where(a > 1e-12, a, 0) * np.where(a > 1e-12, first, 0)
        bound += np.where(b > 1e-12, b, 0) * np.where(b > 1e-12, second, 0)
        return z > (1 + 1e-9) * bound


def mesh(surface: Heightfield, refinement: int = 1) -> Mesh:
    """Triangulate the interpolated surface with `refinement` cells per sample and axis.

    With refinement 1 the vertices are the samples themselves. A "nearest" surface becomes plateaus and vertical walls.
    A field of one row or column that is not periodic has no area and raises InputError.
    """
    if refinement < 1:
        raise InputError(f"mesh refinement {refinement}: at least 1 cell per sample is needed")
    surface.require_complete()
    if surface.interpolation == "nearest":
        return _plateaus(surface)
    overlap = 1 if surface.periodic else 0
    grids = []
    for n, h in zip(surface.shape, surface.pitch_um):
        last = n * refinement if surface.periodic else (n - 1) * refinement
        if last < 1:
            raise InputError(
                f"a surface of {surface.shape} samples has no area to trace: give at least two rows and columns"
            )
        grids.append((0.5 + np.arange(-overlap, last + 1 + overlap) / refinement) * h)
    y, x = grids
    z = surface.interpolant.grid(y, x)
    box = (x[overlap], x[-1 - overlap], y[overlap], y[-1 - overlap])
    period = (surface.size_um[1], surface.size_um[0]) if surface.periodic else None
    vertices = np.stack([*np.meshgrid(x, y), z], axis=-1).reshape(-1, 3)
    return Mesh(vertices, _grid_faces(len(y), len(x)), box, period)


def _grid_faces(ny: int, nx: int) -> NDArray[np.int32]:
    a = (np.arange(ny - 1, dtype=np.int32)[:, None] * nx + np.arange(nx - 1, dtype=np.int32)).ravel()
    lower = np.stack([a, a + 1, a + nx], axis=1)
    upper = np.stack([a + 1, a + nx + 1, a + nx], axis=1)
    return np.stack([lower, upper], axis=1).reshape(-1, 3).astype(np.int32, copy=False)


def _plateaus(surface: Heightfield) -> Mesh:
    """Each sample a horizontal rectangle, and a vertical wall wherever two neighbours differ in height."""
    z = surface.z
    if surface.periodic:
        z = np.pad(z, 1, mode="wrap")
    start = -1 if surface.periodic else 0
    ny, nx = z.shape
    x = (np.arange(nx + 1) + start) * surface.dx
    y = (np.arange(ny + 1) + start) * surface.dy
    quads = []
    x0, y0 = np.meshgrid(x[:-1], y[:-1])
    x1, y1 = np.meshgrid(x[1:], y[1:])
    quads.append(_quads([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]))
    for axis in (0, 1):
        low, high = (z[:, :-1], z[:, 1:]) if axis == 1 else (z[:-1], z[1:])
        j, i = np.nonzero(np.abs(high - low) > LEAST_WALL)
        a, b = low[j, i], high[j, i]
        # the corner order that makes the normal point to the lower side
        if axis == 1:
            w, p, q = x[i + 1], y[j], y[j + 1]
            quads.append(_quads([(w, q, a), (w, p, a), (w, p, b), (w, q, b)]))
        else:
            w, p, q = y[j + 1], x[i], x[i + 1]
            quads.append(_quads([(p, w, a), (q, w, a), (q, w, b), (p, w, b)]))
    corners = np.concatenate(quads)
    first = 4 * np.arange(len(corners), dtype=np.int32)[:, None, None]
    faces = (first + np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)).reshape(-1, 3)
    box = (0.0, surface.size_um[1], 0.0, surface.size_um[0])
    period = (surface.size_um[1], surface.size_um[0]) if surface.periodic else None
    return Mesh(corners.reshape(-1, 3), faces, box, period)


def _quads(corners: list) -> Floats:
    """(m, 4, 3) corners in order. A wall between heights a and b faces the lower side whichever of them that is:
    where the order of heights changes, so does the sense of rotation."""
    return np.stack([np.stack(np.broadcast_arrays(*c), axis=-1).reshape(-1, 3) for c in corners], axis=1).astype(float)


def mirrored(surface: Heightfield) -> Heightfield:
    """The periodic 2 × 2 supercell of a finite field and its mirror images: continuous, and reciprocal as a whole.

    It flips slopes (a blazed grating becomes another one): the last resort where a finite sample is too small.
    """
    z = np.block([[surface.z, surface.z[:, ::-1]], [surface.z[::-1], surface.z[::-1, ::-1]]])
    return surface.with_history(z, "mirrored 2 × 2 supercell", periodic=True)


def profile_once(surface: Heightfield) -> Heightfield:
    """One profile repeated along y as the fewest rows that span the same extent; anything else as it is."""
    ny = surface.shape[0]
    if ny < 3 or not surface.is_profile or surface.missing:
        return surface
    if surface.periodic or surface.interpolation == "nearest":
        rows, dy = 1, ny * surface.dy
    else:
        rows, dy = 2, (ny - 1) * surface.dy
    return replace(surface, z=surface.z[:rows], pitch_um=(dy, surface.dx))
