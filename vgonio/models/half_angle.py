"""The two angles of every facet model: of the half vector to the normal, and of the light to the half vector."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..directions import half_vectors, unit_vectors

Floats = NDArray[np.float64]


def half_angles(
    theta_i: ArrayLike, theta_o: ArrayLike, phi_i: ArrayLike = 0.0, phi_o: ArrayLike = 0.0
) -> tuple[Floats, Floats]:
    """(θ_m, θ_d) in radians, broadcast: θ_m ≥ 0 between macro normal and half vector, θ_d between ω_i and half vector.

    theta_i, theta_o, phi_i, phi_o : radians, broadcastable. In plane (φ_i = φ_o, signed angles) θ_m = |θ_i + θ_o|/2 and
    θ_d = |θ_i − θ_o|/2. θ_d is also the angle of incidence that Fresnel's equations take.
    """
    theta_i, theta_o, phi_i, phi_o = np.broadcast_arrays(theta_i, theta_o, phi_i, phi_o)
    wi, wo = unit_vectors(theta_i, phi_i), unit_vectors(theta_o, phi_o)
    h = half_vectors(wi, wo)
    # arctan2 instead of arccos: exact near 0, where most of the lobe is
    theta_m = np.arctan2(np.hypot(h[..., 0], h[..., 1]), h[..., 2])
    theta_d = np.arctan2(np.linalg.norm(wi - wo, axis=-1), np.linalg.norm(wi + wo, axis=-1))
    return theta_m, theta_d
