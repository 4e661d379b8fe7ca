"""A look through a MATLAB file (versions 5 to 7) before SciPy reads it.

SciPy looks a data type up in a table by the number that stands in the file, and a number beyond the table ends the
process. So every element is visited, its type and its size compared with what there can be.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

from ...errors import FileFormatError

HEAD = 128
# miINT8 … miUTF32; 8, 10 and 11 are not in use
TYPES = {*range(1, 8), 9, *range(12, 19)}
MATRIX, COMPRESSED = 14, 15
MOST_BYTES = 2_000_000_000
MOST_DEPTH = 20


def require_sound(path: Path) -> None:
    """FileFormatError for a MATLAB file whose elements have unknown types or do not fit into each other."""
    content = path.read_bytes()
    if content[126:128] not in (b"IM", b"MI"):
        return  # of version 4, which has no elements, or none
    order = "<" if content[126:128] == b"IM" else ">"
    _elements(memoryview(content)[HEAD:], order, path, 0)


def _elements(data: memoryview, order: str, path: Path, depth: int) -> None:
    """Elements one after another: a tag of type and size, or both in half the space, then bytes filled up to eight."""
    at = 0
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        begin, length = at + 8, size
        if kind >> 16:
            kind, size, begin, length = kind & 0xFFFF, kind >> 16, at + 4, 4
        if kind not in TYPES or size > length or begin + size > len(data) or depth > MOST_DEPTH:
            raise FileFormatError(f"{path}: the MATLAB file is damaged (an element of type {kind} and {size} bytes)")
        if kind == COMPRESSED:
            _elements(_decompressed(data[begin : begin + size], path), order, path, depth + 1)
        elif kind == MATRIX:
            _elements(data[begin : begin + size], order, path, depth + 1)
        at = begin + length if kind == COMPRESSED else begin + length + (-(begin + length) % 8)


def _decompressed(data: memoryview, path: Path) -> memoryview:
    try:
        stream = zlib.decompressobj()
        out = stream.decompress(data, MOST_BYTES)
    except zlib.error as e:
        raise FileFormatError(f"{path}: the MATLAB file is damaged ({e})") from None
    return memoryview(out)
