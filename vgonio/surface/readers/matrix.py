"""A user's own array of heights: text with a row of numbers a line, or NumPy's `.npy`; pitch and unit have to be given.

Row by row as `np.savetxt` and `np.save` write z[iy, ix]: the first row is y = 0. Text may be separated by commas,
semicolons (then with a comma or a point in the numbers), tabs or blanks; an empty cell is a missing point.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from .common import Format, RawSurface, require_points, text_lines
from .npz import array_of

SUFFIXES = (".csv", ".txt", ".asc", ".dat")
FEWEST_COLUMNS = 4  # two and three are the coordinates and heights of points
_LONGEST_LINE = 4_000_000  # bytes looked at to tell whether a file is one


def is_matrix(path: Path) -> bool:
    """Whether the first line that is no comment holds numbers only, more than three, in a file of text.

    Comments with a colon are facts that another program wrote: its reader is asked.
    """
    if path.suffix.lower() not in SUFFIXES:
        return False
    with open(path, "rb") as stream:
        for _ in range(100):
            line = stream.readline(_LONGEST_LINE).decode("utf-8-sig", "replace").strip()
            if line.startswith("#") and ":" not in line:
                continue
            try:
                return len(_numbers(line, _separator(line))) >= FEWEST_COLUMNS
            except ValueError:
                return False
    return False


def _separator(line: str) -> str | None:
    return next((s for s in ";,\t" if s in line), None)


def _plain(line: str, separator: str | None) -> str:
    """The line with points in its numbers and nan in its empty cells, separated by commas or blanks."""
    if separator is None:
        return line
    cells = (cell.strip() or "nan" for cell in line.split(separator))
    return ",".join(cell.replace(",", ".") for cell in cells) if separator == ";" else ",".join(cells)


def _numbers(line: str, separator: str | None) -> list[float]:
    return [float(cell) for cell in _plain(line, separator).split("," if separator else None)]


def read(path: Path) -> RawSurface:
    """RawSurface from a matrix of numbers as text; FileFormatError for rows of different length or other words."""
    lines = [line for line in text_lines(path) if line.strip() and not line.startswith("#")]
    separator = _separator(lines[0]) if lines else None
    try:
        require_points(len(lines), len(_numbers(lines[0], separator)) if lines else 0, path)
        rows = (_plain(line, separator) for line in lines)
        heights = np.loadtxt(rows, delimiter="," if separator else None, comments=None, ndmin=2)
    except FileFormatError:
        raise
    except ValueError as e:
        raise FileFormatError(f"{path}: not a matrix of numbers ({str(e).splitlines()[0].split(';')[0]})") from None
    return RawSurface(heights, None, None, "matrix")


def read_npy(path: Path) -> RawSurface:
    """RawSurface from a `.npy` of a two-dimensional array of real numbers; nothing is unpickled."""
    try:
        with open(path, "rb") as stream:
            heights = array_of(stream, "the array", path, _check)
    except (OSError, EOFError, ValueError, RuntimeError) as e:
        if isinstance(e, FileFormatError):
            raise
        raise FileFormatError(f"{path} is not a complete .npy file ({(str(e) or type(e).__name__)[:200]!r})") from None
    return RawSurface(heights.astype(np.float64), None, None, "npy")


def _check(what: str, shape: tuple[int, ...], dtype: np.dtype, path: Path) -> None:
    if len(shape) != 2 or dtype.kind not in "fiu":
        raise FileFormatError(f"{path}: {what} is {dtype} of shape {shape}: two-dimensional real numbers are read")
    require_points(*shape, path)


FORMAT = Format("matrix of numbers", SUFFIXES, (), read)
NPY = Format("NumPy array", (".npy",), (b"\x93NUMPY",), read_npy)
