"""ASTM E1392 and E2387 text files: keyword lines, then `VARS` with the names of the columns, then rows.

Columns: θ_i, φ_i, θ_s, φ_s and one BSDF value for each wavelength ("550nm") or channel. Angles are radians as in the
files of Cornell's light measurement laboratory, unless a keyword line says `ANGLE_UNITS degrees` or an angle is
beyond 2π. Azimuths are those of the directions to source and detector: mirror direction φ_s = φ_i + 180°.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...errors import FileFormatError
from ...files import text_of
from ...units import degrees
from .channels import nominal
from .checks import Repairs
from .listed import from_spectra, table_of

Floats = NDArray[np.float64]
VARS = re.compile(r"^\s*VARS\b[\s=:]*(.*)$", re.IGNORECASE)
COMMENTS = ("#", "!", ";", "*")


def sniff(head: bytes) -> bool:
    text = head.decode("latin-1")
    return bool(re.search(r"^\s*VARS\b", text, re.MULTILINE | re.IGNORECASE)) or bool(
        re.search(r"ASTM\s*E-?(1392|2387)", text, re.IGNORECASE)
    )


def read(path: Path, repairs: Repairs, *, wavelength_nm: float | None = None) -> xr.Dataset:
    """The dataset of an ASTM file; see the module for its layout and `measure.read`.

    wavelength_nm : of a file with one BSDF column that does not name its wavelength
    Raises FileFormatError for a file without VARS, fewer than five columns, damaged rows or unknown wavelengths.
    """
    lines = list(enumerate(text_of(path, "ASTM file").splitlines(), 1))
    start = next((k for k, (_, line) in enumerate(lines) if VARS.match(line)), None)
    if start is None:
        raise FileFormatError(f"{path} has no line VARS with the names of the columns: no ASTM E1392 or E2387 file")
    match = VARS.match(lines[start][1])
    assert match is not None  # by the search above
    names = _fields(match[1])
    header = dict(_keyword(line) for _, line in lines[:start] if line.strip())
    if len(names) < 5:
        raise FileFormatError(f"{path}: VARS names {len(names)} columns, four angles and one value at least are needed")
    rows = [(k, _fields(line)) for k, line in lines[start + 1 :] if line.strip() and line.strip()[0] not in COMMENTS]
    values = table_of(rows, len(names), path)
    if not len(values):
        raise FileFormatError(f"{path} holds no rows of data after VARS")
    _check_count(header, len(values), path)
    wavelength, note = _wavelengths(names[4:], header, wavelength_nm, path)
    angles, unit = _degrees(values[:, :4], header)
    return from_spectra(
        angles,
        wavelength,
        values[:, 4:],
        None,
        repairs,
        where=str(path),
        attrs={"source": path.name, "units_assumed": f"angles in {unit}"} | ({"channels": note} if note else {}),
    )


def _fields(line: str) -> list[str]:
    return [f.strip() for f in (line.split(",") if "," in line else line.split())]


def _keyword(line: str) -> tuple[str, str]:
    parts = re.split(r"[\s=:]+", line.strip(), maxsplit=1)
    return parts[0].upper(), parts[1] if len(parts) > 1 else ""


def _check_count(header: dict[str, str], rows: int, path: Path) -> None:
    stated = header.get("NUM_POINTS", "").strip()
    if stated.isdecimal() and int(stated) > rows:
        raise FileFormatError(f"{path} is truncated: it announces {stated} points and holds {rows}")


def _wavelengths(
    names: list[str], header: dict[str, str], given: float | None, path: Path
) -> tuple[Floats, str | None]:
    found = [
        re.fullmatch(r"(?:\D*?[_\s])?([\d.]+(?:[eE][+-]?\d+)?)\s*(nm|um|µm)", n.strip(), re.IGNORECASE) for n in names
    ]
    if all(found):
        try:
            return np.array([float(m[1]) * (1.0 if m[2].lower() == "nm" else 1e3) for m in found if m]), None
        except ValueError:
            raise FileFormatError(f"{path}: {', '.join(names)[:100]} are no wavelengths") from None
    if len(names) == 3:
        return nominal(names, str(path))
    if len(names) == 1:
        stated = re.match(r"([\d.]+)\s*(nm|um|µm)?", header.get("WAVELENGTH", ""), re.IGNORECASE)
        if given is not None or stated:
            value = float(given) if given is not None else float(stated[1].strip(".") or 0)  # type: ignore[index]
            micrometres = given is None and ((stated[2] or "").lower() in ("um", "µm") or value < 50)  # type: ignore[index]
            return np.array([value * (1e3 if micrometres else 1.0)]), None
    raise FileFormatError(
        f"{path}: the columns {', '.join(names)[:100]} do not say their wavelengths (as in 550nm); for a single one "
        "give wavelength_nm"
    )


def _degrees(angles: Floats, header: dict[str, str]) -> tuple[Floats, str]:
    stated = next((v.lower() for k, v in header.items() if k in ("ANGLE_UNITS", "ANGLE_UNIT", "ANGLES")), "")
    unit = (
        "degrees"
        if stated.startswith("deg") or np.nanmax(np.abs(angles), initial=0.0) > 2 * np.pi + 0.01
        else "radians"
    )
    return (angles.copy() if unit == "degrees" else np.round(degrees(angles), 7)), unit
