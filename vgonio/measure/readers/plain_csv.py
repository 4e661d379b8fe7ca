"""Plain CSV: one header line with names and units, then one row for each pair of directions and wavelength.

Columns, in any order: `theta_i_deg, phi_i_deg, theta_o_deg, phi_o_deg, wavelength_nm, brdf_per_sr` and, if known,
`brdf_stderr_per_sr`. Without phi_o the polar angles are signed and in one plane: mirror direction θ_o = −θ_i. Lines
that begin with # are comments. Separators: comma, semicolon or tab.

Units are the last part of a name or stand in brackets ("theta_i [rad]"): deg, rad; nm, um; per_sr, sr-1, percent,
reflectance_factor. Where a name has none, angles are degrees if any is beyond 1.6, wavelengths nm from 100 and µm
below 50, and the attribute `units_assumed` says so.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...errors import FileFormatError
from ...file_kinds import require_kind
from ...files import require_file, text_of
from ...units import degrees
from .checks import UNITS, Repairs
from .in_plane import signed_as_full
from .listed import from_rows, table_of

Floats = NDArray[np.float64]
NAMES = {
    "theta_i": ("theta_i", "thetai", "theta_in", "thetain"),
    "phi_i": ("phi_i", "phii", "phi_in", "phiin"),
    "theta_o": ("theta_o", "thetao", "theta_out", "thetaout", "theta_r", "thetar", "theta_s"),
    "phi_o": ("phi_o", "phio", "phi_out", "phiout", "phi_r", "phir", "phi_s"),
    "wavelength": ("wavelength", "lambda"),
    "brdf": ("brdf", "bsdf", "f_r", "fr"),
    "brdf_stderr": ("brdf_stderr", "stderr", "brdf_standard_error"),
    "counts": ("counts", "count", "v", "signal"),
    "counts_stderr": ("counts_stderr",),
}
ANGLES = ("theta_i", "phi_i", "theta_o", "phi_o")
KNOWN_UNITS = {
    "deg": "deg", "degree": "deg", "degrees": "deg", "rad": "rad", "radian": "rad", "radians": "rad",
    "nm": "nm", "um": "um", "µm": "um", "per_sr": "sr-1", "sr-1": "sr-1", "1/sr": "sr-1", "sr^-1": "sr-1",
    "percent": "percent", "%": "percent", "reflectance_factor": "reflectance-factor",
    "reflectance-factor": "reflectance-factor",
}  # fmt: skip


def sniff(head: bytes) -> bool:
    for line in head.decode("utf-8", "replace").lstrip("\ufeff").splitlines():
        if line.strip() and not line.startswith("#"):
            found = {name for name, _ in map(_split, _fields(line))}
            return {"theta_i", "theta_o"} <= found and "brdf" in found
    return False


def _fields(line: str) -> list[str]:
    separator = next((s for s in (",", ";", "\t") if s in line), ",")
    return [f.strip().strip('"') for f in line.split(separator)]


def _split(column: str) -> tuple[str | None, str | None]:
    """The quantity and the unit of a column's name; None for what is not known."""
    text = re.sub(r"\s+", "_", column.strip().lower())
    bracket = re.fullmatch(r"(.*?)_?[\[(](.*)[\])]", text)
    base, unit = (bracket[1], bracket[2]) if bracket else (text, None)
    if unit is None:
        for ending in KNOWN_UNITS:
            if base.endswith("_" + ending):
                base, unit = base[: -len(ending) - 1], ending
                break
    name = next((k for k, names in NAMES.items() if base in names), None)
    return name, KNOWN_UNITS.get(unit, unit) if unit else None


def read(path: Path, repairs: Repairs) -> xr.Dataset:
    """The dataset of a plain CSV; see the module for its layout and `measure.read`.

    Raises FileFormatError for columns that are missing or twice, units that are not known, and rows that are damaged.
    """
    return _read(path, repairs, "brdf")


