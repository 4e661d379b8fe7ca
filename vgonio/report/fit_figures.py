"""Figures of fits: the shift taken apart (thesis 4.7), models beside the measurement (4.12), explained shares.

Slopes of one sample with the global fit (4.8), or of several samples (4.11), are `spectral_figures.shift_slopes`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ..compare import delta_e_2000, fit_global_shift, fit_local_shift, fitted_spectra, rgb_map
from ..compare.metrics import align, detector_dim
from ..errors import InputError
from .spectral_figures import squares
from .style import FURTHER_COLOURS, INK, MUTED, RESULT_COLOURS, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SCALE_WORDS = {
    "normalised": "each spectrum over its value at λₙ",
    "reference-Y50": "both at the reference's Y = 50, square by square",
    "absolute": "π f cos θᵢ as reflectance factor",
}
LARGEST = 12.0  # ΔE₀₀ at the top of the scale at most


def shift_parts(
    data: xr.Dataset, material: Any = "Al", p: float | str = "fit", wavelength_n_nm: float = 600.0
) -> Figure:
    """Fresnel term alone, local fit and global fit of the shift beside the measurement, with ΔE₀₀ below (figure 4.7).

    data : in plane; material, p, wavelength_n_nm : of the shift fits. Colours are shown at equal luminance.
    Raises InputError for a hemisphere and as the fits.
    """
    _in_plane(data)
    local = fit_local_shift(data, material, p, wavelength_n_nm)
    whole = fit_global_shift(data, material, p, "fit", wavelength_n_nm)
    predicted = {
        "Fresnel term of the local fit": fitted_spectra(data, local, fresnel_only=True),
        "local fit (4.2)": fitted_spectra(data, local),
        "global fit (4.5)": fitted_spectra(data, whole),
    }
    return beside_measured(data, predicted, "normalised", chromatic=True, wavelength_n_nm=wavelength_n_nm)


def models_beside(data: xr.Dataset, fits: Mapping[str, xr.Dataset], scale: str = "reference-Y50") -> Figure:
    """The measurement beside fitted models, RGB maps above and ΔE₀₀ below (thesis figure 4.12).

    fits : by name, of `fit_model`;  scale : of ΔE₀₀, see `compare.delta_e_2000`
    """
    _in_plane(data)
    return beside_measured(data, dict(fits), scale, chromatic=False)


def _in_plane(data: xr.Dataset) -> None:
    if detector_dim(data) != "theta_o":
        raise InputError("these maps are of the plane of incidence, the data cover a hemisphere")


@styled
def beside_measured(
    data: xr.Dataset,
    predicted: Mapping[str, xr.Dataset],
    scale: str,
    chromatic: bool,
    wavelength_n_nm: float = 600.0,
) -> Figure:
    """RGB maps of the measurement and of what is predicted, one exposure for all, and ΔE₀₀ of each below."""
    columns = 1 + len(predicted)
    figure = new_figure(2.75 * columns + 0.5, 5.4)
    grid = figure.subplots(2, columns, squeeze=False, sharey=True)
    measured = rgb_map(data, chromatic=chromatic)
    exposure = float(measured.attrs["exposure"])
    _map(grid[0, 0], measured, "measured")
    grid[1, 0].set_axis_off()
    differences = {k: delta_e_2000(data, d, scale, wavelength_n_nm) for k, d in predicted.items()}
    known = np.concatenate([d.values[np.isfinite(d.values)] for d in differences.values()])
    top = float(np.clip(np.percentile(known, 97) if known.size else 1.0, 1.0, LARGEST))
    mesh: Any = None
    for ax, below, (name, d) in zip(grid[0, 1:], grid[1, 1:], predicted.items()):
        same = align(data, d)[1]
        _map(ax, rgb_map(same, exposure, chromatic), name)
        mesh = _difference(below, differences[name], top)
    for ax in (grid[0, 0], grid[1, 1]):
        ax.set_ylabel("θᵢ (°)")
    grid[1, 1].tick_params(labelleft=True)
    for ax in grid[1, 1:]:
        ax.set_xlabel(f"θₒ (°)\n{ax.get_xlabel()}")
    grid[0, 0].set_xlabel("θₒ (°)")
    bar = figure.colorbar(mesh, ax=list(grid[1, 1:]), shrink=0.9, pad=0.015, aspect=20, extend="max")
    bar.set_label("ΔE₀₀")
    bar.outline.set_visible(False)
    words = [SCALE_WORDS[scale] if scale != "normalised" else f"{SCALE_WORDS[scale]} = {wavelength_n_nm:g} nm"]
    words.append("colours at equal luminance" if chromatic else f"exposure {exposure:.3g} for all maps")
    text = "ΔE₀₀ below:\n" + words[0] + "\n\n" + words[1]
    text = "\n".join(_wrapped(line, 30) for line in text.split("\n"))
    grid[1, 0].text(0.0, 0.95, text, va="top", ha="left", color=MUTED, fontsize=8, transform=grid[1, 0].transAxes)
    return figure


def _wrapped(line: str, width: int) -> str:
    import textwrap

    return textwrap.fill(line, width)


def _map(ax: Axes, rgb: xr.DataArray, title: str) -> None:
    rgb = rgb.sortby("theta_i").sortby("theta_o").transpose("theta_i", "theta_o", "rgb")
    squares(ax, rgb, np.nan_to_num(np.clip(rgb.values, 0, 1)), np.isnan(rgb.values).any(axis=-1))
    ax.set_title(title)


def _difference(ax: Axes, data: xr.DataArray, top: float) -> Any:
    data = data.sortby("theta_i").sortby("theta_o").transpose("theta_i", "theta_o")
    values = np.ma.masked_invalid(data.values)
    mesh = squares(ax, data, values, np.isnan(data.values), cmap="viridis", vmin=0, vmax=top)
    ax.set_xlabel(f"mean {float(data.mean()):.2f}, largest {float(data.max()):.2f}")
    return mesh


@styled
def explained(shares: xr.Dataset) -> Figure:
    """Bars of `compare.explained_shares` with their standard errors."""
    names = [str(n) for n in shares["explanation"].values][::-1]
    share = shares["share"].values[::-1] * 100
    error = shares["share_stderr"].values[::-1] * 100
    kinds = [str(k) for k in shares["kind"].values][::-1]
    figure = new_figure(6.4, 0.8 + 0.5 * len(names))
    ax = figure.subplots()
    place = np.arange(len(names))
    ax.barh(place, share, color=[_colour(k) for k in kinds], height=0.6, zorder=2)
    ax.errorbar(share, place, xerr=error, fmt="none", ecolor=INK, elinewidth=1.0, capsize=2.5, zorder=3)
    ax.set_yticks(place, [name if name == kind else f"{name}\n({kind})" for name, kind in zip(names, kinds)])
    low, high = min(0.0, float(np.min(share - error))), max(100.0, float(np.max(share + error)))
    low = max(low, -150.0)
    ax.set_xlim(low - 0.05 * (high - low) * (low < 0), high + 0.3 * (high - low))
    for y, value, e in zip(range(len(names)), share, error):
        digits = 0 if e >= 1 else 1
        text = f"{value:.{digits}f} ± {e:.{digits}f} %".replace("-", "−")
        ax.text(max(value + e, 0) + 0.02 * (high - low), y, text, va="center", fontsize=8.5)
    ax.axvline(0, color=MUTED, lw=0.8)
    ax.grid(axis="y", visible=False)
    ax.set_xlabel("explained share of the measured slopes (%)")
    return figure


def _colour(kind: str) -> str:
    order: Sequence[str] = ("single-scatter waves", "multiple-scatter waves")
    if kind == "rays":
        return RESULT_COLOURS["rays"]
    if kind == order[0]:
        return RESULT_COLOURS["waves"]
    return FURTHER_COLOURS[3] if kind == order[1] else FURTHER_COLOURS[0]
