"""The only place where units are converted.

Public boundaries speak degrees, micrometres (surfaces) and nanometres (wavelengths); inside, angles are radians and
every length is in micrometres.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InputError, nearest

# length units that surface files use, in micrometres
MICROMETRES: dict[str, float] = {
    "m": 1e6,
    "dm": 1e5,
    "cm": 1e4,
    "mm": 1e3,
    "um": 1.0,
    "µm": 1.0,
    "μm": 1.0,
    "nm": 1e-3,
    "Å": 1e-4,
    "A": 1e-4,
    "pm": 1e-6,
    "in": 25_400.0,
}


def to_um(unit: str) -> float:
    """Factor that brings a length in `unit` to micrometres; InputError for an unknown unit."""
    try:
        return MICROMETRES[unit]
    except KeyError:
        raise InputError(f"unknown length unit {unit!r}: {nearest(unit, MICROMETRES)}") from None


def radians(degrees: ArrayLike) -> NDArray[np.float64]:
    return np.deg2rad(np.asarray(degrees, dtype=np.float64))


def degrees(radians: ArrayLike) -> NDArray[np.float64]:
    return np.rad2deg(np.asarray(radians, dtype=np.float64))


def nm_to_um(wavelength_nm: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(wavelength_nm, dtype=np.float64) * 1e-3


def meant_nm(wavelength_nm: float, low_nm: float = 100.0, high_nm: float = 100_000.0) -> str:
    """The end of a message on a wavelength outside `low_nm` to `high_nm`, nm, that is within in µm; else nothing.

    >>> meant_nm(0.55, 400, 700)
    ': wavelengths are in nm, was 550 meant?'
    """
    nm = 1000 * float(wavelength_nm)
    # a rounded 0.4 µm is at the end of a range from 400 nm
    within = low_nm * (1 - 1e-9) <= nm <= high_nm * (1 + 1e-9)
    return f": wavelengths are in nm, was {nm:g} meant?" if within else ""


def wavenumber(wavelength_nm: ArrayLike) -> NDArray[np.float64]:
    """k = 2π/λ in rad/µm for wavelengths in nm."""
    return 2.0 * np.pi / nm_to_um(wavelength_nm)
