"""The CSV layout of readings, and lists of colours to show.

    # vgonio display readings
    # unit: W/(sr m2 nm)
    # full scale: 255
    eye,R,G,B,380,385,…,780
    left,0,0,0,1.2e-7,…

Lines with # are comments; `unit` and `full scale` are read from them. The column `eye` may be absent. After R, G, B in
codes of 0 … full scale come the wavelengths in nm, rising; one reading in a row.
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError, InputError, nearest
from ..files import text_of, written_whole
from .readings import Readings, check_bits

Floats = NDArray[np.float64]
# spectral radiance in W/(sr m² nm) of one unit; keys without blanks
UNITS = {"w/(srm2nm)": 1.0, "mw/(srm2nm)": 1e-3, "uw/(srcm2nm)": 1e-2}
FULL_SCALES = (1, 100, 255, 1023, 4095, 65535)


def unit_factor(unit: str) -> float:
    """Factor that brings spectral radiance to W/(sr m² nm); InputError for an unknown unit."""
    key = re.sub(r"[\s·*]", "", unit.lower().replace("²", "2").replace("µ", "u").replace("μ", "u"))
    if key not in UNITS:
        raise InputError(f"unit {unit!r} is unknown: {nearest(key, UNITS)}")
    return UNITS[key]


def unit_of_file(path: Path, unit: str) -> float:
    """The same for a unit that a file states; FileFormatError for an unknown one."""
    try:
        return unit_factor(unit)
    except InputError as e:
        raise FileFormatError(f"{path}: {e}") from None


def scaled(rgb: Floats, full_scale: float | None, where: str) -> Floats:
    """Codes (n, 3) as signals 0 … 1. Without a full scale the largest code must be one (1, 100, 255, 1023, 4095, …).

    Raises FileFormatError where the full scale is not clear or exceeded.
    """
    largest = float(rgb.max())
    if full_scale is None:
        if not np.any(np.isclose(largest, FULL_SCALES, atol=0, rtol=1e-9)):
            raise FileFormatError(
                f"{where}: the largest RGB is {largest:g}, no full scale ({', '.join(map(str, FULL_SCALES))}): "
                "say which it is, in the file or with --full-scale"
            )
        full_scale = largest
    if full_scale <= 0 or largest > full_scale * (1 + 1e-9) or rgb.min() < 0:
        raise FileFormatError(f"{where}: RGB from {rgb.min():g} to {largest:g} with a full scale of {full_scale:g}")
    return np.clip(rgb / full_scale, 0, 1)


def read_csv(path: Path, full_scale: float | None = None, unit: str | None = None) -> list[Readings]:
    """Readings by eye, in the order of the file; see the module for the layout.

    Raises FileFormatError with the line where the file departs from it.
    """
    text = text_of(path, "table of readings")
    found = dict(re.findall(r"^#\s*(unit|full scale)\s*:\s*(.+?)\s*$", text, flags=re.M | re.I))
    factor = unit_factor(unit) if unit else unit_of_file(path, found.get("unit", "W/(sr m2 nm)"))
    lines = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")]
    if len(lines) < 2:
        raise FileFormatError(f"{path} holds no readings: a head R,G,B,380,… and a row for each are needed")
    head = [h.strip() for h in lines[0][1].split(",")]
    with_eye = head[0].lower() == "eye"
    nm = _wavelengths(path, head[1:] if with_eye else head)
    eyes, values = [], []
    for (number, _), row in zip(lines[1:], csv.reader(line for _, line in lines[1:])):
        eyes.append(row[0].strip() if with_eye else "")
        values.append(_numbers(path, number, row[1:] if with_eye else row, 3 + nm.size))
    table = np.array(values)
    given = full_scale if full_scale is not None else _number(path, found.get("full scale"))
    rgb = scaled(table[:, :3], given, str(path))
    order = list(dict.fromkeys(eyes))
    rows = {eye: np.array([e == eye for e in eyes]) for eye in order}
    return [Readings(rgb[rows[eye]], table[rows[eye], 3:] * factor, nm, eye) for eye in order]


def _wavelengths(path: Path, head: list[str]) -> Floats:
    try:
        if [h.upper() for h in head[:3]] != ["R", "G", "B"]:
            raise ValueError
        nm = np.array([float(h.lower().removesuffix("nm")) for h in head[3:]])
    except ValueError:
        raise FileFormatError(
            f"{path}: the head is {','.join(head[:6])},…; [eye,]R,G,B and wavelengths in nm are needed"
        ) from None
    if nm.size == 0 or not np.all(np.diff(nm) > 0):
        raise FileFormatError(f"{path}: {nm.size} wavelengths after R,G,B; they must rise")
    return nm


def _numbers(path: Path, line: int, row: Sequence[str], count: int) -> list[float]:
    if len(row) != count:
        raise FileFormatError(f"{path}, line {line}: {len(row)} numbers, the head has {count}")
    try:
        numbers = [float(x) for x in row]
    except ValueError as e:
        raise FileFormatError(f"{path}, line {line}: {e}") from None
    if not np.all(np.isfinite(numbers)):
        raise FileFormatError(f"{path}, line {line}: a value that is not finite; leave the reading out or repeat it")
    return numbers


def _number(path: Path, text: str | None) -> float | None:
    try:
        return None if text is None else float(text)
    except ValueError:
        raise FileFormatError(f"{path}: full scale {text!r} is no number") from None


def write_csv(path: str | os.PathLike[str], readings: Sequence[Readings], full_scale: float = 255) -> Path:
    """Write readings, several eyes after each other, with 9 digits. Raises InputError where wavelengths differ."""
    nm = readings[0].wavelength_nm
    if any(not np.array_equal(r.wavelength_nm, nm) for r in readings):
        raise InputError("readings of different wavelengths do not fit into one file: write one for each")
    lines = ["# vgonio display readings", "# unit: W/(sr m2 nm)", f"# full scale: {full_scale:g}"]
    lines.append(",".join(["eye", "R", "G", "B", *(f"{w:.10g}" for w in nm)]))
    for part in readings:
        for rgb, spectrum in zip(part.rgb, part.spectra):
            numbers = [f"{v * full_scale:.9g}" for v in rgb] + [f"{v:.9g}" for v in spectrum]
            lines.append(",".join([part.eye, *numbers]))
    return _write(path, lines)


def write_colours(path: str | os.PathLike[str], rgb: Floats, bits: int = 8) -> Path:
    """Write a list of colours to show and to measure, R,G,B in codes of `bits`; each colour once, in order."""
    codes = np.round(np.asarray(rgb) * (2 ** check_bits(bits) - 1)).astype(int)
    rows = dict.fromkeys(map(tuple, codes.tolist()))
    lines = [f"# full scale: {2**bits - 1}", "R,G,B", *(",".join(map(str, row)) for row in rows)]
    return _write(path, lines)


def _write(path: str | os.PathLike[str], lines: list[str]) -> Path:
    path = Path(path)
    with written_whole(path) as stream:
        stream.write(("\n".join(lines) + "\n").encode())
    return path
