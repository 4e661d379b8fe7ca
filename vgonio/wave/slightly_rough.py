"""In which directions a scalar theory may be used on a slightly rough surface: beside first-order vector theory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..directions import unit_vectors
from ..materials import material
from ..units import radians
from .closed_forms import linearised, rayleigh_rice

# 4π Sq/λ up to which a surface counts as slightly rough: there the full wave sends back what first-order theory says,
# within 0.03 of it at Sq/λ 0.05 (rigorous_profiles.csv)
SLIGHT_PHASE = 0.63
WITHIN = 0.1  # error of the BRDF, relative to the rigorous one of the same direction, up to which a direction counts
WIDEST_DEG = 80  # the tables of rigorous solutions end there


@dataclass(frozen=True)
class Directions:
    """θ_o from `low` to `high`, signed degrees, where a theory is within WITHIN; least and most of it over the rigorous
    BRDF up to ±WIDEST_DEG."""

    low: float
    high: float
    least: float
    most: float


def ratio(
    theory: str, theta_i_deg: float, theta_o_deg: NDArray[np.float64], wavelength_nm: float, name: str, light: str
) -> NDArray[np.float64]:
    """(m,) BRDF of a theory, linearised, over that of Rayleigh and Rice in the plane of incidence.

    name : the material;  light : "s", "p", or "unpolarised" for the mean of both. The surface does not matter.
    """
    wo = unit_vectors(radians(np.asarray(theta_o_deg, float)))
    wi = np.broadcast_to(unit_vectors(radians(np.array([theta_i_deg])))[0], wo.shape)
    made = material(name)
    index = None if name == "perfect" else complex(made.index(wavelength_nm))
    cos_half = np.sqrt(np.maximum(1 + np.sum(wi * wo, axis=-1), 0) / 2)
    reflectance = np.reshape(made.reflectance(cos_half, wavelength_nm), cos_half.shape)
    parts = [rayleigh_rice(p, wi, wo, wavelength_nm, 1.0, index) for p in ("sp" if light == "unpolarised" else light)]
    return np.asarray(linearised(theory, wi, wo, wavelength_nm, 1.0) * reflectance / np.mean(parts, axis=0))


def directions(theory: str, theta_i_deg: float, wavelength_nm: float, name: str, light: str) -> Directions | None:
    """Around the mirror direction, in steps of 1°; None where the theory does not hold even there."""
    theta_o = np.arange(-WIDEST_DEG, WIDEST_DEG + 1.0)
    found = ratio(theory, theta_i_deg, theta_o, wavelength_nm, name, light)
    good = np.abs(found - 1) <= WITHIN
    mirror = int(np.abs(theta_o + theta_i_deg).argmin())
    if not good[mirror]:
        return None
    low = mirror - int(np.argmin(np.append(good[mirror::-1], False))) + 1
    high = mirror + int(np.argmin(np.append(good[mirror:], False))) - 1
    return Directions(float(theta_o[low]), float(theta_o[high]), float(found.min()), float(found.max()))
