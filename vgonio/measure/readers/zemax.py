"""Zemax tabular BSDF (text `.bsdf`, Radiant's BSDF Data Interchange format).

Keyword lines Source, Symmetry, SpectralContent, ScatterType, then SampleRotation, AngleOfIncidence, ScatterAzimuth and
ScatterRadial, each with a count and its angles in degrees on the next line, `Monochrome` or `TristimulusX|Y|Z`,
`DataBegin`, for each angle of incidence `TIS t` and one row of values over the radial angles for each azimuth, and
`DataEnd`. Radial and azimuth angles are polar about the *mirror direction*: radial 0 is the mirror direction, azimuth
0 points from it towards the normal. `PlaneSymmetrical` files have azimuths 0 … 180° only. The format knows no
wavelength: it is read from a comment `# Wavelength_nm 550` as this package writes it, or given.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ...directions import unit_vectors
from ...errors import FileFormatError
from ...files import text_of
from ...units import radians
from ..isotropic import IsotropicBrdf, sampled
from .channels import nominal
from .checks import Repairs, check_size
from .listed import numbers

Floats = NDArray[np.float64]
AXES = ("SampleRotation", "AngleOfIncidence", "ScatterAzimuth", "ScatterRadial")
BLOCKS = {"monochrome": "", "tristimulusx": "X", "tristimulusy": "Y", "tristimulusz": "Z"}


def sniff(head: bytes) -> bool:
    text = head.decode("latin-1").lower()
    return "angleofincidence" in text or ("spectralcontent" in text and "scattertype" in text)


def read(
    path: Path,
    repairs: Repairs,
    *,
    wavelength_nm: float | None = None,
    theta_i_deg: ArrayLike | None = None,
    theta_o_deg: ArrayLike | None = None,
    resolution_deg: float | None = None,
) -> xr.Dataset:
    """The dataset at the angles asked for (`measure.isotropic.sampled`; θ_i by default those of the file).

    Its directions are polar about the mirror direction, so values between them are linear in θ_i, azimuth and radial
    angle; beyond the largest radial angle they are NaN.
    """
    brdf, theta_i, attrs = load(path, wavelength_nm)
    theta_i_deg = theta_i[theta_i < 90] if theta_i_deg is None else theta_i_deg
    attrs = {"source": path.name, **attrs}
    return sampled(brdf, theta_i_deg, theta_o_deg, resolution_deg, attrs).sortby("wavelength")


def load(path: Path, wavelength_nm: float | None = None) -> tuple[IsotropicBrdf, Floats, dict[str, Any]]:
    """The BRDF of the file as a function, its angles of incidence in degrees, and attributes.

    Raises FileFormatError for damaged, transmitting or anisotropic data, or a wavelength that nobody knows.
    """
    text = text_of(path, "Zemax BSDF")
    words = [line.split() for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    facts, axes, rest = _header(words, path)
    if facts.get("scattertype", "BRDF").upper() != "BRDF":
        raise FileFormatError(f"{path} holds transmitted light (ScatterType {facts['scattertype']}): only BRDF is read")
    if axes[0].size > 1:
        raise FileFormatError(f"{path} holds {axes[0].size} rotations of the sample: only isotropic samples are read")
    check_size(int(np.prod([a.size for a in axes])) * 3, str(path))
    names, table, tis = _blocks(rest, tuple(a.size for a in axes[1:]), path)
    wavelength, note = _wavelengths(names, text, wavelength_nm, path)
    symmetric = facts.get("symmetry", "").lower() == "planesymmetrical"
    if symmetric and (axes[2][0] < -1e-9 or axes[2][-1] > 180 + 1e-9):
        raise FileFormatError(
            f"{path}: azimuths of a PlaneSymmetrical file lie within 0 … 180°, got {axes[2].tolist()}"
        )
    grid = (radians(axes[1]), radians(axes[2]), radians(axes[3]))
    brdf = IsotropicBrdf(
        wavelength,
        lambda wi, wo: _lookup(table, grid, symmetric, wi, wo),
        "linear between the radial and azimuth angles about the mirror direction",
    )
    return brdf, axes[1], note | {"tis": tis}


def _header(words: list[list[str]], path: Path) -> tuple[dict[str, str], list[Floats], list[list[str]]]:
    facts: dict[str, str] = {}
    axes: dict[str, Floats] = {}
    k = 0
    while k < len(words) and words[k][0].lower() not in BLOCKS:
        name = next((a for a in AXES if a.lower() == words[k][0].lower()), None)
        if name is None:
            facts[words[k][0].lower()] = " ".join(words[k][1:])
            k += 1
            continue
        count = words[k][1] if len(words[k]) > 1 else ""
        values = numbers(words[k + 1] if k + 1 < len(words) else [], f"{path}, {name}")
        if count != str(values.size) or np.any(~np.isfinite(values)) or np.any(np.diff(values) <= 0):
            raise FileFormatError(
                f"{path}: {name} announces {count[:20]!r} angles, {values.size} in ascending order are found"
            )
        axes[name] = values
        k += 2
    axes.setdefault("SampleRotation", np.zeros(1))
    missing = [a for a in AXES if a not in axes or not axes[a].size]
    if missing or k == len(words):
        what = f"no {', '.join(missing)}" if missing else "no Monochrome or Tristimulus block"
        raise FileFormatError(f"{path} is truncated or no Zemax BSDF: {what}")
    theta = axes["AngleOfIncidence"]
    if theta[0] < 0 or theta[-1] > 90 or axes["ScatterRadial"][0] < 0 or axes["ScatterRadial"][-1] > 180:
        raise FileFormatError(f"{path}: angles of incidence lie within 0 … 90°, radial angles within 0 … 180°")
    return facts, [axes[a] for a in AXES], words[k:]


def _blocks(words: list[list[str]], shape: tuple[int, ...], path: Path) -> tuple[list[str], Floats, str]:
    """Names of the channels, (θ_i, azimuth, radial, channel) values, and the TIS as text."""
    names: list[str] = []
    blocks: list[Floats] = []
    tis: list[str] = []
    rows: list[list[str]] = []
    for line in [*words, ["DataEnd"]]:
        key = line[0].lower()
        if key in BLOCKS:
            names.append(BLOCKS[key])
        elif key == "tis":
            tis.append(" ".join(line[1:]))
        elif key == "dataend":
            if rows:
                blocks.append(_block(rows, shape, path))
                rows = []
        elif key != "databegin":
            rows.append(line)
    if len(blocks) != len(names) or not blocks:
        raise FileFormatError(f"{path} is truncated: {len(names)} channels and {len(blocks)} blocks of data")
    return names, np.stack(blocks, axis=-1), ", ".join(tis)


def _block(rows: list[list[str]], shape: tuple[int, ...], path: Path) -> Floats:
    if len(rows) != shape[0] * shape[1] or any(len(r) != shape[2] for r in rows):
        raise FileFormatError(
            f"{path} is truncated or damaged: {shape[0] * shape[1]} rows of {shape[2]} values are announced, "
            f"{len(rows)} rows are found, or one of another length"
        )
    values = numbers([v for r in rows for v in r], str(path)).reshape(shape)
    if np.any(np.isinf(values)):
        raise FileFormatError(f"{path} holds an infinite value")
    return values


def _wavelengths(names: list[str], text: str, given: float | None, path: Path) -> tuple[Floats, dict[str, str]]:
    if len(names) > 1 or names[0]:
        nm, note = nominal(names, str(path))
        return nm, {"channels": note}
    stated = re.search(r"^#\s*Wavelength_nm\s+([\d.]+)\s*$", text, re.MULTILINE)
    if given is None and stated is None:
        raise FileFormatError(
            f"{path} does not say its wavelength (the format has no place for it): give wavelength_nm"
        )
    return numbers([str(given) if given is not None else stated[1]], f"{path}, wavelength"), {}  # type: ignore[index]


def polar_about_mirror(theta_i: Floats, wo: Floats) -> tuple[Floats, Floats]:
    """Azimuth (0 towards the normal, −π … π) and radial angle of ω_o (n, 3), radians; light from +x at θ_i (n,)."""
    mirror, up = unit_vectors(-theta_i), unit_vectors(np.pi / 2 - theta_i)
    x, y, z = np.sum(wo * up, axis=1), wo[:, 1], np.sum(wo * mirror, axis=1)
    return np.arctan2(y, x), np.arctan2(np.hypot(x, y), z)


def from_mirror(theta_i: float, azimuth: Floats, radial: Floats) -> Floats:
    """(n, 3) directions ω_o of azimuths and radial angles (n,), radians; z < 0 is below the horizon."""
    mirror, up = unit_vectors(-theta_i), unit_vectors(np.pi / 2 - theta_i)
    s = np.sin(radial)[:, None]
    return np.cos(radial)[:, None] * mirror + s * (
        np.cos(azimuth)[:, None] * up + np.sin(azimuth)[:, None] * np.array([0.0, 1.0, 0.0])
    )


def _lookup(table: Floats, grid: tuple[Floats, Floats, Floats], symmetric: bool, wi: Floats, wo: Floats) -> Floats:
    theta_i, phi = np.arccos(np.clip(wi[:, 2], -1, 1)), np.arctan2(wi[:, 1], wi[:, 0])
    c, s = np.cos(phi), np.sin(phi)
    local = np.stack([wo[:, 0] * c + wo[:, 1] * s, wo[:, 1] * c - wo[:, 0] * s, wo[:, 2]], axis=1)
    azimuth, radial = polar_about_mirror(theta_i, local)
    if symmetric:
        azimuth = np.abs(azimuth)
    else:
        azimuth = (azimuth - grid[1][0]) % (2 * np.pi) + grid[1][0]
        if grid[1].size > 1 and grid[1][-1] < grid[1][0] + 2 * np.pi - 1e-9:  # the circle closes
            grid = (grid[0], np.append(grid[1], grid[1][0] + 2 * np.pi), grid[2])
            table = np.concatenate([table, table[:, :1]], axis=1)
    total = np.zeros((len(wo), table.shape[-1]))
    for corner in range(8):
        weight, place = np.ones(len(wo)), []
        for axis, x in enumerate((theta_i, azimuth, radial)):
            low, t = _bracket(grid[axis], x)
            up = corner >> axis & 1
            weight = weight * (t if up else 1 - t)
            place.append(np.minimum(low + up, grid[axis].size - 1))
        value = table[place[0], place[1], place[2]]
        total += np.where(weight[:, None] > 1e-12, value, 0.0) * weight[:, None]
    total[radial > grid[2][-1] + 1e-9] = np.nan
    return total


def _bracket(axis: Floats, x: Floats) -> tuple[NDArray[np.intp], Floats]:
    if axis.size == 1:
        return np.zeros(x.size, np.intp), np.zeros(x.size)
    low = np.clip(np.searchsorted(axis, x, side="right") - 1, 0, axis.size - 2)
    return low, np.clip((x - axis[low]) / (axis[low + 1] - axis[low]), 0.0, 1.0)
