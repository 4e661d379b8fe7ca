"""The global shift with two weighted functions, single and multiple reflections apart, beside the one of thesis 4.5."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..errors import InputError
from ..materials import Material
from ..models import Geometry
from ..models.clausen_2022 import WAVELENGTH_N_NM
from ..models.two_shifts import share_at, slope
from .exponent import P_BOUNDS, fixed_p, p_is_free
from .global_fit import W_BOUNDS
from .goodness import aic, total_r2
from .local_fit import normalised_model
from .metrics import labelled
from .spectra import Spectra, normalised_spectra

Floats = NDArray[np.float64]
NAMES = ("h1", "w1", "h2", "w2", "p")
SCAN = 48  # frequencies of each cosine in the search of the start
_TEXTS = {
    "h1": ("nm-1", "height of the slope of single reflections"),
    "w1": ("1", "frequency of the slope of single reflections over theta_m"),
    "h2": ("nm-1", "height of the slope of multiple reflections"),
    "w2": ("1", "frequency of the slope of multiple reflections over theta_d"),
    "p": ("1", "exponent of the Fresnel reflectance"),
}


def single_share(rays: xr.Dataset, wavelength_n_nm: float = WAVELENGTH_N_NM) -> xr.DataArray:
    """Share of light that leaves after one reflection, (theta_i, theta_o), from a traced result with brdf_by_bounce.

    At the wavelength next to wavelength_n_nm. Directions that caught nothing take the value of the nearest that did (in
    θ_o, at the same θ_i). Made symmetric in source and detector where both pairs were traced: the noise is halved, and
    the model stays reciprocal. Raises InputError for a result without the decomposition or out of plane.
    """
    if "brdf_by_bounce" not in rays or "theta_o" not in rays["brdf_by_bounce"].dims:
        raise InputError("the share of single reflections needs an in-plane result of rays with brdf_by_bounce")
    parts = rays["brdf_by_bounce"].sel(wavelength=wavelength_n_nm, method="nearest")
    total = parts.sum("bounce")
    share = (parts.sel(bounce=1) / total.where(total > 0)).transpose("theta_i", "theta_o")
    share = share.sortby("theta_i").sortby("theta_o").reset_coords(drop=True)
    share = share.interpolate_na("theta_o", method="nearest", fill_value="extrapolate").clip(0, 1)
    if not bool(share.notnull().all()):
        raise InputError("an angle of incidence caught no light at all: trace more rays")
    swapped = share.rename(theta_i="theta_o", theta_o="theta_i").interp(theta_i=share.theta_i, theta_o=share.theta_o)
    mean = xr.where(swapped.notnull(), (share + swapped) / 2, share).transpose("theta_i", "theta_o")
    return labelled(mean, "single_share", "1", "share of the light that leaves after one reflection")


def fit_two_shifts(
    data: xr.Dataset,
    share: xr.DataArray | float,
    material: str | Material | None = "Al",
    p: float | str = "fit",
    wavelength_n_nm: float = WAVELENGTH_N_NM,
    wavelength_range_nm: tuple[float, float] | None = None,
) -> xr.Dataset:
    """m = s h₁ cos(w₁ θ_m) + (1 − s) h₂ cos(w₂ θ_d) fitted to all normalised spectra, as `fit_global_shift` does 4.5.

    share : of single reflections, see `single_share`;  material, p, wavelength_n_nm, wavelength_range_nm : as there
    Returns scalars h1, h2 (nm⁻¹), w1, w2, p with standard errors (sandwich over spectra), r2, the maps slope_global
    (nm⁻¹) and share, and attrs["aic"], which `fit_global_shift` has as well: lower is better, 2 per parameter.
    Raises InputError for too few usable spectra, and as `fit_global_shift`.
    """
    s = normalised_spectra(data, material, wavelength_n_nm, wavelength_range_nm)
    free_p = p_is_free(s, p, P_BOUNDS)
    used = s.used & (np.sum(s.weight > 0, axis=1) >= 2)
    if used.sum() < len(NAMES) + 1:
        raise InputError(f"two shifts need at least {len(NAMES) + 1} usable spectra, {used.sum()} of {used.size} are")
    weights = _share_of(s, share)
    best, errors = _solve(s, used, weights, None if free_p else fixed_p(p))
    m = slope(s.theta_m, s.theta_d, weights, *(best[k] for k in NAMES[:4]))
    model = normalised_model(s, m, np.full(m.size, best["p"]))
    found: dict[str, Any] = {}
    for name in NAMES:
        found[name] = labelled(xr.DataArray(best[name]), name, *_TEXTS[name])
        text = (_TEXTS[name][0], f"standard error of {name}")
        found[f"{name}_stderr"] = labelled(xr.DataArray(errors.get(name, np.nan)), f"{name}_stderr", *text)
    r2 = total_r2(s, used, model)
    found["r2"] = labelled(xr.DataArray(r2), "r2", "1", "coefficient of determination of all normalised spectra")
    found["slope_global"] = labelled(s.on_grid(m), "slope_global", "nm-1", "slope of the two weighted shifts")
    found["share"] = labelled(s.on_grid(weights), "share", "1", "share of single reflections")
    return xr.Dataset(
        found,
        attrs={
            "model": "slope = s h1 cos(w1 theta_m) + (1 - s) h2 cos(w2 theta_d)",
            "spectra_used": int(used.sum()),
            "aic": aic(s, used, model, 4 + free_p),
            "wavelength_n": float(wavelength_n_nm),
        },
    )


def _share_of(s: Spectra, share: xr.DataArray | float) -> Floats:
    if not isinstance(share, xr.DataArray):
        return share_at(Geometry.of(s.theta_m, s.theta_m), share)
    if "theta_o" not in s.grid["brdf"].dims:
        raise InputError("the share of single reflections is known in the plane of incidence only")
    i, o = np.deg2rad(s.grid["theta_i"].values)[:, None], np.deg2rad(s.grid["theta_o"].values)
    return share_at(Geometry.of(i, o), share).ravel()


def _solve(
    s: Spectra, used: NDArray[np.bool_], share: Floats, p: float | None
) -> tuple[dict[str, float], dict[str, float]]:
    import lmfit

    start = _start(s, used, share, p)
    parameters = lmfit.Parameters()
    for name in NAMES[:4]:
        bounds = {"min": W_BOUNDS[0], "max": W_BOUNDS[1]} if name[0] == "w" else {}
        parameters.add(name, start[name], **bounds)
    parameters.add("p", start["p"], **({"min": P_BOUNDS[0], "max": P_BOUNDS[1]} if p is None else {"vary": False}))
    root = np.sqrt(s.weight[used])

    def model(v: Mapping[str, float]) -> Floats:
        # slopes in µm⁻¹ in here, so that all parameters are of order one
        m = 1e-3 * slope(s.theta_m[used], s.theta_d[used], share[used], v["h1"], v["w1"], v["h2"], v["w2"])
        return (1 + m[:, None] * s.offset) * np.exp(v["p"] * s.log_fresnel[used])

    def residual(given: Any) -> Floats:
        return (root * (model({k: given[k].value for k in NAMES}) - s.values[used])).ravel()

    result = lmfit.minimize(residual, parameters, method="least_squares", calc_covar=False)
    best = {k: float(result.params[k].value) for k in NAMES}
    varied = [k for k in NAMES if result.params[k].vary]
    errors = _errors(root, model, best, varied, s.values[used])
    scale = {"h1": 1e-3, "h2": 1e-3}
    return {k: v * scale.get(k, 1.0) for k, v in best.items()}, {k: v * scale.get(k, 1.0) for k, v in errors.items()}


def _start(s: Spectra, used: NDArray[np.bool_], share: Floats, p: float | None) -> dict[str, float]:
    """The best pair of frequencies of a scan; the two heights are linear for each."""
    offset, weight, values = s.offset * 1e-3, s.weight[used], s.values[used]
    best: tuple[float, dict[str, float]] = (np.inf, {})
    for exponent in [p] if p is not None else np.linspace(*P_BOUNDS, 11).tolist():
        g = np.exp(exponent * s.log_fresnel[used])
        norm = np.sum(weight * (offset * g) ** 2, axis=1)
        m = np.sum(weight * offset * g * (values - g), axis=1) / np.where(norm > 0, norm, 1.0)
        rest = np.sum(weight * (values - g - m[:, None] * offset * g) ** 2)
        w = np.linspace(*W_BOUNDS, SCAN)
        a = (share[used] * np.cos(w[:, None] * s.theta_m[used])) * np.sqrt(norm)
        b = ((1 - share[used]) * np.cos(w[:, None] * s.theta_d[used])) * np.sqrt(norm)
        y = m * np.sqrt(norm)
        aa, bb, ab, ay, by = np.sum(a * a, 1)[:, None], np.sum(b * b, 1)[None], a @ b.T, (a @ y)[:, None], (b @ y)[None]
        det = aa * bb - ab**2
        # where nothing is reflected twice (or once) its height is left at 0
        flat = det <= 1e-12 * np.maximum(aa * bb, 1e-300)
        h1 = np.where(flat, ay / np.maximum(aa, 1e-300), (bb * ay - ab * by) / np.where(flat, 1.0, det))
        h2 = np.where(flat, 0.0, (aa * by - ab * ay) / np.where(flat, 1.0, det))
        cost = rest + y @ y - h1 * ay - h2 * by
        i, j = np.unravel_index(int(cost.argmin()), cost.shape)
        if cost[i, j] < best[0]:
            found = {"h1": h1[i, j], "w1": w[i], "h2": h2[i, j], "w2": w[j], "p": exponent}
            best = float(cost[i, j]), {k: float(v) for k, v in found.items()}
    return best[1]


def _errors(root: Floats, model: Any, best: Mapping[str, float], varied: list[str], values: Floats) -> dict[str, float]:
    """Sandwich over spectra, derivatives by central differences; {} where the parameters are degenerate."""
    columns = []
    for name in varied:
        up, down = ({**best, name: best[name] + d} for d in (1e-5, -1e-5))
        columns.append(root * (model(up) - model(down)) / 2e-5)
    jacobian = np.stack(columns, axis=-1)
    size = np.sqrt(np.sum(jacobian**2, axis=(0, 1)))
    if np.any(size == 0):
        return {}
    jacobian = jacobian / size
    normal = np.einsum("nlj,nlk->jk", jacobian, jacobian)
    if np.linalg.cond(normal) > 1e10:
        return {}
    score = np.einsum("nlj,nl->nj", jacobian, root * (values - model(best)))
    inverse, n = np.linalg.inv(normal), len(score)
    covariance = inverse @ (score.T @ score) @ inverse * n / max(n - len(varied), 1)
    return dict(zip(varied, np.sqrt(np.diag(covariance)) / size))
