"""Sums of one window with weights on its points: shadows of source and detector, amplitudes of the facets.

S depends on q alone, but a shadow depends on θ_i or θ_o and a facet's amplitude on θ_i and λ. The scattering vectors
fall into groups with one weight each. What is not shadowed within the window stays one group, so that angles without
shadows cost what they did. Directions of one azimuth hide more and more points the lower they are, so the points fall
into shells, and in the plane of incidence each shell is one transform for all pairs (source, element) that see it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..surface.heightfield import Heightfield
from ..surface.visibility import visible
from . import nufft
from .amplitudes import Facets, Model
from .coherence import Window, WindowPlan
from .fourier import apply
from .job import Job
from .quadrature import Complex, Floats, Points

Bools = NDArray[np.bool_]
KEPT = 5e8  # bytes of shadows that are kept, at one bit a point; others are found again for every window
FINEST = 40_000_000  # points on which shadows are found


@dataclass(eq=False)
class Shadows:
    """Shadows of directions on one surface, found once on a grid of `refine` points per sample and axis."""

    surface: Heightfield
    refine: int
    kept: dict[bytes, NDArray[np.uint8] | None] = field(default_factory=dict)
    bytes: int = 0

    @staticmethod
    def of(surface: Heightfield, spacing: tuple[float, float]) -> Shadows:
        """On a grid no coarser than the points, as far as memory allows."""
        wanted = int(np.ceil(max(p / s for p, s in zip(surface.pitch_um, spacing)) - 1e-9))
        samples = surface.shape[1] * (1 if surface.is_profile else surface.shape[0])
        most = int(FINEST / samples if surface.is_profile else np.sqrt(FINEST / samples))
        return Shadows(surface, max(1, min(wanted, most)))

    @property
    def step_um(self) -> float:
        return max(self.surface.pitch_um) / self.refine

    def at(self, direction: Floats, y: Floats, x: Floats) -> Bools | None:
        """(len(y), len(x)) what sees `direction`, at positions in µm; None where all of it does."""
        packed = self._packed(direction)
        if packed is None:
            return None
        rows = self._index(y, 0) if len(packed) > 1 else np.zeros(len(y), np.int64)
        columns = self._index(x, 1)
        seen = np.unpackbits(packed[rows], axis=1).view(bool)[:, columns]
        return None if seen.all() else seen

    def _index(self, t: Floats, axis: int) -> NDArray[np.int64]:
        n = self.surface.shape[axis] * self.refine
        i = np.floor(t * self.refine / self.surface.pitch_um[axis]).astype(np.int64)
        return i % n if self.surface.periodic else np.clip(i, 0, n - 1)

    def _packed(self, direction: Floats) -> NDArray[np.uint8] | None:
        key = np.round(direction, 12).tobytes()
        if key not in self.kept:
            seen = visible(self.surface, direction, self.refine)
            packed = None if seen.all() else np.packbits(seen, axis=1)
            size = 0 if packed is None else packed.nbytes
            if self.bytes + size > KEPT:
                return packed
            self.kept[key] = packed
            self.bytes += size
        return self.kept[key]


@dataclass(frozen=True, eq=False)
class Place:
    """The points of one window and where they are: y, x from the surface's origin in µm, area A_w in µm²."""

    points: Points
    y: Floats
    x: Floats
    area: float

    @staticmethod
    def of(
        surface: Heightfield, plan: WindowPlan, window: Window | None, spacing: tuple[float, ...], rule: str
    ) -> Place:
        points, area = plan.points(surface, window, spacing, rule)
        cy, cx = window.centre if window is not None else (0.0, 0.0)
        return Place(points, points.y + cy, points.x + cx, area)

    def facets(self, surface: Heightfield) -> Facets:
        ip = surface.interpolant
        if len(self.points.y) == 1:
            zx = ip.grid(surface.y[:1], self.x, dx=1)
            return Facets(zx, np.zeros_like(zx))
        return Facets(ip.grid(self.y, self.x, dx=1), ip.grid(self.y, self.x, dy=1))


def intensity(
    place: Place,
    surface: Heightfield,
    job: Job,
    model: Model,
    wavelength_nm: tuple[float, ...],
    shadows: Shadows | None,
    method: str,
    eps: float,
    azimuth: float | None,
) -> Floats:
    """(outcomes, m) of the model at every scattering vector of the job, from one window, divided by A_w."""
    S = np.zeros((model.parts, len(job.q)), np.complex128)
    facets = place.facets(surface) if model.local else Facets(np.zeros((1, 1)), np.zeros((1, 1)))
    views = _chains(job.views, np.unique(job.view), shadows, place)
    everything = _chains(job.sources, np.arange(len(job.sources)), shadows, place)
    source, wavelength = np.where(model.local, job.source, -1), np.where(model.local, job.wavelength, -1)
    for s, w in np.unique(np.stack([source, wavelength]), axis=1).T:
        group = np.flatnonzero((source == s) & (wavelength == w))
        fields = np.ones((1, 1, 1), np.complex128)
        if model.local:
            fields = model.fields(job.sources[s], wavelength_nm[w], facets)
        sources = [chain.only(s) for chain in everything if s in chain.rank] if model.local else everything
        for lit, seen in itertools.product(sources, views):
            nodes = group[lit.holds(job.source[group]) & seen.holds(job.view[group])]
            if len(nodes) == 0:
                continue
            ranks = (lit.ranks(job.source[nodes]), seen.ranks(job.view[nodes]))
            for part in range(model.parts):
                full = place.points.weight * fields[part] if model.local else place.points.weight
                if not full.any():
                    continue
                points = replace(place.points, weight=full)
                S[part, nodes] = _shaded(method, points, job.q[nodes], eps, azimuth, ranks, (lit.count, seen.count))
    return model.intensity(S, job) * (job.prefactor / place.area)


