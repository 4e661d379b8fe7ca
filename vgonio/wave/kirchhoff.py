"""The wave solver: coherence windows over the sample, S(q) of each, the mean over windows and detector elements."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr

from ..dataset import brdf_dataset, label, versions
from ..directions import Detector, Incoming, wavelength_list
from ..errors import InputError, VgonioWarning, nearest, relative_tolerance, whole
from ..materials import Material, material
from ..surface.heightfield import Heightfield
from ..units import wavenumber
from . import energy, gratings, windowed
from .amplitudes import HalfVector, LocalFacet, Model
from .coherence import WindowPlan
from .fourier import METHODS, check_method
from .job import Job, detector_job
from .polarisation import VectorKirchhoff
from .quadrature import Floats, choose_rule, rates
from .theories import DESCRIPTION, THEORIES
from .weighted import Place, Shadows, intensity

FRESNEL = ("half", "local")
MIN_WINDOWS = 4  # fewer independent windows say too little about their spread
EDGES_CHECKED = 24  # directions for which shadows are found again on a finer grid
SHARPER = 2.0  # how much finer points are to begin with where shadows cut them
SHARPENED = 3  # steps of 1.5 beyond that, at most: the points of the last but one are ten times those without shadows
SPECKLE_NODES = 2 * np.pi  # nodes of spacing 1/ℓ in the area of one speckle: Σ exp(−n²/2) over a square grid


@dataclass(frozen=True)
class How:
    """How the sums are done: spacing of the points along y and x in µm, rule, method, accuracy of the transform,
    azimuth along which rows of scattering vectors run (None: they lie all over the hemisphere)."""

    rule: str
    method: str
    azimuth: float | None
    spacing: tuple[float, float] = (0.0, 0.0)
    eps: float = 0.0


@dataclass(frozen=True)
class Kirchhoff:
    """Scalar diffraction in three theories (contract table; Beckmann and Spizzichino 1963, Yan 2018).

    material : name, file or Material;  wavelength_nm : (w,) nm
    theory : "kirchhoff", "generalized-harvey-shack" or "harvey-shack"
    tol : numerical error of brdf relative to its largest value in θ_o, per θ_i and λ
    method : of `surface_fourier`: "nufft", "opencl", "reference" or "auto"
    windows : at most so many coherence windows, spread over the sample; None takes all that tile it
    shadowing : points that the source or the centre of the detector element cannot see get weight zero; A_w stays that
        of the whole window. Each shadowed pair of source and element costs a transform of its own in every window
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
        job = detector_job(incoming, detector, wavenumber(self.wavelength_nm), plan.step, self.theory, self.seed)
        # the slope of a window at its end is one kink more
        rule = choose_rule(surface, incoming.coherence_um is not None, False, self.tol / 20)
        method = "nufft" if self.method == "auto" else self.method
        azimuth = float(np.deg2rad(incoming.phi_deg)) if detector.kind == "in-plane" else None
        model = self._model(incoming)
        how, error, points = self._refine(surface, plan, job, model, How(rule, method, azimuth))
        shadows, edges = None, 0.0
        if self.shadowing:
            coarse = how.spacing
            how, shadows, edges = self._sharpen(surface, plan, job, model, how)
            points = round(points * np.prod(np.divide(coarse, how.spacing)))

        total, square, single = (np.zeros((model.outcomes, *job.shape)) for _ in range(3))
        for n, values in enumerate(self._intensities(surface, plan, job, model, how, shadows)):
            f = job.gather(job.weight * values)
            total, square = total + f, square + f**2
            single += job.gather(job.weight * values**2)
            if self.progress:
                self.progress((n + 1) / len(plan.windows))
        count = len(plan.windows)
        mean = total / count
        stderr, estimate = _standard_error(mean, square / count, single / count, job, plan)
        data = self._dataset(mean[0], stderr[0], incoming, detector)
        if self.polarised:
            data = _with_mueller(data, mean[1:], stderr[1:])
        if self.energy or self.renormalise:
            data = self._with_energy(data, *self._energy(surface, incoming, plan, model, How(rule, method, None)))
        if shadows is not None:
            data.attrs |= {"shadow_step_um": shadows.step_um, "shadow_edge_error": edges}
        data.attrs |= plan.attrs | {
            "error_achieved": max(error, edges),
            "error_estimate": "largest change of brdf on a grid 1.5 times finer, relative to its maximum over the "
            "detector, in the central window for some angles and wavelengths; the finer one by a direct sum if quick",
            "stderr_estimate": estimate,
            "spacing_um": float(min(how.spacing)),
            "points_per_window": points,
            "scattering_vectors": len(job.q),
            "method_used": method,
            "device": _device(method),
            "surface": surface.name,
            "seconds": time.perf_counter() - start,
        }
        return data

    # ---- one window after the other
    def _model(self, incoming: Incoming) -> Model:
        polarisation = incoming.polarisation
        if self.polarised:
            return VectorKirchhoff(self.material, polarisation, incoming.phi_deg)  # type: ignore[arg-type]
        if self.fresnel == "local":
            return LocalFacet(self.theory, self.material, polarisation)  # type: ignore[arg-type]
        return HalfVector(self.theory, self.material, self.wavelength_nm, polarisation)  # type: ignore[arg-type]

    def _intensities(
        self, surface: Heightfield, plan: WindowPlan, job: Job, model: Model, how: How, shadows: Shadows | None
    ) -> Iterator[Floats]:
        """f (outcomes, m) of every window: together where all windows and rows can share the work, else one by one."""
        plain = not model.local and shadows is None and not surface.is_profile
        shared = (
            how.method == "nufft" and how.rule == "uniform" and how.azimuth is not None and np.sin(how.azimuth) == 0
        )
        if plain and shared and len(np.unique(np.round(job.q[:, 1], 9))) >= windowed.MIN_ROWS:
            prefactor = job.prefactor
            for S, area in windowed.sums(surface, plan.gaussian, how.spacing, job.q, how.eps):
                yield model.intensity(S[None], job) * (prefactor / area)
            return
        for window in plan.windows:
            place = Place.of(surface, plan, window, how.spacing, how.rule)
            yield intensity(place, surface, job, model, self.wavelength_nm, shadows, how.method, how.eps, how.azimuth)

    def _energy(
        self, surface: Heightfield, incoming: Incoming, plan: WindowPlan, model: Model, how: How
    ) -> tuple[Floats, Floats]:
        """Total reflected share and its standard error, (theta_i, wavelength)."""
        job = energy.energy_job(surface, plan, incoming, wavenumber(self.wavelength_nm), self.theory, self.seed)
        how, _, _ = self._refine(surface, plan, job, model, how)
        shadows = None
        if self.shadowing:
            how, shadows, _ = self._sharpen(surface, plan, job, model, how)
        found = self._intensities(surface, plan, job, model, how, shadows)
        return energy.total(np.stack([job.gather(job.weight * values[0]) for values in found]), plan.independent)

    def _with_energy(self, data: xr.Dataset, reflected: Floats, stderr: Floats) -> xr.Dataset:
        over = ("theta_i", "wavelength")
        data["energy_reflected"], data["energy_reflected_stderr"] = (over, reflected), (over, stderr)
        if self.renormalise:
            factor = data.fresnel_macro / data.energy_reflected.where(data.energy_reflected > 0)
            for name in [n for n in ("brdf", "brdf_stderr", "mueller", "mueller_stderr") if n in data]:
                data[name] = (data[name] * factor.fillna(1.0)).transpose(*data[name].dims)
            data["renormalisation"] = factor.fillna(1.0)
            data.attrs["renormalised"] = "brdf times fresnel_macro / energy_reflected, in `renormalisation`"
        return label(data)

    # ---- how finely
    def _refine(
        self, surface: Heightfield, plan: WindowPlan, job: Job, model: Model, how: How
    ) -> tuple[How, float, int]:
        """Spacing of the points and tolerance of the transform, from the fastest phases and then from trial: the
        error of brdf in the central window. (Where all directions are weak, the transform has to be tighter.)"""
        per_cycle = {"uniform": 1.0, "gauss": 2.2, "cells": 1.0}[how.rule] + 0.15 * -np.log10(self.tol)
        spacing = 2 * np.pi / np.maximum(rates(surface, job.q), 1e-9) / per_cycle
        part, window = plan.trial(surface)
        if window is not None:
            spacing = np.minimum(spacing, np.array(window.half) / 12)
        some = job.some(job.checked())
        eps, error, size = self.tol / 30, 0.0, 0
        for _ in range(9):
            place = Place.of(part, plan, window, tuple(spacing), how.rule)
            size = round(place.points.size * surface.area_um2 / part.area_um2)
            fine = Place.of(part, plan, window, tuple(spacing / 1.5), how.rule)
            other = check_method(how.method, fine.points, some.q, self.tol)
            f = intensity(place, part, some, model, self.wavelength_nm, None, how.method, eps, how.azimuth)
            g = intensity(fine, part, some, model, self.wavelength_nm, None, other, eps / 5, how.azimuth)
            error = some.difference(f[0], g[0])
            if error <= 0.8 * self.tol or how.rule == "cells":
                break
            spacing, eps = spacing / 1.3, eps / 10
        if error > self.tol:
            warnings.warn(f"waves: error {error:.1e} instead of {self.tol:.1e}", VgonioWarning, stacklevel=4)
        return replace(how, spacing=(float(spacing[0]), float(spacing[1])), eps=eps), float(error), size

    def _sharpen(
        self, surface: Heightfield, plan: WindowPlan, job: Job, model: Model, how: How
    ) -> tuple[How, Shadows, float]:
        """Points and shadows so fine that edges of shadows, which are cuts, meet the tolerance, as far as memory
        allows; and the error that is left: the change of brdf, relative to its maximum over the detector, when both
        are 1.5 times finer, in the central window for some directions."""
        checked = job.checked()
        some = job.some(checked[:: max(1, len(checked) // EDGES_CHECKED)])
        window = plan.windows[len(plan.windows) // 2]

        def trial(factor: float) -> tuple[How, Shadows, Floats]:
            finer = replace(how, spacing=(how.spacing[0] / factor, how.spacing[1] / factor))
            shadows = Shadows.of(surface, finer.spacing)
            place = Place.of(surface, plan, window, finer.spacing, how.rule)
            f = intensity(place, surface, some, model, self.wavelength_nm, shadows, how.method, how.eps, how.azimuth)
            return finer, shadows, f[0]

        found, error = trial(SHARPER), 0.0
        for n in range(1, SHARPENED + 1):
            finer = trial(SHARPER * 1.5**n)
            error = some.difference(found[2], finer[2])
            if error <= self.tol or n == SHARPENED or finer[1].refine == found[1].refine:
                break
            found = finer
        if error > self.tol:
            warnings.warn(
                f"waves: edges of shadows, found to {found[1].step_um:.2g} µm, make an error of {error:.1e} instead of "
                f"{self.tol:.1e}",
                VgonioWarning,
                stacklevel=4,
            )
        return found[0], found[1], error

    def _dataset(self, brdf: Floats, stderr: Floats, incoming: Incoming, detector: Detector) -> xr.Dataset:
        over = ("theta_i", *detector.dims, "wavelength")
        variables: dict[str, tuple[tuple[str, ...], Any]] = {"brdf": (over, brdf), "brdf_stderr": (over, stderr)}
        macro = self.material.reflectance(  # type: ignore[union-attr]
            incoming.vectors[:, 2], self.wavelength_nm, incoming.polarisation
        )
        variables["fresnel_macro"] = (("theta_i", "wavelength"), macro)
        if detector.kind == "hemisphere":
            reflected = np.einsum("iew,e->iw", brdf, detector.projected_solid_angle)
            variables["energy_reflected"] = (("theta_i", "wavelength"), reflected)
        return brdf_dataset(
            variables,
            incoming.theta_deg,
            self.wavelength_nm,
            detector,
            phi_i_deg=incoming.phi_deg,
            attrs={
                "method": f"waves: {DESCRIPTION[self.theory]}, single scattering, "
                + ("shadowing of source and detector" if self.shadowing else "no shadowing"),
                "fresnel": "at the half vector" if self.fresnel == "half" and not self.polarised else "at each facet",
                "solver": "Kirchhoff",
                "theory": self.theory,
                "material": self.material.name,  # type: ignore[union-attr]
                "material_source": self.material.source,  # type: ignore[union-attr]
                "polarisation": incoming.polarisation,
                "tolerance_asked": self.tol,
                "backend": f"surface_fourier, {self.method}",
                "versions": versions(),
                "seed": self.seed,
            },
        )


def _with_mueller(data: xr.Dataset, mueller: Floats, stderr: Floats) -> xr.Dataset:
    """With Mueller matrices (16, theta_i, element, wavelength) and their standard errors."""
    over = (*data.brdf.dims, "stokes_out", "stokes_in")
    for name, values in (("mueller", mueller), ("mueller_stderr", stderr)):
        data[name] = (over, np.moveaxis(values, 0, -1).reshape(*values.shape[1:], 4, 4))
    return label(data.assign_coords(stokes_out=list("IQUV"), stokes_in=list("IQUV")))


def _standard_error(brdf: Floats, square: Floats, single: Floats, job: Job, plan: WindowPlan) -> tuple[Floats, str]:
    """Standard error of the mean: from the spread over windows, or from that over the speckles of too few windows."""
    n = len(plan.windows)
    if plan.independent >= MIN_WINDOWS:
        variance = np.maximum(square - brdf**2, 0) * n / (n - 1)
        return np.sqrt(variance / plan.independent), f"spread over {plan.independent:.1f} effective independent windows"
    largest = job.gather(job.weight**2)
    speckles = np.maximum(plan.independent / np.maximum(largest, 1e-300) / SPECKLE_NODES, 1.0)
    variance = np.maximum(single - brdf**2, 0)
    return (
        np.sqrt(variance / np.maximum(speckles - 1, 1.0)),
        f"spread over the directions within a detector element: only {plan.independent:.1f} independent windows",
    )


def _device(method: str) -> str:
    if method != "opencl":
        return "CPU"
    from . import opencl

    return f"{opencl.device().name}, {opencl.device().platform}"
