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
from .cook_torrance_1982 import diffuse, facets, reflectance
from .half_angle import half_angles

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


def brdf(
    theta_i: Floats,
    theta_o: Floats,
    wavelength_nm: Floats,
    *,
    alpha: float,
    h: float,
    w: float,
    t_y: float = 0.0,
    p: float = 1.0,
    material: str | Material = "Al",
    eta: float | None = None,
    k_d: ArrayLike = 0.0,
    distribution: str = "ggx",
    wavelength_n_nm: float = WAVELENGTH_N_NM,
    clamp: bool = False,
) -> tuple[Floats, dict[str, float]]:
    """BRDF in sr⁻¹, shape (n_i, n_o, n_λ): shift · D F^p G/(4 cos θ_i cos θ_o) + k_d/π (4.8; there t_y = 0 and p = 1).

    Also returns `shift_negative_share`, the share of (θ_i, θ_o, λ) whose shift is below 0, and `shift_minimum`.
    With `clamp` negative shifts become 0; otherwise they are left, and so is the negative BRDF.
    """
    for name, value in {"h": h, "w": w, "t_y": t_y, "p": p}.items():
        if not np.isfinite(value):
            raise InputError(f"{name} = {value} is not a finite number")
    theta_m, theta_d = half_angles(theta_i[:, None], theta_o[None, :])
    factor = shift(slope(theta_m, h, w, t_y), wavelength_nm, wavelength_n_nm)
    report = {"shift_negative_share": float(np.mean(factor < 0)), "shift_minimum": float(factor.min())}
    if clamp:
        factor = np.maximum(factor, 0.0)
    f = reflectance(theta_d, wavelength_nm, material, eta) ** p
    return facets(theta_i, theta_o, alpha, distribution)[..., None] * f * factor + diffuse(k_d, wavelength_nm), report
