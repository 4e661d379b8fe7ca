"""Figures of a display's characterisation: thesis figures 5.4 (black, white, chromaticity, ΔE₀₀) and 5.5 (patches)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .style import FURTHER_COLOURS, INK, MARK_COLOUR, MUTED, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..display import CalibrationCheck, DisplayModel, ModelCheck

Floats = NDArray[np.float64]
# Okabe and Ito (2008): vermilion, green and blue stand for the channels
CHANNEL_COLOURS = ("#d55e00", "#009e73", "#0072b2")
STANDARD_DASHES = {"sRGB": (0, (5, 2)), "Adobe RGB": (0, (1, 1.5))}
ALONE = "display"
# ΔE₀₀ beyond which the histogram gathers everything in its last bar
MOST_DELTA_E = 20.0


def _columns(count: int, height: float = 2.9) -> tuple[Figure, list[Axes]]:
    figure = new_figure(10.0 if count > 1 else 5.4, height)
    return figure, list(figure.subplots(1, count, squeeze=False, sharey=True)[0])


def _title(ax: Axes, name: str) -> None:
    """The eye, where there is one; a display alone needs no name."""
    if name != ALONE:
        ax.set_title(f"{name} eye" if name in ("left", "right") else name)


@styled
def white_spectra(models: Mapping[str, DisplayModel]) -> Figure:
    """Measured white, its simulation and the three primaries: thesis figure 5.4 (b). One panel for each eye."""
    figure, axes = _columns(len(models))
    for ax, (name, model) in zip(axes, models.items()):
        nm = model.wavelength_nm
        for primary, colour in zip(model.primaries, CHANNEL_COLOURS):
            ax.fill_between(nm, 1e3 * primary, color=colour, alpha=0.18, lw=0)
        ax.plot(nm, 1e3 * model.white, color=INK, label="measured white")
        simulated = model.spectra(np.ones(3))
        ax.plot(nm, 1e3 * simulated, color=CHANNEL_COLOURS[0], ls=(0, (4, 2)), label="black + R + G + B")
        ax.set(xlabel="wavelength in nm", xlim=(nm[0], nm[-1]), ylim=(0, None))
        _title(ax, name)
    axes[0].set_ylabel("radiance in mW/(sr m² nm)")
    axes[0].legend(loc="upper right")
    return figure


@styled
def black_spectra(models: Mapping[str, DisplayModel]) -> Figure:
    """Spectra of black with its luminance: thesis figure 5.4 (a)."""
    figure, axes = _columns(len(models), 2.3)
    for ax, (name, model) in zip(axes, models.items()):
        ax.fill_between(model.wavelength_nm, 1e6 * model.black, color=INK, alpha=0.12, lw=0)
        ax.plot(model.wavelength_nm, 1e6 * model.black, color=INK, lw=1.2)
        ax.text(0.98, 0.95, f"{model.black_xyz[1]:.3g} cd/m²", transform=ax.transAxes, ha="right", va="top")
        ax.set(xlabel="wavelength in nm", xlim=(model.wavelength_nm[0], model.wavelength_nm[-1]))
        ax.set_ylim(top=1.12e6 * max(float(m.black.max()) for m in models.values()) or 1)
        _title(ax, name)
    axes[0].set_ylabel("radiance in µW/(sr m² nm)")
    return figure


@styled
def chromaticity_diagram(models: Mapping[str, DisplayModel]) -> Figure:
    """CIE 1931 chromaticities of the primaries and of white, with sRGB and Adobe RGB: thesis figure 5.4 (c)."""
    from ..display.colorimetry import chromaticity, encoding

    figure = new_figure(10.0 if len(models) > 1 else 5.4, 4.7)
    axes = list(figure.subplots(1, len(models), squeeze=False, sharex=True, sharey=True)[0])
    for ax, (name, model) in zip(axes, models.items()):
        _locus(ax)
        for standard, dashes in STANDARD_DASHES.items():
            ax.plot(*_closed(encoding(standard)[0]), color=INK, lw=1.0, ls=dashes, label=standard, zorder=3)
        xy = chromaticity(model.matrix.T)
        ax.plot(*_closed(xy), color=INK, lw=1.8, marker="o", ms=3.5, label="this display", zorder=4)
        white = chromaticity(model.white_xyz)
        ax.plot(*white, marker="o", ms=5, mfc="white", mec=INK, ls="", label="its white", zorder=4)
        ax.plot(0.3127, 0.3290, marker="+", ms=7, color=INK, ls="", label="D65", zorder=4)
        ax.set(xlabel="x", xlim=(0, 0.76), ylim=(0, 0.86), aspect="equal")
        _title(ax, name)
    axes[0].set_ylabel("y")
    axes[-1].legend(loc="upper right")
    return figure


def _closed(xy: Floats) -> Floats:
    return np.vstack([xy, xy[:1]]).T


def _locus(ax: Axes) -> None:
    """The spectral locus, filled with what sRGB can show of the colours inside, pale."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    from ..compare.colour import OBSERVER, _colour

    colour = _colour()
    cmfs = colour.MSDS_CMFS[OBSERVER]
    seen = (cmfs.wavelengths >= 390) & (cmfs.wavelengths <= 700)
    locus = cmfs.values[seen, :2] / cmfs.values[seen].sum(axis=1, keepdims=True)
    outline = PathPatch(Path(np.vstack([locus, locus[:1]])), fc="none", ec=MUTED, lw=0.9, zorder=2)
    ax.add_patch(outline)
    x, y = np.meshgrid(np.linspace(0.001, 0.76, 180), np.linspace(0.001, 0.86, 200))
    xyz = np.stack([x / y, np.ones_like(x), (1 - x - y) / y], axis=-1)
    linear = np.clip(xyz @ np.linalg.inv(colour.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ).T, 0, None)
    rgb = colour.models.eotf_inverse_sRGB(linear / linear.max(axis=-1, keepdims=True))
    image = ax.imshow(
        0.45 + 0.55 * rgb, origin="lower", extent=(0, 0.76, 0, 0.86), interpolation="bilinear", zorder=1, aspect="equal"
    )
    image.set_clip_path(outline)


