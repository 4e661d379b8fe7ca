"""CGATS text (ANSI CGATS.17; Argyll's .ti3 is one), the format that measuring software writes.

RGB fields RGB_R, RGB_G, RGB_B; spectral fields SPEC_380, SPECTRAL_NM380, SPECTRAL_380 or nm380. Argyll gives RGB in
percent and spectra in mW/(sr m² nm), often scaled so that white has Y = 100: LUMINANCE_XYZ_CDM2 undoes that.
"""

from __future__ import annotations

import os
import re
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError, InputError, VgonioWarning
from ..files import text_of, written_whole
from .csv_files import scaled, unit_factor, unit_of_file
from .readings import Readings

Floats = NDArray[np.float64]
TOKEN = re.compile(r'"(?:[^"]|"")*"|#[^\n]*|[^\s"]+')
SPECTRAL = re.compile(r"(?:SPEC(?:TRAL)?_?(?:NM)?_?|NM_?)(\d{3,4}(?:\.\d+)?)", re.I)
RGB = ("RGB_R", "RGB_G", "RGB_B")
FIRST_WORDS = ("CGATS", "CTI3", "CTI1", "IT8", "ISO28178", "NCI3")


def is_cgats(text: str) -> bool:
    """Does a file begin as CGATS files do?"""
    first = text.lstrip("\ufeff \t\r\n").split(None, 1)
    return bool(first) and first[0].upper().startswith(FIRST_WORDS)


def read_cgats(path: Path, full_scale: float | None = None, unit: str | None = None) -> list[Readings]:
    """The readings of the first table, one eye: that of the keyword EYE, else none.

    Raises FileFormatError where fields, rows or spectra are missing.
    """
    text = text_of(path, "table of readings", errors="replace")
    tokens = [t for t in TOKEN.findall(text) if not t.startswith("#")]
    argyll = tokens[0].upper().startswith("CTI3")
    head, fields, rows = _table(path, tokens[1:])
    names = [f.upper() for f in fields]
    bands = {float(m.group(1)): i for i, f in enumerate(names) if (m := SPECTRAL.fullmatch(f))}
    missing = [c for c in RGB if c not in names]
    if missing or not bands:
        raise FileFormatError(
            f"{path} has no {', '.join(missing) or 'spectral fields (SPEC_380 …)'}: fields are "
            f"{', '.join(fields[:8])} …; export spectra and RGB of the display"
        )
    nm = _exact(head, np.array(sorted(bands)))
    values = _values(path, rows, [*(names.index(c) for c in RGB), *(bands[w] for w in sorted(bands))])
    given = full_scale if full_scale is not None else (100.0 if argyll else _keyword(head, "RGB_FULL_SCALE"))
    spectra = values[:, 3:] * _factor(path, head, argyll, unit)
    found = Readings(scaled(values[:, :3], given, str(path)), spectra, nm, head.get("EYE", ""))
    _compare_luminance(path, found, head)
    return [found]


def _compare_luminance(path: Path, found: Readings, head: dict[str, str]) -> None:
    """Warn where the spectra of white do not give the luminance that the file states: then the unit is another."""
    white, stated = found.index(np.ones(3))[0], _luminance(head)
    if white < 0 or not stated:
        return
    got = float(found.xyz[white, 1])
    if not 0.8 < got / stated < 1.25:
        warnings.warn(
            f"{path}: the spectrum of white gives {got:.3g} cd/m², the file states {stated:.3g}: is the unit of the "
            "spectra right?",
            VgonioWarning,
            stacklevel=3,
        )


def _exact(head: dict[str, str], nm: Floats) -> Floats:
    """Wavelengths from first to last where the names of the fields are rounded to whole nm."""
    first, last = _keyword(head, "SPECTRAL_START_NM"), _keyword(head, "SPECTRAL_END_NM")
    if first is None or last is None or nm.size < 2:
        return nm
    even = np.linspace(first, last, nm.size)
    return even if np.all(np.abs(even - nm) <= 0.51) else nm


