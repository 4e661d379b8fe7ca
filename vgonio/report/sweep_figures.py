"""A sweep at a glance: shares of single and multiple reflections, lobes and run times against what was varied."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from . import quantities as q
from .style import INK, MULTIPLE_COLOURS, SINGLE_COLOUR, angle, logarithmic, new_figure, some, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_LINES = 6
DASHES = ("-", "--", ":", "-.")


@styled
def overview(tree: xr.DataTree, wavelength_nm: float | None = None) -> Figure | None:
    """Panels over the first swept key: reflected power, BRDF lobes, seconds; None where no point is done.

    tree : result of `vgonio.studies.sweep`; shown at the middle θᵢ and near 550 nm. Lines of different dashes are the
    values of the second key; of further keys the first value is shown.
    """
    results = {str(n): g.to_dataset() for n, g in tree.children.items() if "brdf" in g.data_vars}
    if not results or "seconds" not in tree:
        return None
    keys = swept_keys(tree)
    drawn = [(name, data) for name, data in results.items() if "energy_by_bounce" in data][:1]
    lobes = [(name, data) for name, data in results.items() if q.in_plane(data)][:2]
    figure = new_figure(3.6 * (len(drawn) + len(lobes) + 1), 3.3)
    axes = list(figure.subplots(1, len(drawn) + len(lobes) + 1, squeeze=False)[0])
    for (_, data), ax in zip(drawn, axes):
        reflected(ax, prepared(data, wavelength_nm), keys)
    for (name, data), ax in zip(lobes, axes[len(drawn) :]):
        lobe_of_each(ax, prepared(data, wavelength_nm), keys, q.title(name, data))
    seconds_of_each(axes[-1], tree.to_dataset(inherit=False), keys)
    return figure


def swept_keys(tree: xr.DataTree) -> list[str]:
    """Names of the coordinates that were swept, the first numeric one first."""
    dims = tree["state"].dims
    names = [str(n) for n, c in tree.coords.items() if c.dims and set(c.dims) <= set(dims) and str(n) != "point"]
    return sorted(names, key=lambda n: tree.coords[n].dtype.kind not in "fiu")


def prepared(data: xr.Dataset, wavelength_nm: float | None) -> xr.Dataset:
    near = q.near(data, wavelength_nm)
    return near.isel(theta_i=near.sizes["theta_i"] // 2)


def axis_of(data: xr.Dataset, key: str) -> tuple[str, np.ndarray, list[str] | None]:
    """(dim, places, labels or None) of a swept key: words stand at 0, 1, 2, …"""
    coordinate = data[key]
    dim = str(coordinate.dims[0])
    if coordinate.dtype.kind in "fiu":
        return dim, coordinate.values.astype(float), None
    return dim, np.arange(coordinate.size, dtype=float), [str(v) for v in coordinate.values]


def along(data: xr.Dataset, keys: list[str]) -> list[tuple[str, xr.Dataset]]:
    """The data for each value of the second key (at most four), further keys at their first value."""
    first = str(data[keys[0]].dims[0])
    further = [k for k in keys[1:] if str(data[k].dims[0]) != first]
    fixed = data.isel({str(data[k].dims[0]): 0 for k in further[1:]})
    if not further:
        return [("", fixed)]
    dim = str(data[further[0]].dims[0])
    return [
        (f"{further[0]} {data[further[0]].values[i]}", fixed.isel({dim: i})) for i in range(min(data.sizes[dim], 4))
    ]


def reflected(ax: Axes, data: xr.Dataset, keys: list[str]) -> None:
    dim, x, labels = axis_of(data, keys[0])
    for dash, (_, here) in zip(DASHES, along(data, keys)):
        power = here["energy_by_bounce"].transpose(dim, "bounce").values * 100
        ax.plot(x, power[:, 0], dash, color=SINGLE_COLOUR, marker="o", ms=3)
        ax.plot(x, power[:, 1:].sum(axis=1), dash, color=MULTIPLE_COLOURS[0], marker="o", ms=3)
    ax.plot([], [], color=SINGLE_COLOUR, label="one reflection")
    ax.plot([], [], color=MULTIPLE_COLOURS[0], label="two or more")
    if len(along(data, keys)) > 1:
        for dash, (name, _) in zip(DASHES, along(data, keys)):
            ax.plot([], [], dash, color=INK, label=name)
    ax.legend(fontsize=7.5)
    ax.set_ylim(bottom=0)
    ax.set_ylabel("reflected power (%)")
    ax.set_title(f"Rays, {where(data)}")
    label_x(ax, data, keys[0], x, labels)


def lobe_of_each(ax: Axes, data: xr.Dataset, keys: list[str], title: str) -> None:
    from matplotlib import colormaps

    dim, x, labels = axis_of(data, keys[0])
    here = along(data, keys)[0][1]
    # points that failed have no lobe
    known = np.flatnonzero(here["brdf"].notnull().any("theta_o").values)
    chosen = some(known, MOST_LINES)
    top = 0.0
    for place, i in enumerate(chosen):
        brdf = here["brdf"].isel({dim: int(i)})
        colour = colormaps["viridis"](0.9 * place / max(1, len(chosen) - 1))
        ax.plot(here["theta_o"], brdf.where(brdf > 0), color=colour, lw=1.2, label=labels[i] if labels else f"{x[i]:g}")
        top = max(top, float(brdf.max()))
    if top > 0:
        logarithmic(ax, "y", top * 10**-4.5, top * 2)
    if ax.lines:
        # beneath the panel: inside it would lie on the lobes
        title = keys[0] + unit_of(data, keys[0])
        ax.legend(title=title, fontsize=7, title_fontsize=7.5, loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3)
    ax.set_xlabel("angle of reflection θₒ (°)")
    ax.set_ylabel("BRDF (sr⁻¹)")
    fixed = held(data, keys)
    ax.set_title(f"{title[:1].upper()}{title[1:]}, {where(data)}" + (f"\n{fixed}" if fixed else ""))


def held(data: xr.Dataset, keys: list[str]) -> str:
    """The values of the further keys for which lobes are drawn, "correlation_um 5"; "" where there are none."""
    first = str(data[keys[0]].dims[0])
    return ", ".join(f"{k} {data[k].values[0]}" for k in keys[1:] if str(data[k].dims[0]) != first)


def seconds_of_each(ax: Axes, data: xr.Dataset, keys: list[str]) -> None:
    dim, x, labels = axis_of(data, keys[0])
    seconds = data["seconds"].transpose(dim, ...).values.reshape(len(x), -1)
    ax.plot(np.repeat(x[:, None], seconds.shape[1], 1).ravel(), seconds.ravel(), "o", ms=3, color=INK)
    failed = np.flatnonzero((data["state"].transpose(dim, ...).values.reshape(len(x), -1) == 1).any(axis=1))
    for i in failed:
        ax.axvline(x[i], color="#d55e00", lw=1, ls=":", label="points failed here" if i == failed[0] else None)
    if failed.size:
        ax.legend(fontsize=7.5)
    ax.set_ylim(bottom=0)
    ax.set_ylabel("seconds a point")
    ax.set_title("Run time")
    label_x(ax, data, keys[0], x, labels)


def where(data: xr.Dataset) -> str:
    return f"θᵢ = {angle(float(data['theta_i']))}, {float(data['wavelength']):g} nm"


def unit_of(data: xr.Dataset, key: str) -> str:
    attrs: Any = data[key].attrs
    return {"um": " (µm)", "nm": " (nm)", "degree": " (°)"}.get(attrs.get("units", ""), "")


def label_x(ax: Axes, data: xr.Dataset, key: str, x: np.ndarray, labels: list[str] | None) -> None:
    ax.set_xlabel(f"{key}{unit_of(data, key)}")
    if labels:
        ax.set_xticks(x, labels)
