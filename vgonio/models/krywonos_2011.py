"""Smooth surfaces by generalised Harvey–Shack in its reciprocal form, with an ABC (K-correlation) power spectrum.

Krywonos, Harvey and Choi, JOSA A 28, 1121 (2011); reciprocal form of Yan 2018. To first order in the heights
f = R (2π/λ)⁴ (cos θ_i + cos θ_o)⁴ PSD(q)/(16 π² cos θ_i cos θ_o), q = 2π |β − β₀|/λ, as `wave.Kirchhoff` with
theory="generalized-harvey-shack" where (4πσ/λ)² ≪ 1. PSD(q) = A/(1 + (q B)²)^(C/2), the ABC form of Church 1989, scaled
so that ∫ PSD d²q/(4π²) = σ². The mirror peak itself is not in it: scattered light only.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..materials import Material
from .cook_torrance_1982 import reflectance
from .geometry import Geometry

Floats = NDArray[np.float64]


def psd(q: Floats, rms_um: float, b_um: float, c: float) -> Floats:
    """Two-dimensional power spectrum in µm⁴ at |q| in rad/µm: ABC with A = 2π σ² B² (C − 2), C > 2."""
    return 2 * np.pi * rms_um**2 * b_um**2 * (c - 2) * np.exp(-c / 2 * np.log1p((q * b_um) ** 2))


def terms(
    geometry: Geometry,
    wavelength_nm: Floats,
    *,
    rms_um: float,
    b_um: float,
    c_psd: float = 3.0,
    material: str | Material = "Al",
    eta: float | None = None,
) -> dict[str, Floats]:
    """What k_s (1) and k_d (0) multiply, sr⁻¹, geometry.shape + (n_λ,); σ in µm, B in µm (shoulder at q = 1/B), C."""
    for name, value, least in (("rms_um", rms_um, 0.0), ("b_um", b_um, 0.0), ("c_psd", c_psd, 2.0)):
        if not (np.isfinite(value) and value > least):
            raise InputError(f"{name} = {value}: a number above {least:g} is needed (C > 2 keeps the RMS finite)")
    k = 2 * np.pi / (wavelength_nm * 1e-3)
    f = reflectance(geometry.theta_d, wavelength_nm, material, eta)
    ci, co = geometry.cos_i[..., None], geometry.cos_o[..., None]
    spectrum = psd(k * geometry.sine_shift[..., None], rms_um, b_um, c_psd)
    return {"k_s": f * k**4 * (ci + co) ** 4 * spectrum / (16 * np.pi**2 * ci * co), "k_d": np.full((1,), 1 / np.pi)}
