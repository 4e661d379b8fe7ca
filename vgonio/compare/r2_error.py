"""The error of r² of the global shift, from those of the BRDF."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import ascending
from .colour import normalised
from .drawn_errors import Noise, standard_errors, true_share
from .metrics import detector_dim
from .shift import fitted_spectra
from .spectra import normalised_spectra

Floats = NDArray[np.float64]


def r2_error(data: xr.Dataset, fit: xr.Dataset) -> float:
    """Standard error of `r2` of a fit of `fit_global_shift` to the data; NaN where they have no brdf_stderr.

    The fitted function is held: at the best fit r² does not change with its parameters to first order.
    """
    data = ascending(data).transpose(..., "theta_i", detector_dim(data), "wavelength")
    anchor, w = float(fit.attrs["wavelength_n"]), data["wavelength"].values
    spectra = normalised_spectra(data, None, anchor)
    shape = data["brdf"].shape
    counted = ((spectra.weight > 0) & spectra.used[:, None]).reshape(shape)
    scale = np.where(spectra.used, spectra.scale, np.nan).reshape(*shape[:2], 1)
    model = fitted_spectra(data, fit)["brdf"].values / scale
    counted &= np.isfinite(model)

    def spectral(brdf: Floats) -> Floats:
        return np.where(counted, normalised(brdf, w, anchor), np.nan)

    def figures(brdf: Floats) -> dict[str, float]:
        y = spectral(brdf)[counted]
        varies = float(np.sum((y - y.mean()) ** 2))
        return {"r2": float(1 - np.sum((y - model[counted]) ** 2) / varies) if varies > 0 else float("nan")}

    def nearer(noise: Noise, brdf: Floats) -> list[Floats]:
        """As far from the fit as noise does not explain."""
        rest = spectral(brdf) - model
        share = true_share(rest, lambda draw: spectral(brdf + noise(draw)[0]) - model - rest)
        return [np.where(counted, scale * (model + share * rest), brdf)]

    if not counted.any():
        return float("nan")
    return standard_errors(figures, data, centre=nearer).get("r2", float("nan"))
