"""Measured BRDFs from files, one format a file, behind one table; all become the dataset of `vgonio.dataset`.

>>> data = read("sample.json")
>>> write(data, "copy.csv")
>>> write(data, "rendered.bsdf", fill="half-angle")
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..errors import FileFormatError, InputError, nearest
from ..file_kinds import require_kind
from ..files import require_file
from .readers import astm, gonio_json, merl, netcdf, nist_csv, plain_csv, rgl, zemax
from .readers.checks import Repairs, sound
from .writers import astm as astm_file
from .writers import gonio_json as gonio_json_file
from .writers import merl as merl_file
from .writers import netcdf as netcdf_file
from .writers import plain_csv as plain_csv_file
from .writers import rgl as rgl_file
from .writers import zemax as zemax_file

__all__ = ["FORMATS", "Format", "Repairs", "divided", "facts", "options", "read", "recognise", "write"]


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
        gonio_json_file.write,
    ),
    "netcdf": Format(
        (".nc", ".h5"), "result of vgonio (its group 'measured')", netcdf.sniff, netcdf.read, netcdf_file.write
    ),
    "csv": Format(
        (".csv", ".tsv"),
        "plain CSV, a row for each direction pair",
        plain_csv.sniff,
        plain_csv.read,
        plain_csv_file.write,
    ),
    "nist-csv": Format((".csv",), "Mueller BRDF of NIST, in plane or whole", nist_csv.sniff, nist_csv.read),
    "merl": Format((".binary",), "MERL, R, G, B in half angles", merl.sniff, merl.read, merl_file.write),
    "rgl": Format((".bsdf",), "RGL, as Mitsuba's `measured` renders it", rgl.sniff, rgl.read, rgl_file.write),
    "astm": Format((".astm",), "ASTM E1392 and E2387 text", astm.sniff, astm.read, astm_file.write),
    "zemax": Format((".bsdf",), "Zemax tabular BSDF, one wavelength", zemax.sniff, zemax.read, zemax_file.write),
}
BINARY = ("netcdf", "merl", "rgl")


def read(
    path: str | os.PathLike[str],
    format: str | None = None,
    *,
    unit: str | None = None,
    wavelength_unit: str | None = None,
    negative: str = "missing",
    duplicates: str = "error",
    **given: Any,
) -> xr.Dataset:
    """Read a measured BRDF; the format is found by content, then by suffix, unless it is named.

    unit, wavelength_unit, negative, duplicates : repairs of bad data, see `measure.readers.checks`
    given : options of the format. MERL, RGL and Zemax hold functions of two directions and are read at angles:
    theta_i_deg and theta_o_deg (signed, in plane) or resolution_deg (a hemisphere); Zemax and single ASTM columns take
    wavelength_nm; NIST's table is read in plane unless hemisphere=True.
    Returns brdf (theta_i, theta_o, wavelength) in sr⁻¹ over sorted coordinates, signed in-plane angles in degrees, or
    (theta_i, cell, wavelength) where directions are out of plane; what was not measured is NaN. brdf_stderr is there
    where the file has it. Results of vgonio itself (netcdf) are taken as they are.
    Raises FileFormatError for a missing, truncated or foreign file and for data that look like a mistake, InputError
    for an unknown format or option.
    """
    path = Path(path)
    name = recognise(path, format)
    repairs = Repairs(unit, wavelength_unit, negative, duplicates)
    reader = FORMATS[name].read
    _check_options(given, reader, f"reading {name}")
    data = reader(path, repairs, **given)
    return data if name == "netcdf" else sound(data, str(path), repairs)


def options(function: Callable[..., Any]) -> list[str]:
    """Names of the options of a format's `read` or `write`."""
    parameters = inspect.signature(function).parameters.values()
    return [p.name for p in parameters if p.kind is inspect.Parameter.KEYWORD_ONLY]


