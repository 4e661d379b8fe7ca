"""Figures of renderings: previews side by side with their ΔE₀₀ images and a colour bar (thesis figure 4.13)."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from ..render.preview import delta_e, rgb
from .style import INK, MUTED, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANEL_INCHES = 2.3
MOST_IN_A_ROW = 6
# the scale of the ΔE₀₀ images ends at the 99.5th percentile, and never below what can just be noticed
PERCENTILE, JUST_NOTICEABLE = 99.5, 1.0


@styled
def previews(data: xr.Dataset, reference: str | None = None) -> Figure:
    """Pictures of `vgonio.render.preview` with seconds and error; below each but the reference its ΔE₀₀ image.

    reference : the material that ΔE₀₀ is measured against, by default the first
    """
    names = [str(m) for m in data["material"].values][:MOST_IN_A_ROW]
    difference = delta_e(data, reference)
    against = difference.attrs["reference"]
    pictures = rgb(data)
    # two materials: one row, the difference beside them; more: a second row, each below its picture
    rows = 2 if len(names) > 2 else 1
    columns = 3 if len(names) == 2 else len(names)
    figure = new_figure(PANEL_INCHES * columns + 0.9 * (len(names) > 1), (PANEL_INCHES + 0.62) * rows + 0.25)
    grid = figure.subplots(rows, columns, squeeze=False)
    for i, name in enumerate(names):
        one = data.isel(material=i)
        picture(grid[0, i], pictures[i], name)
        below = f"{float(one['seconds']):.1f} s, {int(one['samples'])} paths/pixel, error {float(one['error']):.1%}"
        grid[0, i].set_xlabel(below, fontsize=7.5, color=MUTED)
    if rows == 2:
        difference_row(figure, list(grid[1]), difference, names, against)
    elif columns == 3:
        other = next(n for n in names if n != against)
        difference_row(figure, [grid[0, 2]], difference, [other], against)
    figure.supxlabel(
        f"CIE 1931, D65; Y = 1 of ΔE₀₀ at exposure {data.attrs['exposure']:.3g}; Mitsuba {data.attrs['variant']}",
        fontsize=7.5,
        color=MUTED,
    )
    return figure


def picture(ax: Axes, pixels: np.ndarray, title: str) -> None:
    """A picture without axes."""
    ax.imshow(pixels, interpolation="none")
    ax.set_title(title if len(title) < 32 else title[:30] + "…")
    bare(ax)


def bare(ax: Axes) -> None:
    ax.set_xticks([])
    ax.set_yticks([])
    ax.grid(False)
    for spine in ax.spines.values():
        spine.set_visible(False)


def difference_row(figure: Figure, axes: list[Axes], difference: xr.DataArray, names: list[str], against: str) -> None:
    """ΔE₀₀ images on one scale with one colour bar; mean and 95th percentile below each."""
    others = difference.sel(material=[n for n in names if n != against]).values
    top = max(JUST_NOTICEABLE, float(np.percentile(others, PERCENTILE)))
    image = None
    for ax, name in zip(axes, names):
        bare(ax)
        if name == against:
            ax.text(0.5, 0.5, "reference of ΔE₀₀", transform=ax.transAxes, ha="center", va="center", color=MUTED)
            continue
        values = difference.sel(material=name).values
        image = ax.imshow(values, vmin=0, vmax=top, cmap="viridis", interpolation="none")
        low, high = float(values.mean()), float(np.percentile(values, 95))
        ax.set_title(textwrap.shorten(f"ΔE₀₀ from {against}", 34, placeholder=" …"))
        ax.set_xlabel(f"mean {low:.2f}, 95 % below {high:.2f}", fontsize=7.5, color=INK)
    if image is not None:
        bar = figure.colorbar(image, ax=axes, shrink=0.85, pad=0.02, extend="max")
        bar.set_label("ΔE₀₀")
        bar.outline.set_visible(False)  # type: ignore[operator]
