"""The minimisation behind `fit_global_shift`: a scan for the start, lmfit, and honest standard errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .exponent import AT_BOUND
from .spectra import Spectra

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Bounds = tuple[float, float]
NAMES = ("h", "w", "t_y", "p")
W_BOUNDS = (0.25, 20.0)  # below, the cosine is a parabola and h, t_y are no longer separate; above, steps of 5° alias
# slopes are in µm⁻¹ in here, so that all parameters are of order one
NM = {"h": 1e-3, "w": 1.0, "t_y": 1e-3, "p": 1.0}


def solve(
    s: Spectra, used: Mask, fixed: Mapping[str, float | None], p_bounds: Bounds, w_bounds: Bounds
) -> dict[str, float]:
    """h, w, t_y, p and their standard errors "…_stderr", h and t_y in nm⁻¹; `fixed` gives p and t_y a value or None."""
    import lmfit

    start = _start(s, used, fixed, p_bounds, w_bounds)
    parameters = lmfit.Parameters()
    parameters.add("h", start["h"])
    parameters.add("w", start["w"], min=w_bounds[0], max=w_bounds[1])
    parameters.add("t_y", start["t_y"], vary=fixed["t_y"] is None)
    limits = {"min": p_bounds[0], "max": p_bounds[1]} if fixed["p"] is None else {"vary": False}
    parameters.add("p", start["p"], **limits)
    root = np.sqrt(s.weight[used])

    def residual(values: Any) -> Floats:
        model, _ = _model_and_jacobian(s, used, *(values[k].value for k in NAMES))
        return (root * (model - s.values[used])).ravel()

    # the covariance is estimated below: lmfit's takes all residuals as independent
    result = lmfit.minimize(residual, parameters, method="least_squares", calc_covar=False)
    best = {k: float(result.params[k].value) for k in NAMES}
    varied = [k for k in NAMES if result.params[k].vary and not _at_bound(result.params[k])]
    errors = _sandwich(s, used, best, varied)
    # where h could as well be zero any w fits, and the linearised error of w means nothing
    if not abs(best["h"]) > max(3 * errors.get("h", np.inf), 1e-6):
        errors.pop("w", None)
    found = {k: best[k] * NM[k] for k in NAMES}
    return found | {f"{k}_stderr": errors.get(k, float("nan")) * NM[k] for k in NAMES}


def _at_bound(parameter: Any) -> bool:
    return min(parameter.value - parameter.min, parameter.max - parameter.value) < AT_BOUND


def _start(
    s: Spectra, used: Mask, fixed: Mapping[str, float | None], p_bounds: Bounds, w_bounds: Bounds
) -> dict[str, float]:
    """The best of a scan over w and p; h and t_y are linear for each."""
    best: tuple[float, dict[str, float]] = (np.inf, {})
    weight, values, offset = s.weight[used], s.values[used], s.offset * 1e-3
    t_y = None if fixed["t_y"] is None else fixed["t_y"] / NM["t_y"]
    exponents = [fixed["p"]] if fixed["p"] is not None else np.linspace(p_bounds[0], p_bounds[1], 11).tolist()
    for p in exponents:
        g = np.exp(p * s.log_fresnel[used])
        norm = np.sum(weight * (offset * g) ** 2, axis=1)
        m = np.sum(weight * offset * g * (values - g), axis=1) / norm
        rest = np.sum(weight * (values - g - m[:, None] * offset * g) ** 2)
        for w in np.linspace(w_bounds[0], w_bounds[1], 80):
            cosine = np.cos(w * s.theta_m[used])
            h, t = _linear(cosine, m, norm, t_y)
            cost = rest + np.sum(norm * (m - h * cosine - t) ** 2)
            if cost < best[0]:
                best = cost, {"h": h, "w": float(w), "t_y": t, "p": float(p)}
    return best[1]


def _linear(cosine: Floats, m: Floats, weight: Floats, t_y: float | None) -> tuple[float, float]:
    """Weighted least squares of m = h·cosine + t_y, with t_y free or given."""
    if t_y is not None:
        return float(np.sum(weight * cosine * (m - t_y)) / max(np.sum(weight * cosine**2), 1e-300)), t_y
    c0, m0 = np.average(cosine, weights=weight), np.average(m, weights=weight)
    spread = np.sum(weight * (cosine - c0) ** 2)
    h = np.sum(weight * (cosine - c0) * (m - m0)) / spread if spread > 1e-12 * weight.sum() else 0.0
    return float(h), float(m0 - h * c0)


def _model_and_jacobian(s: Spectra, used: Mask, h: float, w: float, t_y: float, p: float) -> tuple[Floats, Floats]:
    """(n, n_λ) normalised spectra and (n, n_λ, 4) derivatives by h, w, t_y and p."""
    theta, offset = s.theta_m[used][:, None], s.offset * 1e-3
    cosine = np.cos(w * theta)
    g = np.exp(p * s.log_fresnel[used])
    tilt = offset * g
    model = g + (h * cosine + t_y) * tilt
    by_w = -h * theta * np.sin(w * theta) * tilt
    return model, np.stack([cosine * tilt, by_w, tilt, model * s.log_fresnel[used]], axis=-1)


def _sandwich(s: Spectra, used: Mask, best: Mapping[str, float], varied: list[str]) -> dict[str, float]:
    """Standard errors of the parameters `varied`, each spectrum one observation; {} where they are degenerate.

    Each spectrum's residual is that of a fit without it (Bell and McCaffrey 2002, "CR3"): few spectra decide w and t_y,
    and plain residuals understate their errors by a sixth.
    """
    model, jacobian = _model_and_jacobian(s, used, *(best[k] for k in NAMES))
    root = np.sqrt(s.weight[used])
    jacobian = jacobian[..., [NAMES.index(k) for k in varied]] * root[..., None]
    size = np.sqrt(np.sum(jacobian**2, axis=(0, 1)))
    if not varied or np.any(size == 0):
        return {}
    jacobian = jacobian / size
    normal = np.einsum("nlj,nlk->jk", jacobian, jacobian)
    if np.linalg.cond(normal) > 1e10:
        return {}
    score = np.einsum("nlj,nl->nj", jacobian, root * (s.values[used] - model))
    inverse = np.linalg.inv(normal)
    leverage = np.einsum("nlj,nlk->njk", jacobian, jacobian) @ inverse
    loose = (1 + 1e-6) * np.eye(len(varied))  # a spectrum that alone decides a parameter has no fit without it
    score = np.linalg.solve(loose - leverage, score[..., None])[..., 0]
    covariance = inverse @ (score.T @ score) @ inverse
    return dict(zip(varied, np.sqrt(np.diag(covariance)) / size))
