"""1. The surface: height fields, their readers, generators, filters, statistics and mesh."""

from .heightfield import Heightfield
from .interpolant import Interpolant

__all__ = ["Heightfield", "Interpolant"]
