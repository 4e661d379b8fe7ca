"""GGX: distribution of facet normals and its Smith masking.

Walter, Marschner, Li and Torrance, "Microfacet models for refraction through rough surfaces", EGSR 2007 (equations 33
and 34); thesis 2.25, 2.26. α is the width α_g of these formulas: the tangent of the facet angle at which D cos⁴θ has
fallen to a quarter of its peak. It is not squared here: "α = roughness²" of some renderers is applied before.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def distribution(theta_h: ArrayLike, alpha: float) -> Floats:
    """D in sr⁻¹ at facet angles θ_h (radians, any shape); ∫ D cos θ dω over the hemisphere is 1 (thesis 2.25)."""
    c2 = np.cos(theta_h) ** 2
    # α² / (π cos⁴θ (α² + tan²θ)²), multiplied out so that θ_h = 90° is no division by zero
    return alpha**2 / (np.pi * (alpha**2 * c2 + np.sin(theta_h) ** 2) ** 2)


def masking(theta: ArrayLike, alpha: float) -> Floats:
    """Smith's G₁, 0…1, at polar angles |θ| < 90° (radians, any shape) of ω_i or ω_o (thesis 2.26)."""
    return 2.0 / (1.0 + np.sqrt(1.0 + (alpha * np.tan(theta)) ** 2))
