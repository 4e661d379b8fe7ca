"""Oren–Nayar: V-grooves with Lambertian sides, brighter in back-scattering the rougher they are.

Oren and Nayar, "Generalization of Lambert's reflectance model", SIGGRAPH 1994, the qualitative model (their equation
30, without light between the sides of a groove), σ the standard deviation of the slope angle of the sides. It is
reciprocal. It loses energy: without reflections between the sides the albedo falls below k_d as σ grows.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .geometry import Geometry

Floats = NDArray[np.float64]


def terms(geometry: Geometry, wavelength_nm: Floats, *, sigma_deg: float) -> dict[str, Floats]:
    """What k_d(λ) multiplies, sr⁻¹, geometry.shape + (1,); sigma_deg : σ of the slope angles, 0 (Lambert) … 90°."""
    if not (np.isfinite(sigma_deg) and 0 <= sigma_deg <= 90):
        raise InputError(f"sigma_deg = {sigma_deg}°: a standard deviation of slope angles within 0…90° is needed")
    s2 = np.deg2rad(sigma_deg) ** 2
    a, b = 1 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
    polar_i, polar_o = np.abs(geometry.theta_i), np.abs(geometry.theta_o)
    larger, smaller = np.maximum(polar_i, polar_o), np.minimum(polar_i, polar_o)
    rise = np.maximum(geometry.cos_azimuth, 0.0) * np.sin(larger) * np.tan(smaller)
    return {"k_d": ((a + b * rise) / np.pi)[..., None]}