def read_counts(path: str | os.PathLike[str], duplicates: str = "error") -> xr.Dataset:
    """Counts of a spectrometer from a plain CSV with a column `counts`, and `counts_stderr` if known, in plane.

    Returns counts (theta_i, theta_o, wavelength) for `measure.calibration`. Raises FileFormatError as `read` does.
    """
    path = Path(path)
    require_file(path, "CSV of counts")
    require_kind(path, "counts")
    data = _read(path, Repairs(duplicates=duplicates), "counts")
    if "theta_o" not in data["brdf"].dims:
        raise FileFormatError(f"{path}: counts are calibrated in plane, its directions are not")
    data = data.rename({"brdf": "counts"} | ({"brdf_stderr": "counts_stderr"} if "brdf_stderr" in data else {}))
    for name in ("counts", "counts_stderr"):
        if name in data:
            data[name].attrs = {"units": "count", "long_name": f"{name.replace('_stderr', ': standard error')}"}
    return data


def _read(path: Path, repairs: Repairs, quantity: str) -> xr.Dataset:
    lines = [
        (k, line)
        for k, line in enumerate(text_of(path, "CSV").splitlines(), 1)
        if line.strip() and not line.startswith("#")
    ]
    if not lines:
        raise FileFormatError(f"{path} holds no header line")
    place, units = _columns(_fields(lines[0][1]), path, quantity)
    values = table_of([(k, _fields(line)) for k, line in lines[1:]], len(_fields(lines[0][1])), path)
    columns = {name: values[:, k] for name, k in place.items()}
    if not len(values):
        raise FileFormatError(f"{path} holds no rows of data")
    assumed: list[str] = []
    angles = {k: _angle(columns[k], units[k], k, assumed) for k in ANGLES if k in columns}
    if "phi_o" not in angles:
        directions = signed_as_full(angles["theta_i"], angles["theta_o"], angles.get("phi_i", 0.0))
    else:
        directions = np.stack([np.broadcast_to(angles.get(k, 0.0), len(values)) for k in ANGLES], axis=1)
    error = f"{quantity}_stderr"
    factor = {name: UNITS[units[name] or units[quantity] or "sr-1"] for name in (quantity, error) if name in place}
    wavelength = _wavelength(columns["wavelength"], units["wavelength"], assumed, path)
    return from_rows(
        directions,
        wavelength,
        columns[quantity] * factor[quantity],
        columns[error] * factor[error] if error in place else None,
        repairs,
        where=str(path),
        attrs={"source": path.name} | ({"units_assumed": "; ".join(assumed)} if assumed else {}),
    )


def _columns(header: list[str], path: Path, quantity: str) -> tuple[dict[str, int], dict[str, str | None]]:
    place: dict[str, int] = {}
    units: dict[str, str | None] = {}
    for k, column in enumerate(header):
        name, unit = _split(column)
        if name is None:
            continue
        if name in place:
            raise FileFormatError(f"{path}: two columns hold {name}: {header[place[name]]!r} and {column!r}")
        allowed = ("deg", "rad") if name in ANGLES else ("nm", "um") if name == "wavelength" else tuple(UNITS)
        if unit not in (None, *allowed):
            raise FileFormatError(
                f"{path}: the unit {unit!r} of {column!r} is not known; known are {', '.join(allowed)}"
            )
        place[name], units[name] = k, unit
    missing = [k for k in ("theta_i", "theta_o", "wavelength", quantity) if k not in place]
    if missing:
        raise FileFormatError(
            f"{path}: no column {', '.join(missing)} among {', '.join(header)[:200]}; a plain CSV of a BRDF has "
            "theta_i_deg, theta_o_deg, wavelength_nm, brdf_per_sr, and phi_i_deg, phi_o_deg out of plane"
        )
    return place, units


def _angle(values: Floats, unit: str | None, name: str, assumed: list[str]) -> Floats:
    if unit is None:
        unit = "deg" if np.nanmax(np.abs(values), initial=0.0) > 1.6 or not np.any(values) else "rad"
        assumed.append(f"{name} in {unit}")
    return degrees(values) if unit == "rad" else values


def _wavelength(values: Floats, unit: str | None, assumed: list[str], path: Path) -> Floats:
    if not np.all(np.isfinite(values)):
        raise FileFormatError(f"{path}: a wavelength is missing or not finite")
    if unit is None:
        unit = "um" if values.max() < 50 else "nm"
        assumed.append(f"wavelength in {unit}")
    return np.round(values * 1e3, 9) if unit == "um" else values
