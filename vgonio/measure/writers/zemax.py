"""Zemax tabular BSDF of any result, one wavelength a file; layout (Rykowski 2008) in `measure.readers.zemax`."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ...directions import angle_list, unit_vectors
from ...errors import InputError
from ...files import written_whole
from ...units import radians
from ..isotropic import IsotropicBrdf, isotropic
from ..readers.zemax import from_mirror

Floats = NDArray[np.float64]
AZIMUTH_DEG = tuple(range(0, 181, 10))
RADIAL_DEG = (0, 0.5, 1, 1.5, 2, 3, 4, 5, 6, 8, *range(10, 181, 5))


def write(
    dataset: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    fill: str | IsotropicBrdf | None = None,
    wavelength_nm: float | None = None,
    theta_i_deg: ArrayLike | None = None,
    azimuth_deg: ArrayLike = AZIMUTH_DEG,
    radial_deg: ArrayLike = RADIAL_DEG,
) -> Path:
    """Write the isotropic BRDF of a dataset at one wavelength, PlaneSymmetrical; below the horizon it is 0.

    fill : for in-plane data, see `measure.isotropic.isotropic`;  wavelength_nm : one of the dataset's (within 0.5 nm),
    to be given where it has several;  theta_i_deg : by default the dataset's;  azimuth_deg, radial_deg : about the
    mirror direction. TIS is the share of the incident power that the table scatters.
    Raises InputError for in-plane data without `fill`, or a wavelength that is not there.
    """
    brdf = isotropic(dataset, fill)
    k = _wavelength(brdf.wavelength, wavelength_nm)
    theta_i = np.abs(dataset["theta_i"].values) if theta_i_deg is None else angle_list(theta_i_deg, "theta_i_deg")
    theta_i = np.unique(np.abs(theta_i))
    azimuth, radial = (np.unique(np.asarray(a, float)) for a in (azimuth_deg, radial_deg))
    if azimuth[0] < 0 or azimuth[-1] > 180 or radial[0] < 0 or radial[-1] > 180 or min(azimuth.size, radial.size) < 2:
        raise InputError("azimuth_deg and radial_deg: two angles and more within 0 … 180°")
    head = [
        "# written by vgonio: " + brdf.note,
        f"# Wavelength_nm {brdf.wavelength[k]:.10g}",
        "Source  Measured",
        "Symmetry  PlaneSymmetrical",
        "SpectralContent  Monochrome",
        "ScatterType  BRDF",
        "SampleRotation  1",
        "0",
    ]
    for name, axis in (("AngleOfIncidence", theta_i), ("ScatterAzimuth", azimuth), ("ScatterRadial", radial)):
        head += [f"{name}  {axis.size}", "\t".join(f"{v:.6g}" for v in axis)]
    lines = [*head, "", "Monochrome", "DataBegin"]
    for t in theta_i:
        values = _table(brdf, k, float(radians(t)), radians(azimuth), radians(radial))
        lines.append(f"TIS {_scattered(values, float(radians(t)), radians(azimuth), radians(radial)):.6g}")
        lines += ["\t".join(f"{v:.6E}" for v in row) for row in values]
    path = Path(path)
    with written_whole(path) as stream:
        stream.write(("\n".join([*lines, "DataEnd"]) + "\n").encode())
    return path


def _wavelength(wavelength: Floats, asked: float | None) -> int:
    if asked is None and wavelength.size == 1:
        return 0
    k = int(np.abs(wavelength - (np.nan if asked is None else float(asked))).argmin())
    if asked is None or not abs(wavelength[k] - float(asked)) <= 0.5:
        listed = ", ".join(f"{w:g}" for w in wavelength[:20])
        raise InputError(f"a Zemax file holds one wavelength: wavelength_nm = {asked} is none of {listed} nm")
    return k


def _table(brdf: IsotropicBrdf, k: int, theta_i: float, azimuth: Floats, radial: Floats) -> Floats:
    """(azimuth, radial) sr⁻¹, 0 below the horizon."""
    a, r = (v.ravel() for v in np.meshgrid(azimuth, radial, indexing="ij"))
    wo = from_mirror(theta_i, a, r)
    above = wo[:, 2] > 0
    values = np.zeros(len(wo))
    wi = np.tile(unit_vectors(min(theta_i, np.pi / 2 - 1e-6)), (int(above.sum()), 1))
    values[above] = brdf(wi, wo[above])[:, k]
    if not np.all(np.isfinite(values)):
        raise InputError("the BRDF is not known in all directions, as a Zemax file needs it: read it on a hemisphere")
    return values.reshape(azimuth.size, radial.size)


def _scattered(values: Floats, theta_i: float, azimuth: Floats, radial: Floats) -> float:
    """∫ f cos θ_o dω of the table, both halves: midpoints of its patches."""
    a, r = ((x[1:] + x[:-1]) / 2 for x in (azimuth, radial))
    grid = np.meshgrid(a, r, indexing="ij")
    cos = np.maximum(from_mirror(theta_i, grid[0].ravel(), grid[1].ravel())[:, 2], 0).reshape(grid[0].shape)
    middle = (values[1:, 1:] + values[1:, :-1] + values[:-1, 1:] + values[:-1, :-1]) / 4
    area = np.diff(azimuth)[:, None] * -np.diff(np.cos(radial))[None, :]
    return float(2 * np.sum(middle * cos * area))
