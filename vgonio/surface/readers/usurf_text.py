"""µsurf text (NanoFocus confocal microscopes): `DATA`, a line of x, then y and heights; µm throughout.

Two tabs in a row mark a missing point.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from .common import Format, RawSurface, require_points, text_lines, uniform_pitch


def read(path: Path) -> RawSurface:
    """RawSurface from a µsurf text file; FileFormatError for rows of different length or uneven coordinates."""
    lines = text_lines(path)
    if lines[0].strip() != "DATA" or len(lines) < 3:
        raise FileFormatError(f"{path} is not a complete µsurf text file: DATA, a line of x and rows of y and heights")
    x = _numbers(lines[1].split(), 2, path)
    require_points(len(lines) - 2, x.size, path)
    rows = [_row(line, x.size, number, path) for number, line in enumerate(lines[2:], start=3)]
    y = np.array([row[0] for row in rows])
    heights = np.stack([row[1:] for row in rows])
    dx, dy = _pitch(x, "x", path), _pitch(y, "y", path)
    if dx is not None and dx < 0:
        heights = heights[:, ::-1]
    if dy is not None and dy < 0:
        heights = heights[::-1]
    dx, dy = (abs(p) if p else None for p in (dx, dy))
    pitch = None if dx is None and dy is None else (dy or dx, dx or dy)
    return RawSurface(np.ascontiguousarray(heights), "um", pitch, "µsurf text")  # type: ignore[arg-type]


def _row(line: str, columns: int, number: int, path: Path) -> np.ndarray:
    """(1 + columns,) y and heights of one line, NaN where missing."""
    fields = line.rstrip("\r\n").split("\t") if "\t" in line else line.split()
    if len(fields) == columns + 2 and not fields[-1].strip():
        fields.pop()  # a tab at the end of the line
    if len(fields) != columns + 1:
        raise FileFormatError(f"{path}, line {number}: {len(fields) - 1} heights, {columns} expected: truncated?")
    return _numbers([field.strip() or "nan" for field in fields], number, path)


def _numbers(fields: list[str], number: int, path: Path) -> np.ndarray:
    try:
        return np.array(fields, dtype=np.float64)
    except ValueError as e:
        raise FileFormatError(f"{path}, line {number}: {str(e).splitlines()[0]}") from None


def _pitch(coordinates: np.ndarray, axis: str, path: Path) -> float | None:
    return uniform_pitch(coordinates, axis, path) if coordinates.size > 1 else None


FORMAT = Format("µsurf text", (".txt", ".usurf", ".asc", ".dat"), (b"DATA\n", b"DATA\r", b"DATA\t", b"DATA "), read)
