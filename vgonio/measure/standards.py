"""Reflectance standards: a diffuse one of known reflectance, and tables as calibration laboratories give them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ..dataset import label
from ..errors import FileFormatError, InputError
from ..files import text_of

Floats = NDArray[np.float64]
DIMS = ("theta_i", "theta_o", "wavelength")


def lambertian_standard(
    wavelength_nm: ArrayLike, reflectance: ArrayLike, uncertainty: ArrayLike | None = None
) -> xr.Dataset:
    """The in-plane BRDF ρ/π of a perfectly diffuse standard of known reflectance; its `brdf_stderr` where given.

    Real standards are not Lambertian (PTFE falls by 15 % towards grazing): good for the spectrum, not the angles.
    """
    nm, rho = (np.atleast_1d(np.asarray(v, float)) for v in (wavelength_nm, reflectance))
    if nm.shape != rho.shape or not np.all((rho > 0) & (rho <= 1.02)):
        raise InputError("one reflectance in 0 … 1 for each wavelength is needed (not percent)")
    angles = {"theta_i": [0.0, 89.0], "theta_o": [-89.0, 89.0], "wavelength": nm, "phi_i": 0.0}
    variables = {"brdf": (DIMS, np.broadcast_to(rho / np.pi, (2, 2, nm.size)))}
    if uncertainty is not None:
        variables["brdf_stderr"] = (DIMS, np.broadcast_to(np.asarray(uncertainty, float) / np.pi, (2, 2, nm.size)))
    return label(xr.Dataset(variables, coords=angles, attrs={"method": "measured"}))


def read_reflectance(path: str, columns: Sequence[int] = (0, 1, 2), coverage: float = 2.0) -> tuple[Floats, ...]:
    """Wavelength in nm, reflectance and its standard uncertainty from a calibration table in text columns.

    coverage : factor k of the stated uncertainty, by which it is divided. Raises FileFormatError for other files.
    """
    try:
        table = np.loadtxt(text_of(Path(path), "table").splitlines(), usecols=tuple(columns), ndmin=2)
    except (ValueError, IndexError) as e:
        raise FileFormatError(f"{path} is no table of wavelength, reflectance and uncertainty: {e}") from None
    if not table.size or not np.all(np.isfinite(table)) or np.any(table[:, 0] <= 0):
        raise FileFormatError(f"{path} holds no rows, or a value that cannot be")
    return table[:, 0], table[:, 1], table[:, 2] / coverage
