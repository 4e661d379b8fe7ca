"""A BRDF as a NetCDF-4 file of vgonio with a single dataset."""

from __future__ import annotations

import os
from pathlib import Path

import xarray as xr

from ...dataset import check
from .. import storage


def write(dataset: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    return storage.save(check(dataset), path)
