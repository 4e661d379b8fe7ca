"""AsciiMatrix (Dong et al. 2015): `AsciiMatrix columns rows [du dv]` in µm, then rows of heights in µm.

The first row of numbers is y = 0. Without du and dv in the first line the pitch has to be given.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from .common import Format, RawSurface, require_points, text_lines


def read(path: Path) -> RawSurface:
    """RawSurface from an AsciiMatrix file; FileFormatError when numbers are missing or left over."""
    lines = text_lines(path)
    columns, rows, pitch = _header(lines[0], path)
    require_points(rows, columns, path)
    try:
        numbers = np.array(" ".join(lines[1:]).split(), dtype=np.float64)
    except ValueError as e:
        raise FileFormatError(f"{path}: {str(e).splitlines()[0]}") from None
    if numbers.size != rows * columns:
        raise FileFormatError(f"{path}: {numbers.size} heights, {columns} × {rows} = {rows * columns} declared")
    return RawSurface(numbers.reshape(rows, columns), "um", pitch, "AsciiMatrix")


def _header(line: str, path: Path) -> tuple[int, int, tuple[float, float] | None]:
    words = line.split()
    try:
        columns, rows = int(words[1]), int(words[2])
        sizes = [float(word) for word in words[3:]]
    except (ValueError, IndexError):
        sizes = [math.nan]
        columns = rows = 0
    if words[0] != "AsciiMatrix" or len(sizes) not in (0, 2) or any(math.isnan(s) for s in sizes):
        raise FileFormatError(
            f"{path}: the first line is not 'AsciiMatrix columns rows [du dv]': {line.strip()[:60]!r}"
        )
    return columns, rows, (sizes[1], sizes[0]) if sizes else None


FORMAT = Format("AsciiMatrix", (".txt", ".asc", ".dat", ".am"), (b"AsciiMatrix",), read)
