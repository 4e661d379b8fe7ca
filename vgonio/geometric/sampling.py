"""How many rays, in which batches, by which estimator: one angle of incidence until the tolerance is met."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..directions import Detector, Incoming
from ..surface.mesh import KEPT_FACETS
from .beam import ParallelBeam, Scene, Strip
from .facet_sampling import FacetSampling
from .singles import Counts, Sort, count_batch, sorted_counts
from .starters import Starters
from .tally import Tally
from .threads import in_order, workers

Floats = NDArray[np.float64]
BATCH = 1 << 16  # rays of one batch: bounds the memory, and leaves the tracer its share of the cache
ESTIMATORS = ("auto", "binning", "facets")
PATHS_MEMORY, BYTES_OF_A_HIT = 1 << 27, 32  # of one thread
MARGIN = 1.1  # more work than a pilot says, so that the next look is mostly the last
# to a ray: what parallel light does to all facets is known anyway, so that looking at them pays, measured up to 66 to a
# ray; in big meshes it is not, and a facet takes as long as a ray, against 8 times fewer rays and better
MOST_FACETS, MOST_FACETS_OF_BIG_MESHES = 64, 8
POINTS_BESIDE_RAYS = 4  # without a tolerance: one point on a facet for so many rays
CASTS_OF_A_POINT = 1.0  # of a ray's: two casts of which the one towards a high source is left out


@dataclass(frozen=True)
class Settings:
    """rays : the cap;  tol : relative standard error or None;  bounces : kept apart
    run : rays of the run that this is a first look at, which decides as that one would, or 0"""

    rays: int
    tol: float | None
    max_bounces: int
    bounces: int
    threads: int | None
    estimator: str
    wavelengths: int
    polarised: bool
    run: int = 0

    @property
    def at_once(self) -> int:
        """Paths of several reflections that are held at a time: all their hits, four Stokes parameters each and what
        is made of them stay within the memory set aside, however many reflections and wavelengths there are."""
        return max(64, PATHS_MEMORY // max(BYTES_OF_A_HIT * self.max_bounces, 4 * 4 * 8 * self.wavelengths))

    def empty(self, detector: Detector) -> Tally:
        return Tally.empty(self.bounces, len(detector), self.wavelengths, self.polarised)


def sample_angle(
    scene: Scene,
    incoming: Incoming,
    i: int,
    detector: Detector,
    settings: Settings,
    sort: Sort,
    rng: np.random.Generator,
) -> tuple[Tally, str, int]:
    """The tally of incidence i, the estimator that was used, and the points it tried beside the rays."""
    run = _Parallel if incoming.divergence_deg == 0 else _Divergent
    with workers(settings.threads) as pool:
        work = run(scene, incoming, i, detector, settings, sort, pool, rng)
        if settings.tol is None:
            work.more(settings.rays, -(-settings.rays // POINTS_BESIDE_RAYS))
            return work.result(), work.estimator, work.work
        pilot = min(settings.rays, BATCH)
        work.more(pilot, pilot)
        before = (0, 0)
        while True:
            total = work.result()
            rays, points = needed(total, work.by_points, work.points, settings.tol)
            # what is missing, within the cap; a first look that says "many times more" is not believed at once
            rays = min(rays, 16 * work.rays, settings.rays)
            points = min(points, 16 * max(work.points, 1), settings.rays)
            # where no light arrives no number is enough: what more points are asked of may have no use for them
            stuck, before = before == (work.rays, work.work), (work.rays, work.work)
            if relative_error(total) <= settings.tol or stuck or (rays <= work.rays and points <= work.points):
                return total, work.estimator, work.work
            work.more(max(rays - work.rays, 0), max(points - work.points, 0))


class _Divergent:
    """Rays one by one: every facet reflects into many directions."""

    estimator, points, work = "binning", 0, 0  # points on facets; all casts of them that were tried

    def __init__(
        self,
        scene: Scene,
        incoming: Incoming,
        i: int,
        detector: Detector,
        settings: Settings,
        sort: Sort,
        pool: Executor,
        rng: np.random.Generator,
    ) -> None:
        self.scene, self.incoming, self.i, self.detector = scene, incoming, i, detector
        self.settings, self.sort, self.pool, self.rng = settings, sort, pool, rng
        self.total, self.rays = settings.empty(detector), 0
        self.by_points = np.zeros((len(detector), settings.wavelengths))

    def _batch(self, strips: list[Strip], rng: np.random.Generator) -> Tally:
        out = self.settings.empty(self.detector)
        at_once, most = self.settings.at_once, self.settings.max_bounces
        for strip in strips:
            for paths in self.scene.paths(self.incoming, self.i, strip.rays, rng, most, at_once):
                out += self.sort(paths)
        return out

    def more(self, rays: int, points: int) -> None:
        """Trace so many more."""
        # in the order of the jobs, so that the sums do not depend on the threads
        for part in in_order(self.pool, self._batch, _jobs(rays, self.rng)):
            self.total += part
        self.rays += rays

    def result(self) -> Tally:
        return self.total


class _Parallel(_Divergent):
    """Single reflections counted by facet or, into narrow detectors, estimated facet by facet."""

    def __init__(self, *arguments) -> None:
        super().__init__(*arguments)
        self.beam = ParallelBeam(self.scene, self.incoming, self.i)
        self.counts = Counts(self.beam.facets, self.settings.rays)
        self.beam.prepare(self.pool)
        self.facets = self._facet_sampling()
        self.starters: Starters | None = None
        self.estimator = "binning" if self.facets is None else "facets"

    def _facet_sampling(self) -> FacetSampling | None:
        wanted = self.settings.estimator
        if wanted == "binning" or self.detector.kind != "in-plane":
            return None
        most = MOST_FACETS if self.beam.facets <= KEPT_FACETS else MOST_FACETS_OF_BIG_MESHES
        if wanted == "auto" and self.beam.facets > most * max(self.settings.rays, self.settings.run):
            return None
        return FacetSampling.of(self.beam, self.detector)

    def _find_starters(self) -> None:
        """Sort out the starters, once there are more rays to trace than facets to look at; then all begins anew."""
        found = Starters.of(self.beam, self.detector, self.settings.empty(self.detector), self.pool)
        self.starters = found
        if len(found.facet) and self.rays:
            self.counts = Counts(self.beam.facets, self.settings.rays)
            self.total, self.rays = self.settings.empty(self.detector), 0

    @property
    def points(self) -> int:  # type: ignore[override]
        """On facets and on starters each; the more of both."""
        return max(self._points())

    @property
    def work(self) -> int:  # type: ignore[override]
        return sum(self._points())

    def _points(self) -> tuple[int, int]:
        return self.facets.points if self.facets else 0, self.starters.points if self.starters else 0

    def _batch(self, strips: list[Strip], rng: np.random.Generator) -> Tally:
        out = self.settings.empty(self.detector)
        at_once, most = self.settings.at_once, self.settings.max_bounces
        apart = None if self.starters is None else self.starters.apart
        for paths in count_batch(self.beam, self.counts, strips, rng, most, at_once, apart):
            out += self.sort(paths)
        return out

    def more(self, rays: int, points: int) -> None:
        few = self.beam.facets <= min(2 * max(rays, self.settings.run), KEPT_FACETS)
        if self.facets is not None and self.starters is None and few:
            self._find_starters()
        super().more(rays, 0)
        if self.facets is not None and points:
            self.facets.sample(points, self.rng, self.pool)
        if self.starters is not None and (points or self.starters.points == 0):
            # what rays that meet starters would have caught has to come from here: a first look at the least
            points = points or min(rays, BATCH)
            most, at_once = self.settings.max_bounces, self.settings.at_once
            self.starters.sample(points, most, at_once, self.sort, self.rng, self.pool)

    def result(self) -> Tally:
        singles = sorted_counts(self.beam, self.counts, self.sort, self.settings.empty(self.detector), self.pool)
        if self.facets is not None:
            better = self.facets.add_to(self.sort, self.settings.empty(self.detector), self.rays)
            if self.starters is not None:
                self.starters.add_to(better, self.rays)
            self.by_points = better.caught_variance.sum(axis=0)
            for name in ("caught", "caught_variance", "mueller", "mueller_variance"):
                setattr(singles, name, getattr(better, name))
        singles += self.total
        return singles


def needed(total: Tally, by_points: Floats, points: int, tol: float) -> tuple[int, int]:
    """Rays and points altogether that bring every element that counts to `tol`, at the least cost.

    The variance is that of rays, a, and of points, b = `by_points` (element, w); with n rays and m points it is
    a·(rays/n) + b·(points/m).
    """
    power = total.caught.sum(axis=0)
    counts = that_count(power)
    if not counts.any():
        return 1 << 62, 1 << 62
    allowed = (tol * power[counts]) ** 2 / MARGIN
    of_points = by_points[counts]
    of_rays = total.caught_variance.sum(axis=0)[counts] - of_points
    a, b = of_rays / allowed * total.rays, of_points / allowed * points
    if points == 0:
        return int(np.ceil(a.max())), 0
    ratio = np.geomspace(1e-3, 1e3, 61)[:, None]  # points per ray
    rays = (a + b / ratio).max(axis=1)
    best = int(np.argmin(rays * (1 + CASTS_OF_A_POINT * ratio[:, 0])))
    return int(np.ceil(rays[best])), int(np.ceil(rays[best] * ratio[best, 0]))


def that_count(power: Floats) -> NDArray[np.bool_]:
    """Elements whose power exceeds 10⁻³ of the largest, (element, w)."""
    return (power > 0) & (power >= 1e-3 * power.max(axis=0, keepdims=True))


def relative_error(t: Tally) -> float:
    """Largest relative standard error of the caught power where it exceeds 10⁻³ of its largest value."""
    power, variance = t.caught.sum(axis=0), t.caught_variance.sum(axis=0)
    counts = that_count(power)
    return float(np.max(np.sqrt(variance[counts]) / power[counts])) if counts.any() else float("inf")


def _jobs(rays: int, rng: np.random.Generator) -> Iterator[tuple[list[Strip], np.random.Generator]]:
    """Rays in strips of one batch each, some strips to a job, each job with its own generator."""
    batches = max(1, round(rays / BATCH)) if rays else 0
    # what few rays go through (further reflections, sorting) is done once for a job; jobs get smaller towards the end,
    # so that all threads finish together (guided self-scheduling, Polychronopoulos and Kuck 1987)
    start = 0
    while start < batches:
        end = start + int(np.clip((batches - start) // 12, 1, 4))
        ends = [k * rays // batches for k in range(start, end + 1)]
        yield [Strip(b - a, a, rays) for a, b in zip(ends, ends[1:])], rng.spawn(1)[0]
        start = end
