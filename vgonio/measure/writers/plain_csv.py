"""Plain CSV as `measure.readers.plain_csv` reads it: one row for each pair of directions and wavelength."""

from __future__ import annotations

import os
from pathlib import Path

import xarray as xr

from ...files import written_whole
from .rows import in_plane, rows_of


def write(dataset: xr.Dataset, path: str | os.PathLike[str], *, digits: int = 9) -> Path:
    """Write every finite value of a BRDF with its angles and wavelength; in plane the angles are signed.

    digits : significant digits of values; angles and wavelengths have ten. Raises InputError when nothing is finite.
    """
    flat = in_plane(dataset)
    names = ["theta_i_deg", "theta_o_deg"] if flat else ["theta_i_deg", "phi_i_deg", "theta_o_deg", "phi_o_deg"]
    names += ["wavelength_nm", "brdf_per_sr"]
    angles, wavelength, value, stderr = rows_of(dataset, signed=flat)
    if flat:
        angles = angles[:, [0, 2]]
    columns = [[f"{v:.10g}" for v in c] for c in (*angles.T, wavelength)]
    columns.append([f"{v:.{digits}g}" for v in value])
    if stderr is not None:
        names.append("brdf_stderr_per_sr")
        columns.append([f"{v:.{digits}g}" for v in stderr])
    lines = [",".join(names), *(",".join(row) for row in zip(*columns))]
    path = Path(path)
    with written_whole(path) as stream:
        stream.write(("\n".join(lines) + "\n").encode())
    return path
