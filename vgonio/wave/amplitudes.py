"""What a facet does to the amplitude: scalar theories with Fresnel's reflectance at the half vector or at each facet.

A model says which sums over the surface it needs (`parts`, each with its own weight on the points, `fields`) and what
the BRDF is in terms of them:  f = k²/(4π²) / (cos θ_i cos θ_o A_w) · `intensity`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..directions import half_vectors
from ..materials import Material
from .job import Job
from .quadrature import Complex, Floats
from .theories import amplitude


@dataclass(frozen=True, eq=False)
class Facets:
    """Slopes ∂z/∂x and ∂z/∂y (ny, nx) of the surface at the points of a window."""

    zx: Floats
    zy: Floats

    def cosine(self, wi: Floats) -> Floats:
        """(ny, nx) cosine of the local angle of incidence, 0 for facets that face away."""
        c = (wi[2] - wi[0] * self.zx - wi[1] * self.zy) / np.sqrt(1 + self.zx**2 + self.zy**2)
        return np.clip(c, 0.0, 1.0)


class Model(Protocol):
    """parts : number of sums;  outcomes : numbers that `intensity` gives for each direction, the first for brdf;
    local : whether the weights on the points depend on source and wavelength (otherwise there are none)"""

    @property
    def parts(self) -> int: ...
    @property
    def outcomes(self) -> int: ...
    @property
    def local(self) -> bool: ...

    def fields(self, wi: Floats, wavelength_nm: float, facets: Facets) -> Complex:
        """(parts, ny, nx) weights on the points."""
        ...

    def intensity(self, sums: Complex, job: Job) -> Floats:
        """(outcomes, m) from sums (parts, m)."""
        ...


@dataclass(frozen=True, eq=False)
class HalfVector:
    """One real sum; C² R with the reflectance R at the half vector."""

    theory: str
    material: Material
    wavelength_nm: Sequence[float]
    polarisation: str
    parts: int = 1
    outcomes: int = 1
    local: bool = False

    def fields(self, wi: Floats, wavelength_nm: float, facets: Facets) -> Complex:
        return np.ones((1, 1, 1), np.complex128)

    def intensity(self, sums: Complex, job: Job) -> Floats:
        cos_h = np.clip(np.sum(half_vectors(job.wi, job.wo) * job.wi, axis=1), 0, 1)
        reflectance = np.empty(len(job.k))
        for w, wavelength in enumerate(self.wavelength_nm):
            at = job.wavelength == w
            reflectance[at] = self.material.reflectance(cos_h[at], wavelength, self.polarisation)
        return (amplitude(self.theory, job.wi, job.wo) ** 2 * reflectance * np.abs(sums[0]) ** 2)[None]


@dataclass(frozen=True, eq=False)
class LocalFacet:
    """Amplitudes r_s and r_p at the angle of incidence on each facet, in two sums whose intensities are averaged.

    Approximation: s and p of a facet are taken for those of the macroscopic plane, so nothing is cross-polarised.
    Facets that face away count as grazing, r = −1. Where the phase is stationary the facet's normal is the half vector,
    so both choices agree for gentle slopes.
    """

    theory: str
    material: Material
    polarisation: str
    outcomes: int = 1
    local: bool = True

    @property
    def parts(self) -> int:
        return 2 if self.polarisation == "unpolarised" else 1

    def fields(self, wi: Floats, wavelength_nm: float, facets: Facets) -> Complex:
        rs, rp = self.material.amplitudes(facets.cosine(wi), wavelength_nm)
        return np.stack({"s": (rs,), "p": (rp,)}.get(self.polarisation, (rs, rp)))

    def intensity(self, sums: Complex, job: Job) -> Floats:
        return (amplitude(self.theory, job.wi, job.wo) ** 2 * np.mean(np.abs(sums) ** 2, axis=0))[None]
