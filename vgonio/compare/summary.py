"""The comparison in rows: value, standard error and unit of every figure, as the command line prints them."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr

from .colour import SCALE_WORDS, SCALES
from .drawn_errors import median_error
from .exponent import bound_words
from .looks import looks_rows
from .pair_figures import TEXTS
from .significance import in_sigmas, no_figures, no_shift

Row = dict[str, Any]
# quantity of a result: name in the table, variable
_SHIFT = (
    ("height h of the slope", "shift_h"),
    ("frequency w of the slope", "shift_w"),
    ("offset t_y of the slope", "shift_t_y"),
    ("Fresnel exponent p", "shift_p"),
    ("r2 of the global shift", "shift_r2"),
)
# figures of a pair that a table needs, in its order
_PAIR = ("nrmse", "rmse", "median_difference", "values_compared", "delta_e_mean", "delta_e_95", "delta_e_largest")


def summary(comparison: xr.Dataset) -> list[Row]:
    """Rows with the keys of, quantity, value, error, unit: all parts of `summary_tables`, one after the other.

    Values are numbers, None where there is none (NaN); what was skipped or is not covered has the reason in unit.
    """
    return [row for rows in summary_tables(comparison).values() for row in rows]


def summary_tables(comparison: xr.Dataset) -> dict[str, list[Row]]:
    """The rows of `summary` by part: reference, figures (of pairs, and shifts), looks, shares, unlike.

    looks : gloss, haze, reflectance and scatter of each result;  shares : of the reference's shift that is explained
    unlike : what was not simulated alike, in words
    """
    attrs = comparison.attrs
    scale = str(attrs.get("delta_e_scale", SCALES[0]))
    rows = [row for pair in _names(comparison, "pair") for row in _pair_rows(pair, comparison.sel(pair=pair), scale)]
    results = {name: comparison.sel(result=name) for name in _names(comparison, "result")}
    for result, data in results.items():
        rows += _result_rows(result, data, _p_is_free(comparison))
    rows += [_words(part, "left out", why) for part, why in json.loads(attrs.get("skipped", "{}")).items()]
    missing = json.loads(attrs.get("not_covered", "{}"))
    return {
        "reference": [_words(str(attrs["reference"]), "reference", str(attrs["reference_chosen"]))],
        "figures": rows,
        "looks": [row for name, data in results.items() for row in _looks_rows(name, data, missing.get(name, {}))],
        "shares": _share_rows(comparison),
        "unlike": [_words(pair, "simulated alike", why) for pair, why in json.loads(attrs.get("unlike", "{}")).items()],
    }


def _names(comparison: xr.Dataset, dim: str) -> list[str]:
    return [str(v) for v in comparison[dim].values] if dim in comparison.dims else []


def _row(of: str, quantity: str, value: Any, unit: str, error: Any = None) -> Row:
    return {"of": of, "quantity": quantity, "value": _number(value), "error": _number(error), "unit": unit}


def _words(of: str, quantity: str, why: str) -> Row:
    return {"of": of, "quantity": quantity, "value": None, "error": None, "unit": why}


def _number(value: Any) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)


def _figure(of: str, quantity: str, data: xr.Dataset, name: str) -> Row:
    return _row(of, quantity, data[name], str(data[name].attrs["units"]), data.get(f"{name}_stderr"))


def _pair_rows(pair: str, data: xr.Dataset, scale: str) -> list[Row]:
    rows = []
    for name in _PAIR:
        text = TEXTS[name][1] if name in TEXTS else "values compared"
        if name.startswith("delta_e"):
            text += f", {SCALE_WORDS[scale]}"
            if name not in data or not np.isfinite(data[name]):
                continue
        rows.append(_figure(pair, text, data, name))
    if scale != "normalised" and "delta_e_colour" in data and np.isfinite(data["delta_e_colour"]):
        rows.append(_figure(pair, TEXTS["delta_e_colour"][1], data, "delta_e_colour"))
        if "directions_of_colour" in data:
            text = "directions of the colour alone, both bright"
            rows.append(_figure(pair, text, data, "directions_of_colour"))
    return rows


def _p_is_free(comparison: xr.Dataset) -> bool:
    """Whether p was fitted: asked for, with an F that depends on the wavelength, and enough wavelengths (else 1)."""
    asked, material = (str(comparison.attrs.get(k, "")) for k in ("exponent", "material"))
    return asked == "fit" and not material.startswith("none")


def _result_rows(result: str, data: xr.Dataset, free_p: bool) -> list[Row]:
    rows = []
    if "slope" in data:
        known = np.isfinite(data["slope"].values)
        lit = known & (data["slope_bright"].values > 0.5) if "slope_bright" in data else known
        slopes, text = (
            data["slope"].values[lit],
            f"median slope of the shift ({lit.sum()} of {known.sum()} directions, bright)",
        )
        if slopes.size:
            rows.append(_row(result, text, np.median(slopes), "nm-1", median_error(slopes)))
        elif known.any():
            rows.append(_words(result, "median slope of the shift", "too little light in all directions"))
    for quantity, name in _SHIFT:
        if name in data and np.isfinite(data[name]):
            figures = [float(data[f"shift_{k}"]) for k in ("h", "h_stderr", "r2")]
            why = no_shift(*figures)
            if (name == "shift_w" and why) or (name != "shift_r2" and no_figures(*figures)):
                rows.append(_words(result, quantity, why))
                continue
            if name == "shift_h" and why:
                quantity += f": {why}"
            if name == "shift_p" and free_p:
                quantity += bound_words(float(data[name]))
            rows.append(_figure(result, quantity, data, name))
    return rows


def _looks_rows(name: str, data: xr.Dataset, missing: dict[str, str]) -> list[Row]:
    own = data[[v for v in data.data_vars if str(v).startswith(("gloss", "haze", "reflectance", "tis"))]]
    return [row for row in looks_rows(name, own, missing) if row["value"] is None or np.isfinite(row["value"])]


def _share_rows(comparison: xr.Dataset) -> list[Row]:
    if "explained_share" not in comparison:
        why = str(comparison.attrs.get("not_explained", ""))
        return [_words(str(comparison.attrs["reference"]), "explained share", why)] if why else []
    rows = []
    for name in _names(comparison, "explanation"):
        one = comparison.sel(explanation=name)
        share = float(one["explained_share"])
        told = in_sigmas(float(one["explained_significance"])) if share > 0 else "worse than no shift at all"
        text = f"{one['explained_kind'].item()}, {told}"
        rows.append(_figure(name, f"explained share ({text})", one, "explained_share"))
    return rows
