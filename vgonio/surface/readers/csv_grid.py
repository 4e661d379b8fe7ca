"""The CSV that `surface.write` makes: comments with pitch and unit, then rows of heights in µm, y growing downwards."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from .common import Format, RawSurface, require_points, text_lines

MAGIC = "# vgonio surface"


def read(path: Path) -> RawSurface:
    """RawSurface from a CSV of ours; FileFormatError for rows of different length."""
    lines = text_lines(path)
    comments = [line[1:].strip() for line in lines if line.startswith("#")]
    facts = dict(c.split(" = ", 1) for c in comments if " = " in c)
    rows = [line.split(",") for line in lines if not line.startswith("#")]
    if not rows or len({len(row) for row in rows}) != 1:
        raise FileFormatError(f"{path}: no rows of heights, or rows of different length: truncated?")
    require_points(len(rows), len(rows[0]), path)
    try:
        heights = np.array([[cell.strip() or "nan" for cell in row] for row in rows], dtype=np.float64)
        pitch = float(facts["pitch_y_um"]), float(facts["pitch_x_um"])
    except (KeyError, ValueError) as e:
        raise FileFormatError(f"{path}: not a CSV of vgonio ({str(e).splitlines()[0]})") from None
    return RawSurface(
        heights,
        "um",
        pitch,
        "CSV",
        periodic=facts.get("periodic") == "yes",
        interpolation=facts.get("interpolation", "cubic"),
        name=facts.get("name", ""),
    )


FORMAT = Format("CSV of vgonio", (".csv",), (MAGIC.encode(),), read)
