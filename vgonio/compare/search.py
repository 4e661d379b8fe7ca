"""The search behind `model_fit`: several starts, Levenberg–Marquardt by lmfit within bounds, distinct minima."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..models import Range
from .cost import Inner
from .pairs import Problem

Floats = NDArray[np.float64]
# turn the spectrum, not the lobe
SHIFT = {"h", "w", "t_y", "p", "h1", "w1", "h2", "w2"}
SCOUT = 1e-4  # tolerance of a descent that is only to find the valley
THIN = 8  # wavelengths that are enough to find the valley
SAME = 0.02  # minima nearer than this share of the range are one
AT_BOUND = 2e-4  # of the range


def to_unit(value: float, r: Range) -> float:
    """A parameter as 0…1 over its range, logarithmic where the range is."""
    if r.log:
        return float(np.log(value / r.low) / np.log(r.high / r.low))
    return (value - r.low) / (r.high - r.low)


def from_unit(u: float, r: Range) -> float:
    return float(r.low * (r.high / r.low) ** u) if r.log else float(r.low + u * (r.high - r.low))


@dataclass(frozen=True)
class Minimum:
    """Where a descent ended: unit parameters (P,), and their cost."""

    u: Floats
    cost: float


@dataclass
class Descent:
    """Residuals of a problem over unit parameters; remembers the coefficients as the start of the next trial."""

    problem: Problem
    ranges: Mapping[str, Range]
    inner: Inner | None = None

    def shape(self, u: Sequence[float] | Floats) -> dict[str, float]:
        return {k: from_unit(float(x), r) for x, (k, r) in zip(u, self.ranges.items())}

    def solve(self, u: Sequence[float] | Floats) -> Inner:
        start = None if self.inner is None else self.inner.c
        self.inner = self.problem.inner(self.shape(u), start)
        return self.inner

    def run(self, u: Floats, most: int = 300, tol: float = 1e-9) -> Minimum:
        """Levenberg–Marquardt from unit parameters u until they move by less than tol."""
        import lmfit

        if not len(u):
            return Minimum(u, self.solve(u).cost)
        parameters = lmfit.Parameters()
        for name, x in zip(self.ranges, u):
            parameters.add(name, float(np.clip(x, 1e-3, 1 - 1e-3)), min=0.0, max=1.0)

        def residual(values: Any) -> Floats:
            return self.solve([values[k].value for k in self.ranges]).residual.ravel()

        # a step of 10⁻⁵ of the range stays above what is left of the coefficients' own search
        found = lmfit.minimize(
            residual,
            parameters,
            method="leastsq",
            calc_covar=False,
            max_nfev=most,
            epsfcn=1e-10,
            xtol=tol,
            ftol=tol * 1e-3,
        )
        best = np.array([found.params[k].value for k in self.ranges])
        return Minimum(best, self.solve(best).cost)


def starts(descent: Descent, given: Mapping[str, float], count: int, seed: int) -> list[Floats]:
    """The best `count` of a low-discrepancy sample of the ranges, and the start the caller gave, if any.

    Where the model has a shift its parameters are sampled with the others at their best without it: beside a wrong
    width of the lobe, what a shift does to the cost is lost.
    """
    names = list(descent.ranges)
    if not names:
        return [np.zeros(0)]
    turning = [i for i, name in enumerate(names) if name in SHIFT]
    base = np.array([_neutral(r) if name in SHIFT else np.nan for name, r in descent.ranges.items()])
    plain = [i for i in range(len(names)) if i not in turning]
    bases = _sampled(descent, base, plain, count, seed) if plain else [base]
    if turning and plain:
        held = Descent(descent.problem, {names[i]: descent.ranges[names[i]] for i in plain})
        held.problem = descent.problem.with_fixed(
            {names[i]: from_unit(base[i], descent.ranges[names[i]]) for i in turning}
        )
        best = min((held.run(u[plain], 100, SCOUT) for u in bases), key=lambda m: m.cost)
        base[plain] = best.u
    chosen = _sampled(descent, base, turning, count, seed) if turning else bases
    if given:
        first = chosen[0].copy()
        for i, name in enumerate(names):
            first[i] = to_unit(given[name], descent.ranges[name]) if name in given else first[i]
        chosen.insert(0, first)
    return chosen


def _neutral(r: Range) -> float:
    """No slope, one reflection; a frequency in the middle."""
    return to_unit(0.0, r) if r.low < 0 < r.high else 0.5 if r.high > 10 else to_unit(min(max(1.0, r.low), r.high), r)


def _sampled(descent: Descent, base: Floats, varied: list[int], count: int, seed: int) -> list[Floats]:
    """The best of a sample over the parameters `varied`, apart from each other, the others as in `base`."""
    from scipy.stats import qmc

    tried = np.tile(base, (1 << min(9, 4 + len(varied) + (len(varied) > 2)), 1))
    tried[:, varied] = 0.02 + 0.96 * qmc.Sobol(len(varied), seed=seed).random(len(tried))
    costs = np.empty(len(tried))
    for i, u in enumerate(tried):
        descent.inner = None
        costs[i] = descent.solve(u).cost
    chosen: list[Floats] = []
    for i in np.argsort(costs):
        # starts beside each other end in the same valley
        if all(np.abs(tried[i] - other).max() > 0.1 for other in chosen):
            chosen.append(tried[i])
        if len(chosen) >= count:
            break
    return chosen


def distinct(minima: Sequence[Minimum]) -> list[Minimum]:
    """Minima by cost, without those that lie beside a better one."""
    found: list[Minimum] = []
    for minimum in sorted(minima, key=lambda m: m.cost):
        if all(np.abs(minimum.u - other.u).max(initial=0.0) > SAME for other in found):
            found.append(minimum)
    return found


def search(
    problem: Problem,
    ranges: Mapping[str, Range],
    given: Mapping[str, float],
    count: int,
    seed: int,
    progress: Callable[[float], None] | None = None,
) -> list[Minimum]:
    """The minima on all wavelengths, best first: descents from several starts on a few wavelengths, the best two
    of them followed on all."""
    thin = problem.thinned(THIN)
    scout = Descent(thin, ranges)
    found = []
    chosen = starts(scout, given, count, seed)
    for i, u in enumerate(chosen):
        scout.inner = None
        found.append(scout.run(u, 100, SCOUT))
        if progress:
            progress(0.5 * (i + 1) / len(chosen))
    best = distinct(found)[:2]
    final = []
    for i, minimum in enumerate(best):
        final.append(Descent(problem, ranges).run(minimum.u))
        if progress:
            progress(0.5 + 0.5 * (i + 1) / len(best))
    return distinct(final)


def at_bounds(u: Floats, ranges: Mapping[str, Range]) -> dict[str, float]:
    """Parameters that stopped at a bound, and that bound."""
    return {k: r.low if x < 0.5 else r.high for x, (k, r) in zip(u, ranges.items()) if min(x, 1 - x) < AT_BOUND}
