"""Pairs of directions at which a model is evaluated, and the angles that the formulas need of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..directions import unit_vectors
from .half_angle import half_angles

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Geometry:
    """Pairs (ω_i, ω_o), all angles in radians and of one shape; polar angles may be signed, as they are in plane."""

    theta_i: Floats
    theta_o: Floats
    phi_i: Floats
    phi_o: Floats

    @staticmethod
    def of(theta_i: ArrayLike, theta_o: ArrayLike, phi_i: ArrayLike = 0.0, phi_o: ArrayLike = 0.0) -> Geometry:
        """Broadcast angles in radians; in the plane of incidence both azimuths are those of the plane."""
        given = (np.asarray(a, dtype=np.float64) for a in (theta_i, theta_o, phi_i, phi_o))
        return Geometry(*np.broadcast_arrays(*given))

    @property
    def shape(self) -> tuple[int, ...]:
        """The common shape of the angles."""
        return self.theta_i.shape

    @property
    def swapped(self) -> Geometry:
        """Source and detector exchanged."""
        return Geometry(self.theta_o, self.theta_i, self.phi_o, self.phi_i)

    @cached_property
    def cos_i(self) -> Floats:
        """cos θ_i."""
        return np.cos(self.theta_i)

    @cached_property
    def cos_o(self) -> Floats:
        """cos θ_o."""
        return np.cos(self.theta_o)

    @cached_property
    def half(self) -> tuple[Floats, Floats]:
        """(θ_m, θ_d): half vector to the normal, light to the half vector."""
        return half_angles(self.theta_i, self.theta_o, self.phi_i, self.phi_o)

    @property
    def theta_m(self) -> Floats:
        """Angle between half vector and normal, radians."""
        return self.half[0]

    @property
    def theta_d(self) -> Floats:
        """Angle between light and half vector, radians."""
        return self.half[1]

    @cached_property
    def sine_shift(self) -> Floats:
        """|β − β₀|: distance of the direction cosines of ω_o from those of the mirror direction, 0…2."""
        wi, wo = unit_vectors(self.theta_i, self.phi_i), unit_vectors(self.theta_o, self.phi_o)
        return np.hypot(wi[..., 0] + wo[..., 0], wi[..., 1] + wo[..., 1])

    @cached_property
    def cos_azimuth(self) -> Floats:
        """cos(φ_o − φ_i) of the azimuths of directions with polar angles ≥ 0; 1 at the pole."""
        wi, wo = unit_vectors(self.theta_i, self.phi_i), unit_vectors(self.theta_o, self.phi_o)
        length = np.hypot(wi[..., 0], wi[..., 1]) * np.hypot(wo[..., 0], wo[..., 1])
        scalar = wi[..., 0] * wo[..., 0] + wi[..., 1] * wo[..., 1]
        return np.clip(np.divide(scalar, length, out=np.ones_like(length), where=length > 1e-300), -1.0, 1.0)
