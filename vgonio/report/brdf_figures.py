"""Figures of scattering in angle and energy: lobes, decomposition by reflections, energy tallies, hemisphere maps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ..dataset import ascending
from ..errors import InputError
from . import quantities as q
from .style import (
    ABSORBED_COLOUR,
    INK,
    LOST_COLOUR,
    MARK_COLOUR,
    MUTED,
    angle,
    angle_axis,
    bounce_colours,
    colours,
    dashes,
    directions_marked,
    edges,
    logarithmic,
    new_figure,
    panels,
    some,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Results = Mapping[str, xr.Dataset]
MOST_PANELS = 12


def require_in_plane(data: xr.Dataset) -> None:
    if not q.in_plane(data):
        raise InputError(
            "this figure needs signed in-plane angles (theta_o); the result covers a hemisphere: use polar_maps"
        )


def bounce_names(rays: xr.Dataset, single: str = "single reflection") -> list[str]:
    """single reflection, 2 reflections, 3 or more, …; the last entry gathers all higher ones."""
    numbers = rays["bounce"].values.astype(int)
    names = [single if n == 1 else f"{n} reflections" for n in numbers]
    return [*names[:-1], f"{numbers[-1]} or more"] if len(names) > 1 else names


@styled
def decomposition(rays: xr.Dataset, wavelength_nm: float | None = None) -> Figure:
    """Share of single and multiple reflections against θₒ, a panel for each θᵢ (thesis figure 4.10).

    rays : result with brdf_by_bounce (bounce, theta_i, theta_o, wavelength), any wavelength (default nearest 550 nm).
    Bins whose relative standard error exceeds a quarter are hatched, not drawn. Raises InputError for a hemisphere.
    """
    require_in_plane(rays)
    rays = ascending(rays)
    shares, trusted = q.bounce_shares(q.near(rays, wavelength_nm))
    chosen = some(rays["theta_i"].values, MOST_PANELS)
    figure, axes = panels(len(chosen))
    borders = edges(rays["theta_o"].values)
    for ax, theta_i in zip(axes, chosen):
        here = shares.sel(theta_i=theta_i).transpose("bounce", "theta_o").values * 100
        known = trusted.sel(theta_i=theta_i).values
        stack_of_shares(ax, borders, np.where(known, here, np.nan), known)
        directions_marked(ax, theta_i)
        ax.set_title(f"θᵢ = {angle(theta_i)}")
        ax.grid(False)
    axes[0].set_ylim(0, 100)
    axes[0].set_yticks([0, 50, 100])
    angle_axis(axes)
    figure.supxlabel("angle of reflection θₒ (°)", fontsize=9)
    figure.supylabel("share of the BRDF (%)", fontsize=9)
    legend_of_bounces(figure, rays, "too few rays, or none" if not trusted.all() else None)
    return figure


def stack_of_shares(ax: Axes, borders: np.ndarray, shares: np.ndarray, known: np.ndarray) -> None:
    """Stacked steps (bounce, n) over (n + 1,) borders; bins that are not known are hatched."""
    below = np.zeros(shares.shape[1])
    for share, colour in zip(shares, bounce_colours(len(shares))):
        ax.stairs(below + share, borders, baseline=below, fill=True, color=colour, lw=0)
        below = below + share
    if not known.all():
        ax.stairs(
            np.where(known, np.nan, 100.0),
            borders,
            fill=True,
            facecolor="white",
            edgecolor=MARK_COLOUR,
            hatch="////",
            lw=0,
        )


def legend_of_bounces(figure: Figure, rays: xr.Dataset, unknown: str | None) -> None:
    from matplotlib.patches import Patch

    handles = [Patch(color=c, label=n) for c, n in zip(bounce_colours(rays.sizes["bounce"]), bounce_names(rays))]
    if unknown:
        handles.append(Patch(facecolor="white", edgecolor=MARK_COLOUR, hatch="////", label=unknown))
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles), handlelength=1.2)


@styled
def lobes(results: Results, wavelength_nm: float | None = None, decades: float = 4.5) -> Figure:
    """BRDF in the plane of incidence against θₒ, logarithmic, a panel for each θᵢ, all results overlaid with ±1 error.

    results : datasets by name; wavelength_nm : any, default nearest 550 nm. Raises InputError for a hemisphere.
    """
    for data in results.values():
        require_in_plane(data)
    shown = {name: q.near(ascending(data), wavelength_nm) for name, data in results.items()}
    chosen = some(next(iter(shown.values()))["theta_i"].values, MOST_PANELS)
    figure, axes = panels(len(chosen))
    colour, line = colours(list(shown)), dashes(list(shown))
    top = max(float(data["brdf"].max()) for data in shown.values())
    for ax, theta_i in zip(axes, chosen):
        for name, data in shown.items():
            here = q.incidence(data, theta_i)
            if here is not None:
                lobe(ax, here, colour[name], dots=name == "measured", line=line[name])
        directions_marked(ax, theta_i)
        ax.set_title(f"θᵢ = {angle(theta_i)}")
    if top > 0:
        lowest = np.nanmin([float(data["brdf"].where(data["brdf"] > 0).min()) for data in shown.values()])
        logarithmic(axes[0], "y", max(lowest / 1.5, top * 10**-decades), top * 2)
    angle_axis(axes)
    figure.supxlabel("angle of reflection θₒ (°)", fontsize=9)
    figure.supylabel("BRDF (sr⁻¹)", fontsize=9)
    legend_of_results(figure, results, dashed=True)
    return figure


def lobe(ax: Axes, data: xr.Dataset, colour: str, dots: bool, line: Any = "-") -> None:
    """One lobe with its error band; dots for a measurement, else a line of the style `line`."""
    theta_o, value = data["theta_o"].values, data["brdf"].values
    value = np.where(value > 0, value, np.nan)
    if dots:
        ax.plot(theta_o, value, "o", color=colour, ms=2.6, mfc="white", mew=0.9, zorder=3)
    else:
        ax.plot(theta_o, value, color=colour, ls=line)
    if "brdf_stderr" in data and not dots:
        error = data["brdf_stderr"].values
        ax.fill_between(theta_o, np.maximum(value - error, value * 1e-3), value + error, color=colour, alpha=0.22, lw=0)


def legend_of_results(figure: Figure, results: Results, extra: list | None = None, dashed: bool = False) -> None:
    """Names and colours above a figure; dashed : whether its lines are those of `style.dashes`."""
    from matplotlib.lines import Line2D

    colour, line = colours(list(results)), dashes(list(results) if dashed else [])
    handles = [
        Line2D([], [], color=colour[name], label=q.title(name, data), marker="o", ls="none", ms=4, mfc="white")
        if name == "measured"
        else Line2D([], [], color=colour[name], ls=line.get(name, "-"), label=q.title(name, data))
        for name, data in results.items()
    ]
    figure.legend(handles=handles + (extra or []), loc="outside upper left", ncols=5, handlelength=1.8)


@styled
def energy(rays: xr.Dataset, wavelength_nm: float | None = None) -> Figure:
    """Energy tallies of the rays against θᵢ, stacked: by number of reflections, absorbed, lost; their sum is the check.

    rays : result with energy_by_bounce (theta_i, bounce, wavelength); energy_absorbed and energy_lost (theta_i,
    wavelength).
    """
    parts = q.near(q.tallies(rays.sortby("theta_i")), wavelength_nm)
    angles = parts["theta_i"].values
    figure = new_figure(5.4, 3.7)
    ax = figure.subplots()
    step = np.min(np.diff(angles)) if angles.size > 1 else 10.0
    below = np.zeros(angles.size)
    bounces = parts["by_bounce"].transpose("bounce", "theta_i").values * 100
    layers = list(zip(bounce_names(rays, "1 reflection"), bounces, bounce_colours(len(bounces))))
    layers += [
        (n, parts[n].values * 100, c) for n, c in (("absorbed", ABSORBED_COLOUR), ("lost", LOST_COLOUR)) if n in parts
    ]
    for name, height, colour in layers:
        ax.bar(angles, height, width=0.82 * step, bottom=below, color=colour, label=name, lw=0)
        below = below + height
    ax.errorbar(angles, parts["sum"].values * 100, fmt="_", color=INK, ms=14, mew=1.4, label="sum")
    ax.set_ylim(0, max(104.0, 1.04 * below.max()))
    ax.set_xticks(some(angles, 10))
    ax.set_xlabel("angle of incidence θᵢ (°)")
    ax.set_ylabel("share of the incident power (%)")
    ax.grid(axis="x", visible=False)
    handles, names = ax.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper left", ncols=4, handlelength=1.1, columnspacing=1.2)
    return figure


@styled
def wave_energy(results: Results) -> Figure:
    """Total reflected power of wave results against θᵢ, its range over the wavelengths as a band; 100 % marked.

    results : datasets with energy_reflected (theta_i, wavelength), others are passed over.
    """
    figure = new_figure(5.4, 3.7)
    ax = figure.subplots()
    colour = colours(list(results))
    for name, data in results.items():
        if "energy_reflected" in data:
            e = data["energy_reflected"].sortby("theta_i") * 100
            ax.fill_between(e["theta_i"], e.min("wavelength"), e.max("wavelength"), color=colour[name], alpha=0.2, lw=0)
            ax.plot(e["theta_i"], e.mean("wavelength"), "o-", ms=3, color=colour[name], label=q.title(name, data))
    ax.axhline(100, color=MUTED, lw=0.9, ls=(0, (4, 3)))
    top = max(float(d["energy_reflected"].max()) for d in results.values() if "energy_reflected" in d)
    ax.set_ylim(0, max(110.0, 106 * top))
    ax.set_xlabel("angle of incidence θᵢ (°)")
    ax.set_ylabel("reflected power (% of incident)")
    figure.legend(loc="outside upper left", ncols=3, handlelength=1.8)
    return figure
