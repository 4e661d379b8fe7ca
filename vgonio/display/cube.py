"""A 3-D look-up table (.cube, Adobe Cube LUT specification 1.0, 2013): RGB of an encoding to signals of a display."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, whole
from ..files import written_whole
from .colorimetry import decode, delta_e, denormalise
from .model import DisplayModel

Floats = NDArray[np.float64]
LEAST, MOST = 2, 129


def lut(model: DisplayModel, source: str = "sRGB", size: int = 33, gamut: str = "clip") -> Floats:
    """(size, size, size, 3) signals 0 … 1 of the display for RGB of an encoding, axes R, G, B over 0 … 1.

    source : "sRGB", "Adobe RGB" or "Display P3". White of the encoding becomes the display's white, its black the
    display's black. Raises InputError for an unknown encoding or a size outside 2 … 129.
    """
    v = np.linspace(0, 1, whole("size of the LUT", size, LEAST, MOST))
    grid = np.stack(np.meshgrid(v, v, v, indexing="ij"), axis=-1)
    return signals(model, grid, source, gamut)


def signals(model: DisplayModel, rgb: Floats, source: str, gamut: str = "clip") -> Floats:
    """(…, 3) signals of the display for RGB (…, 3) of an encoding, without a table."""
    white = model.xyz(np.ones(3))
    wanted = denormalise(decode(rgb, source), model.black_xyz, white)
    return model.backward(wanted, gamut).rgb


def lut_error(
    model: DisplayModel, table: Floats, source: str, gamut: str = "clip", colours: int = 4000, seed: int = 0
) -> dict[str, float]:
    """Mean and largest ΔE₀₀ of interpolating the table linearly, at random colours of the encoding, in the model."""
    from scipy.interpolate import RegularGridInterpolator

    rgb = np.random.default_rng(seed).random((colours, 3))
    axis = np.linspace(0, 1, table.shape[0])
    shown = model.xyz(np.clip(RegularGridInterpolator((axis,) * 3, table)(rgb), 0, 1))
    difference = delta_e(shown, model.xyz(signals(model, rgb, source, gamut)), model.white_xyz)
    return {"mean": float(difference.mean()), "max": float(difference.max())}


def write_cube(path: str | os.PathLike[str], table: Floats, title: str) -> Path:
    """Write a table (n, n, n, 3) with axes R, G, B; red varies fastest in the file. Returns the path.

    Raises InputError for another shape or values outside 0 … 1, FileFormatError where it cannot be written.
    """
    table = np.asarray(table, dtype=np.float64)
    n = table.shape[0]
    if table.shape != (n, n, n, 3) or not np.all((table >= 0) & (table <= 1)):
        raise InputError(f"LUT of shape {table.shape}: (n, n, n, 3) with values in 0 … 1 is needed")
    rows = table.transpose(2, 1, 0, 3).reshape(-1, 3)
    title = title.replace('"', "'").replace("\n", " ")
    head = f'TITLE "{title}"\nLUT_3D_SIZE {n}\nDOMAIN_MIN 0.0 0.0 0.0\nDOMAIN_MAX 1.0 1.0 1.0\n'
    path = Path(path)
    with written_whole(path) as stream:
        stream.write(head.encode())
        np.savetxt(stream, rows, fmt="%.7f")
    return path
