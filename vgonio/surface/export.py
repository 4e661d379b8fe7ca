"""Height fields to files: `.npz` (ours), `.x3p`, `.stl`, `.csv` and `.vgms`; each written whole or not at all."""

from __future__ import annotations

import inspect
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ..errors import InputError, nearest
from ..files import written_whole
from .heightfield import Heightfield
from .readers import csv_grid, vgms
from .readers.npz import MISSING
from .x3p import x3p


def write(surface: Heightfield, path: str | os.PathLike[str], **options: Any) -> Path:
    """Write `surface` in the format of the suffix of `path`; returns the path.

    .npz   exact (float64), or with int16=True in 65,000 steps over its range (scale_um sets the step)
    .x3p   ISO 25178-72, heights as 64-bit floats in metres; comment="…" is kept with them
    .stl   binary, triangles between the samples as they stand, in µm; nothing where points are missing
    .csv   rows of heights in µm below comments with pitch and unit
    .vgms  float32; encoding="binary" | "ascii", compression="none" | "zlib" | "gzip", unit="um" | "nm" | …

    Only .npz keeps everything; x3p, STL and VGMS have no place for periodicity and interpolation. Raises InputError for
    an unknown suffix or option, FileFormatError where the file cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in WRITERS:
        raise InputError(f"{path}: no surface is written with the suffix {suffix!r}: {nearest(suffix, WRITERS)}")
    writer = WRITERS[suffix]
    allowed = list(inspect.signature(writer).parameters)[2:]
    for key in options:
        if key not in allowed:
            raise InputError(f"{suffix} files have no option {key!r}: {nearest(key, allowed)}")
    with written_whole(path) as stream:
        writer(surface, stream, **options)
    return path


def _npz(surface: Heightfield, stream: BinaryIO, int16: bool = False, scale_um: float | None = None) -> None:
    """See `readers.npz`; with int16 the heights are multiples of `scale_um` about the middle of their range."""
    heights: dict[str, Any] = {"z": surface.z}
    if int16 or scale_um is not None:
        low, high = float(np.nanmin(surface.z)), float(np.nanmax(surface.z))
        step = max((high - low) / 65_000, np.finfo(float).tiny) if scale_um is None else float(scale_um)
        if not step > 0 or (high - low) / step > 65_530:
            raise InputError(f"scale_um = {step:g} µm: 16 bits hold {high - low:g} µm in steps of 1/65,000 or coarser")
        middle = (low + high) / 2
        counts = np.rint((surface.z - middle) / step)
        z = np.where(np.isnan(counts), MISSING, counts).astype(np.int16)
        heights = {"z": z, "scale_um": np.float64(step), "offset_um": np.float64(middle)}
    np.savez_compressed(
        stream,
        **heights,
        pitch_um=np.array(surface.pitch_um),
        periodic=np.bool_(surface.periodic),
        interpolation=np.array(surface.interpolation),
        name=np.array(surface.name),
        history=np.array(surface.history, dtype=np.str_),
        meta=np.array(json.dumps(surface.meta, default=str)),
    )


def _csv(surface: Heightfield, stream: BinaryIO) -> None:
    ny, nx = surface.shape
    header = (
        csv_grid.MAGIC,
        f"# name = {' '.join(surface.name.split())}",
        f"# {nx} columns (x) and {ny} rows (y, growing downwards): heights in um at the cell centres; empty = missing",
        f"# pitch_x_um = {surface.dx!r}",
        f"# pitch_y_um = {surface.dy!r}",
        f"# periodic = {'yes' if surface.periodic else 'no'}",
        f"# interpolation = {surface.interpolation}",
    )
    stream.write(("\n".join(header) + "\n").encode())
    for row in surface.z:
        # repr of a float is the shortest text that reads back to the same number
        stream.write((",".join("" if np.isnan(v) else repr(float(v)) for v in row) + "\n").encode())


def _vgms(
    surface: Heightfield, stream: BinaryIO, encoding: str = "binary", compression: str = "none", unit: str = "um"
) -> None:
    stream.write(vgms.encode(surface, encoding, compression, unit))


_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def _stl(surface: Heightfield, stream: BinaryIO) -> None:
    """Two triangles per cell of four samples, split along the same diagonal, normals up; row by row to save memory."""
    ny, nx = surface.shape
    if min(ny, nx) < 2:
        raise InputError(f"an STL file needs at least 2 × 2 samples, the surface has {nx} × {ny}")
    valid = np.isfinite(surface.z)
    pairs = valid[:-1, :-1] & valid[1:, 1:]
    count = int((pairs & valid[:-1, 1:]).sum() + (pairs & valid[1:, :-1]).sum())
    stream.write(b"vgonio surface, um".ljust(80) + np.uint32(count).tobytes())
    x = np.broadcast_to(surface.x, (2, nx))
    for iy in range(ny - 1):
        y = np.broadcast_to(surface.y[iy : iy + 2, None], (2, nx))
        corner = np.stack([x, y, surface.z[iy : iy + 2]], axis=-1)
        a, b, c, d = corner[0, :-1], corner[0, 1:], corner[1, 1:], corner[1, :-1]
        faces = np.stack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)], axis=1).reshape(-1, 3, 3)
        faces = faces[np.isfinite(faces).all(axis=(1, 2))]
        normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
        out = np.zeros(len(faces), _TRIANGLE)
        out["normal"] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        out["corners"] = faces
        stream.write(out.tobytes())


WRITERS: dict[str, Callable[..., None]] = {".npz": _npz, ".x3p": x3p, ".stl": _stl, ".csv": _csv, ".vgms": _vgms}
