"""The comparison in a few lines, for a table on the command line."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr

from .colour import SCALE_WORDS, SCALES
from .drawn_errors import median_error
from .exponent import bound_words
from .significance import no_shift

Row = dict[str, Any]
# quantity of a result: name in the table, variable, its standard error
_SHIFT = (
    ("height h of the slope", "shift_h", "shift_h_stderr"),
    ("frequency w of the slope", "shift_w", "shift_w_stderr"),
    ("offset t_y of the slope", "shift_t_y", "shift_t_y_stderr"),
    ("Fresnel exponent p", "shift_p", "shift_p_stderr"),
    ("r2 of the global shift", "shift_r2", None),
)


def summary(comparison: xr.Dataset) -> list[Row]:
    """Rows with the keys of, quantity, value, error, unit: errors and colour of each pair, shift of each result.

    Values are numbers, None where there is none (NaN); the last rows say what was skipped, value None, reason in unit.
    """
    scale = str(comparison.attrs.get("delta_e_scale", SCALES[0]))
    rows = [row for pair in _names(comparison, "pair") for row in _pair_rows(pair, comparison.sel(pair=pair), scale)]
    for result in _names(comparison, "result"):
        rows += _result_rows(result, comparison.sel(result=result), _p_is_free(comparison))
    for part, reason in json.loads(comparison.attrs.get("skipped", "{}")).items():
        rows.append({"of": part, "quantity": "left out", "value": None, "error": None, "unit": reason})
    return rows


def _names(comparison: xr.Dataset, dim: str) -> list[str]:
    return [str(v) for v in comparison[dim].values] if dim in comparison.dims else []


def _row(of: str, quantity: str, value: Any, unit: str, error: Any = None) -> Row:
    return {"of": of, "quantity": quantity, "value": _number(value), "error": _number(error), "unit": unit}


def _number(value: Any) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)


def _pair_rows(pair: str, data: xr.Dataset, scale: str) -> list[Row]:
    rows = [
        _row(pair, "NRMSE of the BRDF", data["nrmse"], "1"),
        _row(pair, "RMSE of the BRDF", data["rmse"], "sr-1"),
        _row(pair, "values compared", data["values_compared"], "1"),
    ]
    if "delta_e_2000" in data:
        difference = data["delta_e_2000"].values
        difference = difference[np.isfinite(difference)]
        if difference.size:
            shown = SCALE_WORDS[scale]
            rows.append(_row(pair, f"mean dE00, {shown}", difference.mean(), "1"))
            rows.append(_row(pair, f"95th percentile of dE00, {shown}", np.percentile(difference, 95), "1"))
            rows.append(_row(pair, f"largest dE00, {shown}", difference.max(), "1"))
    return rows


def _p_is_free(comparison: xr.Dataset) -> bool:
    """Whether p was fitted: asked for, with an F that depends on the wavelength, and enough wavelengths (else 1)."""
    asked, material = (str(comparison.attrs.get(k, "")) for k in ("exponent", "material"))
    return asked == "fit" and not material.startswith("none")


def _result_rows(result: str, data: xr.Dataset, free_p: bool) -> list[Row]:
    rows = []
    if "slope" in data:
        slopes = data["slope"].values
        slopes = slopes[np.isfinite(slopes)]
        if slopes.size:
            rows.append(_row(result, "median slope of the shift", np.median(slopes), "nm-1", median_error(slopes)))
    for quantity, name, error in _SHIFT:
        if name in data and np.isfinite(data[name]):
            stderr = data[error] if error else None
            why = no_shift(*(float(data[f"shift_{k}"]) for k in ("h", "h_stderr", "r2")))
            if name == "shift_w" and why:
                rows.append(_row(result, quantity, None, why))
                continue
            if name == "shift_h" and why:
                quantity += f": {why}"
            if name == "shift_p" and free_p:
                quantity += bound_words(float(data[name]))
            rows.append(_row(result, quantity, data[name], str(data[name].attrs["units"]), stderr))
    return rows
