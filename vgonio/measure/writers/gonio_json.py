"""The thesis' gonioreflectometer JSON, as `measure.readers.gonio_json` reads it: one spectrum a line."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...dataset import check
from ...errors import InputError
from ...files import written_whole
from .rows import plane_of

Floats = NDArray[np.float64]


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
    plane = plane_of(dataset)
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
