"""Figures of a Normbox validation, after thesis 3.4 … 3.8, 3.10 and 3.11."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ..render.normbox.comparison import LARGEST_SMALL_ANGLE
from ..render.normbox.verdict import group
from .style import FURTHER_COLOURS, GRID, INK, MUTED, new_figure, some, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MODEL_COLOURS = ("#d55e00", "#0072b2", *FURTHER_COLOURS)
MOST_ANGLES = 4
JUST_NOTICEABLE, PLAINLY_SEEN = 1.0, 2.0


def models(tree: xr.DataTree) -> list[str]:
    return list(json.loads(tree.attrs["models"]))


def predicted(tree: xr.DataTree, model: str) -> xr.Dataset:
    return tree[group(model)].to_dataset()


@styled
def spectra(tree: xr.DataTree, patch: int) -> Figure:
    """Reference and predicted radiance of a patch at some angles, the NSE below each (thesis figure 3.4)."""
    reference = tree["reference"].to_dataset().sel(patch=patch)
    angles = some(reference["angle"].values, MOST_ANGLES)
    figure = new_figure(10.0, 4.3)
    grid = figure.subplots(2, len(angles), sharex=True, sharey="row", squeeze=False, height_ratios=(3, 2))
    for column, angle in enumerate(angles):
        top, bottom = grid[0, column], grid[1, column]
        here = reference.sel(angle=angle)
        w = here["wavelength"].values
        top.plot(w, 1e3 * here["radiance"].values, color=INK, lw=2.2, label="reference")
        for colour, name in zip(MODEL_COLOURS, models(tree)):
            data = predicted(tree, name).sel(patch=patch, angle=angle)
            top.plot(w, 1e3 * data["radiance"].values, color=colour, lw=1.0, label=name)
            bottom.plot(w, 100 * data["nse"].values, color=colour, lw=1.0)
        bottom.axhline(0, color=MUTED, lw=0.8)
        top.set_title(f"{angle:g}°")
        bottom.set_xlabel("wavelength λ (nm)")
    for ax in grid[0]:
        ax.set_ylim(0, None)
    grid[0, 0].set_ylabel("radiance\n(mW m⁻² sr⁻¹ nm⁻¹)")
    grid[1, 0].set_ylabel("NSE (%)")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    return figure


@styled
def errors(tree: xr.DataTree, quantity: str = "nrmse") -> Figure:
    """A map of an error over patches and angles for each model (thesis figures 3.5 a, 3.6 a, 3.10)."""
    factor, label = {
        "nrmse": (100.0, "NRMSE (%)"),
        "rmse": (1e3, "RMSE (mW m⁻² sr⁻¹ nm⁻¹)"),
        "delta_e_2000": (1.0, "ΔE₀₀"),
        "delta_e_1976": (1.0, "ΔE₇₆"),
    }[quantity]
    names = models(tree)
    figure = new_figure(10.0, 1.0 + 1.55 * len(names))
    axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    sets = [predicted(tree, n)[quantity] for n in names]
    top = max(float(d.max()) for d in sets) * factor
    image: Any = None
    for ax, name, data in zip(axes, names, sets):
        image = ax.imshow(factor * data.values.T, aspect="auto", vmin=0, vmax=top, cmap="viridis", origin="lower")
        ax.set_title(f"{name}: mean {factor * float(data.mean()):.3g}")
        ax.set_xticks(range(data.sizes["patch"]), [str(p) for p in data["patch"].values])
        ticks = np.unique(np.linspace(0, data.sizes["angle"] - 1, min(5, data.sizes["angle"])).round().astype(int))
        ax.set_yticks(ticks, [f"{data['angle'].values[k]:g}°" for k in ticks])
        ax.grid(False)
        ax.set_ylabel("angle")
    axes[-1].set_xlabel("patch")
    bar = figure.colorbar(image, ax=list(axes), pad=0.01)
    bar.set_label(label)
    bar.outline.set_visible(False)  # type: ignore[operator]
    return figure


@styled
def correlation(tree: xr.DataTree, model: str | None = None) -> Figure:
    """Radiance against RMSE and NRMSE, small and large angles apart (thesis figures 3.5 b, c and 3.6 b, c)."""
    name = models(tree)[0] if model is None else model
    data = predicted(tree, name)
    found = json.loads(tree.attrs["verdict"])["models"][name]["correlations"]
    small = data["angle"].values <= LARGEST_SMALL_ANGLE
    figure = new_figure(10.0, 4.6)
    grid = figure.subplots(2, 2, sharex="col")
    sides = (("small", small, "30° … 60°"), ("large", ~small, "65° … 90°"))
    for column, (key, chosen, words) in enumerate(sides):
        x = 1e3 * data["mean_radiance"].values[:, chosen].ravel()
        for row, (quantity, factor, label) in enumerate(
            (("rmse", 1e3, "RMSE (mW m⁻² …)"), ("nrmse", 100.0, "NRMSE (%)"))
        ):
            ax = grid[row, column]
            ax.plot(x, factor * data[quantity].values[:, chosen].ravel(), "o", ms=3, color=MODEL_COLOURS[0], alpha=0.6)
            ax.set_ylim(0, None)
            r = found[key][quantity]
            words_r = "no coefficient" if r is None or not np.isfinite(r) else f"r = {r:.2f}".replace("-", "−")
            ax.set_title(f"{words}: {words_r}")
            ax.set_ylabel(label)
        grid[1, column].set_xlabel("mean radiance (mW m⁻² sr⁻¹ nm⁻¹)")
    return figure


@styled
def two_terms(tree: xr.DataTree) -> Figure:
    """The error found beside the two-term model, over the angle, with the direct share (thesis figure 3.7)."""
    model = tree["error_model"].to_dataset()
    data = predicted(tree, models(tree)[0])
    angles = model["angle"].values
    figure = new_figure(10.0, 3.2)
    left, middle, right = figure.subplots(1, 3)
    share = model["direct_share"].values
    left.fill_between(angles, 100 * share.min(axis=0), 100 * share.max(axis=0), color=GRID)
    left.plot(angles, 100 * share.mean(axis=0), "o-", color=INK, ms=3)
    left.set_title("direct light's share (%)")
    left.set_ylim(0, 100)
    for name, values, colour in (
        ("found", data["nrmse"].values, INK),
        ("two-term model", model["modelled_nrmse"].values, MODEL_COLOURS[0]),
    ):
        middle.plot(angles, 100 * values.mean(axis=0), "o-", ms=3, color=colour, label=name)
    middle.plot(
        angles, 100 * (share * model["err_d"].values).mean(axis=0), ":", color=MODEL_COLOURS[1], label="direct term"
    )
    middle.set_title("NRMSE (%), mean of the patches")
    middle.set_ylim(0, None)
    middle.legend()
    for ax in (left, middle):
        ax.set_xlabel("sample angle (°)")
    x, y = 100 * model["modelled_nrmse"].values.ravel(), 100 * data["nrmse"].values.ravel()
    right.plot(x, y, "o", ms=3, color=MODEL_COLOURS[0], alpha=0.6)
    top = 1.05 * max(x.max(), y.max())
    right.plot([0, top], [0, top], color=MUTED, lw=0.8)
    right.set_xlim(0, top)
    right.set_ylim(0, top)
    right.set_title("found against model, NRMSE (%)")
    right.set_xlabel("two-term model")
    return figure


@styled
def fit_against_prediction(tree: xr.DataTree, count: int = 4) -> Figure:
    """NSE of the prediction beside NSE of the fit at the angles of direct light (thesis figure 3.8), first model."""
    data, fit = predicted(tree, models(tree)[0]), tree["error_model"].to_dataset()["nse_fit"]
    angle = float(data["angle"].values[0])
    worst = data["nrmse"].sel(angle=angle).values.argsort()[::-1][:count]
    chosen = [int(data["patch"].values[k]) for k in sorted(worst)]
    figure = new_figure(10.0, 2.9)
    axes = figure.subplots(1, len(chosen), sharex=True, sharey=True, squeeze=False)[0]
    for ax, patch in zip(axes, chosen):
        w = data["wavelength"].values
        ax.plot(w, 100 * data["nse"].sel(patch=patch, angle=angle).values, color=INK, label="prediction")
        ax.plot(w, 100 * fit.sel(patch=patch, angle=angle).values, color=MODEL_COLOURS[0], label="fit")
        ax.axhline(0, color=MUTED, lw=0.8)
        ax.set_title(f"patch {patch}, {angle:g}°")
        ax.set_xlabel("wavelength λ (nm)")
    axes[0].set_ylabel("NSE (%)")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2)
    return figure


@styled
def colour_differences(tree: xr.DataTree, angle_deg: float = 45.0) -> Figure:
    """ΔE₀₀ of all patches, range over the angles (3.10), and ΔE₇₆ at one angle for each patch (3.11 b)."""
    figure = new_figure(10.0, 4.6)
    top, bottom = figure.subplots(2, 1, sharex=True)
    names = models(tree)
    width = 0.8 / len(names)
    for k, (colour, name) in enumerate(zip(MODEL_COLOURS, names)):
        data = predicted(tree, name)
        x = np.arange(data.sizes["patch"]) + (k - (len(names) - 1) / 2) * width
        low, mean, high = (getattr(data["delta_e_2000"], f)("angle").values for f in ("min", "mean", "max"))
        top.vlines(x, low, high, color=colour, lw=2.4, alpha=0.55)
        top.plot(x, mean, "o", ms=3.4, color=colour, label=name)
        nearest = data.sel(angle=angle_deg, method="nearest")
        bottom.bar(x, nearest["delta_e_1976"].values, width, color=colour)
        bottom.set_title(f"ΔE₇₆ at {float(nearest['angle']):g}°")
        bottom.set_xticks(range(data.sizes["patch"]), [str(p) for p in data["patch"].values])
    for level in (JUST_NOTICEABLE, PLAINLY_SEEN):
        top.axhline(level, color=MUTED, lw=0.8, ls=(0, (4, 3)))
    top.set_title("ΔE₀₀, mean and range over the angles")
    for ax in (top, bottom):
        ax.set_ylim(0, None)
    bottom.set_xlabel("patch")
    top.legend(ncols=len(names))
    return figure


@styled
def sources(tree: xr.DataTree) -> Figure:
    """The sources of the error path, small and large angles apart, beside what was found (thesis 3.3.3)."""
    path = tree["error_path"].to_dataset()
    small = path["angle"].values <= LARGEST_SMALL_ANGLE
    names = [str(n) for n in path["source"].values] + ["combined"]
    figure = new_figure(10.0, 0.27 * (len(names) + len(models(tree))) + 1.1)
    ax = figure.subplots()
    rows: list[tuple[str, Any, Any, str]] = []
    for name in names:
        part = path["combined"] if name == "combined" else path["deviation"].sel(source=name)
        rows.append((name, part.values[:, small], part.values[:, ~small], "#5aa2d9"))
    for colour, name in zip(MODEL_COLOURS, models(tree)):
        data = predicted(tree, name)
        chosen = data["angle"].values <= LARGEST_SMALL_ANGLE
        rows.append((f"found: {name}", data["nrmse"].values[:, chosen], data["nrmse"].values[:, ~chosen], colour))
    for k, (_, low, high, colour) in enumerate(reversed(rows)):
        for values, offset, alpha in ((low, 0.19, 1.0), (high, -0.19, 0.45)):
            if values.size:
                ax.barh(k + offset, 100 * np.sqrt(np.mean(values**2)), 0.36, color=colour, alpha=alpha)
    ax.set_yticks(range(len(rows)), [r[0] for r in reversed(rows)])
    ax.set_xlabel("relative error of the radiance, RMS (%): dark 30° … 60°, pale 65° … 90°")
    ax.grid(axis="y", visible=False)
    return figure
