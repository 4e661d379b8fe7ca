"""Figures of gratings: efficiencies of the orders by several solvers, and the errors of theories."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from . import quantities as q
from .style import (
    FURTHER_COLOURS,
    INK,
    MUTED,
    RESULT_COLOURS,
    angle,
    logarithmic,
    panels,
    some,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {
    "full-wave": INK,
    "kirchhoff": RESULT_COLOURS["waves"],
    "generalized-harvey-shack": FURTHER_COLOURS[0],
    "harvey-shack": FURTHER_COLOURS[2],
    "iterated-kirchhoff": FURTHER_COLOURS[1],
}
MOST_PANELS = 6
LEAST = 1e-4  # share of the incident power that is still drawn
ABOUT_RIGHT = 0.05  # the error beyond which `vgonio plan` warns


@styled
def orders(results: Mapping[str, xr.Dataset], wavelength_nm: float | None = None) -> Figure:
    """Efficiencies of the orders of a grating, logarithmic, a panel for each θᵢ, a mark for each solver side by side.

    results : datasets of `orders` by name, efficiency (theta_i, order, wavelength[, polarisation]); polarisations are
    drawn as a bar from one to the other.  wavelength_nm : the nearest there is, by default to 550 nm.
    """
    from matplotlib.ticker import MaxNLocator

    shown = {name: q.near(data, wavelength_nm)["efficiency"] for name, data in results.items()}
    chosen = some(next(iter(shown.values()))["theta_i"].values, MOST_PANELS)
    figure, axes = panels(len(chosen), height=2.6)
    offsets = 0.66 * (np.arange(len(shown)) - (len(shown) - 1) / 2) / max(len(shown), 2)
    top = max(float(data.max()) for data in shown.values())
    for ax, theta_i in zip(axes, chosen):
        for (name, data), offset in zip(shown.items(), offsets):
            marks(ax, data.sel(theta_i=theta_i), offset, *_look(name, results[name]))
        ax.set_title(f"θᵢ = {angle(theta_i)}")
        ax.grid(axis="x", visible=False)
    logarithmic(axes[0], "y", LEAST, max(1.0, 1.5 * top))
    reach = [np.abs(d["order"].values[(d >= LEAST).any([x for x in d.dims if x != "order"])]) for d in shown.values()]
    most = max((int(r.max(initial=0)) for r in reach), default=0)
    axes[0].set_xlim(-most - 0.6, most + 0.6)
    axes[0].xaxis.set_major_locator(MaxNLocator(9, integer=True))
    figure.supxlabel("diffraction order m, at sin θₒ = −sin θᵢ − mλ/P", fontsize=9)
    figure.supylabel("share of the incident power", fontsize=9)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=5, handlelength=1.2)
    return figure


def marks(ax: Axes, data: xr.DataArray, offset: float, colour: str, label: str) -> None:
    """Dots over the orders; two polarisations are the ends of a bar."""
    if "polarisation" not in data.dims:
        ax.plot(data["order"] + offset, data.where(data >= LEAST), "o", ms=4, color=colour, label=label)
        return
    low, high = data.min("polarisation").clip(LEAST), data.max("polarisation")
    there = (high >= LEAST).values
    x = data["order"].values[there] + offset
    names = " and ".join(str(p) for p in data["polarisation"].values)
    ax.vlines(x, low.values[there], high.values[there], color=colour, lw=2.2, label=f"{label}, {names}")
    ax.plot(np.tile(x, 2), np.concatenate([low.values[there], high.values[there]]), "_", ms=7, mew=1.6, color=colour)


@styled
def theory_errors(errors: Mapping[str, xr.DataArray], limit: float | None = ABOUT_RIGHT) -> Figure:
    """Relative errors of theories against what was varied, both logarithmic, a panel for each θᵢ.

    errors : by theory (theta_i, x) with any second dimension x, whose coordinate has long_name and units;
    limit : marked by a line, None for none.
    """
    first = next(iter(errors.values()))
    x = next(d for d in first.dims if d != "theta_i")
    chosen = some(first["theta_i"].values, MOST_PANELS)
    figure, axes = panels(len(chosen), height=2.6)
    for ax, theta_i in zip(axes, chosen):
        for name, data in errors.items():
            values = data.sel(theta_i=theta_i) * 100
            ax.plot(values[x], values, "o-", ms=3.2, color=COLOURS.get(name, MUTED), label=q.THEORIES.get(name, name))
        if limit is not None:
            ax.axhline(100 * limit, color=MUTED, lw=0.9, ls=(0, (4, 3)))
        ax.set_title(f"θᵢ = {angle(theta_i)}")
    every = np.concatenate([data.values.ravel() for data in errors.values()]) * 100
    logarithmic(axes[0], "y", max(float(every[every > 0].min()) / 1.5, 1e-3), 1.5 * float(every.max()))
    logarithmic(axes[0], "x", float(first[x].min()) / 1.15, float(first[x].max()) * 1.15)
    unit = first[x].attrs.get("units", "1").replace("um", "µm")
    figure.supxlabel(f"{first[x].attrs.get('long_name', x)}{'' if unit == '1' else f' ({unit})'}", fontsize=9)
    figure.supylabel("error of the efficiencies (%)", fontsize=9)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=5, handlelength=1.8)
    return figure


def _look(name: str, data: xr.Dataset) -> tuple[str, str]:
    """Colour of a solver by its theory, and its label: what the caller calls it."""
    theory = str(data.attrs.get("theory", ""))
    called = theory if name == "orders" else name
    return COLOURS.get(theory, MUTED), q.THEORIES.get(called, called or name)
