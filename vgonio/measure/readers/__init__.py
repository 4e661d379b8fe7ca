"""Measured BRDFs from files, one format a file, behind one table; all become the dataset of `vgonio.dataset`.

>>> data = read("sample.json")
>>> write(data, "copy.csv")
>>> write(data, "rendered.bsdf", fill="half-angle")
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from ...errors import FileFormatError, InputError, nearest
from .. import writers
from ..writers import astm as _astm
from ..writers import gonio_json as _gonio_json
from ..writers import merl as _merl
from ..writers import netcdf as _netcdf
from ..writers import plain_csv as _plain_csv
from ..writers import rgl as _rgl
from ..writers import zemax as _zemax
from . import astm, gonio_json, merl, netcdf, nist_csv, plain_csv, rgl, zemax
from .checks import Repairs, sound

__all__ = ["FORMATS", "Format", "Repairs", "read", "write", "writers"]


@dataclass(frozen=True)
class Format:
    """A row of the table: `sniff` decides by the first bytes, `write` is None where a format is only read.

    `read(path, repairs, **options)` and `write(dataset, path, **options)` name their options as keywords.
    """

    suffixes: tuple[str, ...]
    summary: str
    sniff: Callable[[bytes], bool]
    read: Callable[..., xr.Dataset]
    write: Callable[..., Path] | None = None


FORMATS = {
    "gonio-json": Format(
        (".json",),
        "in-plane BRDF of the thesis' gonioreflectometer",
        gonio_json.sniff,
        gonio_json.read,
        _gonio_json.write,
    ),
    "netcdf": Format(
        (".nc", ".h5"), "result of vgonio (its group 'measured')", netcdf.sniff, netcdf.read, _netcdf.write
    ),
    "csv": Format(
        (".csv", ".tsv"), "plain CSV, a row for each direction pair", plain_csv.sniff, plain_csv.read, _plain_csv.write
    ),
    "nist-csv": Format((".csv",), "Mueller BRDF of NIST, in-plane part", nist_csv.sniff, nist_csv.read),
    "merl": Format((".binary",), "MERL, R, G, B in half angles", merl.sniff, merl.read, _merl.write),
    "rgl": Format((".bsdf",), "RGL, as Mitsuba's `measured` renders it", rgl.sniff, rgl.read, _rgl.write),
    "astm": Format((".astm",), "ASTM E1392 and E2387 text", astm.sniff, astm.read, _astm.write),
    "zemax": Format((".bsdf",), "Zemax tabular BSDF, one wavelength", zemax.sniff, zemax.read, _zemax.write),
}


def read(
    path: str | os.PathLike[str],
    format: str | None = None,
    *,
    unit: str | None = None,
    wavelength_unit: str | None = None,
    negative: str = "missing",
    duplicates: str = "error",
    **options: Any,
) -> xr.Dataset:
    """Read a measured BRDF; the format is found by content, then by suffix, unless it is named.

    unit, wavelength_unit, negative, duplicates : repairs of bad data, see `measure.readers.checks`
    options : of the format. MERL, RGL and Zemax hold functions of two directions and are read at angles: theta_i_deg
    and theta_o_deg (signed, in plane) or resolution_deg (a hemisphere); Zemax and single ASTM columns take
    wavelength_nm.
    Returns brdf (theta_i, theta_o, wavelength) in sr⁻¹ over sorted coordinates, signed in-plane angles in degrees, or
    (theta_i, cell, wavelength) where directions are out of plane; what was not measured is NaN. brdf_stderr is there
    where the file has it. Results of vgonio itself (netcdf) are taken as they are.
    Raises FileFormatError for a missing, truncated or foreign file and for data that look like a mistake, InputError
    for an unknown format or option.
    """
    path = Path(path)
    if not path.is_file():
        raise FileFormatError(f"no such file: {path}")
    if format is not None and format not in FORMATS:
        raise InputError(f"unknown format {format!r} of measured data: {nearest(format, FORMATS)}")
    repairs = Repairs(unit, wavelength_unit, negative, duplicates)
    name = format or _recognise(path)
    reader = FORMATS[name].read
    _check_options(options, reader, f"reading {name}")
    data = reader(path, repairs, **options)
    return data if name == "netcdf" else sound(data, str(path), repairs)


def _check_options(options: dict[str, Any], function: Callable[..., Any], what: str) -> None:
    parameters = inspect.signature(function).parameters.values()
    known = [p.name for p in parameters if p.kind is inspect.Parameter.KEYWORD_ONLY]
    for option in options:
        if option not in known:
            hint = nearest(option, known) if known else "it has none"
            raise InputError(f"{what} knows no option {option!r}: {hint}")


def _recognise(path: Path) -> str:
    try:
        with path.open("rb") as file:
            head = file.read(4096)
    except OSError as e:
        raise FileFormatError(f"cannot read {path}: {e.strerror or e}") from None
    if not head.strip():
        raise FileFormatError(f"{path} is empty")
    by_suffix = [name for name, entry in FORMATS.items() if path.suffix.lower() in entry.suffixes]
    by_content = [name for name, entry in FORMATS.items() if entry.sniff(head)]
    # a known suffix whose content says otherwise goes to its own reader, whose message is the better one
    for name in by_content + by_suffix:
        return name
    known = "; ".join(f"{name} ({', '.join(entry.suffixes)}): {entry.summary}" for name, entry in FORMATS.items())
    raise FileFormatError(f"{path} is of no known format of measured BRDFs. Known are {known}")


def write(dataset: xr.Dataset, path: str | os.PathLike[str], format: str | None = None, **options: Any) -> Path:
    """Write a BRDF under a temporary name, then rename; the format is found by suffix unless it is named.

    Returns the path. Options are those of the format's `write`; MERL, RGL and Zemax need `fill` for in-plane data,
    which says what other azimuths are. `.bsdf` is RGL unless format="zemax". Raises InputError for a format that is
    unknown or only read, an unknown option, or a dataset that it cannot hold, FileFormatError where the folder cannot
    be written.
    """
    path = Path(path)
    writable = {name: entry for name, entry in FORMATS.items() if entry.write}
    if format is None:
        format = next((name for name, entry in writable.items() if path.suffix.lower() in entry.suffixes), None)
        if format is None:
            suffixes = ", ".join(dict.fromkeys(s for entry in writable.values() for s in entry.suffixes))
            raise InputError(f"no format to write has the suffix {path.suffix!r} of {path}: use one of {suffixes}")
    if format not in writable:
        raise InputError(f"{format!r} is no format that can be written: {nearest(format, writable)}")
    writer = writable[format].write
    assert writer is not None  # by the selection above
    _check_options(options, writer, f"writing {format}")
    return writer(dataset, path, **options)
