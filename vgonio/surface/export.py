"""Height fields to files: `.npz` (ours), `.x3p`, `.stl`, `.csv` and `.vgms`; each written whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ..errors import FileFormatError, InputError, nearest
from .heightfield import Heightfield
from .readers.npz import MISSING


def write(surface: Heightfield, path: str | os.PathLike[str], **options: Any) -> Path:
    """Write `surface` in the format of the suffix of `path`; returns the path.

    .npz  exact (float64), or with `int16=True` to 1/65,000 of the height range (`scale_um` sets the step)
    .x3p  ISO 25178-72, heights as 64-bit floats
    .stl  binary, triangles between the samples as they stand, in µm
    .csv  rows of heights in µm below a header of comments
    .vgms see FORMATS; options `encoding`, `compression`, `unit`

    Raises InputError for an unknown suffix or missing points where the format has none, FileFormatError where the file
    cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in WRITERS:
        raise InputError(f"cannot write {path.suffix or 'a file without suffix'!r} surfaces: {nearest(path.suffix, WRITERS)}")
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with open(temporary, "wb") as stream:
            WRITERS[path.suffix.lower()](surface, stream, **options)
        os.replace(temporary, path)
    except OSError as e:
        raise FileFormatError(f"cannot write {path}: {e.strerror or e}") from None
    finally:
        temporary.unlink(missing_ok=True)
    return path


def npz(surface: Heightfield, stream: BinaryIO, int16: bool = False, scale_um: float | None = None) -> None:
    """Our format, see `readers.npz`; with int16 the heights are multiples of `scale_um` around the middle height."""
    heights: dict[str, Any] = {"z": surface.z}
    if int16 or scale_um is not None:
        low, high = np.nanmin(surface.z), np.nanmax(surface.z)
        step = scale_um or max((high - low) / 65_000, np.finfo(float).tiny)
        if (high - low) / step > 65_534:
            raise InputError(f"scale_um = {step:g} µm is too fine for heights over {high - low:g} µm in 16 bits")
        counts = np.rint((surface.z - (low + high) / 2) / step)
        z = np.where(np.isnan(counts), MISSING, counts).astype(np.int16)
        heights = {"z": z, "scale_um": np.float64(step), "offset_um": np.float64((low + high) / 2)}
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


WRITERS: dict[str, Callable[..., None]] = {".npz": npz}
