"""3. The instrument: source, detector, calibration, results and their files, readers of measured BRDFs."""

from __future__ import annotations

import importlib
from typing import Any

from .gonioreflectometer import Gonioreflectometer
from .storage import open, save

# name: module, loaded when first asked for
_LATER = {
    "Instrument": "instrument",
    "Spectrometer": "hardware",
    "Tilt": "hardware",
    "calibrate": "calibration",
    "calibration_factor": "calibration",
    "cross_validate": "cross_validation",
    "grazing_spectra": "cross_validation",
    "read": "formats",
    "write": "formats",
}
__all__ = ["Gonioreflectometer", "open", "save", *_LATER]


def __getattr__(name: str) -> Any:
    if name in _LATER:
        return getattr(importlib.import_module(f"vgonio.measure.{_LATER[name]}"), name)
    raise AttributeError(f"module 'vgonio.measure' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))
