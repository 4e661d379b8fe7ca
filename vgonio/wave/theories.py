"""What the three scalar theories make of S(q): amplitude factor C and scattering vector (CONVENTIONS.md; Yan 2018).

f = k²/(4π²) · C² · R / (cos θ_i cos θ_o A_w) · |S(q)|²
"""

from __future__ import annotations

import numpy as np

from .quadrature import Floats

THEORIES = ("kirchhoff", "generalized-harvey-shack", "harvey-shack")
DESCRIPTION = {
    "kirchhoff": "tangent-plane Kirchhoff (Beckmann and Spizzichino 1963)",
    "generalized-harvey-shack": "generalized Harvey–Shack, reciprocal form R-GHS (Yan 2018)",
    "harvey-shack": "original Harvey–Shack, reciprocal form R-OHS (Yan 2018)",
}


def amplitude(theory: str, wi: Floats, wo: Floats) -> Floats:
    """C for unit vectors wi, wo (…, 3), broadcast."""
    ci, co = wi[..., 2], wo[..., 2]
    if theory == "kirchhoff":
        return (1 + np.sum(wi * wo, axis=-1)) / (ci + co)
    return (ci + co) / 2


def scattering_vector(theory: str, k: Floats, wi: Floats, wo: Floats) -> Floats:
    """q = k (ω_i + ω_o), rad/µm, (…, 3); for "harvey-shack" q_z = 2k whatever the angles."""
    q = k[..., None] * (wi + wo)
    if theory == "harvey-shack":
        q[..., 2] = 2 * k
    return q