@dataclass(frozen=True, eq=False)
class Chain:
    """Directions of one azimuth from the highest down: what one of them sees, those before it see too.

    rank : of each direction, by its index: 0 for those that see everything
    count : (ny, nx) how many of the others see each point: a direction sees it where its rank is no larger; 0 if none
    """

    rank: dict[int, int]
    count: NDArray[np.uint16]

    def holds(self, index: NDArray[np.int64]) -> Bools:
        return np.isin(index, list(self.rank))

    def ranks(self, index: NDArray[np.int64]) -> NDArray[np.int64]:
        table = np.zeros(max(self.rank) + 1, np.int64)
        table[list(self.rank)] = list(self.rank.values())
        return table[index]

    def only(self, index: int) -> Chain:
        """The same for one of the directions alone."""
        r = self.rank[index]
        return Chain({index: min(r, 1)}, np.asarray(self.count >= r if r else np.zeros((1, 1)), np.uint16))


def _chains(directions: Floats, index: NDArray[np.int64], shadows: Shadows | None, place: Place) -> list[Chain]:
    """The directions (n, 3) with an `index` in chains; those that see all points go with the first."""
    free, azimuths = [], dict[tuple[float, ...], list[int]]()
    for i in index:
        d = directions[i]
        if shadows is None or shadows.at(d, place.y, place.x) is None:
            free.append(int(i))
        else:
            azimuths.setdefault(tuple(np.round(d[:2] / np.hypot(d[0], d[1]), 9) + 0.0), []).append(int(i))
    found = []
    for members in azimuths.values():
        members.sort(key=lambda i: -directions[i, 2])
        count, seen = np.zeros(place.points.z.shape, np.uint16), np.ones((1, 1), bool)
        for i in members:
            mask = shadows.at(directions[i], place.y, place.x) if shadows else None
            seen = seen if mask is None else seen & mask
            count += seen
        found.append(Chain({i: r + 1 for r, i in enumerate(members)}, count))
    if not found:
        return [Chain(dict.fromkeys(free, 0), np.zeros((1, 1), np.uint16))]
    found[0].rank.update(dict.fromkeys(free, 0))
    return found


def _shaded(
    method: str,
    points: Points,
    q: Floats,
    eps: float,
    azimuth: float | None,
    ranks: tuple[NDArray[np.int64], NDArray[np.int64]],
    counts: tuple[NDArray[np.uint16], NDArray[np.uint16]],
) -> Complex:
    """(m,) sums over the points that source and view of each scattering vector see.

    In rows of scattering vectors a transform costs as much as it has points: those seen by the same directions go
    through one of their own, to all vectors whose source and view see them, so that each point is spread once.
    """
    out = np.zeros(len(q), np.complex128)
    lit, seen = ranks
    if not (lit.any() or seen.any()):
        return _sum(method, points, q, eps, azimuth)
    many = int(counts[1].max()) + 1
    if method == "nufft" and azimuth is not None:
        kind = np.where(points.weight != 0, counts[0].astype(np.int32) * many + counts[1], -1).ravel()
        order = np.argsort(kind, kind="stable")
        kinds, first = np.unique(kind[order], return_index=True)
        for n, some in zip(kinds, np.split(order, first[1:])):
            nodes = np.flatnonzero((lit <= n // many) & (seen <= n % many))
            if n >= 0 and len(nodes):
                out[nodes] += nufft.some(points, some, q[nodes], eps / 4, azimuth)  # errors of shells add up
        return out
    for a, b in np.unique(np.stack([lit, seen]), axis=1).T:
        nodes = np.flatnonzero((lit == a) & (seen == b))
        weight = points.weight * ((counts[0] >= a) & (counts[1] >= b))
        if weight.any():
            out[nodes] = _sum(method, replace(points, weight=weight), q[nodes], eps, azimuth)
    return out


def _sum(method: str, points: Points, q: Floats, eps: float, azimuth: float | None) -> Complex:
    if method == "opencl" and np.iscomplexobj(points.weight):
        re, im = (replace(points, weight=np.ascontiguousarray(w)) for w in (points.weight.real, points.weight.imag))
        return apply(method, re, q, eps, azimuth) + 1j * apply(method, im, q, eps, azimuth)
    return apply(method, points, q, eps, azimuth)
