"""The linear colour shift in numbers: slopes of each result, their means near mirror direction and back-scattering."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from ..compare.bright import bright_spectra
from ..compare.exponent import bound_words
from ..compare.significance import SIGMAS, in_sigmas, no_figures, no_shift
from ..errors import VgonioError
from . import quantities as q
from .content import Content
from .tables import ROUNDING, Table, number, plus_minus

NEAR = 15.0  # degrees: what counts as around the mirror direction or back-scattering
FEWEST = 3  # directions that a mean is taken over
NEGLIGIBLE = 1e-4  # nm⁻¹: 1 % per 100 nm is not seen as a colour
SIDES = {"mirror": "around the mirror direction", "back": "around back-scattering"}


def comparison_of(content: Content) -> xr.Dataset | None:
    """The stored comparison; worked out here where there is none, or one without the figures of pairs; None without
    results."""
    stored = content.comparison
    if stored is not None and ("pair" not in stored.dims or "median_difference" in stored):
        return stored
    from ..compare.comparison import compare

    try:
        return compare(content.results, material=content.material()) if content.results else None
    except VgonioError:
        return None


def shift_slopes(comparison: xr.Dataset | None, results: Mapping[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    """The shift fits of each in-plane result: slope, slope_stderr, slope_global (nm⁻¹), bright over (theta_i, "
    "theta_o)."""
    if comparison is None or "slope" not in comparison or "theta_o" not in comparison["slope"].dims:
        return {}
    names = [n for n in ("slope", "slope_stderr", "slope_global", "slope_bright") if n in comparison]
    found = {}
    for name in map(str, comparison["result"].values):
        slopes = comparison[names].sel(result=name, drop=True).dropna("theta_i", how="all", subset=["slope"])
        if slopes.sizes["theta_i"]:
            known = "slope_bright" in slopes
            lit = slopes["slope_bright"] > 0.5 if known else bright_directions(results.get(name), slopes)
            found[name] = slopes.drop_vars("slope_bright", errors="ignore").assign(bright=lit)
    return found


def bright_directions(data: xr.Dataset | None, like: xr.Dataset) -> xr.DataArray:
    """`compare.bright.bright_spectra` on the grid of the slopes, of comparisons that do not hold it; everywhere for an
    unknown result."""
    if data is None:
        return xr.ones_like(like["slope"], dtype=bool)
    share = bright_spectra(data).astype(float)
    grid = {"theta_i": like["theta_i"], "theta_o": like["theta_o"]}
    return share.reindex(grid, method="nearest", tolerance=1e-3).fillna(0.0) >= 0.5


@dataclass(frozen=True)
class MeanShift:
    """Mean slope in nm⁻¹ over `directions` pairs of directions, and its standard error from their scatter."""

    slope: float
    stderr: float
    directions: int


def mean_shift(slopes: xr.Dataset, side: str) -> MeanShift | None:
    """Mean slope within 15° of the mirror direction or of back-scattering, over all θᵢ at which the two lie apart.

    Only directions that catch light count. None where there are fewer than three.
    """
    theta_i, theta_o = slopes["theta_i"], slopes["theta_o"]
    off = theta_o + theta_i if side == "mirror" else theta_o - theta_i
    chosen = slopes["slope"].where((abs(off) <= NEAR) & (abs(theta_i) > NEAR) & slopes["bright"]).values
    known = chosen[np.isfinite(chosen)]
    if known.size < FEWEST:
        return None
    return MeanShift(float(known.mean()), float(known.std(ddof=1) / np.sqrt(known.size)), known.size)


def signed(m: float, digits: int = 2) -> str:
    """A slope in % per 100 nm with its sign."""
    if abs(m) * 1e4 < ROUNDING:
        return "0"
    return ("+" if m > 0 else "") + number(m * 1e4, digits)


def in_words(mean: MeanShift | None) -> str:
    """+9.1 ± 0.3 % per 100 nm (towards red, 30 σ)."""
    if mean is None:
        return "too little light to tell"
    if (abs(mean.slope) + mean.stderr) * 1e4 < ROUNDING:
        return "0 % per 100 nm (to rounding)"
    sign = "+" if mean.slope > 0 else ""
    value = f"{sign}{plus_minus(mean.slope * 1e4, mean.stderr * 1e4)} % per 100 nm"
    sigma = abs(mean.slope) / mean.stderr if mean.stderr > 0 else math.inf
    if abs(mean.slope) + SIGMAS * mean.stderr < NEGLIGIBLE:
        return f"{value} (practically none)"
    if sigma < SIGMAS:
        return f"{value} (not significant, {in_sigmas(sigma)})"
    if abs(mean.slope) < NEGLIGIBLE:
        return f"{value} (hardly any, {in_sigmas(sigma)})"
    return f"{value} (towards {'red' if mean.slope > 0 else 'blue'}, {in_sigmas(sigma)})"


def mean_table(slopes: Mapping[str, xr.Dataset], titles: Mapping[str, str]) -> Table:
    """Mean slopes of each result on both sides."""
    rows = []
    for name, data in slopes.items():
        means = [mean_shift(data, side) for side in SIDES]
        counts = ", ".join("0" if m is None else str(m.directions) for m in means)
        rows.append((titles.get(name, name), *map(in_words, means), counts))
    return Table((f"Mean slope within {NEAR:g}°", *SIDES.values(), "Directions"), rows, numeric=(3,))


def global_fit_table(comparison: xr.Dataset, titles: Mapping[str, str]) -> Table | None:
    """Parameters of the global shift fit with their standard errors; None where there is no fit."""
    if "shift_h" not in comparison:
        return None
    scale = {"h": 1e4, "t_y": 1e4}
    rows = []
    for name in comparison["result"].values:
        fit = comparison.sel(result=name)
        if np.isfinite(float(fit["shift_h"])):
            cells = [with_error(fit, k, scale.get(k, 1.0)) for k in ("h", "w", "t_y", "p")]
            figures = [float(fit[f"shift_{k}"]) for k in ("h", "h_stderr", "r2")]
            why, none = no_shift(*figures), no_figures(*figures)
            if none:
                cells = [why, "–", "–", "–"]
            elif why:
                cells[0], cells[1] = f"{cells[0]}: {why}", "–"
            if not none and comparison.attrs.get("exponent") == "fit" and fit.attrs.get("material") != "none (F = 1)":
                cells[3] += bound_words(float(fit["shift_p"]))
            rows.append(
                (
                    titles.get(str(name), str(name)),
                    *cells,
                    plus_minus(float(fit["shift_r2"]), float(fit.get("shift_r2_stderr", np.nan)), 2),
                )
            )
    head = ("Global fit of the shift", "h (% per 100 nm)", "w", "t (% per 100 nm)", "p", "r²")
    return Table(head, rows, numeric=(1, 2, 3, 4, 5)) if rows else None


def with_error(fit: xr.Dataset, name: str, scale: float) -> str:
    return plus_minus(scale * float(fit[f"shift_{name}"]), scale * float(fit[f"shift_{name}_stderr"]))


def skipped_words(comparison: xr.Dataset | None) -> list[str]:
    """What the comparison could not work out, and why."""
    skipped = {} if comparison is None else q.text(comparison.attrs.get("skipped"), {})
    return [f"Not worked out, {part}: {why}." for part, why in skipped.items()] if isinstance(skipped, dict) else []