@styled
def tone_curves(models: Mapping[str, DisplayModel]) -> Figure:
    """Measured levels and the rising curves through them, on a cube-root scale so that the dark end shows."""
    figure, axes = _columns(len(models), 3.0)
    signal = np.linspace(0, 1, 400)
    for ax, (name, model) in zip(axes, models.items()):
        for curve, colour, label in zip(model.curves, CHANNEL_COLOURS, ("red", "green", "blue")):
            ax.plot(255 * signal, np.cbrt(curve(signal)), color=colour, lw=1.2, label=label)
            ax.plot(
                255 * curve.level,
                np.cbrt(np.maximum(curve.measured, 0)),
                "o",
                ms=3.2,
                color=colour,
                clip_on=False,
                zorder=3,
            )
        ticks = np.array([0, 0.001, 0.01, 0.05, 0.2, 0.5, 1])
        ax.set_yticks(np.cbrt(ticks), [f"{t:g}" for t in ticks])
        ax.set(xlabel="signal (of 255)", xlim=(0, 255), ylim=(-0.01, 1.03), xticks=range(0, 256, 51))
        _title(ax, name)
    axes[0].set_ylabel("light above black, full = 1")
    axes[0].legend(loc="upper left")
    return figure


def _histogram(ax: Axes, values: Floats, top: float, colour: str) -> None:
    from matplotlib.ticker import MaxNLocator

    step = 0.25 if top <= 5 else 0.5 if top <= 13 else 1.0
    bins = np.arange(0, np.ceil(top / step) * step + step / 2, step)
    ax.hist(np.minimum(values, bins[-1] - 1e-9), list(bins), color=colour, alpha=0.85, rwidth=0.92)
    ax.axvline(values.mean(), color=INK, lw=1.0, ls=(0, (4, 3)))
    words = f"mean {values.mean():.2f}\nmax. {values.max():.1f}"
    ax.text(0.97, 0.95, words, transform=ax.transAxes, ha="right", va="top", linespacing=1.5)
    ax.set(xlabel="ΔE₀₀", xlim=(0, bins[-1]))
    ax.yaxis.set_major_locator(MaxNLocator(6, integer=True))
    ax.grid(axis="x", visible=False)


