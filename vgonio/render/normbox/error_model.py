"""The two-term error model of thesis 3.4: what the fits do to direct and to indirect light.

|ΔL| ≈ L_d err_d + L_i err_i, L_d and L_i the direct and the indirect part of the radiance. err_d is the mean |NSE_fit|
of the patch at the angles of direct light; err_i is the mean |NSE_fit| of the patch over all angles plus that of the
wall, once for every reflection at it: light that arrives by way of walls of reflectance ρ has met 1/(1 − ρ) of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.optimize import nnls

from .box import Box
from .comparison import fit_error, mean_fit_error

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Fitted:
    """A measured in-plane BRDF beside its fit."""

    measured: xr.Dataset
    fitted: xr.DataArray


def error_model(
    direct_share: xr.DataArray,
    mean_radiance: xr.DataArray,
    wavelength_nm: Floats,
    patches: Mapping[int, Fitted],
    wall: Fitted,
    box: Box,
) -> xr.Dataset:
    """err_d and nse_fit (patch, angle), err_i (patch), and what follows: modelled_nrmse, modelled_rmse.

    direct_share : (patch, angle), of the mean radiance;  mean_radiance : (patch, angle), of the reference
    """
    numbers, angles = direct_share["patch"].values, direct_share["angle"].values
    nse = xr.concat([_fit_errors(patches[n], box, angles) for n in numbers], dim="patch").interp(
        wavelength=wavelength_nm
    )
    err_d = abs(nse).mean("wavelength").values
    at_wall = mean_fit_error(wall.measured, wall.fitted) * wall_reflections(wall.measured)
    err_i = np.array([mean_fit_error(patches[n].measured, patches[n].fitted) + at_wall for n in numbers])
    d = direct_share.values
    modelled = d * err_d + (1 - d) * err_i[:, None]
    dims = ("patch", "angle")
    data = xr.Dataset(
        {
            "nse_fit": ((*dims, "wavelength"), nse.values),
            "err_d": (dims, err_d),
            "err_i": (("patch",), err_i),
            "direct_share": (dims, d),
            "modelled_nrmse": (dims, modelled),
            "modelled_rmse": (dims, modelled * mean_radiance.values),
        },
        {"patch": numbers, "angle": angles, "wavelength": wavelength_nm},
    )
    for name, long_name in {
        "nse_fit": "normalised spectral error of the fit at the angles of direct light",
        "err_d": "mean absolute error of the fit at the angles of direct light",
        "err_i": "mean absolute error of the fits that indirect light meets",
        "direct_share": "direct light's share of the mean radiance",
        "modelled_nrmse": "error of the two-term model over the mean radiance",
    }.items():
        data[name].attrs |= {"units": "1", "long_name": long_name}
    data["modelled_rmse"].attrs |= {"units": "W m-2 sr-1 nm-1", "long_name": "error of the two-term model"}
    return data


def _fit_errors(fitted: Fitted, box: Box, angles: Floats) -> xr.DataArray:
    """NSE_fit (angle, wavelength) of one patch at the angles of direct light."""
    return xr.concat([fit_error(fitted.measured, fitted.fitted, box, float(a)) for a in angles], dim="angle")


def wall_reflections(wall: xr.Dataset) -> float:
    """Mean number of reflections at walls of the reflectance ρ = π f at 45° and 0°: 1/(1 − ρ), at most 20."""
    near = wall["brdf"].interpolate_na("theta_o").sel(theta_o=0.0, method="nearest")
    rho = float(np.pi * near.sel(theta_i=45.0, method="nearest").mean())
    return float(1 / (1 - np.clip(rho, 0.0, 0.95)))


def regressed(nrmse: xr.DataArray, direct_share: xr.DataArray) -> dict[str, float]:
    """err_d, err_i ≥ 0 that bring d·err_d + (1 − d)·err_i nearest to the errors found, and the variance explained."""
    d, y = direct_share.values.ravel(), nrmse.values.ravel()
    (direct, indirect), _ = nnls(np.stack([d, 1 - d], axis=1), y)
    left = y - d * direct - (1 - d) * indirect
    spread = float(np.sum((y - y.mean()) ** 2))
    explained = 1 - float(np.sum(left**2)) / spread if spread > 0 else float("nan")
    return {"err_d": float(direct), "err_i": float(indirect), "explained": explained}