def _check_options(given: dict[str, Any], function: Callable[..., Any], what: str) -> None:
    known = options(function)
    for option in given:
        if option not in known:
            hint = nearest(option, known) if known else "it has none"
            raise InputError(f"{what} knows no option {option!r}: {hint}")


def divided(
    given: dict[str, Any], source: Path, format: str | None, target: Path, to: str | None
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Options of a conversion, for reading and for writing; one that both know goes to both.

    Raises InputError for an option that neither knows.
    """
    reader, writer = FORMATS[recognise(source, format)].read, _writer(target, to)[1]
    known = ([f.name for f in fields(Repairs)] + options(reader), options(writer))
    for name in given:
        if not any(name in names for names in known):
            raise InputError(f"no option {name!r} of reading or writing: {nearest(name, {*known[0], *known[1]})}")
    return {k: v for k, v in given.items() if k in known[0]}, {k: v for k, v in given.items() if k in known[1]}


def facts(data: xr.Dataset) -> dict[str, Any]:
    """What a BRDF holds, for people: angles, wavelengths, values, and the notes of its reader."""
    theta_i, nm, values = data["theta_i"].values, data["wavelength"].values, data["brdf"].values
    where = f"{data.sizes['cell']} cells" if "cell" in data["brdf"].dims else f"{data.sizes['theta_o']} in plane"
    theta_o = data["theta_o"].values
    notes = ("source", "comment", "description", "channels", "units_assumed", "interpolation", "repairs")
    return {
        "theta_i_deg": f"{theta_i.size}: {theta_i.min():g} … {theta_i.max():g}",
        "directions": f"{where}, θ_o {theta_o.min():g} … {theta_o.max():g}°",
        "wavelength_nm": f"{nm.size}: {nm.min():g} … {nm.max():g}",
        "brdf_per_sr": f"{np.nanmin(values):.4g} … {np.nanmax(values):.4g}" if np.isfinite(values).any() else "none",
        "missing": f"{np.isnan(values).mean():.1%} of the grid",
        "errors": "yes" if "brdf_stderr" in data else "no",
        **{k: data.attrs[k] for k in notes if data.attrs.get(k)},
    }


def recognise(path: str | os.PathLike[str], format: str | None = None) -> str:
    """Name of the format of a file, by content, then by suffix, unless it is given.

    Raises FileFormatError for a file that is missing or of no known format, InputError for an unknown name.
    """
    path = Path(path)
    require_file(path)
    if format is not None and format not in FORMATS:
        raise InputError(f"unknown format {format!r} of measured data: {nearest(format, FORMATS)}")
    if format is None:
        require_kind(path, "measured", "result")
    return format or _recognise(path)


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
    if b"\0" not in head:  # of formats that share a suffix the one that is text
        by_suffix.sort(key=lambda name: name in BINARY)
    # a known suffix whose content says otherwise goes to its own reader, whose message is the better one
    for name in by_content + by_suffix:
        return name
    known = "; ".join(f"{name} ({', '.join(entry.suffixes)}): {entry.summary}" for name, entry in FORMATS.items())
    raise FileFormatError(f"{path} is of no known format of measured BRDFs. Known are {known}")


def write(dataset: xr.Dataset, path: str | os.PathLike[str], format: str | None = None, **given: Any) -> Path:
    """Write a BRDF under a temporary name, then rename; the format is found by suffix unless it is named.

    Returns the path. Options are those of the format's `write`; MERL, RGL and Zemax need `fill` for in-plane data,
    which says what other azimuths are. `.bsdf` is RGL unless format="zemax". Raises InputError for a format that is
    unknown or only read, an unknown option, or a dataset that it cannot hold, FileFormatError where the folder cannot
    be written.
    """
    path = Path(path)
    name, writer = _writer(path, format)
    _check_options(given, writer, f"writing {name}")
    return writer(dataset, path, **given)


def _writer(path: Path, format: str | None) -> tuple[str, Callable[..., Path]]:
    """Name of the format to write and its function, by suffix unless it is named."""
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
    return format, writer
