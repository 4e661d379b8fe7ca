"""Single reflections into narrow detectors: light is sent only onto the facets that reflect into one of them.

Of parallel light each facet sends its reflection into one known direction, so only the facets whose direction falls
into a detector cone count. Points on them, uniform over each facet's footprint in the beam, are tested by two casts:
the point sees the source, and the reflected ray escapes (if it meets another facet it is no single reflection). The
share of points that pass, times the footprint, is an unbiased estimate of the light that the facet sends into the
detector.
Facets where nothing can stand in the way (steeper rays than the steepest facet) are exact and cost nothing.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..directions import Detector
from .beam import BEHIND, CHUNK, FREE, ParallelBeam
from .singles import Sort, single_paths
from .tally import Tally
from .trace import next_facet

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass
class FacetSampling:
    """Facets that reflect into a detector, and how many of the points tried on them count.

    facet : (m,);  share : (m,) footprint over the beam's cross-section;  exact : (m,) nothing to be tested
    wish : (m,) share of the points that a facet gets: equal numbers for all detector elements
    tried, passed : (m,) points;  each : every facet that needs it got two points or more, otherwise facets are drawn
    """

    beam: ParallelBeam
    facet: Ints
    share: Floats
    exact: NDArray[np.bool_]
    wish: Floats
    tried: Ints
    passed: Ints
    points: int = 0
    each: bool = True

    @staticmethod
    def of(beam: ParallelBeam, detector: Detector) -> FacetSampling:
        mesh = beam.scene.mesh
        parts = []
        for a in range(0, beam.facets, CHUNK):
            f = np.arange(a, min(a + CHUNK, beam.facets))
            fate = beam.fate(f)
            _, away, cos_i = beam.reflected(f)
            # what goes down was caught by no element, but a cone at the horizon reaches below it
            ray, element = detector.catch(away)
            ok = (fate[ray] != BEHIND) & (away[ray, 2] > 0) & beam.covers(f[ray])
            parts.append((f[ray[ok]], element[ok], cos_i[ray[ok]], fate[ray[ok]] == FREE))
        pair, element, cos_i, free = (np.concatenate(p) for p in zip(*parts))
        facet, first, which = np.unique(pair, return_index=True, return_inverse=True)
        share = beam.footprint(facet)
        exact = free[first] & mesh.unstoppable(-beam.direction[None])[0] & beam.lies_inside(facet)
        # equal numbers of points for every element: a facet of several elements gets the most that one asks for
        member = sp.csr_array((np.ones(len(pair)), (element, which)), shape=(len(detector), len(facet)))
        open_share = np.where(exact, 0.0, share)
        per_element = member @ open_share
        most = (member.T * np.where(per_element > 0, 1 / np.maximum(per_element, 1e-300), 0)).max(axis=1)
        wish = open_share * np.asarray(most.todense()).ravel()
        wish /= max(wish.sum(), 1e-300)
        zero = np.zeros(len(facet), np.int64)
        return FacetSampling(beam, facet, share, exact, wish, zero, zero.copy())

    @property
    def open(self) -> int:
        """Number of facets that have to be tested."""
        return int(np.count_nonzero(~self.exact))

    def sample(self, points: int, rng: np.random.Generator, pool: Executor) -> None:
        """Try about `points` more points, in proportion to `wish`, two or more on a facet that had none."""
        if self.open == 0:
            return
        if self.points == 0:
            self.each = points >= 2 * self.open
        cumulated = np.concatenate([[0.0], np.cumsum(self.wish)]) * points
        new = np.diff(np.floor(cumulated + rng.random())).astype(np.int64)
        if self.each:
            new = np.where(self.exact, 0, np.maximum(new, np.maximum(2 - self.tried, 0)))
        where = np.repeat(np.arange(len(self.facet)), new)
        jobs = [where[a : a + CHUNK] for a in range(0, len(where), CHUNK)]
        results = pool.map(lambda job: self._pass(self.facet[job[0]], job[1]), zip(jobs, rng.spawn(len(jobs))))
        for job, passed in zip(jobs, results):
            self.passed += np.bincount(job[passed], minlength=len(self.facet))
        self.tried += new
        self.points += len(where)

    def _pass(self, facet: Ints, rng: np.random.Generator) -> NDArray[np.bool_]:
        """(n,) whether a point drawn on each facet is lit and its reflection escapes."""
        scene, beam = self.beam.scene, self.beam
        _, point = beam.points_on(facet, rng)
        ok = beam.lit(point)
        at = np.flatnonzero(ok)
        ok[at] = next_facet(scene.mesh, scene.tracer, point[at], beam.reflected(facet[at])[1])[2]
        return ok

    def weights(self) -> tuple[Floats, Floats]:
        """(m,) light on each facet that leaves it as a single reflection, over the incident light, and its variance."""
        if not self.each:
            # facets drawn with probability ∝ wish: Horvitz and Thompson 1952; Σ x² bounds the variance
            of_a_point = self.share / np.where(self.exact, 1.0, self.wish * self.points)
            weight, variance = self.passed * of_a_point, self.passed * of_a_point**2
            return np.where(self.exact, self.share, weight), np.where(self.exact, 0.0, variance)
        seen = self.passed / np.maximum(self.tried, 1)
        spread = self.share**2 * seen * (1 - seen) / np.maximum(self.tried - 1, 1)
        return np.where(self.exact, self.share, self.share * seen), np.where(self.exact, 0.0, spread)

    def add_to(self, sort: Sort, into: Tally, rays: int) -> Tally:
        """Add what the facets send into the detector to `into`, scaled to `rays` incident rays."""
        weight, variance = self.weights()
        lit = np.flatnonzero(weight)
        for a in range(0, len(lit), CHUNK):
            k = lit[a : a + CHUNK]
            into += sort(single_paths(self.beam, self.facet[k], weight[k] * rays, variance[k] * rays**2))
        return into
