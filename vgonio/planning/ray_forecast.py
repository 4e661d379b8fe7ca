"""What the rays will take: facets, rays, reflections and points, times a machine's speeds.

How much light meets the surface again is taken from the slopes: each facet's reflection escapes as Smith (1967) has it
for normally distributed slopes. The shares of the detector cones come from the same facets.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from ..accuracy.speeds import Speeds
from ..directions import Detector, Incoming
from ..geometric import RayOptics
from ..geometric.rays import MOST_RAYS
from ..geometric.sampling import (
    BATCH,
    MARGIN,
    MOST_FACETS,
    MOST_FACETS_OF_BIG_MESHES,
    PATHS_MEMORY,
    POINTS_BESIDE_RAYS,
    Settings,
)
from ..surface import Heightfield
from ..surface.mesh import KEPT_FACETS, profile_once
from .forecast import MB, Forecast
from .plans import duration

Floats = NDArray[np.float64]
SAMPLED = 40_000  # facets whose reflections are looked at
FACET_BYTES = 230.0  # a facet and its share of vertices, planes, hierarchy and counts
THREAD_BYTES = 32 * MB  # the rays of a batch
AGAIN = 1.4  # reflections of light that is reflected more than once, beside its first
MOST_WALLS = 0.9  # share of light that meets walls, where slopes say nothing, at most
EACH_ANGLE = 0.07  # of what a facet costs in all, for every further angle of incidence
FOLLOWED = 1.0  # rays that the look for starters of several reflections costs, to a facet
STATISTICS = 50_000  # rays of the statistics at most
TRIAL_RAYS = 40_000  # rays that find out whether a finite sample loses light through its sides
LOOK = 4 * BATCH  # rays of a look at most
ROOM = 2.0  # times the rays that a look found, as a cap
LOOKS = 3  # angles of incidence that are looked at where a tolerance decides about the rays
COUNTS = 1e-3  # of the largest value in the detector: what lies below does not count for the error
LUCKY = 3.4  # over the share that is reflected again: how much oftener than rays points on starters find the cones
PARTLY, PARTLY_WALLS = 0.05, 1.0  # variance of facets of which a part is in the shadow
# factors on the error by chosen facets between which it lies: faint cones, which several reflections reach, decide. By
# figures of the surface alone (10⁴ to 10⁵ rays on slopes of 0.1 to 0.5); after a first look (nine tenths of 62 cases)
ROUGH, LOOKED = (0.3, 100.0), (0.13, 6.0)
SHARE, LOOK_SECONDS = 0.05, 0.5  # of the run's time, or so long at the least, a first look may take
FIRST = (16, 1 << 13, 1 << 16)  # of so many rays one is taken in it, at the least and at the most


@dataclass(frozen=True)
class Angle:
    """One angle of incidence. again : share of the light that meets the surface again;  open : share of facets whose
    reflection could be stopped;  caught : (elements,) share of the light that single reflections send into each"""

    again: float
    open: float
    caught: Floats


def ray_forecast(
    solver: RayOptics, surface: Heightfield, incoming: Incoming, detector: Detector, speeds: Speeds, threads: int,
    first_look: bool = False,
) -> Forecast:  # fmt: skip
    """Of `solver.scatter(surface, incoming, detector)`.

    first_look : at some rays, where that tells more of the error and takes little of the run's time
    """
    if solver.tol is None:
        found = _forecast(solver, surface, incoming, detector, speeds, threads, None)
        if first_look and found.rough and np.ptp(surface.z) > 0:  # of a plane there is nothing to find out
            return _with_first_look(found, solver, surface, incoming, detector, speeds, threads)
        return found
    looked = look(solver, surface, incoming, detector)
    return _forecast(solver, surface, incoming, detector, speeds, threads, looked)


def forecasts_of_tolerances(
    solver: RayOptics, surface: Heightfield, incoming: Incoming, detector: Detector, speeds: Speeds, threads: int,
    tolerances: Sequence[float], most: int = MOST_RAYS,
) -> list[tuple[RayOptics, Forecast]]:  # fmt: skip
    """For each tolerance the solver, with the rays that it needs (at most so many) as its cap, and its forecast."""
    looked = look(replace(solver, tol=min(tolerances), rays=LOOK), surface, incoming, detector)
    angles = [_angle(surface, incoming, i, detector) for i in range(len(incoming.theta_deg))]
    found = []
    for tol in tolerances:
        free = replace(solver, tol=tol, rays=most)
        rays, _ = looked.needed(free, len(incoming.theta_deg))
        wanted = replace(free, rays=min(_round(ROOM * max(rays)), most))
        found.append((wanted, _forecast(wanted, surface, incoming, detector, speeds, threads, looked, angles)))
    return found


def _round(rays: float) -> int:
    """Up to one digit."""
    digit = 10 ** int(np.floor(np.log10(max(rays, 1.0))))
    return int(min(np.ceil(rays / digit) * digit, MOST_RAYS))


def _forecast(
    solver: RayOptics, surface: Heightfield, incoming: Incoming, detector: Detector, speeds: Speeds, threads: int,
    looked: Look | None, angles: list[Angle] | None = None,
) -> Forecast:  # fmt: skip
    facets, _ = _facets(solver, surface, incoming)
    if angles is None:
        angles = [_angle(surface, incoming, i, detector) for i in range(len(incoming.theta_deg))]
    by_facets = _by_facets(solver, facets, incoming, detector)
    if looked is None:
        rays = [float(solver.rays)] * len(angles)
        walls = surface.interpolation == "nearest"
        error = max(_error(a, n, facets, detector, by_facets, walls) for a, n in zip(angles, rays))
    else:
        rays, error = looked.needed(solver, len(angles))
    seconds = facets * speeds.facet * (1 + EACH_ANGLE * (len(angles) - 1))
    if not surface.periodic:
        seconds += TRIAL_RAYS * (speeds.ray + speeds.hit)
    for angle, n in zip(angles, rays):
        seconds += _angle_seconds(solver, angle, n, facets, by_facets, incoming, len(detector), speeds)
    memory = _bytes(solver, facets, len(detector), threads)
    if solver.refinement_check:
        seconds, memory = 2 * seconds + 3 * facets * speeds.facet, memory + 4 * facets * FACET_BYTES
    return Forecast(float(seconds), float(memory), float(error), rough=ROUGH if looked is None and by_facets else None)


def _with_first_look(
    found: Forecast, solver: RayOptics, surface: Heightfield, incoming: Incoming, detector: Detector, speeds: Speeds,
    threads: int,
) -> Forecast:  # fmt: skip
    """With the error that some rays have at as many of the angles as there is time for; or as it was."""
    part, least, most = FIRST
    rays = int(np.clip(solver.rays // part, min(least, solver.rays), most))
    short = _FirstLook.at(solver, rays)
    allowed = max(SHARE * found.seconds, LOOK_SECONDS)
    for angles in (LOOKS, 1):
        # of one alone the most oblique: where little light is stopped, it is stopped there
        steep = [int(np.argmax(np.abs(incoming.theta_deg)))]
        which = np.unique(np.linspace(0, len(incoming.theta_deg) - 1, LOOKS).round()) if angles > 1 else np.array(steep)
        which = which.astype(np.int64)
        some = replace(incoming, theta_deg=np.asarray(incoming.theta_deg)[which])
        expected = _forecast(short, surface, some, detector, speeds, threads, None).seconds
        if expected <= allowed:
            break
    else:
        return replace(found, how=f"no first look at its error: that would take {duration(expected)}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        error = short.scatter(surface, some, detector).attrs["error_achieved"]
    words = f"first look at {rays:,} rays from {len(which)} angle{'s' if len(which) > 1 else ''}"
    error = min(error, 1.0) * (rays / solver.rays) ** 0.5
    return replace(found, error=error, rough=LOOKED if error else None, how=words)


@dataclass(frozen=True)
class _FirstLook(RayOptics):
    """Few rays, which are sent where those of the whole run would be."""

    run: int = 0

    @classmethod
    def at(cls, solver: RayOptics, rays: int) -> _FirstLook:
        kept = {f.name: getattr(solver, f.name) for f in fields(RayOptics)}
        left_out = {"polarised": False, "statistics": False, "refinement_check": False, "progress": None}
        return cls(**{**kept, **left_out, "rays": rays, "run": solver.rays})

    def _settings(self) -> Settings:
        return replace(super()._settings(), run=self.run)


@dataclass(frozen=True)
class Look:
    """A first look at some angles of incidence, by index: rays that were taken, and the error with them.

    of_rays : whether that error is one of rays alone, and none of points on chosen facets"""

    which: Floats
    taken: Floats
    errors: Floats
    of_rays: bool

    def needed(self, solver: RayOptics, angles: int) -> tuple[list[float], float]:
        """Rays of every angle that the tolerance needs, and the error with them."""
        tol = float(solver.tol or 1.0)
        least = min(solver.rays, BATCH)
        wanted = np.clip(MARGIN * self.taken * (self.errors / tol) ** 2, least, solver.rays)
        # what met the tolerance needs no more; how much less follows from the error of rays alone: that of chosen
        # facets falls faster than as one over the root of their number
        enough = np.minimum(wanted, self.taken) if self.of_rays else np.minimum(self.taken, solver.rays)
        rays = np.where(self.errors <= tol, enough, wanted)
        error = float(np.max(self.errors * np.sqrt(self.taken / rays)))
        # between the angles that were looked at: a straight line of the logarithm
        return np.exp(np.interp(np.arange(angles), self.which, np.log(rays))).tolist(), error


def look(solver: RayOptics, surface: Heightfield, incoming: Incoming, detector: Detector) -> Look:
    """No figure of the surface tells the error of the faintest cone that counts: only rays do."""
    which = np.unique(np.linspace(0, len(incoming.theta_deg) - 1, LOOKS).round().astype(np.int64))
    short = replace(
        solver, rays=min(solver.rays, LOOK), polarised=False, statistics=False, refinement_check=False, progress=None
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        data = short.scatter(surface, replace(incoming, theta_deg=np.asarray(incoming.theta_deg)[which]), detector)
    counts = (data["brdf"] > 0) & (data["brdf"] >= COUNTS * data["brdf"].max(detector.dims))
    errors = (data["brdf_stderr"] / data["brdf"]).where(counts).max([*detector.dims, "wavelength"]).fillna(1.0)
    of_rays = "facets" not in str(data.attrs["estimator"])
    return Look(which.astype(np.float64), data["rays"].values.astype(np.float64), np.atleast_1d(errors.values), of_rays)


def _facets(solver: RayOptics, surface: Heightfield, incoming: Incoming) -> tuple[float, bool]:
    """Facets of the mesh, and whether a finite sample is too small for a guard band and is mirrored."""
    once = profile_once(surface)
    cells = float(np.prod(np.maximum(np.array(once.shape) - (0 if surface.periodic else 1), 1)))
    facets = 2 * cells * solver.refinement**2 * (2 if surface.interpolation == "nearest" else 1)
    if surface.periodic or solver.edges == "guard":
        return facets, False
    reach = float(np.ptp(surface.z)) * np.tan(np.deg2rad(np.abs(incoming.theta_deg)).max()) * 1.001
    size = np.array(surface.size_um)[::-1]
    along = np.abs([np.cos(np.deg2rad(incoming.phi_deg)), np.sin(np.deg2rad(incoming.phi_deg))])
    left = 0.5 * (size - reach * along)
    mirrored = solver.edges == "mirror" or bool(np.any(left < 0.05 * size))
    return facets * (4 if mirrored else 1), mirrored


def _slopes(surface: Heightfield) -> tuple[Floats, Floats]:
    """(n,) slopes along x and y of some facets, evenly spread."""
    z = surface.z
    dx = (np.roll(z, -1, axis=1) - z)[:, :-1] if z.shape[1] > 1 else np.zeros_like(z)
    dy = (np.roll(z, -1, axis=0) - z)[:-1] if z.shape[0] > 1 else np.zeros_like(z)
    rows, columns = max(min(dx.shape[0], dy.shape[0]), 1), min(dx.shape[1], dy.shape[1])
    zx, zy = dx[:rows, :columns].ravel() / surface.dx, dy[:rows, :columns].ravel() / surface.dy
    some = np.linspace(0, len(zx) - 1, min(len(zx), SAMPLED)).astype(np.int64)
    return zx[some], zy[some]


def _angle(surface: Heightfield, incoming: Incoming, i: int, detector: Detector) -> Angle:
    walls = surface.interpolation == "nearest"
    zx, zy = _slopes(surface)
    if walls:
        zx, zy = np.zeros(1), np.zeros(1)
    wi = incoming.vectors[i]
    normal = np.stack([-zx, -zy, np.ones_like(zx)], axis=1) / np.sqrt(1 + zx**2 + zy**2)[:, None]
    cosine = normal @ wi
    weight = np.maximum(cosine, 0) / normal[:, 2]
    weight = weight / max(weight.sum(), 1e-300)
    away = 2 * cosine[:, None] * normal - wi
    alpha = max(float(np.sqrt(np.mean(zx**2 + zy**2))), 1e-9)  # √2 of the slope along one axis
    steepest = float(np.max(np.hypot(zx, zy)))
    across = np.hypot(away[:, 0], away[:, 1])
    stopped = (away[:, 2] <= steepest * across) & (weight > 0)
    # lit facets lie high and see more of the sky: Smith's shares of both directions together (Heitz 2014)
    lit = 1 / _smith(np.array(wi[2] / max(np.hypot(wi[0], wi[1]), 1e-12)), alpha)
    seen = 1 / np.maximum(_smith(np.maximum(away[:, 2], 0) / np.maximum(across, 1e-12), alpha), 1e-9)
    escapes = np.where(away[:, 2] <= 0, 0.0, lit / (lit + seen - 1))
    again = float(np.sum(weight * np.where(stopped, 1 - escapes, 0.0)))
    up = np.flatnonzero((away[:, 2] > 0) & (weight > 0))
    ray, element = detector.catch(away[up])
    caught = np.bincount(element, (weight * escapes)[up[ray]], len(detector)).astype(np.float64)
    if not walls:
        return Angle(again, float(np.mean(stopped)), caught)
    # walls that light meets on its way down or up, to the area
    along = np.abs(wi[:2] / wi[2]) @ [float(np.mean(np.abs(a))) for a in _slopes(surface)]
    return Angle(float(min(along, MOST_WALLS)), float(along > 0), caught)


def _smith(cotangent: Floats, alpha: float) -> Floats:
    """Share that escapes in a direction of that elevation; Smith (1967), rational form of Walter et al. (2007)."""
    a = np.minimum(cotangent / alpha, 1.6)
    return np.minimum((3.535 * a + 2.181 * a**2) / (1 + 2.276 * a + 2.577 * a**2), 1.0)


def _by_facets(solver: RayOptics, facets: float, incoming: Incoming, detector: Detector) -> bool:
    """Whether light is sent onto chosen facets, the solver's estimator "facets"."""
    if solver.estimator == "binning" or detector.kind != "in-plane" or incoming.divergence_deg:
        return False
    most = MOST_FACETS if facets <= KEPT_FACETS else MOST_FACETS_OF_BIG_MESHES
    return solver.estimator == "facets" or facets <= most * solver.rays


