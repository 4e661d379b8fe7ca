"""Make the picture of the README and of the first page of the documentation from the demo's result.

    make demo && python examples/demo/pictures.py

Writes docs/overview.png: the surface, its lobes by rays and by waves, and the light that is reflected more than once,
which tells up to which angle a theory of single reflections may be trusted.
"""

from __future__ import annotations

from pathlib import Path

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import vgonio as vg
from vgonio.report.brdf_figures import lobe
from vgonio.report.style import (
    MULTIPLE_COLOURS,
    MUTED,
    RESULT_COLOURS,
    directions_marked,
    logarithmic,
    new_figure,
    styled,
)
from vgonio.report.surface_figures import height_image

ROOT = Path(__file__).resolve().parents[2]
WAVELENGTH_NM, THETA_I, SHADOWS_FROM = 560, 40, 65  # the plan of the demo: "shadowing matters beyond 65°"


def surface_panel(ax: Axes, surface: xr.Dataset) -> None:
    image = height_image(ax, surface.z.values, surface.x.values, surface.y.values)
    bar = ax.figure.colorbar(image, ax=ax, shrink=0.8, pad=0.03, aspect=22)
    bar.set_label("height z (µm)")
    bar.outline.set_visible(False)
    ax.set_title("1. The surface")


def lobes_panel(ax: Axes, results: dict[str, xr.Dataset]) -> None:
    for name, data in results.items():
        lobe(ax, data.sel(wavelength=WAVELENGTH_NM, theta_i=THETA_I), RESULT_COLOURS[name], dots=False)
        ax.plot([], [], color=RESULT_COLOURS[name], label=name)
    logarithmic(ax, "y", 1e-3, 20)
    directions_marked(ax, THETA_I)
    ax.set_xlim(-90, 90)
    ax.set_xticks(range(-60, 61, 30))
    ax.set_xlabel("angle of reflection θₒ (°)")
    ax.set_ylabel("BRDF (sr⁻¹)")
    ax.legend(loc="lower left")
    ax.set_title(f"2. How it scatters light, θᵢ = {THETA_I}°")


def multiple_panel(ax: Axes, rays: xr.Dataset) -> None:
    energy = rays.energy_by_bounce.sel(wavelength=WAVELENGTH_NM)
    share = 100 * (1 - energy.sel(bounce=1) / energy.sum("bounce"))
    ax.axvspan(SHADOWS_FROM, 85, color="#f3e3d7", lw=0)
    ax.text((SHADOWS_FROM + 85) / 2, 10.7, "shadows\nmatter", ha="center", va="top", fontsize=8, color=MUTED)
    ax.bar(share.theta_i, share, width=7, color=MULTIPLE_COLOURS[0], lw=0)
    ax.set_xlim(-5, 85)
    ax.set_ylim(0, 11)
    ax.set_xticks(range(0, 81, 20))
    ax.set_xlabel("angle of incidence θᵢ (°)")
    ax.set_ylabel("light reflected more than once (%)")
    ax.grid(axis="x", visible=False)
    ax.set_title("3. What the wave theory leaves out")


@styled
def overview(tree: xr.DataTree) -> Figure:
    figure = new_figure(10.6, 3.0)
    axes = figure.subplots(1, 3, width_ratios=[1.15, 1.2, 1])
    surface_panel(axes[0], tree["surface"].to_dataset())
    lobes_panel(axes[1], {name: tree[name].to_dataset() for name in ("rays", "waves")})
    multiple_panel(axes[2], tree["rays"].to_dataset())
    return figure


def main() -> None:
    figure = overview(vg.open(ROOT / "out" / "demo.nc"))
    figure.savefig(ROOT / "docs" / "overview.png", dpi=110, facecolor="white")


if __name__ == "__main__":
    main()
