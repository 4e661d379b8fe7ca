"""3. The instrument: source, detector, results and their files, readers of measured BRDFs."""

from __future__ import annotations

import importlib
from typing import Any

from .gonioreflectometer import Gonioreflectometer
from .storage import open, save

__all__ = ["Gonioreflectometer", "open", "read", "save", "write"]


def __getattr__(name: str) -> Any:
    if name in ("read", "write"):
        return getattr(importlib.import_module("vgonio.measure.readers"), name)
    raise AttributeError(f"module 'vgonio.measure' has no attribute {name!r}")
