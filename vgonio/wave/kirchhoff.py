"""The wave solver: coherence windows over the sample, S(q) of each, the mean over windows and detector elements."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from ..directions import Detector, Incoming, wavelength_list
from ..errors import InputError, VgonioWarning, nearest, relative_tolerance, whole
from ..materials import Material, material
from ..surface.heightfield import Heightfield
from ..units import wavenumber
from . import energy, gratings, outcome
from .amplitudes import HalfVector, LocalFacet, Model
from .coherence import WindowPlan
from .cone import Choice
from .effort import How, Work
from .fourier import METHODS
from .job import Job, detector_job, parallel
from .lobes import cell_attributes, cone_attributes, cone_rules
from .polarisation import VectorKirchhoff
from .quadrature import Floats, choose_rule
from .theories import THEORIES
from .weighted import Shadows

FRESNEL = ("half", "local")
NARROW = 0.3  # error of narrow lobes in cells of a hemisphere from which it is warned of


@dataclass(frozen=True)
class Kirchhoff:
    """Scalar diffraction in three theories (table in CONVENTIONS.md; Beckmann and Spizzichino 1963, Yan 2018).

    material : name, file or Material;  wavelength_nm : (w,) nm
    theory : "kirchhoff", "generalized-harvey-shack" or "harvey-shack"
    tol : numerical error of brdf relative to its largest value in θ_o, per θ_i and λ
    method : of `surface_fourier`: "nufft", "opencl", "reference" or "auto"
    windows : at most so many coherence windows, spread over the sample; None takes all that tile it
    shadowing : points that the source or the centre of the detector element cannot see get weight zero; A_w stays that
        of the whole window. Points that the same sources and elements see share a transform in the plane of incidence;
        over the hemisphere each shadowed pair costs one of its own in every window
    fresnel : reflectance at the "half" vector, or amplitudes at each "local" facet (s and p apart, no cross-
        polarisation; two transforms for each angle of incidence and wavelength)

    polarised : vector Kirchhoff, `mueller` and its standard error beside brdf (theory "kirchhoff" alone; twelve
        transforms for each angle of incidence and wavelength in every window)
    energy : the total reflected power for each θ_i and λ, by directions of its own over the hemisphere, with its
        standard error, beside the reflectance of a flat surface
    renormalise : brdf times that reflectance over the total, the factor in `renormalisation` (includes energy)

    The mean over windows and over the detector cone is the BRDF, the spread over windows its standard error. Single
    scattering only; nothing is renormalised unasked: where a theory returns more or less than it got, the numbers
    show it.
    `scatter` raises InputError for missing points, MaterialError outside the table, BackendError without a backend.
    """

    material: str | Material = "Al"
    wavelength_nm: Any = (550.0,)
    tol: float = 1e-3
    method: str = "auto"
    theory: str = "kirchhoff"
    windows: int | None = None
    seed: int = 0
    shadowing: bool = False
    fresnel: str = "half"
    polarised: bool = False
    energy: bool = False
    renormalise: bool = False
    progress: Callable[[float], None] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "wavelength_nm", tuple(wavelength_list(self.wavelength_nm)))
        if self.theory not in THEORIES:
            raise InputError(f"theory {self.theory!r}: {nearest(str(self.theory), THEORIES)}")
        if self.method not in METHODS:
            raise InputError(f"method {self.method!r}: {nearest(str(self.method), METHODS)}")
        if self.fresnel not in FRESNEL:
            raise InputError(f"fresnel {self.fresnel!r}: {nearest(str(self.fresnel), FRESNEL)}")
        if self.polarised and (self.theory != "kirchhoff" or self.fresnel != "half"):
            raise InputError(
                f"polarised = True is for theory 'kirchhoff', with amplitudes at each facet: got {self.theory!r} "
                f"and fresnel {self.fresnel!r}; leave them out"
            )
        relative_tolerance(self.tol)
        if self.windows is not None:
            whole("windows", self.windows, 1)
        whole("seed", self.seed, 0)
        object.__setattr__(self, "material", material(self.material))
        self.material.check(self.wavelength_nm)  # type: ignore[union-attr]

    def orders(self, surface: Heightfield, theta_i_deg: Any) -> xr.Dataset:
        """Diffraction efficiencies of a periodic profile: `efficiency (theta_i, order, wavelength)`.

        With energy or renormalise also their sum, `energy_reflected`, beside `fresnel_macro`, the reflectance of a flat
        surface; renormalise scales the efficiencies to it, the factor in `renormalisation`.
        Raises InputError for options that orders do not have: shadowing, Fresnel at the local facet, polarisation.
        """
        if self.shadowing or self.polarised or self.fresnel != "half":
            raise InputError("orders of a grating hold no shadowing, fresnel = 'local' or Mueller matrix: use scatter")
        return gratings.orders(self, surface, theta_i_deg)

    def scatter(self, surface: Heightfield, incoming: Incoming, detector: Detector) -> xr.Dataset:
        """The BRDF of `surface`, (theta_i, detector, wavelength), with the standard error over windows."""
        start = time.perf_counter()
        surface.require_complete()
        plan = WindowPlan.of(surface, incoming.coherence_um, self.windows)
        k = wavenumber(self.wavelength_nm)

        def rules(sources: Floats) -> list[Choice]:
            return cone_rules(surface, sources, self.theory, k, plan.step, detector, self.tol)

        job = detector_job(incoming, detector, k, plan.step, self.theory, self.seed, rules)
        # the slope of a window at its end is one kink more
        rule = choose_rule(surface, incoming.coherence_um is not None, False, self.tol / 20)
        method = "nufft" if self.method == "auto" else self.method
        azimuth = float(np.deg2rad(incoming.phi_deg)) if detector.kind == "in-plane" else None
        work = Work(surface, plan, self._model(incoming), self.wavelength_nm, self.tol)
        how, error, points = work.refine(job, How(rule, method, azimuth))
        shadows, edges = None, 0.0
        if self.shadowing:
            coarse = how.spacing
            how, shadows, edges = work.sharpen(job, how)
            points = round(points * np.prod(np.divide(coarse, how.spacing)))

        mean, stderr, estimate = self._mean(work, job, how, shadows)
        data = outcome.dataset(self, mean[0], stderr[0], incoming, detector)
        if self.polarised:
            data = outcome.with_mueller(data, mean[1:], stderr[1:])
        if self.energy or self.renormalise:
            found = self._energy(incoming, work, How(rule, method, None))
            data = outcome.with_energy(data, *found, self.renormalise)
        if shadows is not None:
            data.attrs |= {"shadow_step_um": shadows.step_um, "shadow_edge_error": edges}
        if detector.kind == "in-plane":
            data.attrs |= cone_attributes(rules(parallel(incoming)[0]))
        else:
            data.attrs |= cell_attributes(surface, job, self.theory, plan.step, detector)
            self._warn_of_cells(data.attrs["cell_error"])
        data.attrs |= plan.attrs | {
            "error_achieved": max(error, edges, data.attrs.get("cone_error", 0.0)),
            "error_estimate": "largest change of brdf on a grid 1.5 times finer, relative to its maximum over the "
            "detector, in the central window for some angles and wavelengths; the finer one by a direct sum if quick",
            "stderr_estimate": estimate,
            "spacing_um": float(min(how.spacing)),
            "points_per_window": points,
            "scattering_vectors": len(job.q),
            "method_used": method,
            "device": outcome.device(method),
            "surface": surface.name,
            "seconds": time.perf_counter() - start,
        }
        return data

    def _warn_of_cells(self, error: float) -> None:
        """Lobes narrow against the cells of the hemisphere, whose directions are few."""
        if error > max(self.tol, NARROW):
            warnings.warn(
                f"waves: lobes are narrow against the cells of the hemisphere, whose few directions miss or "
                f"overrate the brightest by up to {error:.0%}: take a smaller resolution_deg "
                "or coherence_um, or cones in the plane of incidence",
                VgonioWarning,
                stacklevel=4,
            )

    def _mean(self, work: Work, job: Job, how: How, shadows: Shadows | None) -> tuple[Floats, Floats, str]:
        """Mean over windows, its standard error (outcomes, theta_i, element, wavelength), and how that was found."""
        total, square, single = (np.zeros((work.model.outcomes, *job.shape)) for _ in range(3))
        for values in work.intensities(job, how, shadows, self.progress):
            f = job.gather(job.weight * values)
            total, square = total + f, square + f**2
            single += job.gather(job.weight * values**2)
        count = len(work.plan.windows)
        mean = total / count
        stderr, estimate = outcome.standard_error(mean, square / count, single / count, job, work.plan)
        # weights beyond a cone's edge have both signs: what they leave below zero is within the rule's error
        mean[0] = np.maximum(mean[0], 0.0)
        return mean, stderr, estimate

    def _model(self, incoming: Incoming) -> Model:
        polarisation = incoming.polarisation
        if self.polarised:
            return VectorKirchhoff(self.material, polarisation, incoming.phi_deg)  # type: ignore[arg-type]
        if self.fresnel == "local":
            return LocalFacet(self.theory, self.material, polarisation)  # type: ignore[arg-type]
        return HalfVector(self.theory, self.material, self.wavelength_nm, polarisation)  # type: ignore[arg-type]

    def _energy(self, incoming: Incoming, work: Work, how: How) -> tuple[Floats, Floats]:
        """Total reflected share and its standard error, (theta_i, wavelength)."""
        k = wavenumber(self.wavelength_nm)
        job = energy.energy_job(work.surface, work.plan, incoming, k, self.theory, self.seed)
        how, _, _ = work.refine(job, how)
        shadows = None
        if self.shadowing:
            how, shadows, _ = work.sharpen(job, how)
        found = work.intensities(job, how, shadows, self.progress)
        return energy.total(np.stack([job.gather(job.weight * f[0]) for f in found]), work.plan.independent)
