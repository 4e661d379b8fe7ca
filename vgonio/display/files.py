"""Readings from and to files, by what the file is: CGATS where it begins like one, else CSV."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from ..errors import InputError
from ..file_kinds import require_kind
from ..files import require_file, text_of
from .cgats import is_cgats, read_cgats, write_cgats
from .csv_files import read_csv, write_csv
from .readings import Readings

CGATS_ENDINGS = (".ti3", ".cgats", ".txt")


def read(path: str | os.PathLike[str], full_scale: float | None = None, unit: str | None = None) -> list[Readings]:
    """Readings of a file by eye: CSV as `vgonio.display.csv_files` documents it, or CGATS.

    full_scale : the code of full signal, where the file does not say it;  unit : of the spectra, overrides the file's.
    Raises FileFormatError for a file that is neither or damaged.
    """
    path = Path(path)
    require_file(path, "table of readings (CSV or CGATS)")
    require_kind(path, "readings")
    beginning = text_of(path, "table of readings (CSV or CGATS)", errors="replace")[:200]
    return (read_cgats if is_cgats(beginning) else read_csv)(path, full_scale, unit)


def write(path: str | os.PathLike[str], readings: Sequence[Readings], full_scale: float = 255) -> Path:
    """Write readings as CSV (.csv) or, of one eye, as CGATS (.ti3, .cgats, .txt).

    Raises InputError for other endings and for two eyes in one CGATS file.
    """
    ending = Path(path).suffix.lower()
    if ending == ".csv":
        return write_csv(path, readings, full_scale)
    if ending not in CGATS_ENDINGS:
        raise InputError(f"readings to {path}: the ending says the format, .csv or {', '.join(CGATS_ENDINGS)}")
    if len(readings) != 1:
        raise InputError(
            f"{path}: a CGATS file holds one eye, here are {len(readings)}; write CSV or one file for each"
        )
    return write_cgats(path, readings[0], full_scale)
