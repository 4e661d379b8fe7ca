"""A rigorous boundary-integral solver for one-dimensional profiles: gratings, and finite profiles under a beam."""

from .forecast import Forecast, forecast
from .solver import FullWave
from .tapered import scatter_profile

__all__ = ["Forecast", "FullWave", "forecast", "scatter_profile"]
