"""Harvey's shift-invariant lobe of polished surfaces: k_s(λ) [1 + (|β − β₀|/l)²]^(s/2), also known as ABC.

Harvey, "Light-scattering characteristics of optical surfaces", PhD thesis, University of Arizona 1976; the three
parameters as in Harvey 2009. β and β₀ are direction cosines of the light and of the mirror
direction, l the shoulder (no unit), s < 0 the slope of the wings on a doubly logarithmic plot. k_s is the value in the
mirror direction in sr⁻¹, no albedo. An empirical form: reciprocal, but nothing keeps its albedo below 1, and at grazing
incidence part of the lobe lies below the horizon.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .geometry import Geometry

Floats = NDArray[np.float64]


def terms(geometry: Geometry, wavelength_nm: Floats, *, l: float, s: float = -2.0) -> dict[str, Floats]:
    """What k_s(λ), the peak in sr⁻¹, multiplies: geometry.shape + (1,), 1 in the mirror direction."""
    if not (np.isfinite(l) and l > 0):
        raise InputError(f"l = {l}: the shoulder of the lobe, a difference of direction cosines, has to be positive")
    if not (np.isfinite(s) and s <= 0):
        raise InputError(f"s = {s}: the slope of the wings is negative, for example -2")
    return {"k_s": np.exp(s / 2 * np.log1p((geometry.sine_shift / l) ** 2))[..., None], "k_d": np.full((1,), 1 / np.pi)}
