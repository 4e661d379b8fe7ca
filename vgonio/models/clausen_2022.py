"""The shift-extended Cook–Torrance model: a linear function of wavelength turns the spectrum with direction.

Clausen, "Towards predictive virtual prototyping", 2022 (the thesis), equations 4.4, 4.5 and 4.8.

Units. Wavelengths are in nm, so the slope m and its parameters h and t_y are in nm⁻¹: m = 0.001 nm⁻¹ raises 700 nm by
10 % over the reference wavelength λ_n = 600 nm. w and cos(w θ_m) have no unit, θ_m is in radians.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..materials import Material
from .cook_torrance_1982 import facets, reflectance
from .geometry import Geometry

Floats = NDArray[np.float64]
WAVELENGTH_N_NM = 600.0  # λ_n, where every normalised spectrum and every shift is 1 (thesis, section 4.4)


def slope(theta_m: ArrayLike, h: float, w: float, t_y: float = 0.0) -> Floats:
    """m(i, o) = h cos(w θ_m) + t_y in nm⁻¹ at half-vector angles θ_m (radians, any shape); h, t_y in nm⁻¹ (4.5)."""
    return h * np.cos(w * np.asarray(theta_m, dtype=np.float64)) + t_y


def shift(m: ArrayLike, wavelength_nm: ArrayLike, wavelength_n_nm: float = WAVELENGTH_N_NM) -> Floats:
    """m λ + b of shape m.shape + wavelength.shape, with b = 1 − m λ_n so that it is 1 at λ_n (4.4).

    A steep slope makes it negative far from λ_n; it is returned as it is.
    """
    return 1.0 + np.multiply.outer(np.asarray(m, float), np.asarray(wavelength_nm, float) - wavelength_n_nm)


def shift_factor(
    geometry: Geometry,
    wavelength_nm: Floats,
    *,
    h: float,
    w: float,
    t_y: float = 0.0,
    wavelength_n_nm: float = WAVELENGTH_N_NM,
    **_: object,
) -> Floats:
    """The shift of 4.4 and 4.5 at each pair of directions and wavelength, as it is, negative values included."""
    return shift(slope(geometry.theta_m, h, w, t_y), wavelength_nm, wavelength_n_nm)


def terms(
    geometry: Geometry,
    wavelength_nm: Floats,
    *,
    alpha: float,
    h: float,
    w: float,
    t_y: float = 0.0,
    p: float = 1.0,
    material: str | Material = "Al",
    eta: float | None = None,
    distribution: str = "ggx",
    wavelength_n_nm: float = WAVELENGTH_N_NM,
    clamp: bool = False,
) -> dict[str, Floats]:
    """What k_s (1) and k_d(λ) multiply: shift · D F^p G/(4 cos θ_i cos θ_o) and 1/π (4.8; there t_y = 0 and p = 1).

    With `clamp` negative shifts become 0; otherwise they are left, and so is the negative BRDF.
    """
    require_finite(h=h, w=w, t_y=t_y, p=p)
    factor = shift_factor(geometry, wavelength_nm, h=h, w=w, t_y=t_y, wavelength_n_nm=wavelength_n_nm)
    f = reflectance(geometry.theta_d, wavelength_nm, material, eta) ** p
    return shifted_terms(geometry, alpha, distribution, f, factor, clamp)


def shifted_terms(
    geometry: Geometry, alpha: float, distribution: str, fresnel: Floats, factor: Floats, clamp: bool
) -> dict[str, Floats]:
    """What k_s and k_d multiply, from the reflectance and the shift at each pair of directions and wavelength."""
    shifted = np.maximum(factor, 0.0) if clamp else factor
    facet = facets(geometry, alpha, distribution)[..., None]
    return {"k_s": facet * fresnel * shifted, "k_d": np.full((1,), 1.0 / np.pi)}


def require_finite(**values: float) -> None:
    for name, value in values.items():
        if not np.isfinite(value):
            raise InputError(f"{name} = {value} is not a finite number")
