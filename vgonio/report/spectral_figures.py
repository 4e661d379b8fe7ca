"""Figures of spectra and colour: spectra forward and backward, slopes of the linear shift, RGB and ΔE₀₀ maps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ..dataset import ascending
from . import quantities as q
from .brdf_figures import MOST_PANELS, Results, legend_of_results
from .style import (
    MUTED,
    angle,
    angle_axis,
    colours,
    directions_marked,
    directions_named,
    edges,
    new_figure,
    panels,
    some,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GLOBAL_FIT = "global fit of each, h·cos(w·θₘ) + t"
NORMALISED_AT = 600.0  # nm, λ_n of the thesis
SMALLEST_SHIFT = 2.0  # % per 100 nm; less looks like nothing, and is
LARGEST_DELTA_E = 20.0  # colours are altogether different beyond; the scale of the maps ends there at the latest


@styled
def spectra(results: Results, theta_i: float = 40.0, back: float | None = None) -> Figure:
    """BRDF against wavelength in the mirror direction and in back-scattering at one θᵢ (thesis figure 4.5).

    Upper row absolute, lower row relative to 600 nm; bands are ±1 standard error.
    results : datasets by name;  theta_i : degrees, the nearest there is;  back : θₒ of back-scattering, default θᵢ.
    """
    theta_i = nearest_incidence(results, theta_i)
    back = theta_i if back is None else back
    figure = new_figure(10.0, 5.6)
    grid = figure.subplots(2, 2, sharex=True)
    colour = colours(list(results))
    for column, (theta_o, side) in enumerate(((-theta_i, "forward, mirror direction"), (back, "back-scattering"))):
        top, bottom = grid[0][column], grid[1][column]
        for name, data in results.items():
            here = q.incidence(ascending(data), theta_i)
            here = None if here is None else q.direction(here, theta_o)
            if here is not None:
                spectrum(top, here, colour[name], 1.0, name == "measured")
                spectrum(bottom, here, colour[name], value_at(here, NORMALISED_AT), name == "measured")
        top.set_title(f"{side}: θᵢ = {angle(theta_i)}, θₒ = {angle(theta_o)}")
        top.set_ylim(0, None if top.get_lines() else 1)
        bottom.axhline(1, color=MUTED, lw=0.8, ls=(0, (4, 3)))
        bottom.set_xlabel("wavelength λ (nm)")
    grid[0][0].set_ylabel("BRDF (sr⁻¹)")
    grid[1][0].set_ylabel(f"BRDF over its value at {NORMALISED_AT:g} nm")
    say_where_dark(grid)
    drawn = [ax.get_ylim() for ax in grid[1] if ax.get_lines()[1:]] or [(0.5, 1.5)]
    for ax in grid[1]:
        ax.set_ylim(max(0.0, min(low for low, _ in drawn)), min(2.5, max(high for _, high in drawn)))
    legend_of_results(figure, results)
    return figure


def say_where_dark(grid: np.ndarray) -> None:
    """A panel without a spectrum says so."""
    for ax in grid[0]:
        if not ax.get_lines():
            ax.text(0.5, 0.5, "no light was caught here", transform=ax.transAxes, ha="center", color=MUTED)


def nearest_incidence(results: Results, theta_i: float) -> float:
    angles = next(iter(results.values()))["theta_i"].values
    return float(angles[np.abs(angles - theta_i).argmin()])


def value_at(data: xr.Dataset, wavelength_nm: float) -> float:
    """Value at that wavelength of a straight line through the spectrum: less noisy than one value of it."""
    w, f = data["wavelength"].values, data["brdf"].values
    known = np.isfinite(f)
    if known.sum() < 3:
        return float("nan")
    return float(np.polyval(np.polyfit(w[known] - wavelength_nm, f[known], 1), 0.0))


def spectrum(ax: Axes, data: xr.Dataset, colour: str, scale: float, dots: bool) -> None:
    w, f = data["wavelength"].values, data["brdf"].values
    if not (np.isfinite(scale) and scale > 0 and np.nanmax(f) > 0):
        return
    if dots:
        ax.plot(w, f / scale, "o", color=colour, ms=3.2, mfc="white", mew=1.0, zorder=3)
    else:
        ax.plot(w, f / scale, color=colour)
    if "brdf_stderr" in data:
        error = data["brdf_stderr"].values
        if dots:
            ax.errorbar(w, f / scale, error / scale, fmt="none", ecolor=colour, elinewidth=0.7, alpha=0.6)
        else:
            ax.fill_between(w, (f - error) / scale, (f + error) / scale, color=colour, alpha=0.2, lw=0)


@styled
def shift_slopes(slopes: Mapping[str, xr.Dataset], titles: Mapping[str, str] | None = None) -> Figure:
    """Slope m of the local linear shift against θₒ, a panel for each θᵢ, with the global fit (thesis figure 4.8).

    Dots are the local slopes, lines of the same colour the global fits.

    slopes : for each result a dataset (theta_i, theta_o) with slope, slope_stderr and optionally slope_global, all
    in nm⁻¹, and bright (false: drawn pale, hardly any light there). Drawn in % per 100 nm, so that +10 means: 10 %
    brighter for every 100 nm towards red.
    """
    from matplotlib.legend_handler import HandlerTuple
    from matplotlib.lines import Line2D

    first = next(iter(slopes.values()))
    chosen = some(np.sort(first["theta_i"].values), MOST_PANELS)
    figure, axes = panels(len(chosen))
    colour = colours(list(slopes))
    reach = []
    for name, data in slopes.items():
        data = data.sortby("theta_o")
        data = data.assign({k: data[k] * 1e4 for k in data.data_vars if str(k).startswith("slope")})
        seen = data["slope"].where(data["bright"]) if "bright" in data else data["slope"]
        reach.append(np.nan_to_num(np.nanpercentile(np.abs(seen.values), 97)) if seen.notnull().any() else 0.0)
        for ax, theta_i in zip(axes, chosen):
            offset = np.abs(data["theta_i"].values - theta_i)
            if offset.min() <= 0.5:
                slope_curve(ax, data.isel(theta_i=int(offset.argmin())), colour[name])
    for ax, theta_i in zip(axes, chosen):
        ax.axhline(0, color=MUTED, lw=0.8)
        directions_marked(ax, theta_i)
        ax.set_title(f"θᵢ = {angle(theta_i)}")
    limit = max(SMALLEST_SHIFT, 1.35 * max(reach))
    axes[0].set_ylim(-limit, limit)
    angle_axis(axes)
    figure.supxlabel("angle of reflection θₒ (°)", fontsize=9)
    figure.supylabel("slope m of the shift\n(% per 100 nm)", fontsize=9, ma="center")
    handles = [Line2D([], [], color=colour[n], marker="o", ms=3, label=(titles or {}).get(n, n)) for n in slopes]
    labels = [str(h.get_label()) for h in handles]
    fitted = tuple(Line2D([], [], color=colour[n], lw=1.2) for n, data in slopes.items() if "slope_global" in data)
    lines = directions_named()
    shown: list[Any] = [*handles, *([fitted] if fitted else []), *lines]
    labels += [GLOBAL_FIT] if fitted else []
    labels += [str(h.get_label()) for h in lines]
    beside = {tuple: HandlerTuple(ndivide=None, pad=0.2)}
    figure.legend(shown, labels, handler_map=beside, loc="outside upper left", ncols=4, handlelength=2.2)
    return figure


def slope_curve(ax: Axes, data: xr.Dataset, colour: str) -> None:
    theta_o, m = data["theta_o"].values, data["slope"].values
    error = data["slope_stderr"].values if "slope_stderr" in data else np.zeros(m.shape)
    bright = data["bright"].values > 0 if "bright" in data else np.ones(m.shape, bool)
    for shown, alpha in ((bright, 0.9), (~bright, 0.28)):
        if shown.any():
            ax.errorbar(
                theta_o[shown], m[shown], error[shown], fmt="o", ms=2.2, color=colour, elinewidth=0.8, alpha=alpha
            )
    if "slope_global" in data:
        ax.plot(theta_o, data["slope_global"].values, color=colour, lw=1.2)


@styled
def rgb_maps(maps: Mapping[str, xr.DataArray], titles: Mapping[str, str] | None = None) -> Figure:
    """In-plane RGB maps side by side, each square one pair of directions (thesis figures 4.4 and 4.7).

    maps : for each result an array (theta_i, theta_o, rgb) with sRGB in 0…1 and the attributes exposure and
    clipped (share of the squares outside the gamut). Missing squares stay hatched.
    """
    figure, axes = map_figure(len(maps))
    for ax, (name, rgb) in zip(axes, maps.items()):
        rgb = rgb.sortby("theta_i").sortby("theta_o").transpose("theta_i", "theta_o", "rgb")
        squares(ax, rgb, np.nan_to_num(np.clip(rgb.values, 0, 1)), np.isnan(rgb.values).any(axis=-1))
        ax.set_title((titles or {}).get(name, name))
        ax.set_xlabel("θₒ (°)" + map_note(rgb))
    axes[0].set_ylabel("θᵢ (°)")
    return figure


def map_note(rgb: xr.DataArray) -> str:
    clipped = rgb.attrs.get("clipped", rgb.attrs.get("clipped_share"))
    return "" if clipped is None else f"   clipped: {100 * float(clipped):.3g} %"


def map_figure(count: int) -> tuple[Figure, list[Axes]]:
    """A figure with room for that many maps, three in a row (two of four); a single one is half a page wide."""
    columns = 2 if count == 4 else min(3, count)
    rows = -(-count // columns)
    figure = new_figure(10.0 if count > 1 else 5.4, 0.6 + (3.5 if columns == 2 else 2.9) * rows)
    grid = figure.subplots(rows, columns, squeeze=False, sharey=True).ravel()
    for empty in grid[count:]:
        empty.set_visible(False)
    return figure, list(grid[:count])


def squares(ax: Axes, data: xr.DataArray, colour: np.ndarray, missing: np.ndarray, **options):
    """Cells over (theta_i, theta_o) with white lines between them; fine grids are drawn as one picture."""
    x, y = edges(data["theta_o"].values), edges(data["theta_i"].values, lowest=-90)
    fine = colour.shape[0] * colour.shape[1] > 4000
    ax.set_facecolor("#f1f3f5")
    if colour.ndim == 3:
        colour = np.dstack([colour, ~missing])
    mesh = ax.pcolormesh(
        x, y, colour, edgecolors="none" if fine else "white", linewidth=0 if fine else 0.5, rasterized=fine, **options
    )
    ax.grid(False)
    ax.set_xticks(np.arange(-60, 61, 30))
    ax.set_yticks(some(data["theta_i"].values, 9))
    ax.set_xlim(x[0], x[-1])
    for side in ax.spines.values():
        side.set_visible(False)
    return mesh


@styled
def delta_e_maps(maps: Mapping[str, xr.DataArray]) -> Figure:
    """ΔE₀₀ between pairs of results over (theta_i, theta_o), one scale for all, readable by colour-blind people.

    maps : for each pair ("rays and waves") an array (theta_i, theta_o). The mean stands below each map.
    """
    figure, axes = map_figure(len(maps))
    known = np.concatenate([m.values[np.isfinite(m.values)] for m in maps.values()])
    top = float(np.clip(np.percentile(known, 95) if known.size else 1.0, 1.0, LARGEST_DELTA_E))
    for ax, (name, data) in zip(axes, maps.items()):
        data = data.sortby("theta_i").sortby("theta_o").transpose("theta_i", "theta_o")
        values = np.ma.masked_invalid(data.values)
        mesh = squares(ax, data, values, np.isnan(data.values), cmap="viridis", vmin=0, vmax=top)
        ax.set_title(name)
        dark = data.attrs.get("dark", 0)
        left_out = f"\nleft out: {dark} of {data.size} pairs,\nbelow 10⁻³ of the peak" if dark else ""
        ax.set_xlabel(f"θₒ (°)\nmean ΔE₀₀ {float(data.mean()):.3g}, largest {float(data.max()):.3g}{left_out}")
    axes[0].set_ylabel("θᵢ (°)")
    bar = figure.colorbar(mesh, ax=axes, shrink=0.9, pad=0.015, aspect=24, extend="max")
    bar.set_label("ΔE₀₀")
    bar.outline.set_visible(False)
    return figure
