"""Figures of results on the hemisphere: polar maps of the BRDF and of the share of multiple reflections."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from ..errors import InputError
from . import quantities as q
from .brdf_figures import Results
from .style import INK, MUTED, angle, new_figure, powers_of_ten, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


FACE: dict = {"edgecolors": "face", "linewidth": 0.3}


def cell_borders(data: xr.Dataset) -> np.ndarray:
    """(cells, 4): θ from, θ to, φ from, φ to of every cell, degrees, from centres and solid angles.

    Rings are cells of equal θₒ; as they fill the hemisphere from the pole, their borders follow from the solid angle
    that has been used up: cos θ = 1 − Ω/2π.
    """
    theta, phi, solid = (data[k].values for k in ("theta_o", "phi_o", "solid_angle"))
    rings, inverse, count = np.unique(np.round(theta, 6), return_inverse=True, return_counts=True)
    used = np.concatenate([[0.0], np.cumsum(np.bincount(inverse, solid))])
    border = np.rad2deg(np.arccos(np.clip(1 - used / (2 * np.pi), 0, 1)))
    half = 180.0 / count[inverse]
    return np.stack([border[inverse], border[inverse + 1], phi - half, phi + half], axis=1)


def cell_polygons(data: xr.Dataset) -> list[np.ndarray]:
    """Outlines (points, 2) of the cells in the plane with θₒ as radius, in degrees, and the azimuth φₒ as angle."""
    outlines = []
    for inner, outer, start, stop in cell_borders(data):
        arc = np.deg2rad(np.linspace(start, stop, max(3, int((stop - start) / 4) + 1)))
        there, back = outer * np.exp(1j * arc), inner * np.exp(1j * arc[::-1])
        ring = np.concatenate([there, back])
        outlines.append(np.stack([ring.real, ring.imag], axis=1))
    return outlines


def polar_axes(ax: Axes, theta_i: float, phi_i: float) -> None:
    """Circles every 30°, the source (circle) and its mirror direction (cross); no frame."""
    ax.set_aspect("equal")
    ax.set_xlim(-97, 97)
    ax.set_ylim(-102, 97)
    ax.set_axis_off()
    turn = np.linspace(0, 2 * np.pi, 181)
    for r in (30, 60, 90):
        ax.plot(r * np.cos(turn), r * np.sin(turn), color="white" if r < 90 else MUTED, lw=0.7, alpha=0.8)
        below = r == 90
        ax.text(
            0, -r, f"{r}°", fontsize=7, ha="center", va="top" if below else "bottom", color=INK if below else "white"
        )
    source = theta_i * np.array([np.cos(np.deg2rad(phi_i)), np.sin(np.deg2rad(phi_i))])
    ax.plot(*source, "o", ms=6, mfc="none", mec="white", mew=2.6)
    ax.plot(*source, "o", ms=6, mfc="none", mec=INK, mew=1.2)
    ax.plot(*-source, "x", ms=6, color="white", mew=3)
    ax.plot(*-source, "x", ms=6, color=INK, mew=1.4)


@styled
def polar_maps(
    results: Results, theta_i: float = 30.0, wavelength_nm: float | None = None, decades: float = 3.0
) -> Figure:
    """BRDF over the hemisphere for one θᵢ and one wavelength, a map for each result, one logarithmic scale for all.

    results : hemisphere datasets by name;  theta_i : degrees, nearest;  decades : depth of the colour scale.
    Raises InputError for in-plane results.
    """
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import LogNorm

    for data in results.values():
        if q.in_plane(data):
            raise InputError("polar_maps needs results on the hemisphere; these are in-plane: use lobes")
    shown = {n: q.near(d, wavelength_nm).sel(theta_i=theta_i, method="nearest") for n, d in results.items()}
    top = max(float(d["brdf"].max()) for d in shown.values()) or 1.0  # all dark: any scale will do
    norm = LogNorm(top * 10**-decades, top)
    figure = new_figure(3.2 * max(2, len(shown)) + 0.8, 3.6)
    axes = figure.subplots(1, max(2, len(shown)), squeeze=False)[0]
    for ax in axes[len(shown) :]:
        ax.set_visible(False)
    for ax, (name, data) in zip(axes, shown.items()):
        values = np.maximum(data["brdf"].values, top * 10**-decades)
        cells = PolyCollection(
            cell_polygons(data), array=values, norm=norm, cmap="cividis", edgecolors="face", linewidth=0.3
        )
        cells.set_rasterized(len(values) > 800)
        ax.add_collection(cells)
        polar_axes(ax, float(data["theta_i"]), float(data.get("phi_i", 0.0)))
        ax.set_title(f"{q.title(name, results[name])}, θᵢ = {angle(float(data['theta_i']))}")
    bar = figure.colorbar(cells, ax=list(axes[: len(shown)]), shrink=0.8, pad=0.02, extend="min")
    powers_of_ten(bar.ax.yaxis)
    bar.set_label("BRDF (sr⁻¹)")
    bar.outline.set_visible(False)
    return figure


@styled
def polar_decomposition(rays: xr.Dataset, theta_i: float = 30.0, wavelength_nm: float | None = None) -> Figure:
    """Share of multiple reflections over the hemisphere for one θᵢ; cells that caught too few rays stay grey."""
    from matplotlib.collections import PolyCollection

    if q.in_plane(rays):
        raise InputError("polar_decomposition needs a hemisphere; this result is in-plane: use decomposition")
    share, _ = q.multiple_share(q.near(rays, wavelength_nm).sel(theta_i=theta_i, method="nearest"))
    figure = new_figure(5.4, 3.9)
    ax = figure.subplots()
    values = np.ma.masked_invalid(share.values * 100)
    cells = PolyCollection(cell_polygons(rays), array=values, cmap="viridis", **FACE)
    cells.set_clim(0, 100)
    cells.cmap = cells.cmap.with_extremes(bad="#dfe3e8")
    cells.set_rasterized(values.size > 800)
    ax.add_collection(cells)
    polar_axes(ax, float(share["theta_i"]), float(rays.get("phi_i", 0.0)))
    ax.set_title(f"θᵢ = {angle(float(share['theta_i']))}; grey: too few rays")
    bar = figure.colorbar(cells, ax=ax, shrink=0.8, pad=0.02)
    bar.set_label("multiple reflections (% of the BRDF)")
    bar.outline.set_visible(False)
    return figure
