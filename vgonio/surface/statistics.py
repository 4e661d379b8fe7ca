"""Height, slope and lateral parameters of a surface (ISO 25178-2) and the distribution of its slopes.

Slope means the derivative of the interpolant at the samples (cubic spline by default), not a difference: it belongs to
the surface that the solvers see. Level first: a tilt counts in Sdq, the heights are taken about their mean.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from . import checks
from .heightfield import Heightfield
from .spectrum import about_mean, autocorrelation

Floats = NDArray[np.float64]

# units of `parameters`
UNITS = {
    "Sq": "µm",
    "Sa": "µm",
    "Sz": "µm",
    "Ssk": "1",
    "Sku": "1",
    "Sdq": "1",
    "Sal": "µm",
    "alpha": "1",
    "alpha_x": "1",
    "alpha_y": "1",
}


def parameters(surface: Heightfield) -> dict[str, float]:
    """Roughness of a levelled surface; `UNITS` of this module has the units.

    Sq, Sa, Sz : RMS, mean absolute and peak-to-valley height in µm;  Ssk, Sku : skewness and kurtosis (3 for Gaussian)
    Sdq : RMS gradient √⟨z_x² + z_y²⟩
    alpha : Beckmann's √2 · one-axis RMS slope, both axes pooled and the mean slope removed: α² = var z_x + var z_y;
        alpha_x, alpha_y : √2 · RMS slope along one axis, so that α² is the mean of their squares
    Sal : autocorrelation length in µm, where the autocorrelation has first fallen to 0.2 in the direction of fastest
        decay; NaN where it does not within half the field

    Missing points are left out; slopes are central differences of valid neighbours then (ISO 25178-2:2021), and NaN
    where no point has two.
    """
    z = about_mean(surface.z)
    sq = float(np.sqrt(np.nanmean(z**2)))
    zx, zy = (s[np.isfinite(s)] for s in slopes(surface))
    variance = _variance(zx), _variance(zy)
    # the moments of a flat surface are those of nothing
    unit = z / sq if sq > 0 else np.full_like(z, np.nan)
    return {
        "Sq": sq,
        "Sa": float(np.nanmean(np.abs(z))),
        "Sz": float(np.nanmax(z) - np.nanmin(z)),
        "Ssk": float(np.mean(unit[np.isfinite(unit)] ** 3)) if sq > 0 else np.nan,
        "Sku": float(np.mean(unit[np.isfinite(unit)] ** 4)) if sq > 0 else np.nan,
        "Sdq": float(np.sqrt(np.mean(zx**2) + np.mean(zy**2))) if zx.size and zy.size else np.nan,
        "Sal": autocorrelation_length(surface) if sq > 0 else np.nan,
        "alpha": float(np.sqrt(sum(variance))),
        "alpha_x": float(np.sqrt(2 * variance[0])),
        "alpha_y": float(np.sqrt(2 * variance[1])),
    }


def beckmann_alpha(surface: Heightfield) -> float:
    """α = √(var ∂z/∂x + var ∂z/∂y), √2 times the RMS slope along one axis; as in `parameters`."""
    return float(np.sqrt(sum(_variance(s[np.isfinite(s)]) for s in slopes(surface))))


def _variance(values: Floats) -> float:
    return float(values.var()) if values.size else float("nan")


def slopes(surface: Heightfield) -> tuple[Floats, Floats]:
    """(∂z/∂x, ∂z/∂y), each (ny, nx), at the samples: derivatives of the interpolant.

    A field of vertical walls ("nearest") has slope 0 everywhere: its walls are not counted. Where points are missing,
    central differences of valid neighbours take the place of the spline, NaN where there are none.
    """
    if surface.missing:
        return tuple(_differences(surface, axis) for axis in (1, 0))  # type: ignore[return-value]
    between = surface.interpolant
    return between.grid(surface.y, surface.x, dx=1), between.grid(surface.y, surface.x, dy=1)


def _differences(surface: Heightfield, axis: int) -> Floats:
    """Central differences along one axis, NaN beside missing points and at the ends of a field that is not periodic."""
    z = surface.z
    out = (np.roll(z, -1, axis) - np.roll(z, 1, axis)) / (2 * surface.pitch_um[axis])
    if z.shape[axis] == 1:
        return np.where(np.isnan(z), np.nan, 0.0)
    if not surface.periodic:
        ends = (slice(None),) * axis + ([0, -1],)
        out[ends] = np.nan
    return out


def autocorrelation_length(surface: Heightfield, level: float = 0.2) -> float:
    """Sal in µm: least distance from the origin at which the autocorrelation is at `level` (ISO 25178-2, 4.4.2).

    Searched along 180 directions at steps of half a pitch, bilinear between lags; NaN if nothing falls that low.
    """
    from scipy.ndimage import map_coordinates

    acf = autocorrelation(surface)
    step = min(h for h, n in zip(surface.pitch_um, surface.shape) if n > 1) / 2
    reach = [np.abs(lag).max() for lag in (acf.y_um, acf.x_um)]
    direction = np.deg2rad(np.arange(180))
    best = np.inf
    distance = np.arange(0, np.hypot(*reach) + step, step)
    for angle in direction:
        y, x = distance * np.sin(angle), distance * np.cos(angle)
        inside = (np.abs(y) <= reach[0] + 1e-9) & (np.abs(x) <= reach[1] + 1e-9) & (distance < best + 2 * step)
        index = [(c[inside] / h + n // 2) for c, h, n in zip((y, x), surface.pitch_um, acf.values.shape)]
        along = map_coordinates(acf.values, index, order=1, mode="nearest")
        below = np.flatnonzero(along <= level)
        if below.size:
            i = below[0]
            part = (along[i - 1] - level) / (along[i - 1] - along[i])
            best = min(best, float(distance[i - 1] + part * step))
    return best if np.isfinite(best) else float("nan")


@dataclass(frozen=True)
class SlopeDistribution:
    """Densities (n,) of ∂z/∂x and ∂z/∂y over `slope` (n,), each with integral 1; `gaussian` has the same α."""

    slope: Floats
    density_x: Floats
    density_y: Floats
    alpha: float

    @property
    def gaussian(self) -> Floats:
        """exp(−s²/α²)/(√π α): one-axis slopes of a Gaussian surface, Beckmann's distribution. For α = 0, which has no
        density, all in the middle bin."""
        if self.alpha == 0:
            return np.where(np.arange(len(self.slope)) == len(self.slope) // 2, 1 / np.diff(self.slope)[0], 0.0)
        return np.exp(-((self.slope / self.alpha) ** 2)) / (np.sqrt(np.pi) * self.alpha)


def slope_distribution(surface: Heightfield, bins: int = 201) -> SlopeDistribution:
    """Histogram of the slopes along x and y over ± the largest of both, mean slopes removed.

    Raises InputError where too many points are missing for a slope along each axis.
    """
    count = int(checks.number("bins", bins, 3))
    zx, zy = (s[np.isfinite(s)] for s in slopes(surface))
    if not (zx.size and zy.size):
        raise InputError(
            f"{surface.name or 'the surface'} has no slopes: no point has two neighbours along x, or none along y, "
            "that are not missing; fill them"
        )
    zx, zy = zx - zx.mean(), zy - zy.mean()
    largest = max(np.abs(zx).max(), np.abs(zy).max(), np.finfo(float).eps)
    edges = np.linspace(-largest, largest, count + 1)
    x, y = (np.histogram(s, edges, density=True)[0] for s in (zx, zy))
    return SlopeDistribution((edges[1:] + edges[:-1]) / 2, x, y, float(np.sqrt(zx.var() + zy.var())))
