"""Cook–Torrance in the thesis' modified forms: facets without albedos (4.6), with a diffuse part for dielectrics (4.7).

Cook and Torrance, "A reflectance model for computer graphics", ACM TOG 1982. Distribution and masking are those of
`walter_2007` ("ggx", the thesis' choice) or `beckmann_1963` ("beckmann"); G is the separable product of 2.24.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, nearest
from ..materials import Material, material
from . import beckmann_1963, walter_2007
from .half_angle import half_angles

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
    theta_d: Floats, wavelength_nm: Floats, reflector: str | Material | None = "Al", eta: float | None = None
) -> Floats:
    """F of shape theta_d.shape + wavelength.shape at the angles θ_d (radians) between light and half vector.

    Exact Fresnel equations with n + ik of `reflector`, or 2.27 with a constant η (then `reflector` is not used).
    """
    if eta is not None:
        if not (np.isfinite(eta) and eta >= 1):
            raise InputError(f"eta = {eta}: the refractive index of a dielectric in air is at least 1")
        return np.repeat(fresnel_dielectric(np.cos(theta_d), eta)[..., None], wavelength_nm.size, axis=-1)
    return material(reflector or "Al").reflectance(np.cos(theta_d), wavelength_nm)


def facets(theta_i: Floats, theta_o: Floats, alpha: float, distribution: str = "ggx") -> Floats:
    """D·G/(4 cos θ_i cos θ_o) in sr⁻¹, shape (n_i, n_o), for signed in-plane angles in radians: 4.6 with F = 1."""
    if distribution not in DISTRIBUTIONS:
        raise InputError(f"distribution {distribution!r}: {nearest(distribution, DISTRIBUTIONS)}")
    if not (np.isfinite(alpha) and alpha > 0):
        raise InputError(f"alpha = {alpha}: the width of the facet distribution has to be positive")
    shape = DISTRIBUTIONS[distribution]
    theta_m, _ = half_angles(theta_i[:, None], theta_o[None, :])
    masked = shape.masking(theta_i, alpha)[:, None] * shape.masking(theta_o, alpha)[None, :]
    return shape.distribution(theta_m, alpha) * masked / (4.0 * np.cos(theta_i)[:, None] * np.cos(theta_o)[None, :])


def diffuse(k_d: ArrayLike, wavelength_nm: Floats) -> Floats:
    """k_d(λ)/π in sr⁻¹, shape (n_λ,), of a diffuse albedo 0…1 that is a number or one value per wavelength."""
    values = np.asarray(k_d, dtype=np.float64)
    if values.ndim > 1 or values.size not in (1, wavelength_nm.size):
        raise InputError(
            f"k_d has shape {values.shape}: give a number or one value for each of {wavelength_nm.size} wavelengths"
        )
    if not np.all((values >= 0) & (values <= 1)):
        raise InputError(f"k_d = {values.tolist()}: a diffuse albedo lies within 0…1")
    return np.broadcast_to(values, wavelength_nm.shape) / np.pi


def brdf(
    theta_i: Floats,
    theta_o: Floats,
    wavelength_nm: Floats,
    *,
    alpha: float,
    material: str | Material = "Al",
    eta: float | None = None,
    k_d: ArrayLike = 0.0,
    distribution: str = "ggx",
) -> tuple[Floats, dict[str, float]]:
    """BRDF in sr⁻¹, shape (n_i, n_o, n_λ), and no figures to report. Thesis 4.6; with k_d > 0 4.7.

    theta_i (n_i,), theta_o (n_o,) : signed in-plane angles, radians;  wavelength_nm (n_λ,)
    """
    _, theta_d = half_angles(theta_i[:, None], theta_o[None, :])
    f = reflectance(theta_d, wavelength_nm, material, eta)
    return facets(theta_i, theta_o, alpha, distribution)[..., None] * f + diffuse(k_d, wavelength_nm), {}
