"""How well a shift describes normalised spectra: coefficients of determination and Akaike's criterion."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..errors import InputError
from ..models.clausen_2022 import WAVELENGTH_N_NM
from .metrics import align
from .spectra import Spectra, normalised_spectra

Floats = NDArray[np.float64]


def spectral_r2(s: Spectra, model: Floats) -> Floats:
    """(n,) coefficient of determination, unweighted as in the thesis; NaN for a flat spectrum."""
    valid = s.weight > 0
    count = np.maximum(valid.sum(axis=1), 1)
    mean = np.sum(s.values, axis=1, where=valid) / count
    total = np.sum((s.values - mean[:, None]) ** 2, axis=1, where=valid)
    rest = np.sum((s.values - model) ** 2, axis=1, where=valid)
    # below rounding there is nothing to explain
    return np.where(total > 1e-24 * count, 1.0 - rest / np.where(total > 0, total, 1.0), np.nan)


def total_r2(s: Spectra, used: NDArray[np.bool_], model: Floats) -> float:
    """Coefficient of determination of all normalised spectra together, unweighted; NaN where they are all flat."""
    valid = (s.weight > 0) & used[:, None]
    y = s.values[valid]
    total = np.sum((y - y.mean()) ** 2)
    return float(1.0 - np.sum((y - model[valid]) ** 2) / total) if total > 1e-24 * y.size else float("nan")


def aic(s: Spectra, used: NDArray[np.bool_], model: Floats, parameters: int) -> float:
    """Akaike 1974, with whole spectra as observations: n ln(mean squared residual of a spectrum) + 2 P."""
    square = np.sum(s.weight[used] * (s.values[used] - model[used]) ** 2)
    n = int(used.sum())
    return float(n * np.log(max(square, 1e-300) / n) + 2 * parameters)


def spectra_r2(data: xr.Dataset, fit: xr.Dataset, wavelength_n_nm: float = WAVELENGTH_N_NM) -> float:
    """`total_r2` of the spectra of data over their values at λ_n by those of another BRDF, as of a fitted model.

    NaN where λ_n, nm, is beyond the wavelengths in common, or there are fewer than three.
    """
    try:
        own, other = (normalised_spectra(d, None, wavelength_n_nm) for d in align(data, fit))
    except InputError:
        return float("nan")
    used = own.used & other.used
    return total_r2(own, used, other.values) if used.any() else float("nan")
