"""Height, slope and lateral parameters of a surface (ISO 25178-2), its autocorrelation and power spectral density.

Slopes are derivatives of the interpolant at the samples (cubic spline by default), not differences: they belong to the
surface that the solvers see. Missing points are left out of the heights and slopes; what needs a Fourier transform
(autocorrelation, Sal, PSD) asks for a complete field.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .heightfield import Heightfield

Floats = NDArray[np.float64]


def slopes(surface: Heightfield) -> tuple[Floats, Floats]:
    """(∂z/∂x, ∂z/∂y), each (ny, nx), at the samples: derivatives of the interpolant.

    A field of vertical walls ("nearest") has no finite slope there: its slopes are 0 and the walls are not counted.
    Where points are missing, central differences of the valid neighbours take the place of the spline; NaN elsewhere.
    """
    if surface.missing:
        return _differences(surface.z, surface.dx, 1), _differences(surface.z, surface.dy, 0)
    surface_at = surface.interpolant
    return surface_at.grid(surface.y, surface.x, dx=1), surface_at.grid(surface.y, surface.x, dy=1)


def beckmann_alpha(surface: Heightfield) -> float:
    """α = √2 · RMS of the slope along one axis, both axes pooled (mean slope removed)."""
    zx, zy = slopes(surface)
    return float(np.sqrt(np.nanvar(zx) + np.nanvar(zy)))


def _differences(z: Floats, h: float, axis: int) -> Floats:
    """Central differences along one axis, NaN at the ends and beside missing points."""
    out = np.full(z.shape, np.nan)
    inner = [slice(None), slice(None)]
    inner[axis] = slice(1, -1)
    n = z.shape[axis]
    out[tuple(inner)] = (np.take(z, np.arange(2, n), axis) - np.take(z, np.arange(n - 2), axis)) / (2 * h)
    return out
