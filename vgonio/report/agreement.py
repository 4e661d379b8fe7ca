"""How far results of one scene are apart, pair by pair: the figures of their comparison, as the page says them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import xarray as xr

from .tables import percent, plus_minus


@dataclass(frozen=True)
class Figure:
    """A figure of the comparison and its standard error; NaN where it is not known."""

    value: float = math.nan
    stderr: float = math.nan

    @staticmethod
    def of(data: xr.Dataset, name: str) -> Figure:
        return Figure(*(float(data[n]) if n in data else math.nan for n in (name, f"{name}_stderr")))

    def __str__(self) -> str:
        return plus_minus(self.value, self.stderr, 2)

    @property
    def known(self) -> bool:
        return math.isfinite(self.value)

    @property
    def percent(self) -> str:
        """As a share, with its error where that is known."""
        if not (self.known and math.isfinite(self.stderr) and self.stderr > 0):
            return percent(self.value)
        return f"{plus_minus(100 * self.value, 100 * self.stderr)} %"


@dataclass(frozen=True)
class Agreement:
    """How far two results are apart, see `compare.pair_figures`; the second is the reference."""

    names: tuple[str, str]
    nrmse: Figure  # over all common directions and wavelengths
    noise: float  # the NRMSE that the standard errors alone would give; NaN where there are none
    median: Figure  # of |a − b|/b where b exceeds 10⁻³ of its largest value
    mirror_side: Figure  # the median where θ_o and θ_i lie on different sides of the normal, in plane
    source_side: Figure
    within: Figure  # share of the directions that differ by less than a tenth, averaged over the spectrum
    brightness: Figure  # mean ΔE₀₀ with brightness
    colour: Figure  # of the colour alone
    directions: int
    colour_directions: int = 0  # that the colour alone is taken over; 0 where older comparisons do not say


def pairs(comparison: xr.Dataset | None, results: Mapping[str, xr.Dataset]) -> list[Agreement]:
    """Every pair of the comparison that is of these results and has values in common."""
    if comparison is None or "pair" not in comparison.dims:
        return []
    found = [agreement(comparison.isel(pair=i)) for i in range(comparison.sizes["pair"])]
    return [one for one in found if set(one.names) <= set(results) and one.nrmse.known]


def agreement(pair: xr.Dataset) -> Agreement:
    """One pair of a comparison."""
    names = "nrmse median_difference median_mirror_side median_source_side within_tenth delta_e_mean delta_e_colour"
    nrmse, median, mirror, source, within, brightness, colour = (Figure.of(pair, name) for name in names.split())
    noise, directions = float(pair["nrmse_of_noise"]), int(pair["directions"])
    who = str(pair["pair_predicted"].item()), str(pair["pair_reference"].item())
    lit = int(pair["directions_of_colour"]) if "directions_of_colour" in pair else 0
    return Agreement(who, nrmse, noise, median, mirror, source, within, brightness, colour, directions, lit)
