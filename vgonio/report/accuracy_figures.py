"""Error against run time of every solver, one panel for waves' integrals, one for solvers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .style import FURTHER_COLOURS, INK, RESULT_COLOURS, logarithmic, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FLOOR = 1e-16  # an error of exactly 0 is drawn here


@styled
def work_precision(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Left: error achieved against seconds; right: achieved against asked or stated, below the diagonal where kept.

    rows : of `vgonio.accuracy.run_cases`; rows without figures are left out.
    """
    known = [r for r in rows if r["achieved"] is not None]
    figure = new_figure(10.0, 4.2)
    left, right = figure.subplots(1, 2)
    palette = [*RESULT_COLOURS.values(), *FURTHER_COLOURS]
    for i, name in enumerate(dict.fromkeys(r["case"] for r in known)):
        here = [r for r in known if r["case"] == name]
        style = {"color": palette[i % len(palette)], "marker": "os^Dv"[i // len(palette) % 5], "ms": 4, "lw": 1}
        achieved = [max(r["achieved"], FLOOR) for r in here]
        left.plot([r["seconds"] for r in here], achieved, label=name, **style)
        promised = [r["asked"] if r["asked"] is not None else r["stated"] or np.nan for r in here]
        right.plot(promised, achieved, **style)
    for ax in (left, right):
        decades(ax, known)
        ax.set_ylabel("error achieved, relative")
    seconds = [max(r["seconds"], 1e-5) for r in known] or [1.0]
    logarithmic(left, "x", min(seconds) / 2, max(seconds) * 2)
    left.set_xlabel("seconds")
    low, high = right.get_ylim()
    right.set_xscale("log")
    right.plot([low, high], [low, high], color=INK, lw=0.8, ls=":")
    right.annotate("kept below this line", (high / 30, high / 30), ha="right", va="bottom", fontsize=7.5)
    right.set_xlabel("error asked for, or stated where one cannot ask")
    figure.legend(loc="outside right upper", fontsize=7.5)
    return figure


def decades(ax: Axes, rows: Sequence[Mapping[str, Any]]) -> None:
    errors = [max(r["achieved"], FLOOR) for r in rows] or [1.0]
    logarithmic(ax, "y", min(errors) / 3, max(errors) * 3)
