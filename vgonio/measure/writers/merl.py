"""MERL binary of any result, at the middles of its bins; layout in `measure.readers.merl`."""

from __future__ import annotations

import os
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...directions import unit_vectors
from ...files import written_whole
from ..isotropic import IsotropicBrdf, isotropic
from ..readers.channels import RGB_NM, mixture
from ..readers.merl import SCALE, SHAPE, middles

Floats = NDArray[np.float64]


def write(
    dataset: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    fill: str | IsotropicBrdf | None = None,
    rgb_nm: Sequence[float] = RGB_NM,
) -> Path:
    """Write the isotropic BRDF of a dataset as MERL binary; bins below the horizon are −1, "invalid".

    fill : for in-plane data, see `measure.isotropic.isotropic`;  rgb_nm : wavelengths taken as R, G and B, linear
    between those of the dataset (one wavelength serves all three): a look, no colorimetry
    Raises InputError for in-plane data without `fill`, or channels outside the dataset's wavelengths.
    """
    brdf = isotropic(dataset, fill)
    mix = mixture(brdf.wavelength, rgb_nm)
    theta_h, theta_d, phi_d = (a.ravel() for a in np.meshgrid(*middles(), indexing="ij"))
    wi, wo = directions(theta_h, theta_d, phi_d)
    above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
    values = np.full((above.size, 3), -1.0)
    values[above] = np.nan_to_num(brdf(wi[above], wo[above]) @ mix, nan=-1.0)
    table = np.where(values >= 0, values / SCALE, -1.0).T.reshape(3, *SHAPE)
    path = Path(path)
    with written_whole(path) as stream:
        stream.write(struct.pack("<3i", *SHAPE) + table.astype("<f8").tobytes())
    return path


def directions(theta_h: Floats, theta_d: Floats, phi_d: Floats) -> tuple[Floats, Floats]:
    """ω_i and ω_o, (n, 3) each, of half and difference angles in radians; the half vector lies at azimuth 0."""
    d = unit_vectors(theta_d, phi_d)
    c, s = np.cos(theta_h), np.sin(theta_h)
    wi = np.stack([d[:, 0] * c + d[:, 2] * s, d[:, 1], d[:, 2] * c - d[:, 0] * s], axis=1)
    h = unit_vectors(theta_h)
    return wi, 2 * np.sum(wi * h, axis=1)[:, None] * h - wi
