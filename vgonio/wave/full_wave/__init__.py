"""A rigorous boundary-integral solver for one-dimensional profiles: gratings, and finite profiles under a beam."""

from .solver import FullWave
from .tapered import scatter_profile

__all__ = ["FullWave", "scatter_profile"]
