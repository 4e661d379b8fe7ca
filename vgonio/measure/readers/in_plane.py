"""From a list of measured spectra at signed in-plane angles to the dense dataset, and its checks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...dataset import label, plain
from ...errors import FileFormatError
from .checks import check_size, once

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


def _axis(angles: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """Sorted distinct angles and the place of each value among them."""
    order = np.sort(angles)
    axis = order[np.concatenate([[True], np.diff(order) > SAME_ANGLE])]
    return axis, np.searchsorted((axis[1:] + axis[:-1]) / 2, angles)


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
    duplicates: str = "error",
) -> xr.Dataset:
    """Dataset over sorted θ_i, θ_o, λ from n spectra (n, n_λ) at signed angles θ_i (n,), θ_o (n,); gaps are NaN.

    Where every θ_i is on the far side the plane is turned by 180°, so that the light comes from positive angles.
    Raises FileFormatError when a pair of angles appears twice, unless `duplicates` is "mean" or "first".
    """
    if np.all(theta_i <= 0) and np.any(theta_i < 0):
        theta_i, theta_o, plane = -theta_i + 0.0, -theta_o + 0.0, (plane + 180.0) % 360.0
    (axis_i, i), (axis_o, o) = _axis(theta_i), _axis(theta_o)
    check_size(axis_i.size * axis_o.size * wavelength.size, where)
    index = i * axis_o.size + o
    pair, count = np.unique(index, return_counts=True)
    if duplicates == "error" and np.any(count > 1):
        k, j = divmod(int(pair[count > 1][0]), axis_o.size)
        raise FileFormatError(
            f"{where}: the pair θ_i = {axis_i[k]:g}°, θ_o = {axis_o[j]:g}° appears twice; "
            "duplicates=mean or duplicates=first (--set) merges"
        )
    pair, spectra, stderr = once(index, spectra, stderr, duplicates)
    order = np.argsort(wavelength)
    shape = (axis_i.size, axis_o.size, wavelength.size)

    def dense(values: Floats) -> Floats:
        full = np.full((axis_i.size * axis_o.size, wavelength.size), np.nan)
        full[pair] = values[:, order]
        return full.reshape(shape)

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
                "pairs_measured": int(pair.size),
                **({"repairs": f"{theta_i.size - pair.size} duplicates merged"} if pair.size < theta_i.size else {}),
                "pairs_missing": int(np.sum(gaps & ~retro)),
                "pairs_missing_retro": int(np.sum(gaps & retro)),
                **{k: plain(v) for k, v in attrs.items()},
            },
        )
    )


def signed_as_full(theta_i: Floats, theta_o: Floats, phi_i: Floats | float = 0.0) -> Floats:
    """(n, 4) θ_i, φ_i, θ_o, φ_o in degrees with θ ≥ 0, from signed angles in the plane of azimuth φ_i."""
    phi_i = np.broadcast_to(phi_i, theta_i.shape)
    sides = [np.where(t < 0, phi_i + 180.0, phi_i) % 360.0 for t in (theta_i, theta_o)]
    return np.stack([np.abs(theta_i), sides[0], np.abs(theta_o), sides[1]], axis=1)
