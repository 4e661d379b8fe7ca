"""What every reader returns, and what keeps a broken file from doing harm."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import FileFormatError
from ...files import text_of

# a header may declare anything: no array is made for more points than this (10,000 × 10,000 is 0.8 GB of float64)
MAX_POINTS = 10**8


@dataclass(frozen=True)
class RawSurface:
    """What a file says: heights as they stand in it and the unit they are in.

    heights : (ny, nx) float64 in `height_unit` (None where the file does not say), NaN where missing, y growing
        with the row
    pitch_um : (dy, dx) in µm, or None where the file does not say
    """

    heights: NDArray[np.float64]
    height_unit: str | None
    pitch_um: tuple[float, float] | None
    format: str
    notes: tuple[str, ...] = ()
    history: tuple[str, ...] = ()
    periodic: bool = False
    interpolation: str = "cubic"
    name: str = ""
    meta: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Format:
    """A file format: its suffixes, the bytes it starts with (empty where it has none) and its reader."""

    name: str
    suffixes: tuple[str, ...]
    magic: tuple[bytes, ...]
    read: Callable[[Path], RawSurface]


def require_points(rows: int, columns: int, path: Path) -> None:
    """FileFormatError for a shape that cannot be a surface or would not fit the memory."""
    if rows < 1 or columns < 1 or rows * columns < 2:
        raise FileFormatError(f"{path}: the file declares {columns} × {rows} points: that is no surface")
    if rows * columns > MAX_POINTS:
        raise FileFormatError(
            f"{path}: the file declares {columns} × {rows} points, more than the {MAX_POINTS:.0e} read at once: "
            "it is damaged, or has to be cropped in the instrument's software"
        )


def uniform_pitch(coordinates: NDArray[np.float64], axis: str, path: Path) -> float:
    """Spacing of an equidistant axis (n ≥ 2); FileFormatError where it is not one to 1 % of a step."""
    steps = np.diff(coordinates)
    pitch = float((coordinates[-1] - coordinates[0]) / (coordinates.size - 1))
    if not np.isfinite(pitch) or pitch == 0 or np.abs(steps - pitch).max() > 0.01 * abs(pitch):
        raise FileFormatError(f"{path}: the {axis} coordinates are not equally spaced: only regular grids are read")
    return pitch


def text_lines(path: Path) -> list[str]:
    """Lines of a text file without empty ones at the end; FileFormatError where it is no text."""
    lines = text_of(path, "surface as text").splitlines()
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        raise FileFormatError(f"{path} is empty")
    return lines
