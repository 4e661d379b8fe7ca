"""What a fit says of itself: bounds hit, second minima, what the data cannot tell, a shift that turns negative."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..models import Range
from .cost import KNEE, Inner
from .fit_errors import Errors
from .pairs import Problem
from .search import Descent, Minimum, at_bounds
from .significance import is_shift

LARGEST_CONDITION = 1e8  # half the digits of a double are lost
LEAST_INDEPENDENT = 1e-3  # share of a column that the linear coefficients cannot imitate
LARGEST_CORRELATION = 0.98  # an error five times that of a parameter by itself
FEWEST_DECIDING = 3.0  # effective observations: a spread of fewer says little
# a second minimum whose cost lies within that many "units of noise" (cost per spectrum) of the best cannot be excluded
SIGMA_SQUARED = 9.0


def notes_of(
    problem: Problem, ranges: Mapping[str, Range], minima: Sequence[Minimum], inner: Inner, errors: Errors
) -> list[str]:
    """Sentences, empty where nothing is to be wary of."""
    best = minima[0]
    shape = Descent(problem, ranges).shape(best.u)
    found = [f"{k} stopped at its bound {v:g}" for k, v in at_bounds(best.u, ranges).items()]
    low, high = problem.bounds()
    for k, name in enumerate(problem.names):
        held = int(np.sum((inner.c[k] <= low[k]) | (inner.c[k] >= high[k])))
        if held:
            found.append(f"{name} sits at its bound at {held} of {inner.c.shape[1]} wavelengths")
    found += _undetermined(problem, ranges, errors, shape)
    found += _second(problem, ranges, minima)
    found += _negative(problem, shape, inner)
    return found


def _undetermined(
    problem: Problem, ranges: Mapping[str, Range], errors: Errors, shape: Mapping[str, float]
) -> list[str]:
    names = [*ranges, *problem.names]
    found = []
    for name, share in zip(ranges, errors.independent):
        if share < LEAST_INDEPENDENT and problem.names:
            found.append(f"ill-conditioned: {name} cannot be told from {' and '.join(problem.names)}, which imitate it")
    for name, count in zip(ranges, errors.deciding):
        if count < FEWEST_DECIDING:
            found.append(f"{name} is decided by {count:.1f} observations: its error is uncertain")
    if errors.condition > LARGEST_CONDITION:
        found.append(f"ill-conditioned: the parameters' normal matrix has the condition number {errors.condition:.1g}")
    for i in range(len(names)):
        for j in range(i):
            if abs(errors.correlation[i, j]) > LARGEST_CORRELATION and not {names[i], names[j]} <= set(problem.names):
                found.append(f"{names[j]} and {names[i]} are correlated by {errors.correlation[i, j]:.4f}")
    for height, frequency in (("h", "w"), ("h1", "w1"), ("h2", "w2")):
        if height in ranges and frequency in ranges:
            error = errors.shape[list(ranges).index(height)]
            if not is_shift(shape[height], error):
                found.append(f"{height} is not significant ({shape[height]:.2g} ± {error:.2g} per nm), so that "
                             f"{frequency} means nothing")  # fmt: skip
    return found


def _second(problem: Problem, ranges: Mapping[str, Range], minima: Sequence[Minimum]) -> list[str]:
    if len(minima) < 2:
        return []
    noise = minima[0].cost / max(problem.target.g.shape[0] - minima[0].u.size, 1)
    if minima[1].cost - minima[0].cost > SIGMA_SQUARED * noise:
        return []
    other = Descent(problem, ranges).shape(minima[1].u)
    where = ", ".join(f"{k} = {v:.4g}" for k, v in other.items())
    return [f"two minima: {where} has a cost only {minima[1].cost / minima[0].cost - 1:.1%} higher"]


def _negative(problem: Problem, shape: Mapping[str, float], inner: Inner) -> list[str]:
    value = problem.value(shape, inner.c)
    known = problem.target.weight > 0
    negative = known & (value < 0)
    beyond = known & (problem.target.cosine * value < KNEE)
    found = []
    if negative.any():
        found.append(f"the fitted BRDF is negative at {negative.sum() / known.sum():.2%} of the values")
    if beyond.any():
        found.append(f"{int(beyond.sum())} values lie where the cost function is continued by its tangent")
    return found
