"""The thesis' gonioreflectometer JSON: in-plane BRDF spectra.

A top-level array. Element 0 is an object with `wavelengths` in nm, and any text such as `comment` or `provenance`.
Every later element has `thetaIn, phiIn, thetaOut, phiOut` in degrees (θ ≥ 0, φ tells the side) and `spectrum`, one BRDF
value in sr⁻¹ per wavelength (null = not measured), and may have `standardError`, an addition of ours that others skip.
The order is free; the exact back-scattering pair, where the detector hides the source, is absent.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...dataset import check, plain
from ...errors import FileFormatError, InputError
from ...files import written_whole
from .in_plane import check_values, dense_dataset, signed_angles

Floats = NDArray[np.float64]
ANGLES = ("thetaIn", "phiIn", "thetaOut", "phiOut")


def sniff(head: bytes) -> bool:
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    return text.startswith(b"[") and b"wavelengths" in head


def read(path: str | os.PathLike[str]) -> xr.Dataset:
    """The in-plane BRDF of a gonioreflectometer JSON; see `measure.readers.read`.

    Signed angles are relative to the azimuth of the plane of incidence (coordinate phi_i). `comment` and `provenance`
    of the file are kept as attributes, anything else of element 0 as JSON in `header`.
    """
    path = Path(path)
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
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as e:
        raise FileFormatError(f"cannot read {path}: {e.strerror or e}") from None
    except UnicodeDecodeError:
        raise FileFormatError(f"{path} is no text file, so no gonioreflectometer JSON") from None
    except RecursionError:
        raise FileFormatError(f"{path} is nested too deeply for a gonioreflectometer JSON") from None
    except ValueError as e:
        raise FileFormatError(f"{path} is truncated or no JSON: {e}") from None
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


def write(
    dataset: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    provenance: str | None = None,
    comment: str | None = None,
    digits: int | None = None,
) -> Path:
    """Write an in-plane BRDF as gonioreflectometer JSON, one spectrum a line; spectra that are all NaN are left out.

    provenance, comment : texts for element 0, by default those in the attributes
    digits : significant digits of the BRDF; None keeps every bit
    Raises InputError for a hemisphere, further dimensions or a plane that is neither at φ = 0 nor at 180°.
    """
    path = Path(path)
    brdf, stderr, plane = _in_plane(dataset)
    texts = {
        "comment": comment or dataset.attrs.get("comment"),
        "provenance": provenance or dataset.attrs.get("provenance"),
    }
    head = {k: v for k, v in texts.items() if v} | {"wavelengths": dataset["wavelength"].values.tolist()}
    lines = [json.dumps(head, ensure_ascii=False)]
    theta_i, theta_o = dataset["theta_i"].values, dataset["theta_o"].values
    for i, o in zip(*np.nonzero(np.isfinite(brdf).any(axis=-1))):
        entry: dict[str, Any] = {**_side(theta_i[i], plane, "In"), **_side(theta_o[o], plane, "Out")}
        entry["spectrum"] = _rounded(brdf[i, o], digits)
        if stderr is not None:
            entry["standardError"] = _rounded(stderr[i, o], digits)
        lines.append(json.dumps(entry, separators=(",", ":"), allow_nan=False))
    if len(lines) == 1:
        raise InputError("the BRDF to write holds no finite value")
    with written_whole(path) as stream:
        stream.write(("[\n" + ",\n".join(lines) + "\n]\n").encode())
    return path


def _in_plane(dataset: xr.Dataset) -> tuple[Floats, Floats | None, float]:
    check(dataset)
    dims = ("theta_i", "theta_o", "wavelength")
    if set(dataset["brdf"].dims) != set(dims):
        got = ", ".join(map(str, dataset["brdf"].dims))
        raise InputError(f"gonioreflectometer JSON holds in-plane BRDFs over {', '.join(dims)}, got {got}")
    plane = float(dataset["phi_i"]) % 360 if "phi_i" in dataset.coords else 0.0
    if plane not in (0.0, 180.0):
        raise InputError(f"gonioreflectometer JSON holds planes of incidence at 0° or 180°, got phi_i = {plane:g}°")
    stderr = dataset["brdf_stderr"].transpose(*dims).values if "brdf_stderr" in dataset else None
    if stderr is not None and not np.any(np.isfinite(stderr)):
        stderr = None
    return dataset["brdf"].transpose(*dims).values, stderr, plane


def _side(theta: float, plane: float, suffix: str) -> dict[str, float]:
    phi = plane if theta >= 0 else (plane + 180.0) % 360.0
    return {f"theta{suffix}": _short(abs(theta)), f"phi{suffix}": _short(phi)}


def _short(value: float) -> float | int:
    return int(value) if float(value).is_integer() else float(value)


def _rounded(values: Floats, digits: int | None) -> list[float | None]:
    return [None if not np.isfinite(v) else float(v if digits is None else f"{v:.{digits}g}") for v in values]
