"""Lambert: k_d(λ)/π, the same in every direction. Johann Heinrich Lambert, "Photometria", 1760."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .geometry import Geometry

Floats = NDArray[np.float64]


def terms(geometry: Geometry, wavelength_nm: Floats) -> dict[str, Floats]:
    """What k_d(λ) multiplies: 1/π in sr⁻¹."""
    return {"k_d": np.full((1,), 1.0 / np.pi)}
