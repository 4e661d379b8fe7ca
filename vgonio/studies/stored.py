"""One stored point, read fast: xarray takes 60 ms to open a result of some groups, HDF5 itself 2 ms."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..errors import FileFormatError
from ..hdf5 import require_harmless_groups

LENGTHS = {"Sq", "Sa", "Sz", "Sal"}  # of the parameters of ISO 25178 that a result keeps
UNITS = (("_um", "um"), ("_nm", "nm"), ("_deg", "degree"))


def read_point(path: Path) -> dict[str, xr.Dataset]:
    """The groups of a stored result that hold a BRDF, its `surfaces` (parameters) and its `seconds`; numbers only.

    Raises FileFormatError for a file that cannot be read: removed, it is computed again.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            require_harmless_groups(file, path)
            found = {"seconds": _seconds(file.attrs.get("seconds", "{}"))}
            for name, group in file.items():
                if isinstance(group, h5py.Group) and "brdf" in group and name != "measured":
                    found[name] = _numbers(group)
                elif name == "surface":
                    found["surfaces"] = _parameters(group.attrs)
    except FileFormatError:
        raise
    except Exception as e:  # damaged HDF5 fails in as many ways as there are bytes
        raise FileFormatError(f"{path} is damaged ({e}): remove it, and it is computed again") from None
    return found


def _numbers(group: Any) -> xr.Dataset:
    """Variables of numbers; dims without a coordinate count from 0."""
    arrays = {k: v for k, v in group.items() if hasattr(v, "shape") and v.dtype.kind in "fiu" and not _is_bare(v)}
    variables = {k: (_dims(k, v), v[()], _attrs(v)) for k, v in arrays.items()}
    coordinates = {k for k, (dims, *_) in variables.items() if dims == (k,)}
    coordinates |= set(str(group["brdf"].attrs.get("coordinates", "")).split()) & set(variables)
    data = xr.Dataset({k: v for k, v in variables.items() if k not in coordinates}).assign_coords(
        {k: variables[k] for k in coordinates}
    )
    return data.assign_coords({d: np.arange(n) for d, n in data.sizes.items() if d not in data.coords})


def _is_bare(variable: Any) -> bool:
    """NetCDF's dimensions without values are stored as variables that say so."""
    return bytes(variable.attrs.get("NAME", b"")).startswith(b"This is a netCDF dimension")


def _dims(name: str, variable: Any) -> tuple[str, ...]:
    if variable.is_scale:
        return (name,)
    return tuple(d[0].name.rpartition("/")[2] for d in variable.dims)


def _attrs(variable: Any) -> dict[str, str]:
    return {k: str(variable.attrs[k]) for k in ("units", "long_name") if k in variable.attrs}


def _seconds(text: Any) -> xr.Dataset:
    value = float(sum(json.loads(text).values()))
    return xr.Dataset({"seconds": ((), value, {"units": "s", "long_name": "run time"})})


def _parameters(attrs: Mapping[str, Any]) -> xr.Dataset:
    # NetCDF keeps a single number as a list of one
    found = {k: np.asarray(v) for k, v in attrs.items()}
    numbers = {k: float(v.ravel()[0]) for k, v in found.items() if v.size == 1 and v.dtype.kind in "fiu"}
    return xr.Dataset({k: ((), v, {"units": unit(k), "long_name": k}) for k, v in numbers.items()})


def unit(name: str) -> str:
    """The unit that a name carries at its end, or that of a surface parameter."""
    return "um" if name in LENGTHS else next((u for end, u in UNITS if name.endswith(end)), "1")
