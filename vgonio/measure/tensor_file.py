"""Tensor files, the container of RGL `.bsdf`: named arrays of numbers (Dupuy and Jakob 2018; Mitsuba's TensorFile).

12 bytes "tensor_file\\0", 2 bytes of version (1, 0), u32 number of fields; for each field u16 length of its name, the
name, u16 number of dimensions, u8 type, u64 offset of its data in the file, u64 for each dimension. Little-endian, rows
last.
"""

from __future__ import annotations

import math
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError
from ..files import bytes_of, written_whole

MAGIC = b"tensor_file\x00"
TYPES = {1: "<u1", 2: "<i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<u8", 8: "<i8", 9: "<f2", 10: "<f4", 11: "<f8"}
CODES = {np.dtype(name): code for code, name in TYPES.items()}
MOST_FIELDS, MOST_DIMENSIONS = 1000, 16
ALIGNMENT = 8


def read(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of a tensor file by name; nothing is allocated that the file does not hold.

    Raises FileFormatError for another kind of file, or fields that lie outside it.
    """
    content = bytes_of(path, "tensor file")
    if not content.startswith(MAGIC):
        raise FileFormatError(f"{path} is no tensor file (RGL .bsdf): it does not begin with 'tensor_file'")
    try:
        return _fields(content, path)
    except (struct.error, UnicodeDecodeError):
        raise FileFormatError(f"{path} is truncated or damaged: its list of fields ends early") from None


def _fields(content: bytes, path: Path) -> dict[str, NDArray[Any]]:
    major, _, count = struct.unpack_from("<BBI", content, len(MAGIC))
    if major != 1 or count > MOST_FIELDS:
        raise FileFormatError(
            f"{path}: version {major} with {count} fields; version 1 and at most {MOST_FIELDS} are read"
        )
    at, fields = len(MAGIC) + 6, {}
    for _ in range(count):
        (size,) = struct.unpack_from("<H", content, at)
        name = content[at + 2 : at + 2 + size].decode("utf-8")
        at += 2 + size
        dims, code, offset = struct.unpack_from("<HBQ", content, at)
        if dims > MOST_DIMENSIONS or code not in TYPES:
            raise FileFormatError(
                f"{path}: field {name[:40]!r} has {dims} dimensions of type {code}: the file is damaged"
            )
        shape = struct.unpack_from(f"<{dims}Q", content, at + 11)
        at += 11 + 8 * dims
        dtype = np.dtype(TYPES[code])
        total = math.prod(shape)
        if offset + total * dtype.itemsize > len(content):
            raise FileFormatError(
                f"{path}: field {name[:40]!r} of {total:.3g} values lies outside the file of {len(content)} bytes: "
                "it is truncated"
            )
        fields[name] = np.frombuffer(content, dtype, total, offset).reshape(shape)
    return fields


def write(path: str | os.PathLike[str], fields: dict[str, NDArray[Any]]) -> Path:
    """Write named arrays as a tensor file, whole or not at all; returns the path."""
    path = Path(path)
    head = MAGIC + struct.pack("<BBI", 1, 0, len(fields))
    size = len(head) + sum(2 + len(name.encode()) + 11 + 8 * a.ndim for name, a in fields.items())
    entries, data, offset = b"", [], size
    for name, array in fields.items():
        array = np.ascontiguousarray(array)
        array = array.astype(array.dtype.newbyteorder("<"), copy=False)
        gap = -offset % ALIGNMENT
        offset += gap
        entries += struct.pack("<H", len(name.encode())) + name.encode()
        entries += struct.pack(f"<HBQ{array.ndim}Q", array.ndim, CODES[array.dtype], offset, *array.shape)
        data += [b"\0" * gap, array.tobytes()]
        offset += array.nbytes
    with written_whole(path) as stream:
        stream.write(head + entries + b"".join(data))
    return path
