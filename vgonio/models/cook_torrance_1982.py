"""Cook–Torrance: k_d/π + k_s D F G/(4 cos θ_i cos θ_o) − c, in all the forms of the thesis.

Cook and Torrance, "A reflectance model for computer graphics", ACM TOG 1982. Distribution and masking are those of
`walter_2007` ("ggx", the thesis' choice) or `beckmann_1963` ("beckmann"); G is the separable product of 2.24.

2.23 has k_d(λ) and k_s(λ); 3.1 subtracts a constant c from it; 4.6 is k_s = 1, k_d = 0 (conductors), 4.7 k_s = 1
(dielectrics). With k_d(λ) free, c is not a parameter of its own: k_d/π − c is all that counts, and c says no more than
that k_d may become negative.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, nearest
from ..materials import Material
from ..materials import material as named_material
from . import beckmann_1963, walter_2007
from .geometry import Geometry

Floats = NDArray[np.float64]
DISTRIBUTIONS = {"ggx": walter_2007, "beckmann": beckmann_1963}


def fresnel_dielectric(cos_i: ArrayLike, eta: ArrayLike) -> Floats:
    """Reflectance of a dielectric of real index η for unpolarised light, broadcast over cos_i and η (thesis 2.27).

    2.27 has two misprints; this is Cook and Torrance's own form: g² = η² + c² − 1, last bracket
    [c(g + c) − 1]²/[c(g − c) + 1]². It equals Fresnel's equations.
    """
    c = np.asarray(cos_i, dtype=np.float64)
    g = np.sqrt(np.asarray(eta, dtype=np.float64) ** 2 + c * c - 1.0)
    return 0.5 * ((g - c) / (g + c)) ** 2 * (1.0 + ((c * (g + c) - 1.0) / (c * (g - c) + 1.0)) ** 2)


def reflectance(
    theta_d: Floats, wavelength_nm: Floats, material: str | Material | None = "Al", eta: float | None = None
) -> Floats:
    """F of shape theta_d.shape + wavelength.shape at the angles θ_d (radians) between light and half vector.

    Exact Fresnel equations with n + ik of `material`, or 2.27 with a constant η (then `material` is not used).
    """
    if eta is not None:
        if not (np.isfinite(eta) and eta >= 1):
            raise InputError(f"eta = {eta}: the refractive index of a dielectric in air is at least 1")
        one = fresnel_dielectric(np.cos(theta_d), eta)[..., None]
        return np.broadcast_to(one, (*np.shape(theta_d), wavelength_nm.size))
    return named_material(material or "Al").reflectance(np.cos(theta_d), wavelength_nm)


def facets(geometry: Geometry, alpha: float, distribution: str = "ggx") -> Floats:
    """D·G/(4 cos θ_i cos θ_o) in sr⁻¹, shape of the geometry: 4.6 with F = 1."""
    if distribution not in DISTRIBUTIONS:
        raise InputError(f"distribution {distribution!r}: {nearest(distribution, DISTRIBUTIONS)}")
    if not (np.isfinite(alpha) and alpha > 0):
        raise InputError(f"alpha = {alpha}: the width of the facet distribution has to be positive")
    shape = DISTRIBUTIONS[distribution]
    masked = shape.masking(geometry.theta_i, alpha) * shape.masking(geometry.theta_o, alpha)
    return shape.distribution(geometry.theta_m, alpha) * masked / (4.0 * geometry.cos_i * geometry.cos_o)


def terms(
    geometry: Geometry,
    wavelength_nm: Floats,
    *,
    alpha: float,
    c: float = 0.0,
    material: str | Material = "Al",
    eta: float | None = None,
    distribution: str = "ggx",
) -> dict[str, Floats]:
    """What k_s(λ) and k_d(λ) multiply, and "", what nothing multiplies: sr⁻¹, geometry.shape + (n_λ,) or broadcast."""
    if not np.isfinite(c):
        raise InputError(f"c = {c} is not a finite number (sr⁻¹)")
    f = reflectance(geometry.theta_d, wavelength_nm, material, eta)
    specular = facets(geometry, alpha, distribution)[..., None] * f
    constant = {"": np.full((1,), -c)} if c else {}
    return {"k_s": specular, "k_d": np.full((1,), 1.0 / np.pi), **constant}
