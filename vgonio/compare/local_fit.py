"""The local fit behind `shift.fit_local_shift`: slope and exponent of every spectrum, all spectra at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .spectra import Spectra

Floats = NDArray[np.float64]


def normalised_model(s: Spectra, m: Floats, p: Floats) -> Floats:
    """(n, n_λ) of 4.2 for slopes (n,) and exponents (n,)."""
    return (1.0 + m[:, None] * s.offset) * np.exp(p[:, None] * s.log_fresnel)


def profile(s: Spectra, p: Floats) -> tuple[Floats, Floats]:
    """Best slope (n,) for exponents (n,), which is linear, and the weighted sum of squares (n,) that is left."""
    g = np.exp(p[:, None] * s.log_fresnel)
    column, rest = s.offset * g, s.values - g
    norm = np.sum(s.weight * column**2, axis=1)
    m = np.sum(s.weight * column * rest, axis=1) / np.where(norm > 0, norm, 1.0)
    return m, np.sum(s.weight * (rest - m[:, None] * column) ** 2, axis=1)


def best_exponents(s: Spectra, bounds: tuple[float, float]) -> Floats:
    """Exponent (n,) of the smallest sum of squares: a scan for the right valley, then golden sections, all at once."""
    scan = np.linspace(bounds[0], bounds[1], 21)
    costs = np.stack([profile(s, np.full(s.used.size, p))[1] for p in scan])
    best, step = scan[costs.argmin(axis=0)], scan[1] - scan[0]
    low, high = np.maximum(best - step, bounds[0]), np.minimum(best + step, bounds[1])
    ratio = (np.sqrt(5) - 1) / 2
    for _ in range(32):
        a, b = high - ratio * (high - low), low + ratio * (high - low)
        left = profile(s, a)[1] < profile(s, b)[1]
        low, high = np.where(left, low, a), np.where(left, b, high)
    middle = (low + high) / 2
    # the interval shrinks towards a bound without reaching it
    return np.where(middle - bounds[0] < 1e-6, bounds[0], np.where(bounds[1] - middle < 1e-6, bounds[1], middle))


def standard_errors(s: Spectra, m: Floats, p: Floats, free: bool) -> Floats:
    """(2, n) standard errors of m and p from the scatter about the fit; p's is NaN unless it is free.

    The noise σ² of the samples also moves f(λ_n), and with it the whole normalised spectrum, by −ε·values. So the sum
    of squares estimates σ²·(dof + c |u|²) with u the part of `values` that the fit cannot follow and c the anchor's
    variance, and the parameters get c q qᵀ on top of the usual covariance, q their answer to `values`.
    """
    g = np.exp(p[:, None] * s.log_fresnel)
    model = (1.0 + m[:, None] * s.offset) * g
    jacobian = np.stack([s.offset * g, model * s.log_fresnel * free], axis=-1) * np.sqrt(s.weight)[..., None]
    normal = np.einsum("nlj,nlk->njk", jacobian, jacobian)
    # a parameter that is not fitted gets an equation of its own, so that the inverse exists
    normal[:, 1, 1] += np.where(normal[:, 1, 1] > 0, 0.0, 1.0)
    normal[:, 0, 0] += np.where(normal[:, 0, 0] > 0, 0.0, 1.0)
    inverse = np.linalg.pinv(normal, hermitian=True)
    y = s.values * np.sqrt(s.weight)
    q = np.einsum("njk,nlk,nl->nj", inverse, jacobian, y)
    u = y - np.einsum("nlj,nj->nl", jacobian, q)
    residual = np.sum(s.weight * (s.values - model) ** 2, axis=1)
    dof = np.sum(s.weight > 0, axis=1) - 1 - free
    variance = residual / np.where(dof > 0, dof + s.anchor_variance * np.sum(u**2, axis=1), np.nan)
    diagonal = np.einsum("njj->jn", inverse) + s.anchor_variance * q.T**2
    errors = np.sqrt(variance * diagonal)
    return errors if free else np.stack([errors[0], np.full(m.shape, np.nan)])
