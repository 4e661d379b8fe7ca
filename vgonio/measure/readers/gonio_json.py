"""The thesis' gonioreflectometer JSON: in-plane BRDF spectra.

A top-level array. Element 0 is an object with `wavelengths` in nm, and any text such as `comment` or `provenance`.
Every later element has `thetaIn, phiIn, thetaOut, phiOut` in degrees (θ ≥ 0, φ tells the side) and `spectrum`, one BRDF
value in sr⁻¹ per wavelength (null = not measured), and may have `standardError`, an addition of ours that others skip.
The order is free; the exact back-scattering pair, where the detector hides the source, is absent.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...dataset import plain
from ...errors import FileFormatError
from ...files import json_of
from .checks import Repairs, check_values
from .in_plane import dense_dataset, signed_angles

Floats = NDArray[np.float64]
ANGLES = ("thetaIn", "phiIn", "thetaOut", "phiOut")


def sniff(head: bytes) -> bool:
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    return text.startswith(b"[") and b"wavelengths" in head


def read(path: Path, repairs: Repairs) -> xr.Dataset:
    """The in-plane BRDF of a gonioreflectometer JSON; see `measure.read`.

    Signed angles are relative to the azimuth of the plane of incidence (coordinate phi_i). `comment` and `provenance`
    of the file are kept as attributes, anything else of element 0 as JSON in `header`.
    """
    head, entries = _load(path)
    wavelength = _numbers(head["wavelengths"], f"{path}: wavelengths")
    spectra = np.array([_spectrum(e, "spectrum", wavelength.size, k, path) for k, e in enumerate(entries, 1)])
    angles = np.array([[_angle(e, name, k, path) for name in ANGLES] for k, e in enumerate(entries, 1)])
    theta_in, phi_in, theta_out, phi_out = angles.T
    check_values(angles[:, [0, 2]].ravel(), wavelength, str(path))
    if not np.any(np.isfinite(spectra)):
        raise FileFormatError(f"{path} holds no finite BRDF value")
    return dense_dataset(
        signed_angles(theta_in, phi_in, 0.0, str(path)),
        signed_angles(theta_out, phi_out, 0.0, str(path)),
        wavelength,
        spectra,
        _standard_errors(entries, wavelength.size, path),
        plane=0.0,
        where=str(path),
        attrs={"source": path.name, **_texts(head)},
        duplicates=repairs.duplicates,
    )


def _standard_errors(entries: list[dict[str, Any]], size: int, path: Path) -> Floats | None:
    """(n, n_λ) with NaN where an element has none, or None where no element has one."""
    key = "standardError"
    if not any(key in e for e in entries):
        return None
    absent = {key: [None] * size}
    stderr = np.array([_spectrum(absent | e, key, size, k, path) for k, e in enumerate(entries, 1)])
    if np.any(stderr < 0):
        raise FileFormatError(f"{path}: a {key} is negative")
    return stderr


def _load(path: Path) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    content = json_of(path, "gonioreflectometer JSON")
    if not (isinstance(content, list) and content and isinstance(content[0], dict) and "wavelengths" in content[0]):
        raise FileFormatError(
            f"{path} is JSON of another kind: a gonioreflectometer file is an array that begins with 'wavelengths'"
        )
    if len(content) < 2 or not all(isinstance(e, dict) for e in content):
        raise FileFormatError(f"{path} holds no spectra after its wavelengths, or something that is no object")
    return content[0], content[1:]


def _numbers(values: Any, what: str) -> Floats:
    """A flat list of numbers, null = NaN."""
    if not isinstance(values, list) or any(isinstance(v, (bool, str, list, dict)) for v in values):
        raise FileFormatError(f"{what} has to be a list of numbers, got {str(values)[:60]}")
    try:
        return np.array([np.nan if v is None else v for v in values], dtype=np.float64)
    except OverflowError:
        raise FileFormatError(f"{what} holds a number that is too large") from None


def _spectrum(entry: dict[str, Any], key: str, size: int, k: int, path: Path) -> Floats:
    if key not in entry:
        raise FileFormatError(f"{path}: element {k} has no '{key}', only {sorted(entry)}")
    values = _numbers(entry[key], f"{path}: {key} of element {k}")
    if values.size != size:
        raise FileFormatError(f"{path}: {key} of element {k} has {values.size} values for {size} wavelengths")
    if np.any(np.isinf(values)):
        raise FileFormatError(f"{path}: {key} of element {k} holds an infinite value")
    return values


def _angle(entry: dict[str, Any], key: str, k: int, path: Path) -> float:
    value = entry.get(key)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= 1e6:
        raise FileFormatError(f"{path}: element {k} needs a number of degrees as '{key}', got {str(value)[:60]}")
    return float(value)


def _texts(head: dict[str, Any]) -> dict[str, Any]:
    known = {k: plain(head[k]) for k in ("comment", "provenance") if head.get(k) is not None}
    rest = {k: v for k, v in head.items() if k not in ("wavelengths", "comment", "provenance")}
    return known | ({"header": json.dumps(rest)} if rest else {})
