"""NIST's Mueller-matrix BRDF tables (Germer 2017), the in-plane part of the unpolarised BRDF.

One header line; λ in µm, θ_i, φ_i, θ_r, φ_r in degrees, f_r11 in sr⁻¹, then the 15 other Mueller elements over f_r11.
There θ_i is 0 or negative and φ_r = 0 is the mirror side: with positive θ_i the plane of incidence has the azimuth 180°
and the mirror side negative θ_o. ±0.001° stands for 0.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from ...errors import FileFormatError
from ...files import text_of
from .checks import Repairs, check_size, check_values, once
from .in_plane import dense_dataset
from .listed import from_rows

# reflected directions within this of φ_r = 0 or 180° count as in plane; the tables list these exactly
IN_PLANE_DEG = 0.01


def sniff(head: bytes) -> bool:
    return head.lstrip(b"\xef\xbb\xbf").lower().startswith(b"lambda,thetai,phi")


def read(path: Path, repairs: Repairs, *, hemisphere: bool = False) -> xr.Dataset:
    """The f_r11 of a NIST table, in plane, or all directions (`hemisphere`); see `measure.read`."""
    text = text_of(path, "NIST BRDF table")
    if not sniff(text[:64].encode()):
        raise FileFormatError(f"{path} is no NIST BRDF table: its header has to begin with lambda,thetai,phi")
    try:
        rows = np.loadtxt(text.splitlines(), delimiter=",", skiprows=1, usecols=range(6), ndmin=2)
    except (ValueError, IndexError) as e:
        raise FileFormatError(f"{path} is truncated or no NIST BRDF table: {e}") from None
    if rows.size == 0 or not np.all(np.isfinite(rows)):
        raise FileFormatError(f"{path} holds no rows, or a value that is not finite")
    if hemisphere:
        return _all_directions(path, rows, repairs)
    off = np.abs(rows[:, 4])
    inside = (np.minimum(off, np.abs(180 - off)) <= IN_PLANE_DEG) | (rows[:, 3] <= 0.001)
    plane = rows[inside]
    if not plane.size:
        raise FileFormatError(f"{path} holds no in-plane geometry (φ_r = 0 or 180°)")
    theta_i, theta_o = np.where(np.abs(plane[:, [1, 3]]) <= 0.001, 0.0, plane[:, [1, 3]]).T
    theta_o = np.where(np.abs(plane[:, 4]) < 90, -theta_o, theta_o) + 0.0
    return _assemble(path, np.abs(theta_i), theta_o, plane, len(rows), repairs.duplicates)


def _all_directions(path: Path, rows: np.ndarray, repairs: Repairs) -> xr.Dataset:
    nearly_zero = np.abs(rows[:, [1, 3]]) <= 0.001
    theta = np.where(nearly_zero, 0.0, np.abs(rows[:, [1, 3]]))
    # the light comes from negative θ_i, so from the azimuth 180°
    directions = np.stack([theta[:, 0], rows[:, 2] + 180.0, theta[:, 1], rows[:, 4]], axis=1)
    attrs = {"source": path.name}
    return from_rows(directions, rows[:, 0] * 1e3, rows[:, 5], None, repairs, where=str(path), attrs=attrs)


def _assemble(
    path: Path, theta_i: np.ndarray, theta_o: np.ndarray, rows: np.ndarray, total: int, duplicates: str
) -> xr.Dataset:
    wavelength = np.unique(np.round(rows[:, 0] * 1e3, 6))
    check_values(np.abs(np.concatenate([theta_i, theta_o])), wavelength, str(path))
    pairs, place = np.unique(np.stack([theta_i, theta_o], axis=1), axis=0, return_inverse=True)
    check_size(len(pairs) * wavelength.size, str(path))
    index = place.ravel() * wavelength.size + np.searchsorted(wavelength, np.round(rows[:, 0] * 1e3, 6))
    if duplicates == "error" and np.unique(index).size < index.size:
        k = int(np.flatnonzero(np.bincount(index) > 1)[0])
        i, o = pairs[k // wavelength.size]
        raise FileFormatError(
            f"{path}: the pair θ_i = {i:g}°, θ_o = {o:g}° appears twice at {wavelength[k % wavelength.size]:g} nm; "
            "duplicates=mean or duplicates=first (--set) merges"
        )
    kept, values, _ = once(index, rows[:, 5:6], None, duplicates)
    spectra = np.full(len(pairs) * wavelength.size, np.nan)
    spectra[kept] = values[:, 0]
    return dense_dataset(
        pairs[:, 0],
        pairs[:, 1],
        wavelength,
        spectra.reshape(len(pairs), wavelength.size),
        None,
        plane=180.0,
        where=str(path),
        attrs={"source": path.name, "comment": f"in-plane part: {len(rows)} of {total} rows"},
    )
