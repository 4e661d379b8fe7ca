"""From rows of a table (directions, wavelength, value) to the dataset: in plane where it can be, else a hemisphere."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...errors import FileFormatError
from . import checks
from .in_plane import SAME_ANGLE, dense_dataset, signed_angles
from .out_of_plane import cell_dataset

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
    told: dict[str, Any] = {"where": where, "attrs": attrs, "duplicates": repairs.duplicates}
    try:
        signed = [signed_angles(t, p, plane, where) for t, p in ((theta_i, phi_i), (theta_o, phi_o))]
    except FileFormatError:
        return cell_dataset(directions, wavelength, spectra, stderr, **told)
    return dense_dataset(signed[0], signed[1], wavelength, spectra, stderr, plane=plane % 360.0, **told)
