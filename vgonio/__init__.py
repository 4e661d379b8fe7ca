"""vgonio: a virtual gonioreflectometer and a wave-optics simulator for measured surfaces.

>>> import vgonio as vg
>>> surface = vg.surface.gaussian(rms_um=0.5, correlation_um=5, shape=(256, 256), pitch_um=0.25, seed=0)
>>> gonio = vg.measure.Gonioreflectometer(theta_i_deg=[30], theta_o_deg=range(-85, 86, 5), aperture_deg=2.0)
>>> rays = gonio.measure(surface, vg.geometric.RayOptics(material="Al", wavelength_nm=[550], rays=100_000))

Importing this package loads nothing but itself: every part is loaded where it is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from . import (
        accuracy,
        compare,
        directions,
        display,
        errors,
        geometric,
        materials,
        measure,
        models,
        render,
        report,
        surface,
        units,
        wave,
    )
    from .measure.storage import open, save
    from .planning import plan
    from .simulation import simulate
    from .studies import sweep

# functions on whole scenes and results; the modules have other names, so that no import order can hide a function
_FUNCTIONS = {
    "simulate": "vgonio.simulation",
    "plan": "vgonio.planning",
    "sweep": "vgonio.studies",
    "save": "vgonio.measure.storage",
    "open": "vgonio.measure.storage",
}

# parts that hand out results; with them come the pictures as methods, `result.vgonio.plot_lobes()`
_WITH_PICTURES = {"compare", "measure", "models", "open", "simulate", "sweep"}

__all__ = [
    "__version__",
    "accuracy",
    "compare",
    "directions",
    "display",
    "errors",
    "geometric",
    "materials",
    "measure",
    "models",
    "open",
    "plan",
    "render",
    "report",
    "save",
    "simulate",
    "surface",
    "sweep",
    "units",
    "wave",
]
_MODULES = set(__all__) - set(_FUNCTIONS) - {"__version__"}


def __getattr__(name: str) -> Any:
    if name in _WITH_PICTURES:
        importlib.import_module("vgonio.report.accessor")
    if name in _MODULES:
        return importlib.import_module(f"vgonio.{name}")
    if name in _FUNCTIONS:
        value = getattr(importlib.import_module(_FUNCTIONS[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'vgonio' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))
