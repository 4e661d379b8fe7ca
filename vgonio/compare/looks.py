"""How a BRDF looks to instruments of one number: gloss, haze, reflectance and scatter as the eye weighs wavelengths."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import ascending, takes_nodes
from ..errors import VgonioError
from ..units import radians
from .cells import integrated
from .drawn_errors import standard_errors
from .gloss import RECEPTORS_DEG, Reading, gloss, haze, luminous_weights
from .metrics import labelled
from .reflectances import (
    ENERGIES,
    OWN_CONE,
    SPECULAR_DEG,
    hemisphere_rule,
    reflectance,
    total_integrated_scatter,
)

Floats = NDArray[np.float64]
Row = dict[str, Any]
# variable: what it is called in a table, its unit there
READINGS = {f"gloss_{a:.0f}": (f"gloss {a:g}° (ISO 2813)", "GU") for a in RECEPTORS_DEG} | {
    "haze_20": ("haze 20° (ISO 13803)", "HU")
}
SHARES = {
    "reflectance": ("reflectance", "1"),
    "tis": (f"total integrated scatter outside of {SPECULAR_DEG:g}° about the mirror direction", "1"),
}


def looks(data: xr.Dataset) -> tuple[xr.Dataset, dict[str, str]]:
    """Gloss, haze, reflectance and total integrated scatter, and why what is missing is not covered, by variable.

    data : a BRDF over theta_i, theta_o or cell, and wavelength, or a fit of `fit_model`
    gloss_20, gloss_60, gloss_85, haze_20 : scalars, with …_stderr, which follows from brdf_stderr, and
        …_interpolation, the error from the angles in between
    reflectance, tis : (theta_i), luminous means over the wavelengths, with …_stderr, and …_interpolation, the
        error from the directions in between, or of the energies that a simulation has summed up
    A standard error is absent where brdf_stderr is.
    """
    found: dict[str, xr.DataArray] = {}
    missing: dict[str, str] = {}
    readers: dict[str, Callable[[], Reading]] = {f"gloss_{a:.0f}": lambda a=a: gloss(data, a) for a in RECEPTORS_DEG}  # type: ignore[misc]
    for name, read in (readers | {"haze_20": lambda: haze(data)}).items():
        try:
            found |= _reading(name, read())
        except VgonioError as e:
            missing[name] = str(e)
    for name, function in (("reflectance", reflectance), ("tis", total_integrated_scatter)):
        try:
            found |= _share(name, function(data), data)
        except VgonioError as e:
            missing[name] = str(e)
    return xr.Dataset(found), missing


def _reading(name: str, read: Reading) -> dict[str, xr.DataArray]:
    text, unit = READINGS[name]
    made = {name: labelled(xr.DataArray(read.value), name, unit, text)}
    long_name = f"error of {name} from the interpolation between the angles"
    made[f"{name}_interpolation"] = labelled(xr.DataArray(read.error), "", unit, long_name)
    if np.isfinite(read.stderr):
        made[f"{name}_stderr"] = labelled(xr.DataArray(read.stderr), "", unit, f"standard error of {name}")
    return made


def _share(name: str, found: xr.DataArray, data: xr.Dataset) -> dict[str, xr.DataArray]:
    """Luminous means over the wavelengths of a share of the light, with what brdf_stderr makes of them."""
    weight = luminous_weights(found["wavelength"].values)
    mean = xr.DataArray(found.values @ weight, {"theta_i": found["theta_i"]}, ("theta_i",))
    made = {name: labelled(mean, name, "1", f"{found.attrs['long_name']}, luminous mean")}
    error = np.asarray(found["error"].values) @ weight
    text = f"error of {name} from the directions in between, or of the energies"
    made[f"{name}_interpolation"] = labelled(mean.copy(data=error), "", "1", text)
    if data.attrs.get("method") != "fit" and found.attrs["source"] not in (ENERGIES, OWN_CONE):
        data = ascending(data)
        rows, rule = hemisphere_rule(data)
        specular = hemisphere_rule(data, float(radians(SPECULAR_DEG)))[1] if name == "tis" else None

        def figures(brdf: Floats) -> dict[str, float]:
            whole = integrated(brdf[rows], rule)
            values = (whole if specular is None else 1 - integrated(brdf[rows], specular) / whole) @ weight
            return {str(i): float(v) for i, v in enumerate(values)}

        errors = standard_errors(figures, data)
        if errors:
            stderr = mean.copy(data=[errors.get(str(i), np.nan) for i in range(mean.size)])
            made[f"{name}_stderr"] = labelled(stderr, "", "1", f"standard error of {name}")
    return made


@takes_nodes
def appearance(name: str, data: xr.Dataset) -> list[Row]:
    """Rows of a table (of, quantity, value, error, unit): `looks` of a result, what it does not cover with the reason.

    The error is the standard error that follows from brdf_stderr; of gloss and haze together with that of the
    interpolation, in squares.
    """
    return looks_rows(name, *looks(data))


def looks_rows(name: str, found: xr.Dataset, missing: dict[str, str]) -> list[Row]:
    """The rows of `looks`; a quantity that is missing has the value None and the reason as its unit."""
    rows: list[Row] = []
    for variable, (text, unit) in (READINGS | SHARES).items():
        if variable in missing or variable not in found:
            why = missing.get(variable, "not known")
            rows.append({"of": name, "quantity": text, "value": None, "error": None, "unit": why})
            continue
        errors = [found[f"{variable}_{k}"] for k in ("stderr", "interpolation") if f"{variable}_{k}" in found]
        total = sum((e.fillna(0.0) ** 2 for e in errors), xr.zeros_like(found[variable])) ** 0.5
        for value, error in zip(np.atleast_1d(found[variable].values), np.atleast_1d(total.values)):
            rows.append(
                {"of": name, "quantity": text, "value": float(value), "error": float(error) or None, "unit": unit}
            )
        if found[variable].ndim:
            for row, angle in zip(rows[-found[variable].size :], found["theta_i"].values):
                row["quantity"] = f"{text} at {angle:g}°"
    return rows