def _table(path: Path, tokens: list[str]) -> tuple[dict[str, str], list[str], list[list[str]]]:
    """Keywords, fields and rows of the first table."""
    try:
        a, b = tokens.index("BEGIN_DATA_FORMAT"), tokens.index("END_DATA_FORMAT")
        c, d = tokens.index("BEGIN_DATA"), tokens.index("END_DATA")
    except ValueError:
        raise FileFormatError(f"{path} lacks BEGIN_DATA_FORMAT … END_DATA_FORMAT or BEGIN_DATA … END_DATA") from None
    fields, data = tokens[a + 1 : b], tokens[c + 1 : d]
    before = tokens[:a] + tokens[b + 1 : c]
    head = {k.upper(): v.strip('"') for k, v in zip(before, before[1:]) if re.fullmatch(r"[A-Za-z][\w.]*", k)}
    stated = head.get("NUMBER_OF_SETS", "")
    if not fields or not data or len(data) % len(fields):
        raise FileFormatError(f"{path}: {len(data)} values do not fill rows of {len(fields)} fields")
    rows = [data[i : i + len(fields)] for i in range(0, len(data), len(fields))]
    if stated.isdecimal() and stated.lstrip("0") != str(len(rows)):
        raise FileFormatError(f"{path}: NUMBER_OF_SETS is {stated}, there are {len(rows)} rows")
    return head, fields, rows


def _values(path: Path, rows: list[list[str]], columns: list[int]) -> Floats:
    try:
        values = np.array([[float(row[i]) for i in columns] for row in rows])
    except ValueError as e:
        raise FileFormatError(f"{path}: {e} among the readings") from None
    if not np.all(np.isfinite(values)):
        row = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
        raise FileFormatError(f"{path}: row {row + 1} of the data has a value that is not finite")
    return values


def _keyword(head: dict[str, str], name: str) -> float | None:
    try:
        return float(head[name])
    except (KeyError, ValueError):
        return None


def _factor(path: Path, head: dict[str, str], argyll: bool, unit: str | None) -> float:
    """What brings the numbers of the file to W/(sr m² nm)."""
    stated = head.get("SPECTRAL_UNIT") or ("mW/(sr m2 nm)" if argyll else "W/(sr m2 nm)")
    factor = unit_factor(unit) if unit else unit_of_file(path, stated)
    if head.get("NORMALIZED_TO_Y_100", "").upper() == "YES":
        factor *= (_luminance(head) or 100.0) / 100
    return factor


def _luminance(head: dict[str, str]) -> float | None:
    """Y in cd/m² of the white that Argyll states."""
    xyz = re.findall(r"[-+.\deE]+", head.get("LUMINANCE_XYZ_CDM2", ""))
    return float(xyz[1]) if len(xyz) == 3 else None


def write_cgats(path: str | os.PathLike[str], readings: Readings, full_scale: float = 255) -> Path:
    """Write readings of one eye as CGATS.17, with fields SPEC_380 … (names rounded to whole nm).

    Raises InputError for wavelengths that are less than 1 nm apart, whose names would be the same.
    """
    nm = readings.wavelength_nm
    names = [f"SPEC_{w:03.0f}" for w in nm]
    if len(set(names)) < nm.size:
        raise InputError("wavelengths less than 1 nm apart have no place in CGATS: write CSV")
    fields = ["SAMPLE_ID", *RGB, *names]
    own = {"SPECTRAL_UNIT": "W/(sr m2 nm)", "RGB_FULL_SCALE": f"{full_scale:g}", "EYE": readings.eye}
    lines = ["CGATS.17", "", 'ORIGINATOR "vgonio"', 'DEVICE_CLASS "DISPLAY"', 'COLOR_REP "RGB"']
    lines += [f'KEYWORD "{k}"\n{k} "{v}"' for k, v in own.items() if v]
    if np.allclose(nm, np.linspace(nm[0], nm[-1], nm.size), atol=1e-6):
        lines += [f'SPECTRAL_BANDS "{nm.size}"', f'SPECTRAL_START_NM "{nm[0]:.6f}"', f'SPECTRAL_END_NM "{nm[-1]:.6f}"']
    lines += [f"NUMBER_OF_FIELDS {len(fields)}", "BEGIN_DATA_FORMAT", " ".join(fields), "END_DATA_FORMAT", ""]
    lines += [f"NUMBER_OF_SETS {len(readings)}", "BEGIN_DATA"]
    for i, (rgb, spectrum) in enumerate(zip(readings.rgb, readings.spectra), 1):
        lines.append(" ".join([str(i), *(f"{v * full_scale:.9g}" for v in rgb), *(f"{v:.9g}" for v in spectrum)]))
    path = Path(path)
    with written_whole(path) as stream:
        stream.write(("\n".join([*lines, "END_DATA", ""])).encode())
    return path
