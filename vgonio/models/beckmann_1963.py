"""Beckmann: distribution of facet normals of a Gaussian surface and its Smith masking.

Beckmann and Spizzichino, "The scattering of electromagnetic waves from rough surfaces", 1963; masking by Smith 1967 in
the form of Walter 2007 (text above equation 27). α = √2 · one-axis RMS slope of the surface.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def distribution(theta_h: ArrayLike, alpha: float) -> Floats:
    """D in sr⁻¹ at facet angles |θ_h| < 90° (radians, any shape); ∫ D cos θ dω over the hemisphere is 1."""
    c2 = np.cos(theta_h) ** 2
    return np.exp(-((np.tan(theta_h) / alpha) ** 2)) / (np.pi * alpha**2 * c2**2)


def masking(theta: ArrayLike, alpha: float) -> Floats:
    """Smith's G₁, 0…1, at polar angles |θ| < 90° (radians, any shape) of ω_i or ω_o; exact, with the error function."""
    from scipy.special import erf

    # the slope of the ray over the slope of the surface; at normal incidence infinite, where G₁ = 1
    a = 1.0 / np.maximum(alpha * np.abs(np.tan(theta)), 1e-12)
    return 2.0 / (1.0 + erf(a) + np.exp(-(np.minimum(a, 30.0) ** 2)) / (a * np.sqrt(np.pi)))
