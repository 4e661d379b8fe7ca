"""What has no formula in the renderer goes there as a table in RGL's layout, for Mitsuba's `measured`."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import brdf_dataset
from ..directions import Detector
from ..measure.formats import write
from ..measure.isotropic import IsotropicBrdf, isotropic
from ..models import Geometry, brdf

Floats = NDArray[np.float64]


@lru_cache(maxsize=1)
def _folder() -> Path:
    """A temporary folder that goes when the process ends: Mitsuba reads the file when the scene is made."""
    folder = tempfile.mkdtemp(prefix="vgonio-render-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def table_file(data: xr.Dataset, fill: Any = "half-angle", folder: Any = None) -> tuple[Path, str]:
    """Write the table of a dataset; its path and how values outside the measured directions come about."""
    known = isotropic(data, None if "cell" in data["brdf"].dims else fill)
    place = _folder() if folder is None else Path(folder)
    path = place / f"{len(list(place.glob('*.bsdf')))}.bsdf"
    return Path(write(data, path, fill=known)), known.note


def of_formula(model: str, parameters: Mapping[str, Any], wavelength_nm: Any) -> IsotropicBrdf:
    """A model of `vgonio.models` as a function of two directions; negative values are 0."""
    w = np.asarray(wavelength_nm, dtype=np.float64)

    def values(wi: Floats, wo: Floats) -> Floats:
        polar = [np.arccos(np.clip(d[:, 2], -1, 1)) for d in (wi, wo)]
        azimuth = [np.arctan2(d[:, 1], d[:, 0]) for d in (wi, wo)]
        return np.maximum(brdf(model, Geometry.of(*polar, *azimuth), w, **parameters), 0.0)

    return IsotropicBrdf(w, values, f"{model} as a table")


def formula_file(model: str, parameters: Mapping[str, Any], wavelength_nm: Any) -> tuple[Path, str]:
    """The table of a model without a plug-in."""
    known = of_formula(model, parameters, wavelength_nm)
    detector = Detector.in_plane([0.0], 1.0)
    empty = brdf_dataset({"brdf": (("theta_i", "theta_o", "wavelength"), np.zeros((1, 1, known.wavelength.size)))},
                         [0.0], known.wavelength, detector, attrs={"source": model})  # fmt: skip
    return table_file(empty, known)
