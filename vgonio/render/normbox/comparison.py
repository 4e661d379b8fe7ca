"""Reference against prediction: spectral errors, correlations, colour differences (thesis 3.3.2, 3.4)."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...compare import colour
from ...errors import InputError
from .box import Box

Floats = NDArray[np.float64]
# up to 60° direct light dominates, from 65° on indirect light grows (thesis 3.4)
LARGEST_SMALL_ANGLE = 60.0
WHITE_PATCH, WHITE_ANGLE = 19, 30.0


def compare(reference: xr.DataArray, predicted: xr.DataArray) -> xr.Dataset:
    """NSE(λ) = (reference − predicted)/reference, RMSE, NRMSE, ΔE₀₀, ΔE₇₆ of every patch and angle, mean radiance.

    reference, predicted : (patch, angle, wavelength), W/(m² sr nm). NSE is NaN where the reference is 0.
    Raises InputError where the reference is black altogether.
    """
    reference, predicted = xr.align(reference, predicted, join="exact")
    r, p = reference.values, predicted.values
    if not np.all(r.mean(axis=-1) > 0):
        i, j = np.argwhere(r.mean(axis=-1) <= 0)[0]
        raise InputError(
            f"reference of patch {reference['patch'].values[i]} at {reference['angle'].values[j]:g}° is 0 at every "
            "wavelength: nothing can be compared with it"
        )
    nse = np.divide(r - p, r, out=np.full(r.shape, np.nan), where=r > 0)
    rmse = np.sqrt(np.mean((r - p) ** 2, axis=-1))
    x, y = (colour.lab(t) for t in tristimulus(reference, predicted))
    dims = ("patch", "angle")
    data = xr.Dataset(
        {
            "nse": ((*dims, "wavelength"), nse),
            "rmse": (dims, rmse),
            "nrmse": (dims, rmse / r.mean(axis=-1)),
            "mean_radiance": (dims, r.mean(axis=-1)),
            "delta_e_2000": (dims, colour.delta_e(x, y)),
            "delta_e_1976": (dims, colour.delta_e(x, y, "CIE 1976")),
        },
        reference.coords,
    )
    return _labelled(data)


def tristimulus(reference: xr.DataArray, predicted: xr.DataArray) -> tuple[Floats, Floats]:
    """XYZ (patch, angle, 3) of both, as shares of the reference's white patch at 30° (the brightest one where that is
    missing) times D65: the thesis normalises with that patch, and takes D65 for L*a*b*."""
    matrix = colour.emitted_weights(reference["wavelength"].values)
    both = [x.values @ matrix for x in (reference, predicted)]
    patches, angles = reference["patch"].values, reference["angle"].values
    if WHITE_PATCH in patches and WHITE_ANGLE in angles:
        white = both[0][list(patches).index(WHITE_PATCH), list(angles).index(WHITE_ANGLE)]
    else:
        flat = both[0].reshape(-1, 3)
        white = flat[flat[:, 1].argmax()]
    scale = colour.white_point() / np.where(white > 0, white, 1.0)
    return both[0] * scale, both[1] * scale


def correlations(data: xr.Dataset) -> dict[str, dict[str, float]]:
    """Pearson's coefficient of mean radiance with RMSE and NRMSE, for small and large angles (thesis 3.5, 3.6).

    NaN with fewer than three values.
    """
    small = data["angle"].values <= LARGEST_SMALL_ANGLE
    found = {}
    for name, chosen in (("small", small), ("large", ~small)):
        x = data["mean_radiance"].values[:, chosen].ravel()
        found[name] = {k: _pearson(x, data[k].values[:, chosen].ravel()) for k in ("rmse", "nrmse")}
    return found


def _pearson(x: Floats, y: Floats) -> float:
    # values that differ by rounding alone have no coefficient
    if x.size < 3 or any(np.ptp(v) <= 1e-9 * np.abs(v).max() for v in (x, y)):
        return float("nan")
    return float(np.corrcoef(x, y)[0, 1])


def brdf_at(data: xr.DataArray, theta_i: float, theta_o: float) -> Floats:
    """(n_λ,) BRDF at a pair of in-plane angles, linear between neighbours; beyond the ends the nearest.

    The pair is also looked up with both signs turned, an isotropic surface being the same.
    """
    inside = data["theta_i"].values.min() - 1e-9 <= theta_i <= data["theta_i"].values.max() + 1e-9
    if not inside:
        theta_i, theta_o = -theta_i, -theta_o
    theta_i = float(np.clip(theta_i, data["theta_i"].values.min(), data["theta_i"].values.max()))
    theta_o = float(np.clip(theta_o, data["theta_o"].values.min(), data["theta_o"].values.max()))
    return data.interp(theta_i=theta_i, theta_o=theta_o).values


def direct_pairs(box: Box, angle_deg: float, count: int = 20) -> tuple[Floats, float, Floats]:
    """Angles under which direct light is seen: θ_i (n,) of strips of the light, θ_o of the instrument, weights (n,).

    In the plane of the light's middle; weights are each strip's irradiance on the sample and sum to 1. Light from
    straight above a sample at 30° gives the thesis' pair 30°, −60°. Strips behind the sample weigh nothing.
    """
    sx, sy, sz = box.sample_at_mm
    y = box.light_offset_mm[1] + box.light_mm[1] * ((np.arange(count) + 0.5) / count - 0.5) - sy
    height = box.size_mm[2] - sz
    # measured from the vertical, positive away from the instrument, as the sample's normal is at −angle
    theta_i = np.degrees(np.arctan2(y, height)) + angle_deg
    weight = np.maximum(np.cos(np.radians(theta_i)), 0.0) * height**2 / (y**2 + height**2) ** 1.5
    kept = weight > 0
    return theta_i[kept], angle_deg - 90.0, weight[kept] / weight.sum()


def fit_error(measured: xr.Dataset, fitted: xr.DataArray, box: Box, angle_deg: float) -> xr.DataArray:
    """NSE_fit(λ) = (measured − fitted)/measured of a BRDF in direct light, the strips averaged (thesis 3.8)."""
    theta_i, theta_o, weight = direct_pairs(box, angle_deg)
    m, f = (
        np.average([brdf_at(without_gaps(data), float(t), theta_o) for t in theta_i], axis=0, weights=weight)
        for data in (measured["brdf"], fitted)
    )
    error = np.divide(m - f, m, out=np.full(m.shape, np.nan), where=m > 0)
    return xr.DataArray(error, {"wavelength": measured["wavelength"].values}, ("wavelength",))


def without_gaps(data: xr.DataArray) -> xr.DataArray:
    """Gaps, as at exact back-scattering, filled along θ_o."""
    return data.interpolate_na("theta_o")


def mean_fit_error(measured: xr.Dataset, fitted: xr.DataArray, largest_deg: float = 90.0) -> float:
    """Mean |NSE_fit| over all pairs up to that angle and all wavelengths; incident light weighs with its cosine."""
    m, f = measured["brdf"], fitted
    inside = (abs(m["theta_i"]) <= largest_deg) & (abs(m["theta_o"]) <= largest_deg)
    error = (abs(m - f) / m.where(m > 0)).where(inside)
    weight = xr.DataArray(np.cos(np.radians(m["theta_i"].values)), {"theta_i": m["theta_i"]})
    return float(error.weighted(weight).mean())


def _labelled(data: xr.Dataset) -> xr.Dataset:
    names = {
        "nse": ("1", "normalised spectral error (reference - predicted)/reference"),
        "rmse": ("W m-2 sr-1 nm-1", "root mean square error over the spectrum"),
        "nrmse": ("1", "rmse over the mean of the reference"),
        "mean_radiance": ("W m-2 sr-1 nm-1", "mean of the reference over the spectrum"),
        "delta_e_2000": ("1", "colour difference CIE DE2000"),
        "delta_e_1976": ("1", "colour difference CIE 1976"),
    }
    for name, (units, long_name) in names.items():
        data[name].attrs |= {"units": units, "long_name": long_name}
    return data
