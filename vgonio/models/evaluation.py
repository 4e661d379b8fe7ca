"""Models evaluated: at pairs of directions, and as the dataset that every result is."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ..dataset import label, plain, versions
from ..directions import Detector, angle_list, wavelength_list
from ..errors import InputError, VgonioWarning, nearest
from ..units import radians
from .geometry import Geometry
from .registry import EMPTY, Model, find

Floats = NDArray[np.float64]
SMALLEST = 1e-50  # parameter that is not 0


def brdf(model: str, geometry: Geometry, wavelength_nm: ArrayLike, **parameters: Any) -> Floats:
    """Values in sr⁻¹ of shape geometry.shape + (n_λ,), of a named model at any pairs of directions.

    Raises InputError and MaterialError as `evaluate`; negative values are returned as they are.
    """
    entry = find(model)
    _check_parameters(model, entry, parameters)
    wavelength = wavelength_list(wavelength_nm)
    shape = {k: v for k, v in parameters.items() if k not in entry.coefficients}
    parts = entry.terms(geometry, wavelength, **entry.preset, **shape)
    total = np.zeros((*geometry.shape, wavelength.size))
    for name, part in parts.items():
        total += part * _coefficient(entry, name, parameters, wavelength)
    return total


def _coefficient(entry: Model, name: str, given: Mapping[str, Any], wavelength: Floats) -> Floats:
    """(n_λ,) or (1,) factor of a term. k_d is an albedo, 0…1; k_s any factor that is not negative."""
    if not name:
        return np.ones(1)
    values = np.asarray(given.get(name, entry.coefficients[name]), dtype=np.float64)
    if values.ndim > 1 or values.size not in (1, wavelength.size):
        raise InputError(
            f"{name} has shape {values.shape}: give a number or one value for each of {wavelength.size} wavelengths"
        )
    if name == "k_d" and not np.all((values >= 0) & (values <= 1)):
        raise InputError(f"k_d = {values.tolist()}: a diffuse albedo lies within 0…1")
    if not np.all(np.isfinite(values) & (values >= 0)):
        raise InputError(f"{name} = {values.tolist()}: finite values are needed, none negative")
    return np.atleast_1d(values)


def evaluate(
    model: str, theta_i_deg: ArrayLike, theta_o_deg: ArrayLike | Detector, wavelength_nm: ArrayLike, **parameters: Any
) -> xr.Dataset:
    """The BRDF of a named model on a grid of directions, as the dataset that every result is.

    theta_i_deg (n_i,) : degrees;  wavelength_nm (n_λ,);  parameters : see `table()`
    theta_o_deg (n_o,) : signed in-plane angles in degrees, or the cells of `Detector.hemisphere(…)`
    Returns brdf (theta_i, theta_o or cell, wavelength) in sr⁻¹ at the exact directions (no detector cone); attrs name
    the model, its source and the parameters. A model whose shift is negative somewhere warns (VgonioWarning) and says
    so in attrs.
    Raises InputError for an unknown model, a missing, unknown or impossible parameter, MaterialError for wavelengths
    outside the material's table.
    """
    entry = find(model)
    theta_i, wavelength = angle_list(theta_i_deg, "theta_i_deg"), wavelength_list(wavelength_nm)
    geometry, dim, coords = _grid(theta_i, theta_o_deg)
    values = brdf(model, geometry, wavelength, **parameters)
    report = _shift_report(model, entry, geometry, wavelength, parameters)
    used = {k: v for k, v in entry.parameters.items() if v is not EMPTY} | parameters
    return label(
        xr.Dataset(
            {"brdf": (("theta_i", dim, "wavelength"), values)},
            coords={"theta_i": theta_i, **coords, "wavelength": wavelength, "phi_i": 0.0},
            attrs={
                "method": "model",
                "model": model,
                "source": entry.source,
                "parameters": json.dumps({k: _json(v) for k, v in used.items()}),
                "versions": versions(),
                **{k: plain(v) for k, v in report.items()},
            },
        )
    )


def _grid(theta_i: Floats, theta_o: ArrayLike | Detector) -> tuple[Geometry, str, dict[str, Any]]:
    if isinstance(theta_o, Detector):
        detector, dim = theta_o, theta_o.dims[0]
        coords: dict[str, Any] = {"theta_o": (dim, detector.theta_deg), "phi_o": (dim, detector.phi_deg)}
        if dim == "cell":
            coords |= {"cell": np.arange(len(detector)), "solid_angle": (dim, detector.solid_angle)}
        return (
            Geometry.of(radians(theta_i)[:, None], radians(detector.theta_deg), 0.0, radians(detector.phi_deg)),
            dim,
            coords,
        )
    angles = angle_list(theta_o, "theta_o_deg")
    return Geometry.of(radians(theta_i)[:, None], radians(angles)[None, :]), "theta_o", {"theta_o": angles}


def _shift_report(
    name: str, entry: Model, geometry: Geometry, wavelength: Floats, parameters: Mapping[str, Any]
) -> dict[str, float]:
    if entry.shift is None:
        return {}
    factor = entry.shift(geometry, wavelength, **{k: v for k, v in parameters.items() if k not in entry.coefficients})
    share, lowest = float(np.mean(factor < 0)), float(factor.min())
    if share > 0:
        warnings.warn(
            f"{name}: the shift is negative at {share:.1%} of the points (minimum {lowest:.3g}); choose a smaller "
            "slope, or clamp=True to set it to 0",
            VgonioWarning,
            stacklevel=3,
        )
    return {"shift_negative_share": share, "shift_minimum": lowest}


def _check_parameters(name: str, entry: Model, given: Mapping[str, Any]) -> None:
    known = entry.parameters
    for key in given:
        if key not in known:
            raise InputError(f"model {name!r} has no parameter {key!r}: {nearest(key, known)}")
    missing = [k for k, v in known.items() if v is EMPTY and k not in given]
    if missing:
        raise InputError(f"model {name!r} needs {', '.join(missing)}: give {missing[0]}=…")
    if given.get("eta") is not None and "material" in given:
        raise InputError("give either eta (a dielectric of constant index) or material, not both")
    for key, value in given.items():
        if isinstance(value, int | float) and not _computable(value):
            raise InputError(
                f"{key} = {value:g}: sizes from {SMALLEST:g} to {1 / SMALLEST:g} can be computed with, and 0"
            )


def _computable(value: float) -> bool:
    """Whether the fourth power is a number; what is no number is left to the model, which knows why."""
    return not np.isfinite(value) or value == 0 or SMALLEST <= abs(value) <= 1 / SMALLEST


def _json(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, xr.DataArray):
        return f"array over {', '.join(map(str, value.dims))} of shape {value.shape}"
    kept = value is None or isinstance(value, (str, int, float, list, tuple))
    return value if kept else getattr(value, "name", str(value))
