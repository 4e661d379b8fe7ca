"""MERL binary (Matusik 2003): three int32 (90, 90, 180), then R, G, B in the angles of Rusinkiewicz 1998.

Bin k of θ_h spans 90°·(k/90)² … 90°·((k + 1)/90)², bins of θ_d and φ_d are 1° wide, φ_d from 0 to 180°. Values are
float64 over 1/1500, 1.15/1500, 1.66/1500 sr⁻¹ for R, G, B; negative means invalid. Here a bin's value is that of its
middle, and directions between are interpolated linearly.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ...directions import half_vectors
from ...errors import FileFormatError
from ..isotropic import IsotropicBrdf, sampled
from .channels import nominal
from .checks import Repairs

Floats = NDArray[np.float64]
SHAPE = (90, 90, 180)
SCALE = np.array([1.0, 1.15, 1.66]) / 1500.0
SIZE = 12 + 3 * 8 * int(np.prod(SHAPE))


def sniff(head: bytes) -> bool:
    return head[:12] == struct.pack("<3i", *SHAPE)


def read(
    path: Path,
    repairs: Repairs,
    *,
    theta_i_deg: ArrayLike | None = None,
    theta_o_deg: ArrayLike | None = None,
    resolution_deg: float | None = None,
) -> xr.Dataset:
    """The dataset at the angles asked for (`measure.isotropic.sampled`), over nominal wavelengths of R, G, B."""
    brdf, note = load(path)
    attrs: dict[str, Any] = {"source": path.name, "channels": note}
    return sampled(brdf, theta_i_deg, theta_o_deg, resolution_deg, attrs).sortby("wavelength")


def load(path: Path) -> tuple[IsotropicBrdf, str]:
    """The BRDF of the file as a function, and what its wavelengths stand for.

    Raises FileFormatError for another size or header.
    """
    try:
        content = path.read_bytes() if path.stat().st_size == SIZE else b""
    except OSError as e:
        raise FileFormatError(f"cannot read {path}: {e.strerror or e}") from None
    if not sniff(content):
        raise FileFormatError(
            f"{path} is no MERL file: {SIZE} bytes that begin with 90, 90, 180 are needed, it has {path.stat().st_size}"
        )
    table = np.frombuffer(content, "<f8", offset=12).reshape(3, *SHAPE) * SCALE[:, None, None, None]
    table = np.moveaxis(np.where((table >= 0) & (table < np.inf), table, np.nan), 0, -1)
    wavelength, note = nominal(["R", "G", "B"], str(path))
    return IsotropicBrdf(wavelength, lambda wi, wo: _lookup(table, wi, wo), "linear between MERL's bins"), note


def coordinates(wi: Floats, wo: Floats) -> tuple[Floats, Floats, Floats]:
    """θ_h, θ_d and φ_d in radians of (n, 3) pairs; φ_d in 0 … π, as isotropic reciprocal BRDFs need no more."""
    h = half_vectors(wi, wo)
    theta_h, phi_h = np.arccos(np.clip(h[:, 2], -1, 1)), np.arctan2(h[:, 1], h[:, 0])
    # ω_i turned so that the half vector becomes the normal
    x = wi[:, 0] * np.cos(phi_h) + wi[:, 1] * np.sin(phi_h)
    y = wi[:, 1] * np.cos(phi_h) - wi[:, 0] * np.sin(phi_h)
    d = np.stack(
        [x * np.cos(theta_h) - wi[:, 2] * np.sin(theta_h), y, x * np.sin(theta_h) + wi[:, 2] * np.cos(theta_h)], 1
    )
    return theta_h, np.arccos(np.clip(d[:, 2], -1, 1)), np.arctan2(d[:, 1], d[:, 0]) % np.pi


def _lookup(table: Floats, wi: Floats, wo: Floats) -> Floats:
    theta_h, theta_d, phi_d = coordinates(wi, wo)
    # in bins, measured between their middles; θ_h on its own stretched axis
    middle = middles()
    h = np.interp(theta_h, middle[0], np.arange(90.0))
    d = np.clip(theta_d / (np.pi / 2) * 90 - 0.5, 0, 89)
    p = (phi_d / np.pi * 180 - 0.5) % 180
    total = 0.0
    for corner in range(8):
        weight, place = 1.0, []
        for axis, (x, size) in enumerate(((h, 90), (d, 90), (p, 180))):
            low = np.minimum(np.floor(x).astype(int), size - 1)
            up = corner >> axis & 1
            weight = weight * (x - low if up else 1 - (x - low))
            place.append((low + up) % size if axis == 2 else np.minimum(low + up, size - 1))
        value = table[place[0], place[1], place[2]]
        # a bin without weight must not spoil the others with its NaN
        total = total + np.where(np.asarray(weight)[:, None] > 1e-12, value, 0.0) * np.asarray(weight)[:, None]
    return np.asarray(total)


def middles() -> tuple[Floats, Floats, Floats]:
    """θ_h (90,), θ_d (90,) and φ_d (180,) of the middles of the bins, radians."""
    k = np.arange(90)
    theta_h = (k**2 + (k + 1) ** 2) / 2 / 90**2 * np.pi / 2
    return theta_h, (k + 0.5) / 90 * np.pi / 2, (np.arange(180) + 0.5) / 180 * np.pi
