"""Numbers with their errors beside the law that they should follow."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from ..errors import InputError
from .style import FURTHER_COLOURS, INK, MUTED, RESULT_COLOURS, logarithmic, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PALETTE = (RESULT_COLOURS["waves"], RESULT_COLOURS["rays"], *FURTHER_COLOURS)
WIDE = 20.0  # from this ratio of the largest to the smallest value on, the axis along is logarithmic


@styled
def agreement(
    found: xr.DataArray,
    expected: xr.DataArray,
    stderr: xr.DataArray | None = None,
    along: xr.DataArray | None = None,
    by: str | None = None,
) -> Figure:
    """What was found, with ±1 standard error, and the law as a line; below, found minus expected.

    found, expected, stderr : alike but for the order of their dims, as they broadcast; names and units are taken from
    `long_name` and `units`, of `found` and of `along`
    along : of the horizontal axis, by default `expected` itself, so that the law is the diagonal
    by : the coordinate whose values have colours of their own (at most six)
    Raises InputError where no value is known or `by` is no dimension.
    """
    along = expected.rename("along").assign_attrs(long_name="expected") if along is None else along
    error = xr.zeros_like(found) if stderr is None else stderr
    along, found, expected, error = xr.broadcast(along, found, expected, error)
    if by is not None and by not in found.dims:
        raise InputError(f"by = {by!r} is no dimension of what was found: these are {', '.join(map(str, found.dims))}")
    known = np.isfinite(found.values) & np.isfinite(expected.values) & np.isfinite(along.values)
    if not known.any():
        raise InputError("nothing to draw: no value is known together with what is expected of it")
    figure = new_figure(6.2, 4.6)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.6, 1))
    x = along.values[known]
    below.axhline(0, color=INK, lw=1.0)
    above.plot([], [], color=INK, lw=1.0, label="law")
    for name, colour, chosen in _groups(found, by, known):
        order = np.argsort(along.values[chosen], kind="stable")
        above.plot(along.values[chosen][order], expected.values[chosen][order], color=INK, lw=1.0, zorder=1)
        style = {"fmt": "o", "ms": 3.5, "color": colour, "elinewidth": 0.9, "alpha": 0.85}
        above.errorbar(along.values[chosen], found.values[chosen], error.values[chosen], label=name, **style)
        difference = (found - expected).values[chosen]
        below.errorbar(along.values[chosen], difference, error.values[chosen], **style)
    if x.min() > 0 and x.max() > WIDE * x.min():
        logarithmic(below, "x", x.min() / 1.25, x.max() * 1.25)
    above.legend(title=None if by is None else _words(found[by], short=True))
    above.set_ylabel(_words(found))
    below.set_ylabel("difference")
    below.set_xlabel(_words(along))
    below.tick_params(colors=MUTED, labelcolor=INK)
    return figure


def _groups(found: xr.DataArray, by: str | None, known: np.ndarray) -> list[tuple[str | None, str, np.ndarray]]:
    """(label, colour, which points) of each value of `by`, of all points together without it."""
    if by is None:
        return [(None, PALETTE[0], known)]
    place = found.dims.index(by)
    number = np.arange(found.sizes[by]).reshape([-1 if i == place else 1 for i in range(found.ndim)])
    values = found[by].values
    names = [f"{v:g}" if np.issubdtype(values.dtype, np.number) else str(v) for v in values]
    return [(name, PALETTE[i % len(PALETTE)], known & (number == i)) for i, name in enumerate(names)]


def _words(data: xr.DataArray, short: bool = False) -> str:
    """Name and unit for an axis: "wavelength (nm)"; `short`: the coordinate's own name."""
    name = str((not short and data.attrs.get("long_name")) or data.name or "")
    unit = {"um": "µm", "degree": "°", "sr-1": "sr⁻¹"}.get(str(data.attrs.get("units", "1")), data.attrs.get("units"))
    return name if unit in (None, "1", "") else f"{name} ({unit})"
