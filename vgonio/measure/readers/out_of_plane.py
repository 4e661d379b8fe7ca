"""Rows that leave the plane of incidence: every direction of reflection of the file is a cell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...dataset import label, plain
from ...directions import unit_vectors
from ...errors import FileFormatError
from ...units import radians
from .checks import check_size, once
from .in_plane import SAME_ANGLE

Floats = NDArray[np.float64]


def cell_dataset(
    directions: Floats,
    wavelength: Floats,
    spectra: Floats,
    stderr: Floats | None,
    *,
    where: str,
    attrs: Mapping[str, Any],
    duplicates: str,
) -> xr.Dataset:
    """Spectra (n, n_λ) of directions (n, 4) in degrees over dims (theta_i, cell, wavelength).

    Raises FileFormatError for light from several azimuths and, with duplicates "error", pairs that appear twice.
    """
    theta_i, phi_i, theta_o, phi_o = directions.T
    plane = _azimuth(phi_i[theta_i > SAME_ANGLE], where)
    axis_i, i = np.unique(np.round(theta_i / SAME_ANGLE) * SAME_ANGLE, return_inverse=True)
    phi_o = np.where(theta_o <= SAME_ANGLE, 0.0, np.round(phi_o % 360.0, 6) % 360.0)
    cells, c = np.unique(np.stack([theta_o, phi_o], axis=1), axis=0, return_inverse=True)
    shape = (axis_i.size, len(cells), wavelength.size)
    check_size(int(np.prod(shape)), where)
    index = i.ravel() * len(cells) + c.ravel()
    if duplicates == "error" and np.unique(index).size < index.size:
        k, j = divmod(int(np.flatnonzero(np.bincount(index) > 1)[0]), len(cells))
        raise FileFormatError(
            f"{where}: θ_i = {axis_i[k]:g}°, θ_o = {cells[j, 0]:g}°, φ_o = {cells[j, 1]:g}° appears twice; "
            "duplicates=mean or duplicates=first (--set) merges"
        )
    place, values, errors = once(index, spectra, stderr, duplicates)
    order = np.argsort(wavelength)

    def dense(v: Floats) -> Floats:
        full = np.full((shape[0] * shape[1], shape[2]), np.nan)
        full[place] = v[:, order]
        return full.reshape(shape)

    found = {"brdf": values} | ({} if errors is None else {"brdf_stderr": errors})
    coords = {
        "theta_i": axis_i,
        "wavelength": wavelength[order],
        "phi_i": plane,
        "cell": np.arange(len(cells)),
        "theta_o": ("cell", cells[:, 0]),
        "phi_o": ("cell", cells[:, 1]),
        "solid_angle": ("cell", solid_angles(cells[:, 0], cells[:, 1])),
    }
    said = {
        "method": "measured",
        "pairs_measured": int(place.size),
        "pairs_missing": int(shape[0] * shape[1] - place.size),
        **{k: plain(v) for k, v in attrs.items()},
    }
    dims = ("theta_i", "cell", "wavelength")
    return label(xr.Dataset({k: (dims, dense(v)) for k, v in found.items()}, coords, said))


def _azimuth(phi_i: Floats, where: str) -> float:
    """The one azimuth of incidence, 0 where all light is along the normal."""
    planes = np.unique(np.round(phi_i % 360.0, 6))
    if planes.size > 1:
        raise FileFormatError(
            f"{where} has light from {planes.size} azimuths ({planes[0]:g}°, {planes[1]:g}° …): only isotropic "
            "samples, measured with one azimuth of incidence, are read"
        )
    return float(planes[0]) if planes.size else 0.0


def solid_angles(theta_deg: Floats, phi_deg: Floats) -> Floats:
    """(n,) solid angle in sr nearer to each direction than to any other, up to the horizon; NaN for fewer than four.

    Cells of the spherical Voronoi diagram of the directions and their mirror images below the horizon, so that
    cells end there.
    """
    from scipy.spatial import QhullError, SphericalVoronoi

    up = unit_vectors(radians(theta_deg), radians(phi_deg))
    try:
        return SphericalVoronoi(np.concatenate([up, up * [1, 1, -1]])).calculate_areas()[: len(up)]
    except (ValueError, QhullError, IndexError):
        return np.full(len(up), np.nan)
