"""6. Look at it: the figures, and HTML pages that need nothing else.

`plot_lobes(result)`, … draw the usual pictures of any result; they are methods of results as well, registered by this
package: `result.vgonio.plot_lobes()`. `page` writes the report, `explorer_page` a page with sliders. The functions of
`figures` behind them take datasets by name.
"""

from __future__ import annotations

import importlib
from typing import Any

from . import accessor as _accessor  # noqa: F401 (registers result.vgonio)
from .plots import (
    plot_decomposition,
    plot_delta_e,
    plot_energy,
    plot_heights,
    plot_hemisphere,
    plot_lobes,
    plot_mueller,
    plot_orders,
    plot_psd,
    plot_rgb,
    plot_shift,
    plot_slopes,
    plot_spectra,
    plot_surface,
    plot_sweep,
    plot_wave_energy,
    plot_ways,
)

# name: module, loaded when first asked for
_LATER = {
    "display_page": "display_document",
    "explorer_page": "explorer",
    "page": "document",
    "render": "document",
}
# figures of results and fits, of displays, of renderings
_FIGURES = ("figures", "display_figures", "render_figures")
__all__ = [
    "display_figures",
    "display_page",
    "explorer_page",
    "figures",
    "page",
    "plot_decomposition",
    "plot_delta_e",
    "plot_energy",
    "plot_heights",
    "plot_hemisphere",
    "plot_lobes",
    "plot_mueller",
    "plot_orders",
    "plot_psd",
    "plot_rgb",
    "plot_shift",
    "plot_slopes",
    "plot_spectra",
    "plot_surface",
    "plot_sweep",
    "plot_wave_energy",
    "plot_ways",
    "render",
    "render_figures",
]


def __getattr__(name: str) -> Any:
    if name in _FIGURES:
        return importlib.import_module(f"vgonio.report.{name}")
    if name in _LATER:
        return getattr(importlib.import_module(f"vgonio.report.{_LATER[name]}"), name)
    raise AttributeError(f"module 'vgonio.report' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))
