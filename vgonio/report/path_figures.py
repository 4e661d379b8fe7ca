"""Figures of what goes beyond the BRDF: Mueller matrices, and the ways of light between its reflections."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from ..dataset import ascending
from . import quantities as q
from .brdf_figures import bounce_names, legend_of_results, require_in_plane
from .style import angle, angle_axis, bounce_colours, colours, directions_marked, logarithmic, new_figure, some, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Results = Mapping[str, xr.Dataset]
STOKES = "IQUV"


@styled
def mueller(results: Results, theta_i: float, wavelength_nm: float | None = None) -> Figure:
    """Mueller elements over M_II against θₒ for one θᵢ and wavelength: a panel for each row and column.

    results : datasets with `mueller` (…, stokes_out, stokes_in) in the plane of incidence, by name; the first panel is
    M_II over its largest value, ± one standard error. Directions where M_II is below 10⁻³ of that are left out: what
    rays or speckle do to all elements alike is gone from the quotients. Raises InputError for a hemisphere.
    """
    for data in results.values():
        require_in_plane(data)
    figure = new_figure(10.0, 6.6)
    axes = figure.subplots(4, 4, sharex=True, sharey=True)
    colour = colours(list(results))
    for name, data in results.items():
        here = q.incidence(q.near(ascending(data), wavelength_nm), theta_i)
        if here is None:
            continue
        m = here["mueller"].transpose("theta_o", "stokes_out", "stokes_in").values
        whole = np.where(m[:, 0, 0] > 1e-3 * m[:, 0, 0].max(), m[:, 0, 0], np.nan)
        for i in range(4):
            for j in range(4):
                over = whole if i + j else m[:, 0, 0].max()
                value = m[:, i, j] / over
                axes[i, j].plot(here["theta_o"], value, color=colour[name], lw=1.2)
        if "mueller_stderr" in here:
            error = here["mueller_stderr"].sel(stokes_out="I", stokes_in="I").values / m[:, 0, 0].max()
            value = m[:, 0, 0] / m[:, 0, 0].max()
            band = {"color": colour[name], "alpha": 0.22, "lw": 0}
            axes[0, 0].fill_between(here["theta_o"], value - error, value + error, **band)
    for i in range(4):
        for j in range(4):
            ax = axes[i, j]
            directions_marked(ax, theta_i)
            ax.set_title(f"{STOKES[i]} from {STOKES[j]}" + ("" if i + j else ", over its largest"), fontsize=8)
    axes[0, 0].set_ylim(-1.08, 1.08)
    axes[0, 0].set_yticks([-1, 0, 1])
    angle_axis(list(axes.ravel()))
    figure.supxlabel("angle of reflection θₒ (°)", fontsize=9)
    figure.supylabel("element of the Mueller matrix over that of I from I", fontsize=9)
    legend_of_results(figure, results)
    return figure


@styled
def ways(rays: xr.Dataset) -> Figure:
    """Path length and slope of the last facet against θᵢ by number of reflections, and how far second hits lie.

    rays : result with path_length, last_facet_slope_rms (theta_i, bounce), second_hit_beyond (theta_i, distance).
    """
    rays = rays.sortby("theta_i")
    figure = new_figure(10.0, 3.1)
    length, slope, beyond = figure.subplots(1, 3)
    names, shades = bounce_names(rays, "1 reflection"), bounce_colours(rays.sizes["bounce"])
    seen = rays["paths_followed"].transpose("bounce", "theta_i").values > 0
    for k, (name, shade) in enumerate(zip(names, shades)):
        for ax, variable in ((length, "path_length"), (slope, "last_facet_slope_rms")):
            if k == 0 and variable == "path_length":
                continue  # nothing between one hit and itself
            value = np.where(seen[k], rays[variable].isel(bounce=k), np.nan)
            ax.plot(rays["theta_i"], value, "o-", color=shade, ms=3, lw=1.2, label=name)
    chosen = some(rays["theta_i"].values, 4)
    for theta_i, shade in zip(chosen, bounce_colours(len(chosen) + 1)):
        beyond.plot(
            rays["distance"], 100 * rays["second_hit_beyond"].sel(theta_i=theta_i), color=shade, label=angle(theta_i)
        )
    length.set_ylim(bottom=0)
    slope.set_ylim(bottom=0)
    beyond.set_ylim(0, 102)
    logarithmic(beyond, "x", float(rays["distance"].min()), float(rays["distance"].max()))
    beyond.set_xticks([d for d in 10.0 ** np.arange(-6, 7) if rays["distance"].min() <= d <= rays["distance"].max()])
    beyond.xaxis.set_major_formatter("{x:g}")
    labels = (
        (length, "θᵢ (°)", "path between first and last hit (µm)"),
        (slope, "θᵢ (°)", "RMS slope of the last facet"),
        (beyond, "distance of the second hit (µm)", "second hits that lie beyond (%)"),
    )
    for ax, x, y in labels:
        ax.set_xlabel(x)
        ax.set_ylabel(y)
    beyond.legend(title="θᵢ", title_fontsize=8.5)
    handles, found = slope.get_legend_handles_labels()
    figure.legend(handles, found, loc="outside upper left", ncols=len(found))
    return figure
