"""Figures of the surface, from the summary that a result carries (`vgonio.measure.surface_summary.surface_dataset`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from .style import INK, MUTED, logarithmic, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

FEW_LINES = 8  # a spectrum of fewer frequencies is drawn as lines: a grating
BLUE, ORANGE = "#0b4a8f", "#d55e00"


@styled
def surface_map(surface: xr.Dataset) -> Figure:
    """Height map with a scale bar and a colour bar in µm; beside it a detail at full resolution where there is one.

    surface : summary with z (y, x) and optionally z_detail (y_detail, x_detail), µm. Missing points stay white.
    """
    parts = [("z", "x", "y", "the whole surface")]
    if "z_detail" in surface:
        parts.append(("z_detail", "x_detail", "y_detail", "detail, every sample"))
    ny, nx = (float(np.ptp(surface[k].values)) for k in ("y", "x"))
    tall = np.clip(4.3 * ny / max(nx, 1e-9), 1.2, 5.5) if 0.25 < ny / max(nx, 1e-9) < 4 else 2.6
    figure = new_figure(4.6 * len(parts) + 0.8, tall + 0.75)
    axes = figure.subplots(1, len(parts), squeeze=False)[0]
    low, high = np.nanpercentile(surface["z"].values, [0.2, 99.8])
    limits = (low, high) if high > low else (low - 0.5, high + 0.5)
    for ax, (z, x, y, title) in zip(axes, parts):
        image = height_image(ax, surface[z].values, surface[x].values, surface[y].values)
        image.set_clim(*limits)
        ax.set_title(title)
    bar = figure.colorbar(image, ax=list(axes), shrink=0.85, pad=0.015, aspect=28, extend="both")
    bar.set_label("height z (µm)")
    bar.outline.set_visible(False)
    if len(parts) > 1:
        left, right = surface["x_detail"].values[[0, -1]]
        low, high = surface["y_detail"].values[[0, -1]]
        outline = ([left, right, right, left, left], [low, low, high, high, low])
        axes[0].plot(*outline, color="white", lw=2.2)
        axes[0].plot(*outline, color=INK, lw=1.1)
    return figure


def height_image(ax: Axes, z: np.ndarray, x: np.ndarray, y: np.ndarray) -> AxesImage:
    """One map to scale with its scale bar; a narrow field is stretched so that it can be seen, and says so."""
    hx, hy = (float(np.mean(np.diff(c))) if c.size > 1 else 1.0 for c in (x, y))
    extent = (x[0] - hx / 2, x[-1] + hx / 2, y[0] - hy / 2, y[-1] + hy / 2)
    wide, tall = extent[1] - extent[0], extent[3] - extent[2]
    stretched = not 0.25 < tall / wide < 4
    image = ax.imshow(z, origin="lower", extent=extent, cmap="cividis", aspect="auto" if stretched else "equal")
    ax.grid(False)
    ax.set_xticks([])
    ax.set_yticks([])
    for side in ax.spines.values():
        side.set_visible(False)
    scale_bar(ax, extent)
    if stretched:
        ax.set_xlabel(f"{wide:.4g} µm × {tall:.4g} µm, not to scale", color=MUTED)
    else:
        ax.set_xlabel(f"{wide:.4g} µm × {tall:.4g} µm", color=MUTED)
    return image


def scale_bar(ax: Axes, extent: tuple[float, float, float, float]) -> None:
    """A bar of a round length, about a fifth of the width, in the lower left corner."""
    from matplotlib.patheffects import withStroke

    wide, tall = extent[1] - extent[0], extent[3] - extent[2]
    length = round_length(wide / 5)
    left, low = extent[0] + 0.05 * wide, extent[2] + 0.06 * tall
    ax.plot([left, left + length], [low, low], color="white", lw=5, solid_capstyle="butt")
    ax.plot([left, left + length], [low, low], color=INK, lw=3, solid_capstyle="butt")
    text = ax.text(left, low + 0.03 * tall, f"{length:g} µm", color=INK, va="bottom", weight="bold")
    text.set_path_effects([withStroke(linewidth=2.5, foreground="white")])


def round_length(value: float) -> float:
    """The largest of 1, 2, 5 · 10ⁿ that is not above `value`."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)) * power)