@styled
def delta_e_histogram(checks: Mapping[str, ModelCheck]) -> Figure:
    """ΔE₀₀ between measured and simulated test colours: thesis figure 5.4 (d)."""
    figure, axes = _columns(len(checks), 2.6)
    top = max(2.0, *(float(c.delta_e.max()) for c in checks.values()))
    for ax, (name, check) in zip(axes, checks.items()):
        _histogram(ax, check.delta_e, min(top, MOST_DELTA_E), CHANNEL_COLOURS[2])
        _title(ax, name)
    axes[0].set_ylabel("test colours")
    return figure


@styled
def patches(check: CalibrationCheck) -> Figure:
    """Patches (outer square) with their reproduction (inner) and ΔE₀₀ by profile: thesis figure 5.5."""
    figure = new_figure(10.0, 5.2)
    grid = figure.subplots(2, len(check.delta_e), height_ratios=(1.25, 1), squeeze=False)
    for ax in grid[1, 1:]:
        ax.sharey(grid[1, 0])
    top = min(MOST_DELTA_E, max(2.0, *(float(d.max()) for d in check.delta_e.values())))
    colours = (FURTHER_COLOURS[2], FURTHER_COLOURS[1], CHANNEL_COLOURS[2])
    for column, (name, difference) in enumerate(check.delta_e.items()):
        _squares(grid[0, column], check.targets.reference, check.shown[name])
        grid[0, column].set_title(name)
        _histogram(grid[1, column], difference, top, colours[column])
    grid[1, 0].set_ylabel("patches")
    return figure


def _squares(ax: Axes, outer: Floats, inner: Floats) -> None:
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Rectangle

    columns = 6 if len(outer) <= 30 else int(np.ceil(np.sqrt(1.5 * len(outer))))
    place = [(i % columns, -(i // columns)) for i in range(len(outer))]
    for xyz, size in ((outer, 0.94), (inner, 0.5)):
        squares = [Rectangle((x - size / 2, y - size / 2), size, size) for x, y in place]
        ax.add_collection(PatchCollection(squares, facecolors=_on_screen(xyz), edgecolors="none"))
    ax.set(xlim=(-0.6, columns - 0.4), ylim=(place[-1][1] - 0.6, 0.6), aspect="equal")
    ax.set_axis_off()


def _on_screen(xyz: Floats) -> Floats:
    from ..display.colorimetry import encode

    return np.clip(encode(xyz, "sRGB"), 0, 1)


@styled
def influence(matrices: Mapping[str, Floats], names: Sequence[str] = ("red", "green", "blue")) -> Figure:
    """Relative change in % of the light of a channel (row) by a second one (column), measured in pairs."""
    figure = new_figure(7.0 if len(matrices) > 1 else 4.2, 2.6)
    axes = list(figure.subplots(1, len(matrices), squeeze=False)[0])
    top = max(1.0, *(120 * float(np.nanmax(np.abs(m), initial=0)) for m in matrices.values()))
    for ax, (name, matrix) in zip(axes, matrices.items()):
        image = ax.imshow(100 * matrix, cmap="RdBu_r", vmin=-top, vmax=top)
        for i, j in np.ndindex(3, 3):
            if np.isfinite(matrix[i, j]):
                dark = abs(100 * matrix[i, j]) > 0.6 * top
                text = f"{100 * matrix[i, j]:+.2f}".replace("-", "−")
                ax.text(j, i, text, ha="center", va="center", color="white" if dark else INK)
        ax.set_xticks(range(3), names)
        ax.set_yticks(range(3), names)
        ax.set(xlabel="when this is on", ylabel="changes by %" if ax is axes[0] else "")
        ax.grid(visible=False)
        ax.set_facecolor(MARK_COLOUR + "55")
        _title(ax, name)
    figure.colorbar(image, ax=axes, label="%", shrink=0.85)
    return figure
