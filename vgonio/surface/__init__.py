"""1. The surface: height fields, their readers, generators, filters, statistics and mesh."""

from .export import write
from .generate import flat, gaussian, power_law
from .heightfield import Heightfield
from .interpolant import Interpolant
from .plausible import describe_import
from .readers import read
from .sandblasting import sandblasted

__all__ = [
    "Heightfield",
    "Interpolant",
    "describe_import",
    "flat",
    "gaussian",
    "power_law",
    "read",
    "sandblasted",
    "write",
]
