"""Standard errors of figures of whole BRDFs, by drawing the BRDFs anew within brdf_stderr.

How the errors of one BRDF hang together is not known as a rule: noise may be independent from value to value, or shared
by a whole spectrum, as where one ray carries all wavelengths. Both are drawn, the larger spread counts; directions and
angles of incidence are independent. The speckle of waves is drawn as their coherence length has it (`speckle`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .metrics import detector_dim
from .speckle import Speckle

Floats = NDArray[np.float64]
DRAWS = 100  # of each kind: the error is then known to 7 %
LOOKS = 8  # draws that say how much of a difference is noise: of thousands of values each


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of several BRDFs: called with the number of a draw, an array (θ_i, direction, λ) for each, in sr⁻¹.

    shared : by all wavelengths of a spectrum, else independent from value to value, or as speckle has it where that is
        known, see `Speckle`
    Speckle of the same windows of one surface is the same. A value whose error is not known has none.
    """

    data: Sequence[xr.Dataset]
    shared: bool
    seed: int = 0

    def __call__(self, draw: int) -> list[Floats]:
        return [
            sigma * (rng.standard_normal(self._shape(sigma)) if speckle is None else speckle(rng, self.shared))
            for sigma, speckle, rng in zip(self._sigma, self._speckle, self._generators(draw))
        ]

    def _shape(self, sigma: Floats) -> tuple[int, ...]:
        return (*sigma.shape[:2], 1 if self.shared else sigma.shape[2])

    def _generators(self, draw: int) -> Iterator[np.random.Generator]:
        """One for each of the data, the same where their speckle is the same."""
        for speckle, number in zip(self._speckle, range(len(self.data))):
            same = (i for i, s in enumerate(self._speckle) if speckle and s and speckle.lit == s.lit)
            yield np.random.default_rng([self.seed, draw, next(same, number)])

    @cached_property
    def _sigma(self) -> list[Floats]:
        return [np.nan_to_num(_values(d, "brdf_stderr")) for d in self.data]

    @cached_property
    def _speckle(self) -> list[Speckle | None]:
        return [Speckle.of(d) for d in self.data]


def _values(data: xr.Dataset, name: str) -> Floats:
    return data[name].transpose("theta_i", detector_dim(data), "wavelength").values


def standard_errors(
    figures: Callable[..., Mapping[str, float]],
    *data: xr.Dataset,
    draws: int = DRAWS,
    seed: int = 0,
    centre: Callable[..., Sequence[Floats]] | None = None,
) -> dict[str, float]:
    """Standard errors of the numbers that figures(*brdf) returns by name; {} unless all data have a brdf_stderr.

    figures : of arrays (θ_i, direction, λ) of the BRDF, one for each of the data
    centre : centre(noise, *brdf) gives the arrays that noise is added to. By default they are the data, whose own noise
        then counts twice in a figure that is not linear in it
    A value whose error is not known is left as it is. A figure that no error changes, or that is not a number in every
    draw, is left out.
    """
    if not all("brdf_stderr" in d and bool((d["brdf_stderr"] > 0).any()) for d in data):
        return {}
    brdf = [_values(d, "brdf") for d in data]
    spread: dict[str, float] = {}
    for shared in (False, True) if any(d.sizes["wavelength"] > 1 for d in data) else (False,):
        noise = Noise(data, shared, seed)
        middle = brdf if centre is None else centre(noise, *brdf)
        found = [figures(*(f + e for f, e in zip(middle, noise(k)))) for k in range(draws)]
        for name in found[0]:
            spread[name] = max(spread.get(name, 0.0), float(np.std([one[name] for one in found], ddof=1)))
    return {name: error for name, error in spread.items() if error > 0}


def true_share(difference: Floats, noise: Callable[[int], Floats]) -> float:
    """Factor on a difference that leaves what its noise does not explain: √(1 − mean noise² / mean difference²).

    noise : noise(k) of the difference in draw k, same shape; NaN counts for nothing
    """
    known = np.isfinite(difference)
    total = float(np.mean(difference[known] ** 2)) if known.any() else 0.0
    if not total > 0:
        return 0.0
    drawn = [noise(k)[known] for k in range(LOOKS)]
    by_chance = [float(np.mean(d[np.isfinite(d)] ** 2)) for d in drawn if np.isfinite(d).any()]
    return float(np.sqrt(max(0.0, 1.0 - float(np.mean(by_chance or [0.0])) / total)))


def median_error(values: Floats, samples: int = 200, seed: int = 0) -> float:
    """Standard error of the median of values (n,) by the bootstrap; NaN for fewer than five."""
    if values.size < 5:
        return float("nan")
    drawn = np.random.default_rng(seed).integers(0, values.size, (samples, values.size))
    return float(np.std(np.median(values[drawn], axis=1), ddof=1))
