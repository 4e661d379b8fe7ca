"""Single reflections of parallel light are counted by facet: whatever depends on the facet alone comes after the trace.

Rays that meet a second facet go on one by one. Rays come in pairs from one cell of a grid; a pair that ends on the same
facet adds nothing to the variance, so it is the rays without such a partner that are counted for it: Σ (x₁ − x₂)² over
the pairs (Cochran 1977, section 5A.12, two units per stratum), without the mixed term, which could only lower it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from .beam import CHUNK, FREE, OPEN, ParallelBeam, Strip
from .tally import Tally
from .threads import in_order
from .trace import Paths, Step, ahead, dot, next_facet, trace

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Sort = Callable[[Paths], Tally]


class Counts:
    """Rays per facet that were reflected once: escaped, alone of their pair, left through the sides."""

    def __init__(self, facets: int, rays: int) -> None:
        kind = np.int32 if rays < 2**31 else np.int64
        self.escaped, self.alone, self.lost = (np.zeros(facets, kind) for _ in range(3))
        self.stray, self.rays = 0, 0
        self.lock = Lock()

    def add(self, first: NDArray[np.int32], single: NDArray[np.bool_], lost: NDArray, stray: int) -> None:
        """first (n,) facets met, single (n,) where that was the only one, lost (m,) facets of those that left."""
        pairs = np.where(single, first, -1)[: len(first) // 2 * 2].reshape(-1, 2)
        differ = pairs[:, 0] != pairs[:, 1]
        alone = pairs[differ].ravel()
        # a last ray without a partner counts as alone
        alone = np.concatenate([alone[alone >= 0], first[len(first) // 2 * 2 :][single[len(first) // 2 * 2 :]]])
        with self.lock:
            for into, facets in ((self.escaped, first[single]), (self.alone, alone), (self.lost, lost)):
                np.add.at(into, facets, np.ones(len(facets), into.dtype))
            self.stray += stray
            self.rays += len(first)


def count_batch(
    beam: ParallelBeam,
    counts: Counts,
    strips: Sequence[Strip],
    rng: np.random.Generator,
    max_bounces: int,
    at_once: int = 1 << 16,
    apart: NDArray[np.bool_] | None = None,
) -> Iterator[Paths]:
    """Cast the rays of some strips, one after the other, and count the single reflections.

    What comes are the paths of two and more reflections, those of all strips together, `at_once` at a time; those that
    start on facets `apart` do not count for the detector.
    """
    found = [_count_strip(beam, counts, strip, rng, max_bounces) for strip in strips]
    first, point, second, beyond = (np.concatenate(part) for part in zip(*found))
    for a in range(0, len(first), at_once):
        part = slice(a, a + at_once)
        still = np.zeros(len(first[part]), bool)
        known: list[Step] = [(first[part], point[part], still), (second[part], beyond[part], still)]
        paths = _trace(beam, point[part], known, max_bounces)
        paths.of_rays = sum(strip.rays for strip in strips)
        paths.counted = None if apart is None else ~apart[first[part]]
        yield paths


def _count_strip(
    beam: ParallelBeam, counts: Counts, strip: Strip, rng: np.random.Generator, max_bounces: int
) -> tuple[Ints, Floats, Ints, Floats]:
    """Count what a strip's rays do; first facets and points on them, second facets and points, of those that go on."""
    mesh, tracer = beam.scene.mesh, beam.scene.tracer
    n, position = strip.rays, beam.starts(strip, rng)
    direction = np.broadcast_to(beam.direction, position.shape)
    first = np.asarray(tracer.facet(position, direction), np.int32)
    again = np.flatnonzero(first < 0)
    if len(again):  # over the border of the period
        first[again], position[again], _ = next_facet(mesh, tracer, position[again], direction[again])
    fate = beam.fate(first)
    fate[first < 0] = 0
    single = fate == FREE
    check = np.flatnonzero(fate == OPEN)
    facet, start = first[check].astype(np.int64), np.take(position, check, axis=0)
    normal, offset = mesh.planes(facet)
    cos_i = -dot(normal, beam.direction)
    point = ahead(start, (dot(start, normal) - offset) / cos_i, beam.direction)
    away = ahead(beam.direction, 2 * cos_i, normal)
    second, beyond, escaped = next_facet(mesh, tracer, ahead(point, mesh.lift, normal), away, may_be_free=False)
    single[check[escaped]] = True
    on = (second >= 0) & (max_bounces > 1)
    go, lost = np.flatnonzero(on), facet[~(on | escaped)]
    counts.add(first, single, lost, int(n - single.sum() - len(lost) - len(go)))
    return facet[go], np.take(point, go, axis=0), second[go], np.take(beyond, go, axis=0)


def _trace(beam: ParallelBeam, start: Floats, known: list[Step], max_bounces: int) -> Paths:
    shape = (len(start), 3)
    direction, s = np.broadcast_to(beam.direction, shape), np.broadcast_to(beam.s_axis, shape)
    return trace(beam.scene.mesh, beam.scene.tracer, start, direction, s, max_bounces, known)


def single_paths(beam: ParallelBeam, facet: NDArray, weight: NDArray, variance: NDArray, escaped: bool = True) -> Paths:
    """Paths that end after one reflection on facets (n,), each `weight` (n,) times."""
    first, second, third = beam.scene.mesh.corners(facet)
    middle = (first + second + third) / 3
    n = len(facet)
    known: list[Step] = [(facet.astype(np.int64), middle, np.zeros(n, bool))]
    known.append((np.full(n, -1, np.int64), middle, np.full(n, escaped)))
    paths = _trace(beam, middle, known, 1)
    paths.weight, paths.variance = weight.astype(np.float64), variance.astype(np.float64)
    return paths


def sorted_counts(beam: ParallelBeam, counts: Counts, sort: Sort, into: Tally, pool: Executor) -> Tally:
    """Add the power of all counted rays to the tally `into`, facet by facet."""

    def chunks() -> Iterator[tuple]:
        for number, variance, escaped in ((counts.escaped, counts.alone, True), (counts.lost, counts.lost, False)):
            facets = np.flatnonzero(number)
            for a in range(0, len(facets), CHUNK):
                f = facets[a : a + CHUNK]
                yield f, number[f], variance[f], escaped

    for part in in_order(pool, lambda *chunk: sort(single_paths(beam, *chunk)), chunks()):
        into += part
    into.lost += counts.stray
    into.rays += counts.stray
    return into
