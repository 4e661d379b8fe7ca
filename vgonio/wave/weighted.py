"""Sums of one window with weights on its points: shadows of source and detector, amplitudes of the facets.

S depends on q alone, but a shadow depends on θ_i or θ_o and a facet's amplitude on θ_i and λ. The scattering vectors
fall into groups with one weight each. What is not shadowed within the window stays one group, so that angles without
shadows cost what they did; every shadowed pair (source, detector element) is a transform of its own.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..surface.heightfield import Heightfield
from ..surface.visibility import visible
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
    lit = [shadows.at(w, place.y, place.x) if shadows else None for w in job.sources]
    hidden = np.array([s is not None for s in lit])
    seen = _partly_seen(job, shadows, place)
    source = np.where(hidden[job.source] | model.local, job.source, -1)
    wavelength = np.where(model.local, job.wavelength, -1)
    view = np.where(np.isin(job.view, seen), job.view, -1)
    order = np.lexsort((view, wavelength, source))
    keys = np.stack([source, wavelength, view])[:, order]
    first = np.flatnonzero(np.concatenate([[True], np.any(np.diff(keys, axis=1) != 0, axis=0)]))
    fields, last = np.ones((1, 1, 1), np.complex128), (-2, -2)
    for a, b in itertools.pairwise([*first, len(order)]):
        s, w, v = (int(key) for key in keys[:, a])
        if model.local and (s, w) != last:
            fields, last = model.fields(job.sources[s], wavelength_nm[w], facets), (s, w)
        weight = place.points.weight
        view_mask = shadows.at(job.views[v], place.y, place.x) if shadows and v >= 0 else None
        for mask in (lit[s] if s >= 0 else None, view_mask):
            weight = weight if mask is None else weight * mask
        if not weight.any():
            continue
        nodes = order[a:b]
        for part in range(model.parts):
            full = weight * fields[part] if model.local else weight
            if not full.any():
                continue
            S[part, nodes] = _sum(method, replace(place.points, weight=full), job.q[nodes], eps, azimuth)
    return model.intensity(S, job) * (job.prefactor / place.area)


def _partly_seen(job: Job, shadows: Shadows | None, place: Place) -> NDArray[np.int64]:
    """Those views that do not see all points."""
    if shadows is None:
        return np.zeros(0, np.int64)
    return np.array(
        [v for v in np.unique(job.view) if shadows.at(job.views[v], place.y, place.x) is not None], np.int64
    )


def _sum(method: str, points: Points, q: Floats, eps: float, azimuth: float | None) -> Complex:
    if method == "opencl" and np.iscomplexobj(points.weight):
        re, im = (replace(points, weight=np.ascontiguousarray(w)) for w in (points.weight.real, points.weight.imag))
        return apply(method, re, q, eps, azimuth) + 1j * apply(method, im, q, eps, azimuth)
    return apply(method, points, q, eps, azimuth)
