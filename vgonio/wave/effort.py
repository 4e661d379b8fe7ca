"""How finely and by which method the waves of a job are summed, found by trial, and the sums window by window."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..errors import VgonioWarning
from ..surface.heightfield import Heightfield
from . import forecast, windowed
from .amplitudes import Model
from .coherence import WindowPlan
from .fourier import check_method
from .job import Job
from .quadrature import Floats, finer, rates
from .weighted import Place, Shadows, intensity

EDGES_CHECKED = 24  # directions for which shadows are found again on a finer grid
SHARPER = 2.0  # how much finer points are to begin with where shadows cut them
SHARPENED = 3  # steps of 1.5 beyond that, at most: the points of the last but one are ten times those without shadows


@dataclass(frozen=True)
class How:
    """How the sums are done: spacing of the points along y and x in µm, rule, method, accuracy of the transform,
    azimuth along which rows of scattering vectors run (None: they lie all over the hemisphere)."""

    rule: str
    method: str
    azimuth: float | None
    spacing: tuple[float, float] = (0.0, 0.0)
    eps: float = 0.0


@dataclass(frozen=True, eq=False)
class Work:
    """What does not change from one job to the next."""

    surface: Heightfield
    plan: WindowPlan
    model: Model
    wavelength_nm: tuple[float, ...]
    tol: float

    def refine(self, job: Job, how: How) -> tuple[How, float, int]:
        """Spacing of the points and tolerance of the transform, from the fastest phases and then from trial: the
        error of brdf in the central window. (Where all directions are weak, the transform has to be tighter.)"""
        surface, plan, tol = self.surface, self.plan, self.tol
        per_cycle = {"uniform": 1.0, "gauss": 2.2, "cells": 1.0}[how.rule] + 0.15 * -np.log10(tol)
        spacing = 2 * np.pi / np.maximum(rates(surface, job.q), 1e-9) / per_cycle
        part, window = plan.trial(surface)
        if window is not None:
            spacing = np.minimum(spacing, np.array(window.half) / 12)
        some = job.some(job.checked())
        eps, error, size = tol / 30, 0.0, 0
        for _ in range(9):
            place = Place.of(part, plan, window, tuple(spacing), how.rule)
            size = round(place.points.size * surface.area_um2 / part.area_um2)
            fine = Place.of(part, plan, window, tuple(finer(part, spacing, how.rule)), how.rule)
            other = check_method(how.method, fine.points, some.q, tol)
            f = intensity(place, part, some, self.model, self.wavelength_nm, None, how.method, eps, how.azimuth)
            g = intensity(fine, part, some, self.model, self.wavelength_nm, None, other, eps / 5, how.azimuth)
            error = some.difference(f[0], g[0])
            if error <= 0.8 * tol or how.rule == "cells":
                break
            spacing, eps = spacing / 1.3, eps / 10
        # double precision of the largest phase: no finer grid shows it
        error = max(error, 4 * np.finfo(float).eps * float(np.abs(job.q[:, 2]).max() * np.abs(surface.z).max()))
        if error > tol:
            warnings.warn(f"waves: error {error:.1e} instead of {tol:.1e}", VgonioWarning, stacklevel=4)
        return replace(how, spacing=(float(spacing[0]), float(spacing[1])), eps=eps), float(error), size

    def sharpen(self, job: Job, how: How) -> tuple[How, Shadows, float]:
        """Points and shadows so fine that edges of shadows, which are cuts, meet the tolerance, as far as memory
        allows; and the error that is left: the change of brdf, relative to its maximum over the detector, when both
        are 1.5 times finer, in the central window for some directions."""
        checked = job.checked()
        some = job.some(checked[:: max(1, len(checked) // EDGES_CHECKED)])
        window = self.plan.windows[len(self.plan.windows) // 2]

        def trial(factor: float) -> tuple[How, Shadows, Floats]:
            finer = replace(how, spacing=(how.spacing[0] / factor, how.spacing[1] / factor))
            shadows = Shadows.of(self.surface, finer.spacing)
            place = Place.of(self.surface, self.plan, window, finer.spacing, how.rule)
            given = (self.model, self.wavelength_nm, shadows, how.method, how.eps, how.azimuth)
            return finer, shadows, intensity(place, self.surface, some, *given)[0]

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

    def shared(self, job: Job, how: How, shadows: Shadows | None) -> bool:
        """Can all windows and rows share the sums over y?"""
        plain = not self.model.local and shadows is None and not self.surface.is_profile
        along_x = how.azimuth is not None and np.sin(how.azimuth) == 0
        fits = how.method == "nufft" and how.rule == "uniform" and along_x
        return plain and fits and len(np.unique(np.round(job.q[:, 1], 9))) >= windowed.MIN_ROWS

    def intensities(
        self, job: Job, how: How, shadows: Shadows | None, progress: Callable[[float], None] | None = None
    ) -> Iterator[Floats]:
        """f (outcomes, m) of every window; raises ToleranceError before work that would take days (see `forecast`)."""
        forecast.require_affordable(self, job, how, shadows)
        for n, values in enumerate(self._each(job, how, shadows)):
            yield values
            if progress:
                progress((n + 1) / len(self.plan.windows))

    def _each(self, job: Job, how: How, shadows: Shadows | None) -> Iterator[Floats]:
        if self.shared(job, how, shadows):
            prefactor = job.prefactor
            for S, area in windowed.sums(self.surface, self.plan.gaussian, how.spacing, job.q, how.eps):
                yield self.model.intensity(S[None], job) * (prefactor / area)
            return
        for window in self.plan.windows:
            place = Place.of(self.surface, self.plan, window, how.spacing, how.rule)
            given = (self.model, self.wavelength_nm, shadows, how.method, how.eps, how.azimuth)
            yield intensity(place, self.surface, job, *given)
