"""VGMS, the height field of the Rust tool of the same name: 68 bytes of header, then rows of float32, top row first.

Little-endian. The unit (m, cm, mm, µm, nm) holds for pitch and heights; compression is of the body only.
"""

from __future__ import annotations

import gzip
import struct
import zlib
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from ...errors import FileFormatError, InputError
from ...files import bytes_of
from ...units import to_um
from ..heightfield import Heightfield
from .common import Format, RawSurface, require_points

HEADER = struct.Struct("<4sII32sBBBxIIIff")
VERSION = 0x000100
UNITS = ("m", "cm", "mm", "um", "nm")
ENCODINGS = {"binary": 0x21, "ascii": 0x23}
COMPRESSIONS = {"none": 0, "zlib": 1, "gzip": 2}
# characters that one height takes at most in the ASCII encoding, separator included
_ASCII_BYTES = 64


def read(path: Path) -> RawSurface:
    """RawSurface from a VGMS file of any encoding and compression; FileFormatError where it is damaged."""
    data = bytes_of(path, "VGMS file")
    if len(data) < HEADER.size or data[:4] != b"VGMS":
        raise FileFormatError(f"{path} is not a VGMS file: {len(data)} bytes, beginning {data[:4]!r}")
    _, version, length, time, size, encoding, compression, unit, columns, rows, du, dv = HEADER.unpack_from(data)
    if version >> 16 or size != 4:
        raise FileFormatError(f"{path}: VGMS version {version:#08x}, {size} bytes a sample: version 0 with 4 is read")
    if length > len(data):
        raise FileFormatError(f"{path} is truncated: {len(data)} of {length} bytes")
    if unit >= len(UNITS):
        raise FileFormatError(f"{path}: unit code {unit}: 0 to {len(UNITS) - 1} are known")
    require_points(rows, columns, path)
    body = _decompressed(data[HEADER.size :], compression, rows * columns * _bytes(encoding, path), path)
    heights = _decoded(body, encoding, rows, columns, path)[::-1]
    factor = to_um(UNITS[unit])
    when = time.split(b"\0")[0].decode("ascii", "replace").strip()
    return RawSurface(
        np.ascontiguousarray(heights),
        UNITS[unit],
        (_clean(dv) * factor, _clean(du) * factor),
        "VGMS",
        meta={"time": when} if when else {},
    )


def encode(
    surface: Heightfield, encoding: str = "binary", compression: str = "none", unit: str = "um", time: str | None = None
) -> bytes:
    """The bytes of a VGMS file: heights as float32; periodic and interpolation have no place in it.

    InputError for an unknown encoding, compression or unit.
    """
    for value, known in ((encoding, ENCODINGS), (compression, COMPRESSIONS), (unit, UNITS)):
        if value not in known:
            raise InputError(f"VGMS has no {value!r}: known are {', '.join(known)}")
    factor = to_um(unit)
    z = np.ascontiguousarray(surface.z[::-1] / factor, dtype="<f4")
    body = z.tobytes()
    if encoding == "ascii":
        body = "\n".join(" ".join(f"{v:.9g}" for v in row) for row in z).encode()
    if compression != "none":
        body = zlib.compress(body, 6) if compression == "zlib" else gzip.compress(body, 6, mtime=0)
    when = time or datetime.now(UTC).isoformat(timespec="seconds")
    header = HEADER.pack(
        b"VGMS",
        VERSION,
        HEADER.size + len(body),
        when.encode("ascii")[:32],
        4,
        ENCODINGS[encoding],
        COMPRESSIONS[compression],
        UNITS.index(unit),
        surface.shape[1],
        surface.shape[0],
        surface.dx / factor,
        surface.dy / factor,
    )
    return header + body


def _bytes(encoding: int, path: Path) -> int:
    if encoding not in ENCODINGS.values():
        raise FileFormatError(f"{path}: encoding {encoding:#04x}: 0x21 (binary) and 0x23 (ASCII) are known")
    return 4 if encoding == ENCODINGS["binary"] else _ASCII_BYTES


def _decompressed(body: bytes, compression: int, at_most: int, path: Path) -> bytes:
    """The body, never more than `at_most` bytes of it."""
    if compression == COMPRESSIONS["none"]:
        return body
    if compression not in COMPRESSIONS.values():
        raise FileFormatError(f"{path}: compression code {compression}: 0 none, 1 zlib and 2 gzip are known")
    try:
        stream = zlib.decompressobj(wbits=47)  # zlib or gzip header, whichever is there
        out = stream.decompress(body, at_most)
    except zlib.error as e:
        raise FileFormatError(f"{path}: the compressed heights are damaged ({e})") from None
    return out


def _decoded(body: bytes, encoding: int, rows: int, columns: int, path: Path) -> np.ndarray:
    if encoding == ENCODINGS["binary"]:
        if len(body) < 4 * rows * columns:
            raise FileFormatError(f"{path} is truncated: {len(body)} of {4 * rows * columns} bytes of heights")
        return np.frombuffer(body, "<f4", rows * columns).reshape(rows, columns).astype(np.float64)
    try:
        values = np.array(body.decode("ascii").split(), dtype=np.float64)
    except ValueError:
        raise FileFormatError(f"{path}: the ASCII heights hold something that is no number") from None
    if values.size != rows * columns:
        raise FileFormatError(f"{path}: {values.size} of {rows * columns} heights")
    return values.reshape(rows, columns)


def _clean(value: float) -> float:
    """A float32 as the decimal number that was meant (0.625, not 0.62500001)."""
    return float(f"{value:.7g}")


FORMAT = Format("VGMS", (".vgms",), (b"VGMS",), read)
