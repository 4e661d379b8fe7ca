"""1. The surface: height fields, their readers, generators, filters, statistics and mesh."""

from .export import write
from .filter import fill, gaussian_filter, level, remove_outliers
from .generate import blazed, flat, gaussian, lamellar, power_law, sandblasted, sinusoid
from .heightfield import Heightfield
from .interpolant import Interpolant
from .plausible import describe_import
from .readers import read
from .spectrum import autocorrelation, psd
from .statistics import parameters, slope_distribution
from .visibility import visible

__all__ = [
    "Heightfield",
    "Interpolant",
    "autocorrelation",
    "blazed",
    "describe_import",
    "fill",
    "flat",
    "gaussian",
    "gaussian_filter",
    "lamellar",
    "level",
    "parameters",
    "power_law",
    "psd",
    "read",
    "remove_outliers",
    "sandblasted",
    "sinusoid",
    "slope_distribution",
    "visible",
    "write",
]
