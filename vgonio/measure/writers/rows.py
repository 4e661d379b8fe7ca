"""From the dataset to rows of a table: directions, wavelength, value."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...dataset import check
from ...errors import InputError
from ..readers.in_plane import signed_as_full

Floats = NDArray[np.float64]


def in_plane(dataset: xr.Dataset) -> bool:
    """Whether the plane of incidence is at azimuth 0 and holds every direction: signed angles say it all."""
    return "theta_o" in check(dataset)["brdf"].dims and plane_of(dataset) == 0


def plane_of(dataset: xr.Dataset) -> float:
    """Azimuth of the plane of incidence in 0 … 360°."""
    return float(dataset["phi_i"]) % 360 if "phi_i" in dataset.coords else 0.0


def directions_of(dataset: xr.Dataset, signed: bool = False) -> Floats:
    """(n_i, n_o, 4) θ_i, φ_i, θ_o, φ_o in degrees; θ ≥ 0, or as they are (`signed`, φ without meaning)."""
    check(dataset)
    extra = set(dataset["brdf"].dims) - {"theta_i", "theta_o", "cell", "wavelength"}
    if extra:
        raise InputError(
            f"a table has no place for the dimension {sorted(map(str, extra))[0]!r}: select one entry first"
        )
    theta_i, theta_o, plane = dataset["theta_i"].values, dataset["theta_o"].values, plane_of(dataset)
    i, o = (a.ravel() for a in np.meshgrid(theta_i, theta_o, indexing="ij"))
    if "cell" in dataset["brdf"].dims:
        phi_o = np.tile(dataset["phi_o"].values % 360.0, theta_i.size)
        sides = signed_as_full(i, np.zeros_like(i), plane)
        found = np.stack([sides[:, 0], sides[:, 1], o, phi_o], axis=1)
    elif signed:
        found = np.stack([i, np.zeros_like(i), o, np.zeros_like(i)], axis=1)
    else:
        found = signed_as_full(i, o, plane)
    return found.reshape(theta_i.size, theta_o.size, 4)


def spectra_of(dataset: xr.Dataset, name: str = "brdf") -> Floats | None:
    """(n_i, n_o, n_λ) of a variable, or None where it is absent or holds no number."""
    if name not in dataset:
        return None
    dim = "cell" if "cell" in dataset["brdf"].dims else "theta_o"
    values = dataset[name].transpose("theta_i", dim, "wavelength").values
    return values if np.any(np.isfinite(values)) else None


def rows_of(dataset: xr.Dataset, signed: bool = False) -> tuple[Floats, Floats, Floats, Floats | None]:
    """Directions (n, 4), wavelength (n,), value (n,) and standard error (n,) or None of the finite values."""
    directions, values = directions_of(dataset, signed), spectra_of(dataset)
    if values is None:
        raise InputError("the BRDF to write holds no finite value")
    i, o, w = np.nonzero(np.isfinite(values))
    stderr = spectra_of(dataset, "brdf_stderr")
    return (
        directions[i, o],
        dataset["wavelength"].values[w],
        values[i, o, w],
        None if stderr is None else stderr[i, o, w],
    )