@styled
def height_histogram(surface: xr.Dataset) -> Figure:
    """Probability density of the heights with the Gaussian of the same Sq.

    surface : summary with height_density (height) in µm⁻¹ and the attribute Sq in µm.
    """
    height, sq = surface["height"].values, float(surface.attrs.get("Sq", 0.0))
    expected = np.exp(-0.5 * (height / sq) ** 2) / (np.sqrt(2 * np.pi) * sq) if sq > 0 else None
    figure, ax = _histogram(surface["height_density"], expected, "Gaussian of the same Sq")
    histogram_axes(figure, ax, "height z (µm)", "probability density (µm⁻¹)")
    return figure


@styled
def slope_histogram(surface: xr.Dataset) -> Figure:
    """Probability density of the slope along x, with the Gaussian that Beckmann's α stands for (variance α²/2).

    surface : summary with slope_density (slope) and the attribute alpha.
    """
    slope, alpha = surface["slope"].values, float(surface.attrs.get("alpha", 0.0))
    expected = np.exp(-((slope / alpha) ** 2)) / (np.sqrt(np.pi) * alpha) if alpha > 0 else None
    figure, ax = _histogram(surface["slope_density"], expected, f"Beckmann, α = {alpha:.3g}")
    histogram_axes(figure, ax, "slope ∂z/∂x", "probability density")
    return figure


def _histogram(density: xr.DataArray, expected: np.ndarray | None, label: str) -> tuple[Figure, Axes]:
    """The density of a surface and, where there is one, what is expected of it under that name."""
    figure = new_figure(3.4, 2.9)
    ax = figure.subplots()
    x = density[density.dims[0]].values
    ax.fill_between(x, density.values, color=BLUE, alpha=0.22, lw=0)
    ax.plot(x, density.values, color=BLUE, label="surface")
    if expected is not None:
        ax.plot(x, expected, color=ORANGE, lw=1.1, ls=(0, (4, 2)), label=label)
    return figure, ax


def histogram_axes(figure: Figure, ax: Axes, x: str, y: str) -> None:
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    ax.set_ylim(bottom=0)
    figure.legend(loc="outside upper left", ncols=2, handlelength=1.6, columnspacing=1.0, fontsize=8)


@styled
def psd(surface: xr.Dataset) -> Figure:
    """Radially averaged power spectral density against spatial frequency, both logarithmic.

    surface : summary with psd (frequency) in µm⁴ over µm⁻¹ (µm³ for a profile: the variable's units).
    """
    figure = new_figure(3.4, 2.9)
    ax = figure.subplots()
    data = surface["psd"]
    frequency, power = data["frequency"].values, data.values
    use = (frequency > 0) & (power > 0) & (power > np.nanmax(power) * 1e-14)
    if use.any():
        low, high = power[use].min() / 1.5, power[use].max() * 1.5
        if use.sum() < FEW_LINES:
            ax.vlines(frequency[use], min(low, high * 1e-3), power[use], color=BLUE)
        ax.plot(frequency[use], power[use], "o" if use.sum() < FEW_LINES else "-", color=BLUE, ms=4)
        logarithmic(ax, "x", frequency[use].min() / 1.1, frequency[use].max() * 1.1)
        logarithmic(ax, "y", min(low, high * 1e-3), high)
    else:
        ax.text(0.5, 0.5, "a flat surface has none", transform=ax.transAxes, ha="center", color=MUTED)
    ax.set_xlabel("spatial frequency (µm⁻¹)")
    ax.set_ylabel(f"PSD ({data.attrs.get('units', 'um4').replace('um', 'µm').translate(str.maketrans('234', '²³⁴'))})")
    return figure
