"""Standard errors of figures of whole BRDFs, by drawing the BRDFs anew within brdf_stderr.

How the errors of one BRDF hang together is not known: noise may be independent from value to value, or shared by a
whole spectrum, as where one ray carries all wavelengths. Both are drawn, the larger spread counts. What neighbouring
directions share, as speckle, is not in it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import xarray as xr

DRAWS = 10  # of each kind: the error is then known to a quarter


def standard_errors(
    figures: Callable[..., Mapping[str, float]], *data: xr.Dataset, draws: int = DRAWS, seed: int = 0
) -> dict[str, float]:
    """Standard errors of the numbers that figures(*data) returns by name; {} unless all data have a brdf_stderr.

    A value whose error is not known is left as it is. A figure that no error changes, or that is not a
    number in every draw, is left out.
    """
    if not all("brdf_stderr" in d and bool((d["brdf_stderr"] > 0).any()) for d in data):
        return {}
    spread: dict[str, float] = {}
    for shared in (False, True):
        rng = np.random.default_rng(seed)
        found = [figures(*(_drawn(d, rng, shared) for d in data)) for _ in range(draws)]
        for name in found[0]:
            spread[name] = max(spread.get(name, 0.0), float(np.std([one[name] for one in found], ddof=1)))
    return {name: error for name, error in spread.items() if error > 0}


def _drawn(data: xr.Dataset, rng: np.random.Generator, shared: bool) -> xr.Dataset:
    """The BRDF plus noise of its standard errors; `shared` by all wavelengths of a spectrum."""
    brdf = data["brdf"]
    sigma = data["brdf_stderr"].transpose(*brdf.dims).fillna(0.0)
    shape = [1 if shared and d == "wavelength" else n for d, n in brdf.sizes.items()]
    return data.assign(brdf=(brdf.dims, brdf.values + sigma.values * rng.standard_normal(shape), brdf.attrs))


def median_error(values: np.ndarray, samples: int = 200, seed: int = 0) -> float:
    """Standard error of the median of values (n,) by the bootstrap; NaN for fewer than five."""
    if values.size < 5:
        return float("nan")
    drawn = np.random.default_rng(seed).integers(0, values.size, (samples, values.size))
    return float(np.std(np.median(values[drawn], axis=1), ddof=1))