def _angle_seconds(
    solver: RayOptics, angle: Angle, rays: float, facets: float, by_facets: bool, incoming: Incoming, elements: int,
    speeds: Speeds,
) -> float:  # fmt: skip
    wavelengths = len(solver.wavelength_nm)  # type: ignore[arg-type]
    further = AGAIN * angle.again * speeds.hit * (1 + 0.01 * wavelengths)
    seconds = rays * (speeds.ray + further)
    if incoming.divergence_deg:  # ray by ray
        seconds = rays * (speeds.hit + further)
    if by_facets and angle.open > 0:
        seconds += rays / POINTS_BESIDE_RAYS * speeds.point
        if angle.again > 0 and facets <= min(2 * rays, KEPT_FACETS):
            seconds += rays / POINTS_BESIDE_RAYS * speeds.point + FOLLOWED * facets * angle.open * speeds.ray
    if solver.polarised:
        caught = float(angle.caught.sum()) + angle.again / 2
        seconds += rays * min(caught, 1.0) * wavelengths * speeds.mueller
    if solver.statistics:
        seconds += min(rays, STATISTICS) * speeds.hit * (1 + angle.again)
    return seconds


def _error(angle: Angle, rays: float, facets: float, detector: Detector, by_facets: bool, walls: bool) -> float:
    """Largest relative standard error of the cones that count."""
    several = angle.again * detector.projected_solid_angle / np.pi
    # so little light, from less than a facet, goes elsewhere or comes without an error
    several = np.where(by_facets & (several * facets < 1), 0.0, several)
    single = angle.caught
    total = single + several
    counts = total >= COUNTS * total.max(initial=0.0)
    if not counts.any() or total.max() == 0:
        return 1.0
    if not by_facets:
        return float(np.max(1 / np.sqrt(np.maximum(rays * total[counts], 1.0))))
    of_rays = several[counts] * min(angle.again / LUCKY, 1.0) / rays
    points = rays / POINTS_BESIDE_RAYS / np.count_nonzero(counts)
    partly = PARTLY_WALLS if walls else PARTLY
    of_points = single[counts] ** 2 * partly * angle.open * angle.again / points
    return float(np.max(np.sqrt(of_rays + of_points) / total[counts]))


def _bytes(solver: RayOptics, facets: float, elements: int, threads: int) -> float:
    """Memory of mesh, batches and tallies."""
    wavelengths = len(solver.wavelength_nm)  # type: ignore[arg-type]
    tally = 16.0 * solver.bounces * elements * wavelengths
    held = THREAD_BYTES
    if solver.polarised:
        tally += 16 * 16.0 * elements * wavelengths
        held += PATHS_MEMORY
    return facets * FACET_BYTES + threads * held + (2 * threads + 4) * tally
