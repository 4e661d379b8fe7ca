"""What a result keeps of its surface: a small picture, parameters, and the distributions that the report draws."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..errors import FileFormatError
from ..surface.heightfield import Heightfield
from ..surface.spectrum import psd
from ..surface.statistics import parameters, slope_distribution

Floats = NDArray[np.float64]
LARGEST_PICTURE = 256  # samples a side
BINS = 101

UNITS = {
    "z": ("um", "height"),
    "z_detail": ("um", "height, the middle of the field at its full resolution"),
    "height_density": ("um-1", "probability density of the heights"),
    "slope_density": ("1", "probability density of the slope along one axis"),
    "psd": ("um4", "power spectral density, mean over directions"),
    "x": ("um", "position along x"),
    "y": ("um", "position along y"),
    "x_detail": ("um", "position along x"),
    "y_detail": ("um", "position along y"),
    "height": ("um", "height about the mean"),
    "slope": ("1", "slope"),
    "frequency": ("um-1", "spatial frequency"),
}


NEEDED = {"z": ("y", "x"), "height_density": ("height",), "slope_density": ("slope",)}


def check_summary(data: xr.Dataset, what: str = "summary") -> xr.Dataset:
    """Raise FileFormatError unless `data` is a summary of a surface as `surface_dataset` makes it."""
    for name, dims in NEEDED.items():
        variable = data.get(name)
        if variable is None or variable.dims != dims or variable.dtype.kind != "f" or not variable.size:
            raise FileFormatError(f"{what}: {name!r} over {', '.join(dims)} is missing or holds no numbers")
        if not set(dims) <= set(data.coords):
            raise FileFormatError(f"{what}: {name!r} lacks a coordinate of {', '.join(dims)}")
    return data


def surface_dataset(surface: Heightfield) -> xr.Dataset:
    """A summary of a height field of some 100 kB, whatever its size.

    z (y, x) : every n-th sample, at most 256 a side, µm; z_detail (y_detail, x_detail) : the middle, every sample,
    where z is not the whole;  height_density (height), slope_density (slope) : of all samples, both axes pooled (x
    alone for a profile);  psd (frequency) : mean over rings in µm⁴, for a profile in µm³; absent while points miss
    attrs : the parameters of `surface.statistics.parameters` in µm, name, history (JSON), pitch, size, samples
    """
    steps = [-(-n // LARGEST_PICTURE) for n in surface.shape]
    picture = tuple(slice(step // 2, None, step) for step in steps)
    parts = {"z": (picture, "y", "x")}
    if max(steps) > 1:
        parts["z_detail"] = (tuple(map(_middle, surface.shape)), "y_detail", "x_detail")
    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    for name, (part, y, x) in parts.items():
        variables[name] = ((y, x), surface.z[part].astype(np.float32))
        coordinates |= {y: surface.y[part[0]], x: surface.x[part[1]]}
    height, density = height_density(surface)
    slopes = slope_distribution(surface, BINS)
    pooled = slopes.density_x if surface.is_profile else (slopes.density_x + slopes.density_y) / 2
    variables |= {"height_density": (("height",), density), "slope_density": (("slope",), pooled)}
    coordinates |= {"height": height, "slope": slopes.slope}
    if not surface.missing:
        frequency, power = _mean_psd(surface)
        variables["psd"] = (("frequency",), power)
        coordinates["frequency"] = frequency
    return _labelled(xr.Dataset(variables, coordinates, _facts(surface)), surface)


def _middle(n: int) -> slice:
    size = min(n, max(64, min(n // 4, LARGEST_PICTURE)))
    return slice((n - size) // 2, (n - size) // 2 + size)


def height_density(surface: Heightfield) -> tuple[Floats, Floats]:
    """(n,) heights about their mean in µm and (n,) their probability density in µm⁻¹; integral 1."""
    z = surface.z[np.isfinite(surface.z)]
    z = z - z.mean()
    reach = max(float(np.abs(z).max()), 1e-9)
    density, edges = np.histogram(z, np.linspace(-reach, reach, BINS + 1), density=True)
    return (edges[1:] + edges[:-1]) / 2, density


def _mean_psd(surface: Heightfield) -> tuple[Floats, Floats]:
    """(n,) frequencies in µm⁻¹ and the PSD over them: ring means in µm⁴, of a profile along x in µm³."""
    spectrum = psd(surface)
    if surface.is_profile:
        step = spectrum.fy[1] - spectrum.fy[0] if spectrum.fy.size > 1 else 1.0
        positive = spectrum.fx > 0
        return spectrum.fx[positive], spectrum.values.sum(axis=0)[positive] * step
    ring = spectrum.radial()
    return ring.f, ring.values


def _facts(surface: Heightfield) -> dict[str, Any]:
    ny, nx = surface.shape
    ly, lx = surface.size_um
    pitch = f"{surface.dx:g} µm" if surface.dx == surface.dy else f"{surface.dx:g} × {surface.dy:g} µm"
    facts: dict[str, Any] = {k: float(v) for k, v in parameters(surface).items()}
    return facts | {
        "name": surface.name,
        "history": json.dumps(list(surface.history), ensure_ascii=False),
        "points": f"{nx} × {ny}",
        "pitch": pitch,
        "size": f"{lx:.6g} × {ly:.6g} µm",
        "missing": surface.missing,
        "interpolation": surface.interpolation,
        "periodic": int(surface.periodic),
    }


def _labelled(data: xr.Dataset, surface: Heightfield) -> xr.Dataset:
    for name in data.variables:
        data[name].attrs = dict(zip(("units", "long_name"), UNITS[str(name)]))
    if "psd" in data and surface.is_profile:
        data["psd"].attrs = {"units": "um3", "long_name": "power spectral density of the profile"}
    return data
