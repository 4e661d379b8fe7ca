"""The tone curve of one channel: linear light over signal, rising everywhere and so invertible.

Measured levels go through isotonic regression (the rising sequence nearest to them in the least-squares sense; Barlow
1972) and a monotone cubic through the result (Fritsch and Carlson 1980). The cubic runs in the domain in which the
curve is nearly straight, light^(1/p) with the exponent p fitted to the levels: ten levels then suffice for a display of
any gamma. Where levels are clipped, below or above, a slope of 10⁻⁶ is left, so that an inverse exists; it is far below
what an 18-bit signal could show.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

Floats = NDArray[np.float64]
LEAST_SLOPE = 1e-6  # of light over signal added to every curve, so that it can be turned round
FEWEST_LEVELS = 4  # both ends and two between, else there is no curve to tell
POWERS = (0.4, 4.0)  # of a display's tone curve: 1 is linear, 2.2 to 2.6 usual


@dataclass(frozen=True)
class ToneCurve:
    """Light (n,) at levels (n,), both rising from 0 to 1; `power` is the domain of interpolation, `measured` (n,) what
    was measured at the levels, in the same unit."""

    level: Floats
    light: Floats
    power: float
    measured: Floats

    @cached_property
    def _root(self) -> PchipInterpolator:
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(self.level, self.light ** (1 / self.power))

    def __call__(self, signal: ArrayLike) -> Floats:
        """Linear light 0 … 1 of signals of any shape; signals are clipped to 0 … 1."""
        v = np.clip(np.asarray(signal, dtype=np.float64), 0.0, 1.0)
        return np.where(v < 1, np.clip(self._root(v), 0.0, 1.0) ** self.power, 1.0)

    def inverse(self, light: ArrayLike) -> Floats:
        """Signal 0 … 1 that gives a linear light of any shape; light is clipped to 0 … 1. Bisection, to rounding."""
        wanted = np.clip(np.asarray(light, dtype=np.float64), 0.0, 1.0) ** (1 / self.power)
        knots = self.light ** (1 / self.power)
        i = np.clip(np.searchsorted(knots, wanted, side="right") - 1, 0, knots.size - 2)
        c3, c2, c1, c0 = self._root.c[:, i]
        low, high = np.zeros_like(wanted), np.diff(self.level)[i]
        for _ in range(54):
            middle = (low + high) / 2
            below = ((c3 * middle + c2) * middle + c1) * middle + c0 < wanted
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        found = self.level[i] + high
        return np.where(wanted >= 1, 1.0, np.where(wanted <= 0, 0.0, found))

    @property
    def departure(self) -> float:
        """Largest distance of a measured level from the curve, as a share of full light: noise, or a falling curve."""
        return float(np.abs(self.measured - self.light).max())

    @property
    def saturates_at(self) -> float:
        """The lowest measured level with at least 99.9 % of the full light; below 1 where the top is clipped."""
        return float(self.level[np.argmax(self.light >= 0.999)])

    @property
    def dark_until(self) -> float:
        """The highest measured level without light above black; above 0 where the lowest levels drown."""
        return float(self.level[np.flatnonzero(self.light <= 2 * LEAST_SLOPE)[-1]])


def tone_curve(level: ArrayLike, light: ArrayLike) -> tuple[ToneCurve, float]:
    """The rising curve nearest to measured light (n,) above black, in any unit, at signal levels (n,) in 0 … 1; and the
    light of its upper end in that unit. Repeated levels are averaged.

    Raises InputError for fewer than `FEWEST_LEVELS` levels, levels that do not reach from 0 to 1, values that are not
    finite, or a channel that gives no light.
    """
    from scipy.optimize import isotonic_regression

    v, y = np.asarray(level, float), np.asarray(light, float)
    if v.shape != y.shape or v.ndim != 1 or not np.all(np.isfinite(v) & np.isfinite(y)):
        raise InputError(f"levels {v.shape} and light {y.shape} of a tone curve: two equal lists of finite numbers")
    knots, index, count = np.unique(v, return_inverse=True, return_counts=True)
    if knots.size < FEWEST_LEVELS or knots[0] != 0 or knots[-1] != 1:
        raise InputError(
            f"{knots.size} levels from {v.min(initial=1):g} to {v.max(initial=0):g} of full scale: a tone curve needs "
            f"at least {FEWEST_LEVELS}, better 10 or more, from 0 to 1"
        )
    mean = np.bincount(index, weights=y) / count
    rising = np.clip(isotonic_regression(mean, weights=count.astype(float)).x, 0.0, None)
    top = float(rising[-1])
    if top <= 0:
        raise InputError("a channel gives no light above black at any level: are the readings in the right order?")
    rising[0] = 0.0  # the lowest level is black itself
    light01 = (1 - LEAST_SLOPE) * rising / top + LEAST_SLOPE * knots
    return ToneCurve(knots, light01, _power(knots, light01), mean / top), top


def _power(level: Floats, light: Floats) -> float:
    """Exponent of the power law nearest to the curve in the logarithm, where there is light to speak of."""
    seen = (level > 0) & (level < 1) & (light > 2e-3) & (light < 0.999)
    if not seen.any():
        return 1.0
    x, y = np.log(level[seen]), np.log(light[seen])
    return float(np.clip(x @ y / (x @ x), *POWERS))
