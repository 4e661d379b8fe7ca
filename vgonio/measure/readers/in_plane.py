"""From a list of measured spectra at signed in-plane angles to the dense dataset, and its checks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...dataset import label, plain
from ...errors import FileFormatError

Floats = NDArray[np.float64]
# angles of an instrument are the same when they differ by less than this, in degrees
SAME_ANGLE = 1e-6


def signed_angles(theta: Floats, phi: Floats, plane: float, where: str) -> Floats:
    """Signed angles in degrees: +θ on the side of azimuth `plane`, −θ opposite; FileFormatError when out of plane."""
    turn = np.abs((phi - plane + 180.0) % 360.0 - 180.0)  # 0…180° from the plane's azimuth
    out = (theta > SAME_ANGLE) & (np.minimum(turn, 180.0 - turn) > 0.01)
    if np.any(out):
        k = int(np.flatnonzero(out)[0])
        raise FileFormatError(
            f"{where}: a direction at θ = {theta[k]:g}°, φ = {phi[k]:g}° lies outside the plane of incidence: "
            f"φ has to be {plane:g}° or {(plane + 180) % 360:g}°"
        )
    return np.where(turn > 90.0, -theta, theta) + 0.0  # + 0.0 turns −0 into 0


def check_values(theta: Floats, wavelength: Floats, where: str) -> None:
    """FileFormatError unless 0 ≤ θ < 90° and wavelengths are positive, finite and none twice."""
    bad = theta[~((theta >= 0) & (theta < 90))]
    if bad.size:
        raise FileFormatError(f"{where}: polar angle {bad[0]:g}° is not allowed, 0° ≤ θ < 90° (φ tells the side)")
    if wavelength.size == 0:
        raise FileFormatError(f"{where}: the list of wavelengths is empty")
    bad = wavelength[~(np.isfinite(wavelength) & (wavelength > 0))]
    if bad.size:
        raise FileFormatError(f"{where}: wavelength {bad[0]:g} nm is not allowed, wavelengths are positive")
    if np.unique(wavelength).size != wavelength.size:
        raise FileFormatError(f"{where}: a wavelength is listed twice")


def _axis(angles: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """Sorted distinct angles and the place of each value among them."""
    order = np.sort(angles)
    axis = order[np.concatenate([[True], np.diff(order) > SAME_ANGLE])]
    return axis, np.abs(angles[:, None] - axis[None, :]).argmin(axis=1)


def dense_dataset(
    theta_i: Floats,
    theta_o: Floats,
    wavelength: Floats,
    spectra: Floats,
    stderr: Floats | None,
    *,
    plane: float,
    where: str,
    attrs: Mapping[str, Any],
) -> xr.Dataset:
    """Dataset over sorted θ_i, θ_o, λ from n spectra (n, n_λ) at signed angles θ_i (n,), θ_o (n,); gaps are NaN.

    Where every θ_i is on the far side the plane is turned by 180°, so that the light comes from positive angles.
    Raises FileFormatError when a pair of angles appears twice.
    """
    if np.all(theta_i <= 0) and np.any(theta_i < 0):
        theta_i, theta_o, plane = -theta_i + 0.0, -theta_o + 0.0, (plane + 180.0) % 360.0
    (axis_i, i), (axis_o, o) = _axis(theta_i), _axis(theta_o)
    pair, count = np.unique(i * axis_o.size + o, return_counts=True)
    if np.any(count > 1):
        k, j = divmod(int(pair[count > 1][0]), axis_o.size)
        raise FileFormatError(f"{where}: the pair θ_i = {axis_i[k]:g}°, θ_o = {axis_o[j]:g}° appears twice")
    order = np.argsort(wavelength)
    shape = (axis_i.size, axis_o.size, wavelength.size)

    def dense(values: Floats) -> Floats:
        full = np.full(shape, np.nan)
        full[i, o] = values[:, order]
        return full

    variables = {"brdf": (("theta_i", "theta_o", "wavelength"), dense(spectra))}
    if stderr is not None:
        variables["brdf_stderr"] = (("theta_i", "theta_o", "wavelength"), dense(stderr))
    gaps = np.isnan(variables["brdf"][1]).all(axis=-1)
    retro = np.abs(axis_i[:, None] - axis_o[None, :]) <= SAME_ANGLE
    return label(
        xr.Dataset(
            variables,
            coords={"theta_i": axis_i, "theta_o": axis_o, "wavelength": wavelength[order], "phi_i": plane},
            attrs={
                "method": "measured",
                "pairs_measured": int(theta_i.size),
                "pairs_missing": int(np.sum(gaps & ~retro)),
                "pairs_missing_retro": int(np.sum(gaps & retro)),
                **{k: plain(v) for k, v in attrs.items()},
            },
        )
    )
