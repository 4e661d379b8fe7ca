"""Several reflections into narrow detectors: more rays where such paths start.

In parallel light the facets that a path meets determine where it goes. One ray is followed from the middle of every
facet that may send light to others: where one of the facets beside those that it meets would send it into a detector
cone, the first facet is a *starter*. Starters cover a per cent of the area or less, and points drawn on them find their
way into the cones a hundred times as often as rays drawn anywhere. Rays of the ordinary sample that meet a starter
first count for the detector with their first reflection only; what other facets send there they find as ever.

Which facets are starters depends on no random number, so both parts are unbiased however well they were chosen.
(Rays traced back from the detector, f(i, o) = f(o, i), would have to meet a direction of measure zero: parallel light.)
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..directions import Detector
from ..surface.mesh import Mesh
from .beam import CHUNK, OPEN, ParallelBeam
from .singles import Sort, Step
from .tally import Tally
from .threads import in_order
from .trace import Paths, ahead, dot, next_facet, trace

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
FOLLOWED = 3  # reflections after the first that are looked at


@dataclass
class Starters:
    """Starters of a beam, and what points on them sent into the detector after two and more reflections.

    facet : (m,);  share : (m,) footprint over the beam's cross-section;  apart : (facets,) is a starter, or the copy of
    one in the overlap of a periodic mesh;  total : sums over the calls of `sample`, per incident ray and times points
    """

    beam: ParallelBeam
    facet: Ints
    share: Floats
    apart: NDArray[np.bool_]
    total: Tally
    points: int = 0

    @staticmethod
    def of(beam: ParallelBeam, detector: Detector, empty: Tally, pool: Executor) -> Starters:
        mesh = beam.scene.mesh
        chunks = [(np.arange(a, min(a + CHUNK, beam.facets)),) for a in range(0, beam.facets, CHUNK)]
        found = list(in_order(pool, lambda f: f[_may_reach(beam, detector, f)], chunks))
        facet = np.concatenate(found)
        apart = np.zeros(beam.facets, bool)
        apart[facet] = True
        if mesh.period is not None:
            _mark_copies(mesh, facet, apart)
        return Starters(beam, facet, beam.footprint(facet), apart, empty)

    def sample(self, points: int, max_bounces: int, at_once: int, sort: Sort, rng: np.random.Generator, pool: Executor):
        """Follow about `points` more points, two at least, in pairs on one facet.

        Every starter gets a pair where there are enough; otherwise starters are drawn with probability ∝ share
        (Horvitz and Thompson 1952).
        """
        if len(self.facet) == 0:
            return
        points = max(points, 2)
        pairs = self.share / self.share.sum() * points / 2
        drawn = np.diff(np.floor(np.concatenate([[0.0], np.cumsum(pairs)]) + rng.random())).astype(np.int64)
        each = points >= 4 * len(self.facet)
        if each:
            drawn = np.maximum(drawn, 1)
        weight = self.share / (2 * (drawn if each else pairs))
        where = np.repeat(np.arange(len(self.facet)), 2 * drawn)
        step = max(2, at_once // 2 * 2)
        parts = [where[a : a + step] for a in range(0, len(where), step)]

        def work(part: Ints, rng: np.random.Generator) -> Tally:
            return sort(_paths(self.beam, self.facet[part], weight[part], each, max_bounces, rng))

        for found in in_order(pool, work, zip(parts, rng.spawn(len(parts)))):
            for name, power in (("caught", 1), ("mueller", 1), ("caught_variance", 2), ("mueller_variance", 2)):
                getattr(self.total, name).__iadd__(getattr(found, name) * float(len(where)) ** power)
        self.points += len(where)

    def add_to(self, into: Tally, rays: int) -> None:
        """Add what the starters send into the detector to `into`, scaled to `rays` incident rays."""
        if self.points:
            for name, power in (("caught", 1), ("mueller", 1), ("caught_variance", 2), ("mueller_variance", 2)):
                getattr(into, name).__iadd__(getattr(self.total, name) * (rays / self.points) ** power)


def _may_reach(beam: ParallelBeam, detector: Detector, facet: Ints) -> NDArray[np.bool_]:
    """(n,) whether facets are starters, by the ray from the middle of each."""
    mesh, tracer = beam.scene.mesh, beam.scene.tracer
    starts = np.zeros(len(facet), bool)
    row = np.flatnonzero((beam.fate(facet) == OPEN) & beam.covers(facet))
    normal, direction, _ = beam.reflected(facet[row])
    point = _middle(mesh, facet[row])
    for _ in range(FOLLOWED):
        hit, point, _ = next_facet(mesh, tracer, ahead(point, mesh.lift, normal), direction)
        go = np.flatnonzero(hit >= 0)
        row, hit, point, direction = row[go], hit[go], np.take(point, go, axis=0), np.take(direction, go, axis=0)
        for beside in _beside(mesh, hit):
            normal = mesh.planes(beside)[0]
            away = ahead(direction, -2 * dot(direction, normal), normal)
            ray, _ = detector.catch(away)
            starts[row[ray[away[ray, 2] > 0]]] = True
        normal = mesh.planes(hit)[0]
        direction = ahead(direction, -2 * dot(direction, normal), normal)
    return starts


def _beside(mesh: Mesh, facet: Ints) -> Iterator[Ints]:
    """Facets beside (n,) facets, one kind after the other: two triangles a cell, cells in rows. In a mesh of another
    kind they are any facets, which costs time but no truth."""
    cells = int(mesh.faces[0, 2] - mesh.faces[0, 0]) - 1
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            cell = facet // 2 + dy * cells + dx
            for half in (0, 1):
                yield np.clip(2 * cell + half, 0, len(mesh.faces) - 1)


def _mark_copies(mesh: Mesh, facet: Ints, apart: NDArray[np.bool_]) -> None:
    """Mark the copies of `facet` (n,) in the overlap of a periodic mesh: a ray may meet either."""
    from scipy.spatial import KDTree

    assert mesh.period is not None
    if len(facet) == 0:
        return
    tree = KDTree(_middle(mesh, facet))
    others = np.concatenate(
        [
            f[~mesh.in_box(f)]
            for a in range(0, len(mesh.faces), CHUNK)
            for f in [np.arange(a, min(a + CHUNK, len(mesh.faces)))]
        ]
    )
    middle = _middle(mesh, others)
    for i in (-1, 0, 1):
        for j in (-1, 0, 1):
            distance, _ = tree.query(middle + (i * mesh.period[0], j * mesh.period[1], 0.0), distance_upper_bound=1e9)
            apart[others[distance < mesh.lift]] = True


def _middle(mesh: Mesh, facet: Ints) -> Floats:
    a, b, c = mesh.corners(facet)
    return (a + b + c) / 3


def _paths(
    beam: ParallelBeam, facet: Ints, weight: Floats, each: bool, max_bounces: int, rng: np.random.Generator
) -> Paths:
    """Paths from points on facets (n,), pairs side by side on one facet, where light gets there; (n,) weights.

    Two paths of a pair that go the same way carry the same power and add nothing to the variance.
    """
    scene = beam.scene
    point, lifted = beam.points_on(facet, rng)
    lit = np.flatnonzero(beam.lit(lifted))
    shape = (len(lit), 3)
    direction, s = np.broadcast_to(beam.direction, shape), np.broadcast_to(beam.s_axis, shape)
    known: list[Step] = [(facet[lit], point[lit], np.zeros(len(lit), bool))]
    paths = trace(scene.mesh, scene.tracer, point[lit], direction, s, max_bounces, known)
    end = np.full((len(facet), 3), np.nan)
    end[lit] = np.where((paths.escaped & (paths.bounces > 1))[:, None], paths.direction, np.nan)
    bounces = np.zeros(len(facet), np.int64)
    bounces[lit] = paths.bounces
    twins = np.all(end[0::2] == end[1::2], axis=1) & (bounces[0::2] == 2) & (bounces[1::2] == 2) & each
    paths.weight = weight[lit]
    paths.variance = np.where(np.repeat(twins, 2)[lit], 0.0, weight[lit] ** 2)
    paths.counted = paths.bounces > 1
    return paths
