"""Measured BRDFs from files, one format a file, behind one table; all become the dataset of `vgonio.dataset`.

>>> data = read("sample.json")
>>> write(data, "copy.json")
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from ...errors import FileFormatError, InputError, nearest
from . import gonio_json, netcdf, nist_csv

__all__ = ["FORMATS", "Format", "gonio_json", "netcdf", "nist_csv", "read", "write"]


@dataclass(frozen=True)
class Format:
    """A row of the table: `sniff` decides by the first bytes, `write` is None where a format is only read."""

    suffixes: tuple[str, ...]
    summary: str
    sniff: Callable[[bytes], bool]
    read: Callable[[Path], xr.Dataset]
    write: Callable[..., Path] | None = None


FORMATS = {
    "gonio-json": Format(
        (".json",),
        "in-plane BRDF of the thesis' gonioreflectometer",
        gonio_json.sniff,
        gonio_json.read,
        gonio_json.write,
    ),
    "netcdf": Format(
        (".nc", ".h5"), "result of vgonio (its group 'measured')", netcdf.sniff, netcdf.read, netcdf.write
    ),
    "nist-csv": Format((".csv",), "Mueller BRDF of NIST, in-plane part", nist_csv.sniff, nist_csv.read),
}


def read(path: str | os.PathLike[str], format: str | None = None) -> xr.Dataset:
    """Read a measured BRDF; the format is found by content, then by suffix, unless it is named.

    Returns brdf (theta_i, theta_o, wavelength) in sr⁻¹ over sorted coordinates, signed in-plane angles in degrees; what
    was not measured is NaN. brdf_stderr is there where the file has it.
    Raises FileFormatError for a missing, truncated or foreign file, InputError for an unknown format name.
    """
    path = Path(path)
    if not path.is_file():
        raise FileFormatError(f"no such file: {path}")
    if format is not None and format not in FORMATS:
        raise InputError(f"unknown format {format!r} of measured data: {nearest(format, FORMATS)}")
    return FORMATS[format or _recognise(path)].read(path)


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

    Returns the path. Options are those of the format's `write`. Raises InputError for a format that is unknown or only
    read, or a dataset that it cannot hold, FileFormatError where the folder cannot be written.
    """
    path = Path(path)
    writable = {name: entry for name, entry in FORMATS.items() if entry.write}
    if format is None:
        format = next((name for name, entry in writable.items() if path.suffix.lower() in entry.suffixes), None)
        if format is None:
            suffixes = ", ".join(s for entry in writable.values() for s in entry.suffixes)
            raise InputError(f"no format to write has the suffix {path.suffix!r} of {path}: use one of {suffixes}")
    if format not in writable:
        raise InputError(f"{format!r} is no format that can be written: {nearest(format, writable)}")
    writer = writable[format].write
    assert writer is not None  # by the selection above
    return writer(dataset, path, **options)
