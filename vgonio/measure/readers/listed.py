"""From rows of a table (directions, wavelength, value) to the dataset: in plane where it can be, else a hemisphere."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...dataset import label, plain
from ...directions import unit_vectors
from ...errors import FileFormatError
from ...units import radians
from . import checks
from .in_plane import SAME_ANGLE, dense_dataset, signed_angles

Floats = NDArray[np.float64]


def numbers(fields: list[str], where: str) -> Floats:
    """(n,) of decimal numbers; FileFormatError for anything else."""
    try:
        return np.array([float(v) for v in fields])
    except ValueError as e:
        raise FileFormatError(f"{where}: {str(e)[:80]}") from None


def table_of(lines: list[tuple[int, list[str]]], columns: int, path: Path) -> Floats:
    """(n, columns) from numbered lines of fields; "" and "nan" are NaN, FileFormatError names the line that is bad."""
    values = np.empty((len(lines), columns))
    for k, (number, fields) in enumerate(lines):
        if len(fields) != columns:
            raise FileFormatError(
                f"{path}, line {number}: {len(fields)} values for {columns} columns: damaged or truncated"
            )
        values[k] = numbers([f.strip() or "nan" for f in fields], f"{path}, line {number}")
    return values


def from_rows(
    directions: Floats,
    wavelength: Floats,
    value: Floats,
    stderr: Floats | None,
    repairs: checks.Repairs,
    *,
    where: str,
    attrs: Mapping[str, Any],
) -> xr.Dataset:
    """The dataset of rows that hold one direction pair and one wavelength each.

    directions : (n, 4) θ_i, φ_i, θ_o, φ_o in degrees;  wavelength : (n,);  value, stderr : (n,)
    A negative polar angle is one on the other side; reflected directions at the horizon and below are left out.
    Raises FileFormatError for no rows, angles or wavelengths that cannot be, or rows that appear twice.
    """
    if not np.all(np.isfinite(wavelength)):
        raise FileFormatError(f"{where}: a wavelength is missing or not finite")
    directions, kept, note = _upright(directions, where)
    wavelength, value, stderr = wavelength[kept], value[kept], None if stderr is None else stderr[kept]
    attrs = {**attrs, **note}
    axis = np.unique(np.round(wavelength, 9))
    checks.check_values(directions[:, [0, 2]].ravel(), axis, where)
    pairs, pair = np.unique(np.round(directions / SAME_ANGLE) * SAME_ANGLE, axis=0, return_inverse=True)
    checks.check_size(len(pairs) * axis.size, where)
    index = pair.ravel() * axis.size + np.searchsorted(axis, np.round(wavelength, 9))
    if repairs.duplicates == "error" and np.unique(index).size < index.size:
        k = np.flatnonzero(np.bincount(index) > 1)[0]
        i, _, o, phi = pairs[k // axis.size]
        raise FileFormatError(
            f"{where}: the pair θ_i = {i:g}°, θ_o = {o:g}°, φ_o = {phi:g}° appears twice at {axis[k % axis.size]:g} "
            "nm; duplicates=mean or duplicates=first (--set) merges"
        )
    place, values, errors = checks.once(
        index, value[:, None], None if stderr is None else stderr[:, None], repairs.duplicates
    )

    def dense(v: Floats) -> Floats:
        full = np.full(len(pairs) * axis.size, np.nan)
        full[place] = v[:, 0]
        return full.reshape(len(pairs), axis.size)

    return from_spectra(
        pairs, axis, dense(values), None if errors is None else dense(errors), repairs, where=where, attrs=attrs
    )


def _upright(directions: Floats, where: str) -> tuple[Floats, NDArray[np.bool_], dict[str, str]]:
    """Directions with θ ≥ 0 and φ in 0 … 360°, which rows are above the horizon, and a note on those that are not."""
    if not len(directions):
        raise FileFormatError(f"{where} holds no rows of data")
    if not np.all(np.isfinite(directions)):
        raise FileFormatError(f"{where}: an angle is missing or not finite")
    directions = directions.copy()
    for theta, phi in ((0, 1), (2, 3)):
        directions[:, phi] = (directions[:, phi] + np.where(directions[:, theta] < 0, 180.0, 0.0)) % 360.0
        directions[:, theta] = np.abs(directions[:, theta])
    kept = directions[:, 2] < 90
    lost = int(np.sum(~kept & (directions[:, 2] <= 180)))
    if lost == 0 or not kept.any():
        return directions, np.ones(len(directions), bool), {}
    kept |= directions[:, 2] > 180  # no angle at all: refused later
    return directions[kept], kept, {"repairs": f"{lost} rows at the horizon or below left out"}


def from_spectra(
    directions: Floats,
    wavelength: Floats,
    spectra: Floats,
    stderr: Floats | None,
    repairs: checks.Repairs,
    *,
    where: str,
    attrs: Mapping[str, Any],
) -> xr.Dataset:
    """The same from one spectrum (n, n_λ) for each row of `directions` (n, 4)."""
    directions, kept, note = _upright(directions, where)
    spectra, stderr, attrs = spectra[kept], None if stderr is None else stderr[kept], {**attrs, **note}
    checks.check_values(directions[:, [0, 2]].ravel(), wavelength, where)
    checks.check_size(np.unique(directions[:, 0]).size * np.unique(directions[:, 2:], axis=0).shape[0], where)
    theta_i, phi_i, theta_o, phi_o = directions.T
    off = theta_i > SAME_ANGLE
    # light along the normal has no azimuth: the plane is that of the directions of reflection
    plane = float(phi_i[off][0]) if off.any() else float(phi_o[theta_o.argmax()]) % 180.0
    try:
        signed = [signed_angles(t, p, plane, where) for t, p in ((theta_i, phi_i), (theta_o, phi_o))]
    except FileFormatError:
        return _hemisphere(directions, wavelength, spectra, stderr, repairs, where, attrs)
    return dense_dataset(
        signed[0],
        signed[1],
        wavelength,
        spectra,
        stderr,
        plane=plane % 360.0,
        where=where,
        attrs=attrs,
        duplicates=repairs.duplicates,
    )


def _hemisphere(
    directions: Floats,
    wavelength: Floats,
    spectra: Floats,
    stderr: Floats | None,
    repairs: checks.Repairs,
    where: str,
    attrs: Mapping[str, Any],
) -> xr.Dataset:
    """Out of plane: dims (theta_i, cell, wavelength), the cells being all directions of reflection of the file."""
    theta_i, phi_i, theta_o, phi_o = directions.T
    planes = np.unique(np.round(phi_i[theta_i > SAME_ANGLE] % 360.0, 6))
    if planes.size > 1:
        raise FileFormatError(
            f"{where} has light from {planes.size} azimuths ({planes[0]:g}°, {planes[1]:g}° …): only isotropic "
            "samples, measured with one azimuth of incidence, are read"
        )
    axis_i, i = np.unique(np.round(theta_i / SAME_ANGLE) * SAME_ANGLE, return_inverse=True)
    phi_o = np.where(theta_o <= SAME_ANGLE, 0.0, np.round(phi_o % 360.0, 6) % 360.0)
    cells, c = np.unique(np.stack([theta_o, phi_o], axis=1), axis=0, return_inverse=True)
    checks.check_size(axis_i.size * len(cells) * wavelength.size, where)
    index = i.ravel() * len(cells) + c.ravel()
    if repairs.duplicates == "error" and np.unique(index).size < index.size:
        k, j = divmod(int(np.flatnonzero(np.bincount(index) > 1)[0]), len(cells))
        raise FileFormatError(
            f"{where}: θ_i = {axis_i[k]:g}°, θ_o = {cells[j, 0]:g}°, φ_o = {cells[j, 1]:g}° appears twice; "
            "duplicates=mean or duplicates=first (--set) merges"
        )
    place, values, errors = checks.once(index, spectra, stderr, repairs.duplicates)
    order = np.argsort(wavelength)

    def dense(v: Floats) -> Floats:
        full = np.full((axis_i.size * len(cells), wavelength.size), np.nan)
        full[place] = v[:, order]
        return full.reshape(axis_i.size, len(cells), wavelength.size)

    dims = ("theta_i", "cell", "wavelength")
    variables = {"brdf": (dims, dense(values))}
    if errors is not None:
        variables["brdf_stderr"] = (dims, dense(errors))
    return label(
        xr.Dataset(
            variables,
            coords={
                "theta_i": axis_i,
                "wavelength": wavelength[order],
                "phi_i": float(planes[0]) if planes.size else 0.0,
                "cell": np.arange(len(cells)),
                "theta_o": ("cell", cells[:, 0]),
                "phi_o": ("cell", cells[:, 1]),
                "solid_angle": ("cell", solid_angles(cells[:, 0], cells[:, 1])),
            },
            attrs={
                "method": "measured",
                "pairs_measured": int(place.size),
                "pairs_missing": int(axis_i.size * len(cells) - place.size),
                **{k: plain(v) for k, v in attrs.items()},
            },
        )
    )


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
