"""Standard errors of a fitted model: sandwich estimate and bootstrap, both with whole spectra as the observations.

The usual covariance takes all residuals as independent and of one size. Under the logarithmic cost they are neither: it
understates the errors. The sandwich (White 1980; clusters: Liang and Zeger 1986) takes the scores as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..models import Range
from .cost import Inner
from .pairs import Problem
from .search import Descent, from_unit

Floats = NDArray[np.float64]
STEP = 1e-4  # of a unit range, for central differences


@dataclass(frozen=True)
class Errors:
    """shape (P,) and coefficients (K, n_λ): standard errors, NaN where nothing can be said; unit parameters' ones too.

    correlation (P + K, P + K) of the parameters and the spectral means of the coefficients
    independent (P,) : share of a parameter's influence that the coefficients inside cannot imitate, 0…1
    deciding (P,) : effective number of clusters that decide a parameter; below about 3 its error is itself uncertain
    condition : of the scaled normal matrix of the shape parameters;  samples : (B, P) of the bootstrap, or None
    """

    shape: Floats
    coefficients: Floats
    correlation: Floats
    independent: Floats
    deciding: Floats
    condition: float
    samples: Floats | None = None


def derivatives(problem: Problem, ranges: Mapping[str, Range], u: Floats, c: Floats) -> Floats:
    """(P, n, n_λ) derivatives of f by the unit parameters, the coefficients held."""
    descent = Descent(problem, ranges)
    found = []
    for j in range(len(u)):
        a, b = u.copy(), u.copy()
        a[j], b[j] = max(u[j] - STEP, 0.0), min(u[j] + STEP, 1.0)
        values = [problem.value(descent.shape(x), c) for x in (b, a)]
        found.append((values[0] - values[1]) / (b[j] - a[j]))
    return np.stack(found) if found else np.zeros((0, *problem.pairs.values.shape))


def sandwich(
    problem: Problem,
    ranges: Mapping[str, Range],
    u: Floats,
    inner: Inner,
    cluster: NDArray[np.intp] | None,
    held: list[int],
) -> Errors:
    """Errors from the scores of clusters (n,) of spectra, None: of single values; `held` (indices, at a bound) get NaN.

    Residuals are those of a fit without their own cluster (the jackknife form of Bell and McCaffrey 2002, "CR3"): a
    peak that few directions see is followed by the fit, and its residual says little of its noise.
    """
    by_u = derivatives(problem, ranges, u, inner.c) * inner.by_f
    free = [j for j in range(len(u)) if j not in held]
    columns = _columns(problem, ranges, u, inner)
    # what the coefficients inside can imitate is taken out, wavelength by wavelength
    normal = np.einsum("jnl,knl->ljk", columns, columns)
    for k in range(len(columns)):
        normal[:, k, k] += normal[:, k, k] == 0
    inverse = np.linalg.pinv(normal, hermitian=True)
    imitation = np.einsum("ljk,lkp->ljp", inverse, np.einsum("knl,pnl->lkp", columns, by_u))
    alone = by_u - np.einsum("knl,lkp->pnl", columns, imitation)
    size, own = (np.sqrt(np.sum(x**2, axis=(1, 2))) for x in (by_u, alone))
    scale = np.where(own[free] > 0, own[free], 1.0)
    tangent = alone[free] / scale[:, None, None]
    square = np.einsum("pnl,qnl->pq", tangent, tangent)
    condition = float(np.linalg.cond(square)) if len(free) and np.all(own[free] > 0) else 1.0 if not free else np.inf
    back = np.linalg.pinv(square, hermitian=True) / scale[:, None]
    if cluster is None:
        rest = _values_left_out(tangent, square, columns, inverse, inner.residual)
        full = np.zeros((len(u), rest.size))
        full[free] = back @ (tangent * rest).reshape(len(free), rest.size)
        variance, mean = _coefficient_values(np.einsum("ljk,knl->jnl", inverse, columns * rest), imitation, full)
    else:
        rest = _left_out(tangent, square, columns, normal, inner.residual, cluster)
        count = int(cluster.max()) + 1
        full = np.zeros((len(u), count))
        full[free] = back @ _by_cluster(np.einsum("pnl,nl->pn", tangent, rest), cluster, count)
        by_c = np.einsum("ljk,kcl->jcl", inverse, _by_cluster(columns * rest, cluster, count))
        by_c = by_c - np.einsum("ljp,pc->jcl", imitation, full)
        variance, mean = np.sum(by_c**2, axis=1), by_c.mean(axis=2)
    squares, fourth = np.sum(full**2, axis=1), np.sum(full**4, axis=1)
    shape = np.sqrt(squares) * np.array([_unit_slope(x, r) for x, r in zip(u, ranges.values())])
    shape[held] = np.nan
    return Errors(
        shape,
        np.sqrt(variance),
        _correlation(np.concatenate([full, mean])),
        own / np.where(size > 0, size, 1.0),
        np.where(fourth > 0, squares**2 / np.where(fourth > 0, fourth, 1.0), np.nan),
        condition,
    )


def _values_left_out(tangent: Floats, square: Floats, columns: Floats, inverse: Floats, residual: Floats) -> Floats:
    """(n, n_λ) residuals as they would be had their own value not been fitted: r/(1 − h), h the leverage."""
    h = np.einsum("pnl,pq,qnl->nl", tangent, np.linalg.pinv(square, hermitian=True), tangent)
    h = h + np.einsum("jnl,ljk,knl->nl", columns, inverse, columns)
    return residual / np.maximum(1.0 - h, 1e-6)


def _coefficient_values(direct: Floats, imitation: Floats, full: Floats) -> tuple[Floats, Floats]:
    """(K, n_λ) variances of the coefficients and (K, values) influence on their spectral means.

    direct (K, n, n_λ) : influence of a value on the coefficient of its wavelength, the shape held;  full (P, values)
    """
    k, n, m = direct.shape
    through = np.einsum("ljp,pq,ljq->jl", imitation, full @ full.T, imitation)
    own = np.einsum("ljp,pnl->jnl", imitation, full.reshape(len(full), n, m))
    variance = through + np.sum(direct**2 - 2 * direct * own, axis=1)
    mean = direct.reshape(k, n * m) / m - imitation.mean(axis=0) @ full
    return np.maximum(variance, 0.0), mean


def _left_out(
    tangent: Floats, square: Floats, columns: Floats, normal: Floats, residual: Floats, cluster: NDArray[np.intp]
) -> Floats:
    """(n, n_λ) residuals as they would be had their cluster not been fitted: (1 − H)⁻¹ r, H of low rank (Woodbury)."""
    found = np.empty_like(residual)
    # a direction that alone decides a parameter has no residual without it: a floor keeps its error finite
    loose, floor = 1e-6, 1e-6 * np.eye(len(square))
    for c in range(int(cluster.max()) + 1):
        n = np.flatnonzero(cluster == c)
        r, j, inside = residual[n], tangent[:, n], columns[:, n]
        without = normal - np.einsum("jnl,knl->ljk", inside, inside) + loose * normal

        def freed(x: Floats, inside: Floats = inside, without: Floats = without) -> Floats:
            if not len(inside):
                return x
            back = np.linalg.solve(without, np.einsum("knl,...nl->...lk", inside, x)[..., None])[..., 0]
            return x + np.einsum("knl,...lk->...nl", inside, back)

        r, free_j = freed(r), np.stack([freed(x) for x in j]) if len(j) else j
        if len(j):
            own = square - np.einsum("pnl,qnl->pq", j, free_j) + floor
            r = r + np.einsum("pnl,p->nl", free_j, np.linalg.solve(own, np.einsum("pnl,nl->p", j, r)))
        found[n] = r
    return found


def _columns(problem: Problem, ranges: Mapping[str, Range], u: Floats, inner: Inner) -> Floats:
    """(K, n, n_λ) derivatives of the residuals by the coefficients, 0 where one sits at its bound."""
    _, parts = problem.parts(Descent(problem, ranges).shape(u))
    low, high = problem.bounds()
    inside = (inner.c > low[:, None]) & (inner.c < high[:, None])
    return parts * inner.by_f * inside[:, None, :]


def _by_cluster(values: Floats, cluster: NDArray[np.intp], count: int) -> Floats:
    """Sums of (k, n, …) over the clusters of n: (k, count, …)."""
    found = np.zeros((values.shape[0], count, *values.shape[2:]))
    for k in range(len(values)):
        np.add.at(found[k], cluster, values[k])
    return found


def _unit_slope(u: float, r: Range) -> float:
    """d value / d u of a unit parameter."""
    return from_unit(u, r) * float(np.log(r.high / r.low)) if r.log else r.high - r.low


def _correlation(influence: Floats) -> Floats:
    covariance = influence @ influence.T
    size = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(np.outer(size, size) > 0, covariance / np.outer(size, size), np.nan)


def bootstrap(
    problem: Problem,
    ranges: Mapping[str, Range],
    u: Floats,
    inner: Inner,
    cluster: NDArray[np.intp],
    base: Errors,
    count: int,
    seed: int,
    progress: Callable[[float], None] | None = None,
) -> Errors:
    """Errors from `count` fits to clusters drawn with replacement, each started at the best parameters."""
    rng = np.random.default_rng(seed)
    clusters = int(cluster.max()) + 1
    shapes, coefficients = [], []
    for i in range(count):
        drawn = np.bincount(rng.integers(clusters, size=clusters), minlength=clusters)
        descent = Descent(problem.weighted(drawn[cluster].astype(float)), ranges, inner)
        minimum = descent.run(u, most=60)
        assert descent.inner is not None
        shapes.append([from_unit(x, r) for x, r in zip(minimum.u, ranges.values())])
        coefficients.append(descent.inner.c)
        if progress:
            progress((i + 1) / count)
    values, c = np.array(shapes).reshape(count, len(u)), np.array(coefficients)
    means = np.concatenate([values, c.mean(axis=2)], axis=1)
    centred = (means - means.mean(axis=0)).T
    return Errors(
        values.std(axis=0, ddof=1),
        c.std(axis=0, ddof=1),
        _correlation(centred),
        base.independent,
        base.deciding,
        base.condition,
        values,
    )
