"""The wave solver: coherence windows over the sample, S(q) of each, the mean over windows and detector elements."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import brdf_dataset, versions
from ..directions import Detector, Incoming, half_vectors, wavelength_list
from ..errors import InputError, VgonioWarning, nearest
from ..materials import Material, material
from ..surface.heightfield import Heightfield
from ..units import wavenumber
from . import gratings, windowed
from .coherence import WindowPlan
from .cone import Nodes, cell_nodes, cone_nodes
from .fourier import METHODS, apply, check_method
from .quadrature import Complex, Floats, choose_rule, rates
from .theories import DESCRIPTION, THEORIES, amplitude, scattering_vector

NODES_PER_CELL = 4  # directions evaluated in each cell of a hemisphere, per window
MIN_WINDOWS = 4  # fewer independent windows say too little about their spread
SPECKLE_NODES = 2 * np.pi  # nodes of spacing 1/ℓ in the area of one speckle: Σ exp(−n²/2) over a square grid


@dataclass(frozen=True, eq=False)
class Job:
    """Everything that is wanted of one set of windows: scattering vectors and where their |S|² goes.

    q : (m, 3);  factor : (m,) what makes f of |S|²/A_w;  weight : (m,) in the mean over the detector element
    target : (m,) flat index (theta_i, element, w) into `shape`
    """

    q: Floats
    factor: Floats
    weight: Floats
    target: NDArray[np.int64]
    shape: tuple[int, int, int]

    def gather(self, values: Floats) -> Floats:
        summed = np.bincount(self.target, values, int(np.prod(self.shape)))
        return np.asarray(summed, np.float64).reshape(self.shape)


@dataclass(frozen=True)
class Kirchhoff:
    """Scalar diffraction in three theories (contract table; Beckmann and Spizzichino 1963, Yan 2018).

    material : name, file or Material;  wavelength_nm : (w,) nm
    theory : "kirchhoff", "generalized-harvey-shack" or "harvey-shack"
    tol : numerical error of brdf relative to its largest value in θ_o, per θ_i and λ
    method : of `surface_fourier`: "nufft", "opencl", "reference" or "auto"
    windows : at most so many coherence windows, spread over the sample; None takes all that tile it

    The mean over windows and over the detector cone is the BRDF, the spread over windows its standard error. Single
    scattering only; nothing is renormalised: where a theory returns more or less than it got, the numbers show it.
    `scatter` raises InputError for missing points, MaterialError outside the table, BackendError without a backend.
    """

    material: str | Material = "Al"
    wavelength_nm: Any = (550.0,)
    tol: float = 1e-3
    method: str = "auto"
    theory: str = "kirchhoff"
    windows: int | None = None
    seed: int = 0
    progress: Callable[[float], None] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "wavelength_nm", tuple(wavelength_list(self.wavelength_nm)))
        if self.theory not in THEORIES:
            raise InputError(f"theory {self.theory!r}: {nearest(str(self.theory), THEORIES)}")
        if self.method not in METHODS:
            raise InputError(f"method {self.method!r}: {nearest(str(self.method), METHODS)}")
        if not 0 < self.tol < 1:
            raise InputError(f"tol = {self.tol}: a relative error between 0 and 1 is needed")
        if self.windows is not None and self.windows < 1:
            raise InputError(f"windows = {self.windows}: at least one is needed")
        object.__setattr__(self, "material", material(self.material))
        self.material.check(self.wavelength_nm)  # type: ignore[union-attr]

    def orders(self, surface: Heightfield, theta_i_deg: Any) -> xr.Dataset:
        """Diffraction efficiencies of a periodic profile: `efficiency (theta_i, order, wavelength)`."""
        return gratings.orders(self, surface, theta_i_deg)

    def scatter(self, surface: Heightfield, incoming: Incoming, detector: Detector) -> xr.Dataset:
        """The BRDF of `surface`, (theta_i, detector, wavelength), with the standard error over windows."""
        start = time.perf_counter()
        surface.require_complete()
        plan = WindowPlan.of(surface, incoming.coherence_um, self.windows)
        job = self._job(incoming, detector, plan.step)
        # the slope of a window at its end is one kink more
        rule = choose_rule(surface, incoming.coherence_um is not None, False, self.tol / 20)
        method = "nufft" if self.method == "auto" else self.method
        azimuth = float(np.deg2rad(incoming.phi_deg)) if detector.kind == "in-plane" else None
        spacing, eps, error, points = self._refine(surface, plan, job, rule, method, azimuth)

        total, square, single = np.zeros(job.shape), np.zeros(job.shape), np.zeros(job.shape)
        sums = self._sums(surface, plan, job, spacing, eps, rule, method, azimuth)
        for n, (S, area) in enumerate(sums):
            intensity = job.factor * np.abs(S) ** 2 / area
            f = job.gather(job.weight * intensity)
            total, square = total + f, square + f**2
            single += job.gather(job.weight * intensity**2)
            if self.progress:
                self.progress((n + 1) / len(plan.windows))
        count = len(plan.windows)
        brdf = total / count
        stderr, estimate = _standard_error(brdf, square / count, single / count, job, plan)
        data = self._dataset(brdf, stderr, incoming, detector)
        data.attrs |= plan.attrs | {
            "error_achieved": error,
            "error_estimate": "largest change of brdf on a grid 1.5 times finer, relative to its maximum over the "
            "detector, in the central window for some angles and wavelengths; the finer one by a direct sum if quick",
            "stderr_estimate": estimate,
            "spacing_um": float(min(spacing)),
            "points_per_window": points,
            "scattering_vectors": len(job.q),
            "method_used": method,
            "device": _device(method),
            "surface": surface.name,
            "seconds": time.perf_counter() - start,
        }
        return data

    # ---- what is wanted
    def _job(self, incoming: Incoming, detector: Detector, step: float) -> Job:
        k = wavenumber(self.wavelength_nm)
        directions, share = incoming.spread()
        rng = np.random.default_rng(self.seed)
        across = np.array([-np.sin(np.deg2rad(incoming.phi_deg)), np.cos(np.deg2rad(incoming.phi_deg)), 0.0])
        shape = (len(directions), len(detector), len(k))
        parts = []
        parallel: Nodes | None = None
        for i, source in enumerate(directions):
            up = source[:, 2] > 1e-4
            for wi, w in zip(source[up], share[up] / share[up].sum()):
                if detector.kind == "hemisphere":
                    nodes = cell_nodes(detector, k, NODES_PER_CELL, rng)
                elif incoming.divergence_deg == 0:
                    nodes = parallel = parallel or cone_nodes(detector, k, step)
                else:
                    nodes = cone_nodes(detector, k, step, float(wi @ across))
                parts.append(
                    (
                        *self._terms(wi, nodes, incoming.polarisation),
                        nodes.weight * w,
                        nodes.target + i * shape[1] * shape[2],
                    )
                )
        q, factor, weight, target = (np.concatenate(p) for p in zip(*parts))
        return Job(q, factor, weight, target, shape)

    def _terms(self, wi: Floats, nodes: Nodes, polarisation: str) -> tuple[Floats, Floats]:
        """q and k²/(4π²) C² R / (cos θ_i cos θ_o) at the nodes."""
        wo = nodes.direction
        q = scattering_vector(self.theory, nodes.k, wi, wo)
        reflectance = np.empty(len(wo))
        cos_h = np.clip(np.sum(half_vectors(wi, wo) * wi, axis=1), 0, 1)
        for k, wavelength in zip(wavenumber(self.wavelength_nm), self.wavelength_nm):
            at = nodes.k == k
            reflectance[at] = self.material.reflectance(cos_h[at], wavelength, polarisation)  # type: ignore[union-attr]
        c = amplitude(self.theory, wi, wo)
        return q, nodes.k**2 / (4 * np.pi**2) * c**2 * reflectance / (wi[2] * wo[:, 2])

    def _sums(
        self,
        surface: Heightfield,
        plan: WindowPlan,
        job: Job,
        spacing: tuple[float, float],
        eps: float,
        rule: str,
        method: str,
        azimuth: float | None,
    ) -> Iterator[tuple[Complex, float]]:
        """S and A_w of every window: together where all windows and rows can share the work, one by one otherwise."""
        shared = method == "nufft" and rule == "uniform" and azimuth is not None and np.sin(azimuth) == 0
        if shared and not surface.is_profile and len(np.unique(np.round(job.q[:, 1], 9))) >= windowed.MIN_ROWS:
            yield from windowed.sums(surface, plan.gaussian, spacing, job.q, eps)
            return
        for window in plan.windows:
            grid, area = plan.points(surface, window, spacing, rule)
            yield apply(method, grid, job.q, eps, azimuth), area

    # ---- how finely
    def _refine(
        self, surface: Heightfield, plan: WindowPlan, job: Job, rule: str, method: str, azimuth: float | None
    ) -> tuple[tuple[float, float], float, float, int]:
        """Spacing of the points and tolerance of the transform, from the fastest phases and then from trial: the
        error of brdf in the central window. (Where all directions are weak, the transform has to be tighter.)"""
        per_cycle = {"uniform": 1.0, "gauss": 2.2, "cells": 1.0}[rule] + 0.15 * -np.log10(self.tol)
        spacing = 2 * np.pi / np.maximum(rates(surface, job.q), 1e-9) / per_cycle
        part, window = plan.trial(surface)
        if window is not None:
            spacing = np.minimum(spacing, np.array(window.half) / 12)
        some = _checked(job)
        eps, error, size = self.tol / 30, 0.0, 0
        for _ in range(9):
            grid, area = plan.points(part, window, tuple(spacing), rule)
            size = round(grid.size * surface.area_um2 / part.area_um2)
            fine, fine_area = plan.points(part, window, tuple(spacing / 1.5), rule)
            q, other = job.q[some], check_method(method, fine, job.q[some], self.tol)
            f = job.factor[some] * np.abs(apply(method, grid, q, eps, azimuth)) ** 2 / area
            g = job.factor[some] * np.abs(apply(other, fine, q, eps / 5, azimuth)) ** 2 / fine_area
            error = _relative_to_peak(job.target[some], job.shape, f, g)
            if error <= 0.8 * self.tol or rule == "cells":
                break
            spacing, eps = spacing / 1.3, eps / 10
        if error > self.tol:
            warnings.warn(f"waves: error {error:.1e} instead of {self.tol:.1e}", VgonioWarning, stacklevel=4)
        return (float(spacing[0]), float(spacing[1])), eps, float(error), size

    def _dataset(self, brdf: Floats, stderr: Floats, incoming: Incoming, detector: Detector) -> xr.Dataset:
        over = ("theta_i", *detector.dims, "wavelength")
        variables: dict[str, tuple[tuple[str, ...], Any]] = {"brdf": (over, brdf), "brdf_stderr": (over, stderr)}
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
                "method": f"waves: {DESCRIPTION[self.theory]}, single scattering, no shadowing",
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


def _checked(job: Job) -> NDArray[np.int64]:
    """Scattering vectors that are computed again: every detector element at two angles and two wavelengths.

    In each element the vector closest to mirror reflection, so that the peak of a narrow lobe is among them.
    """
    angles, elements, wavelengths = job.shape
    tilt = np.hypot(job.q[:, 0], job.q[:, 1]) / job.q[:, 2]
    order = np.lexsort((tilt, job.target))
    first = np.searchsorted(job.target[order], np.arange(np.prod(job.shape) + 1))
    wanted = [
        (i * elements + e) * wavelengths + w
        for i in sorted({0, angles - 1})
        for w in sorted({0, wavelengths // 2})
        for e in range(0, elements, max(1, elements // 64))
    ]
    return np.array([order[first[t]] for t in wanted if first[t + 1] > first[t]])


def _relative_to_peak(target: NDArray[np.int64], shape: tuple[int, int, int], f: Floats, g: Floats) -> float:
    """Largest |f − g| relative to the largest f of the same angle of incidence and wavelength."""
    group = target // (shape[1] * shape[2]) * shape[2] + target % shape[2]
    peak = np.zeros(shape[0] * shape[2])
    np.maximum.at(peak, group, np.maximum(f, g))
    return float(np.max(np.abs(f - g) / np.maximum(peak[group], 1e-300), initial=0.0))


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
