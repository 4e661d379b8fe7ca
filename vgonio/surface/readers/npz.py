"""Our own format: a NumPy `.npz` archive.

z : (ny, nx) float64, float32 or float16 in µm, or int16 with `scale_um` and `offset_um` (−32768 = missing point)
pitch_um : number or (dy, dx);  periodic : bool;  interpolation, name : text;  history : texts;  meta : JSON text

Only `z` is required. Nothing is unpickled, and no array is allocated beyond what the file really holds.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

import numpy as np

from ...errors import FileFormatError
from ..interpolant import KINDS
from .common import Format, RawSurface, require_points

MISSING = -32768
_SMALL = ("scale_um", "offset_um", "pitch_um", "periodic", "interpolation", "name", "history", "meta")
_SMALL_BYTES = 4_000_000
Check = Callable[[str, tuple[int, ...], np.dtype, Path], None]


def read(path: Path) -> RawSurface:
    """RawSurface from a `.npz` of ours; FileFormatError where it is none."""
    try:
        with zipfile.ZipFile(path) as archive:
            members = set(archive.namelist())
            if "z.npy" not in members:
                raise FileFormatError(f"{path}: no array 'z' of heights in it: not a height field of vgonio")
            z = _array(archive, "z", path)
            facts = {key: _array(archive, key, path) for key in _SMALL if f"{key}.npy" in members}
    except (OSError, EOFError, ValueError, NotImplementedError, RuntimeError, zipfile.BadZipFile, zlib.error) as e:
        if isinstance(e, FileFormatError):
            raise
        raise FileFormatError(f"{path} is not a complete .npz archive ({_line(e)})") from None
    return _surface(z, facts, path)


def _surface(z: np.ndarray, facts: dict[str, np.ndarray], path: Path) -> RawSurface:
    try:
        pitch = np.broadcast_to(np.asarray(facts["pitch_um"], float), (2,)) if "pitch_um" in facts else None
        heights = _heights(z, facts)
        interpolation = str(facts.get("interpolation", "cubic"))
        meta = json.loads(str(facts.get("meta", "{}")))
    except (TypeError, ValueError) as e:
        raise FileFormatError(f"{path}: an entry beside the heights cannot be read ({_line(e)})") from None
    if interpolation not in KINDS or not isinstance(meta, dict):
        raise FileFormatError(f"{path}: interpolation {interpolation!r} or its 'meta' is unknown to this vgonio")
    return RawSurface(
        heights,
        "um",
        None if pitch is None else (float(pitch[0]), float(pitch[1])),
        "npz",
        history=tuple(str(step) for step in np.atleast_1d(facts.get("history", np.array([], str)))),
        periodic=bool(np.all(facts.get("periodic", False))),
        interpolation=interpolation,
        name=str(facts.get("name", "")),
        meta=meta,
    )


def _heights(z: np.ndarray, facts: dict[str, np.ndarray]) -> np.ndarray:
    if z.dtype.kind == "f":
        return z.astype(np.float64)
    scale, offset = (float(facts.get(key, default)) for key, default in (("scale_um", 1.0), ("offset_um", 0.0)))
    heights = z * scale + offset
    heights[z == MISSING] = np.nan
    return heights


def _array(archive: zipfile.ZipFile, key: str, path: Path) -> np.ndarray:
    """One array, its declared shape checked against what the archive really holds before it is made."""
    with archive.open(f"{key}.npy") as member:
        return array_of(member, key, path, _check)


def array_of(stream: IO[bytes], key: str, path: Path, check: Check) -> np.ndarray:
    """The array of a `.npy` stream; check(key, shape, dtype, path) refuses before bytes are read. Never unpickles."""
    version = np.lib.format.read_magic(stream)
    read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    try:
        shape, fortran, dtype = read_header(stream)
    except Exception as e:  # the header is parsed as Python, and a damaged one fails in as many ways
        raise FileFormatError(f"{path}: the header of {key!r} is damaged ({_line(e)[:200]!r})") from None
    check(key, shape, dtype, path)
    size = int(np.prod(shape, dtype=np.int64)) * dtype.itemsize
    body = stream.read(size)
    if len(body) != size:
        raise FileFormatError(f"{path}: array {key!r} is truncated: {len(body)} of {size} bytes")
    return np.frombuffer(body, dtype=dtype).reshape(shape, order="F" if fortran else "C")


def _check(key: str, shape: tuple[int, ...], dtype: np.dtype, path: Path) -> None:
    if key == "z":
        if len(shape) != 2 or not (dtype.kind == "f" or dtype == np.int16):
            raise FileFormatError(f"{path}: 'z' is {dtype} of shape {shape}: two-dimensional floats or int16 are read")
        require_points(*shape, path)
    elif dtype.kind not in "fiubU" or int(np.prod(shape, dtype=np.int64)) * dtype.itemsize > _SMALL_BYTES:
        raise FileFormatError(f"{path}: entry {key!r} is {dtype} of shape {shape}: that is not ours")


def _line(e: Exception) -> str:
    text: Any = str(e)
    return text.splitlines()[0] if text else type(e).__name__


FORMAT = Format("vgonio npz", (".npz",), (b"PK\x03\x04",), read)
