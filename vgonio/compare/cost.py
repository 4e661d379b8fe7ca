"""The cost function of BRDF fits (thesis 3.2–3.4, after Löw 2012) and, by variable projection, the coefficients inside.

E = Σ (ln(1 + cos^w θ_i f_fit) − ln(1 + cos^w θ_i f_ref))². f_fit is linear in k_d(λ) and k_s(λ): for every trial of the
other parameters these are brought to the minimum of the same E, wavelength by wavelength and all at once (Golub and
Pereyra 2003, with a nonlinear inside); a linear regression is only where that starts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
# below this value of cos^w θ_i f the logarithm goes on as its tangent: a steep shift can make f_fit less than −1/cos^w
KNEE = -0.5
MOST_STEPS, CLOSE = 40, 1e-10


def compressed(x: Floats) -> tuple[Floats, Floats]:
    """ln(1 + x) and its derivative, below `KNEE` the tangent there, so that negative BRDFs have a cost as well."""
    inside = np.maximum(x, KNEE)
    slope = 1.0 / (1.0 + inside)
    return np.log1p(inside) + (x - inside) * slope, slope


@dataclass(frozen=True)
class Target:
    """What is fitted: f_ref as g (n, n_λ), cosines cos^w θ_i (n, 1), weights of squares (n, n_λ), 0 = no data."""

    g: Floats
    cosine: Floats
    weight: Floats

    def residual(self, f: Floats) -> tuple[Floats, Floats]:
        """Weighted residuals (n, n_λ) of a BRDF f, and their derivative by f."""
        value, slope = compressed(self.cosine * f)
        root = np.sqrt(self.weight)
        return root * (value - self.g), root * slope * self.cosine


@dataclass(frozen=True)
class Inner:
    """The best coefficients c (K, n_λ), the residuals (n, n_λ) and their derivative by f (n, n_λ)."""

    c: Floats
    residual: Floats
    by_f: Floats

    @property
    def cost(self) -> float:
        return float(np.sum(self.residual**2))


def best_coefficients(
    target: Target, constant: Floats, parts: Floats, low: Floats, high: Floats, start: Floats | None = None
) -> Inner:
    """Coefficients of `parts` (K, n, n_λ) within low, high (K,) that minimise E beside `constant` (n, n_λ).

    K is 0, 1 or 2. Gauss–Newton steps with exact bounds, halved at each wavelength whose cost would rise.
    """
    if len(parts) == 0:
        return Inner(np.zeros((0, target.g.shape[1])), *target.residual(constant))
    c = _regression(target, constant, parts, low, high) if start is None else start
    residual, by_f = target.residual(constant + np.einsum("kl,knl->nl", c, parts))
    cost = np.sum(residual**2, axis=0)
    damping = np.ones(cost.shape)
    for _ in range(MOST_STEPS):
        columns = parts * by_f
        trial = _step(columns, residual, c, low, high)
        trial = c + damping * (trial - c)
        new, new_by_f = target.residual(constant + np.einsum("kl,knl->nl", trial, parts))
        new_cost = np.sum(new**2, axis=0)
        better = new_cost <= cost
        moved = np.max(np.abs(trial - c) / (np.abs(c) + 1e-9), initial=0.0, where=better)
        c = np.where(better, trial, c)
        residual, by_f = np.where(better, new, residual), np.where(better, new_by_f, by_f)
        settled = (cost - new_cost) <= 1e-15 * cost
        cost = np.where(better, new_cost, cost)
        # a wavelength that no step improves any more has arrived
        damping = np.where(better, 1.0, damping / 4)
        if moved < CLOSE and np.all(better | (damping < 1e-4) | settled):
            break
    return Inner(c, residual, by_f)


def _regression(target: Target, constant: Floats, parts: Floats, low: Floats, high: Floats) -> Floats:
    """Linear regression with the weights that the logarithm has at the measured values."""
    f_ref = np.expm1(target.g) / target.cosine
    slope = target.cosine / (1.0 + np.maximum(target.cosine * f_ref, KNEE)) * np.sqrt(target.weight)
    zero = np.zeros((len(parts), target.g.shape[1]))
    return _step(parts * slope, slope * (constant - f_ref), zero, low, high)


def _step(columns: Floats, residual: Floats, c: Floats, low: Floats, high: Floats) -> Floats:
    """Minimum of |residual + columns·(x − c)|² within the bounds, for each wavelength."""
    normal = np.einsum("jnl,knl->ljk", columns, columns)
    right = np.einsum("ljk,kl->lj", normal, c) - np.einsum("jnl,nl->lj", columns, residual)
    if len(c) == 1:
        size = normal[:, 0, 0]
        x = right[:, 0] / np.where(size > 0, size, 1.0)
        return np.where(size > 0, np.clip(x, low[0], high[0]), c[0])[None, :]
    return _box_minimum(normal, right, low, high)


def _box_minimum(normal: Floats, right: Floats, low: Floats, high: Floats) -> Floats:
    """Minimum of ½xᵀNx − rᵀx in a box of two dimensions, for each of m problems: inside, or on one of four edges."""
    a, b, d = normal[:, 0, 0], normal[:, 0, 1], normal[:, 1, 1]
    det = a * d - b * b
    good = det > 1e-14 * a * d
    safe = np.where(good, det, 1.0)
    free = np.stack([(d * right[:, 0] - b * right[:, 1]) / safe, (a * right[:, 1] - b * right[:, 0]) / safe])
    inside = good & np.all((free >= low[:, None]) & (free <= high[:, None]), axis=0)
    candidates = []
    for fixed in (0, 1):
        other, size = 1 - fixed, normal[:, 1 - fixed, 1 - fixed]
        for bound in (low[fixed], high[fixed]):
            if np.isfinite(bound):
                value = (right[:, other] - b * bound) / np.where(size > 0, size, 1.0)
                edge = np.empty_like(free)
                edge[fixed], edge[other] = bound, np.clip(value, low[other], high[other])
                candidates.append(edge)
    x = np.stack(candidates)
    height = 0.5 * np.einsum("cjl,ljk,ckl->cl", x, normal, x) - np.einsum("lj,cjl->cl", right, x)
    best = np.take_along_axis(x, height.argmin(axis=0)[None, None, :], axis=0)[0]
    return np.where(inside, free, best)
