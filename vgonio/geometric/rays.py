"""The ray solver: sample the beam over its projected area, trace, weigh with Fresnel, sort into the detector."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import label
from ..directions import Detector, Incoming, wavelength_list
from ..errors import InputError, VgonioWarning, nearest, relative_tolerance, whole
from ..materials import Material, material
from ..surface.heightfield import Heightfield
from .beam import warn_of_fine_relief
from .fresnel_table import FresnelTable
from .outcome import dataset
from .sampling import ESTIMATORS, Settings, sample_angle
from .sides import caution, edges_in_words, scenes
from .statistics import statistics_variables
from .tally import Tally, tally
from .trace import Paths
from .tracers import TRACERS

Floats = NDArray[np.float64]
LOST_TOO_MUCH = 0.01  # a share that is worth a warning
MOST_RAYS = 10**15  # years of tracing: a slip of the pen
EDGES = ("auto", "guard", "mirror")


@dataclass(frozen=True)
class RayOptics:
    """Geometric optics: every facet of the triangulated surface is a mirror (thesis 2.3).

    material : name, file or Material;  wavelength_nm : (w,) nm, all of them share one trace
    rays : number of rays per angle of incidence, a cap where `tol` is given
    tol : relative standard error wanted wherever brdf exceeds 10⁻³ of its largest value, per angle and wavelength
    max_bounces : a ray that goes on beyond is counted as lost (a groove eight times as deep as wide takes 920 at
    89°)
    bounces : entries kept apart by number of reflections, the last gathers the rest
    refinement : mesh cells per sample;  edges : what happens at the sides of a finite sample: "guard" starts rays only
    where what they can reach is real, "mirror" continues it by reflection, "auto" takes the guard band at those angles
    of incidence where it loses less than 5e-4, or 1e-2 of a surface whose slopes lean to one side (mirrors would turn
    them round; where it comes to that a warning says so). Periodic surfaces wrap.
    estimator : "binning" sorts rays into the detector; "facets" sends light onto those facets only whose single
    reflection falls into a detector cone, and more of it where paths of several reflections into cones begin; "auto"
    does that for cones in parallel light, where it needs far fewer rays (not beyond 64 facets to a ray, 8 of
    a mesh of more than 4 million)
    tracer : "embree", "reference" (slow) or "warp" (CUDA, extra "gpu")
    threads : of the tracing, None for all processors
    polarised : the 4 × 4 Mueller BRDF as well (`mueller`, see CONVENTIONS.md), whatever the light's polarisation
    refinement_check : the same again on twice the refinement, `brdf_refinement_change` is by how much the BRDF changes:
    standard errors do not cover that, and cones that are narrow against the steps of the facets' slopes change a lot
    statistics : path lengths, distances between hits and slopes of the last facet as well (statistics.py)

    `scatter` raises InputError for missing points and MaterialError outside the material's table.
    """

    material: str | Material = "Al"
    wavelength_nm: Any = (550.0,)
    rays: int = 10**6
    seed: int = 0
    tol: float | None = None
    max_bounces: int = 1000
    bounces: int = 4
    refinement: int = 1
    edges: str = "auto"
    tracer: str = "embree"
    estimator: str = "auto"
    polarised: bool = False
    statistics: bool = False
    refinement_check: bool = False
    threads: int | None = None
    progress: Callable[[float], None] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "wavelength_nm", tuple(wavelength_list(self.wavelength_nm)))
        for name, low in (("rays", 1), ("max_bounces", 1), ("bounces", 1), ("refinement", 1)):
            most = MOST_RAYS if name == "rays" else None
            object.__setattr__(self, name, whole(name, getattr(self, name), low, most))
        if self.tol is not None:
            relative_tolerance(self.tol)
        if self.threads is not None:
            whole("threads", self.threads, 1)
        whole("seed", self.seed, 0)
        if self.tracer not in TRACERS:
            raise InputError(f"tracer {self.tracer!r}: {nearest(self.tracer, TRACERS)}")
        if self.estimator not in ESTIMATORS:
            raise InputError(f"estimator {self.estimator!r}: {nearest(self.estimator, ESTIMATORS)}")
        if self.edges not in EDGES:
            raise InputError(f"edges {self.edges!r}: {nearest(self.edges, EDGES)}")
        object.__setattr__(self, "material", material(self.material))
        self.material.check(self.wavelength_nm)  # type: ignore[union-attr]

    def scatter(self, surface: Heightfield, incoming: Incoming, detector: Detector) -> xr.Dataset:
        """The BRDF and the energy tallies of `surface`, (theta_i, detector, wavelength), with standard errors."""
        start = time.perf_counter()
        at, mirror = scenes(self, surface, incoming)
        largest = max(at, key=lambda scene: len(scene.mesh.faces))
        warn_of_fine_relief(largest.mesh)
        table = FresnelTable(self.material, self.wavelength_nm)  # type: ignore[arg-type]
        seeds = np.random.SeedSequence(self.seed).spawn(len(incoming.theta_deg))
        settings = self._settings()

        def sort(paths: Paths) -> Tally:
            return tally(paths, table, detector, incoming.polarisation, self.bounces, self.polarised, incoming.phi_deg)

        results = []
        for i, seed in enumerate(seeds):
            results.append(sample_angle(at[i], incoming, i, detector, settings, sort, np.random.default_rng(seed)))
            if self.progress:
                self.progress((i + 1) / len(seeds))
        tallies, estimators, points = zip(*results)
        data = dataset(self, list(tallies), incoming, detector)
        if self.statistics:
            found, coords = statistics_variables(at, incoming, self.bounces, self.rays, self.max_bounces, self.seed)
            data = label(data.assign(found).assign_coords(coords))
        if self.refinement_check:
            data = self._with_refinement_change(data, surface, incoming, detector)
        self._warn_of_losses(float(data["energy_lost"].max()))
        data.attrs |= {
            "edges": edges_in_words(surface, incoming, mirror),
            "seconds": time.perf_counter() - start,
            "facets": len(largest.mesh.faces),
            "backend": largest.tracer.name,
            "device": largest.tracer.device,
            "estimator": ", ".join(sorted(set(estimators))),
            "facet_points": sum(points),
            "surface": surface.name,
        }
        told = caution(surface, incoming, mirror)
        if told:
            data.attrs["edges_caution"] = told
            warnings.warn(told, VgonioWarning, stacklevel=2)
        return data

    def _with_refinement_change(
        self, data: xr.Dataset, surface: Heightfield, incoming: Incoming, detector: Detector
    ) -> xr.Dataset:
        finer = replace(self, refinement=2 * self.refinement, refinement_check=False, statistics=False, polarised=False)
        change = finer.scatter(surface, incoming, detector)["brdf"] - data["brdf"]
        largest = data["brdf"].max(detector.dims)
        counts = data["brdf"] > 1e-3 * largest
        rms = np.sqrt(((change / data["brdf"].where(counts)) ** 2).mean()).item()
        return label(data.assign(brdf_refinement_change=change)).assign_attrs(
            refinement_change=f"{rms:.2g}, the RMS relative change of brdf on twice the refinement where it exceeds "
            "1e-3 of its largest value, with the noise of both"
        )

    def _warn_of_losses(self, lost: float) -> None:
        if lost > LOST_TOO_MUCH:
            warnings.warn(
                f"{lost:.1%} of the light was lost, at max_bounces = {self.max_bounces} or through the sides of the "
                "sample (energy_lost): raise max_bounces, or let edges be 'auto'",
                VgonioWarning,
                stacklevel=3,
            )

    def _settings(self) -> Settings:
        return Settings(
            rays=self.rays,
            tol=self.tol,
            max_bounces=self.max_bounces,
            bounces=self.bounces,
            threads=self.threads,
            estimator=self.estimator,
            wavelengths=len(self.wavelength_nm),
            polarised=self.polarised,
        )
