"""Linear wavelength shifts of BRDF spectra: the local fit of every spectrum (thesis 4.2) and the global one (4.3–4.5).

Both normalise a spectrum at λ_n = 600 nm and describe it as f/f(λ_n) = (m λ + b)·(F/F(λ_n))^p with b = 1 − m λ_n.
Slopes m, and h and t_y of the global fit, are in nm⁻¹ (0.001 nm⁻¹ = 10 % per 100 nm), as in `models.clausen_2022`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import takes_nodes
from ..errors import InputError
from ..materials import Material
from ..models.clausen_2022 import WAVELENGTH_N_NM, slope
from .exponent import P_BOUNDS, fixed_p, p_is_free
from .global_fit import W_BOUNDS, solve
from .goodness import aic, spectral_r2, total_r2
from .local_fit import best_exponents, normalised_model, profile, standard_errors
from .metrics import labelled
from .spectra import Spectra, inside_table, normalised_spectra

Floats = NDArray[np.float64]

_LABELS = {
    "slope": ("nm-1", "slope of the linear shift, relative to the value at wavelength_n"),
    "slope_stderr": ("nm-1", "standard error of slope"),
    "slope_global": ("nm-1", "slope of the global shift fit"),
    "p": ("1", "exponent of the Fresnel reflectance"),
    "p_stderr": ("1", "standard error of p"),
    "r2": ("1", "coefficient of determination of the normalised spectrum"),
    "theta_m": ("degree", "angle between the macro normal and the half vector"),
    "h": ("nm-1", "height of the cosine of the slope"),
    "h_stderr": ("nm-1", "standard error of h"),
    "w": ("1", "frequency of the cosine of the slope over theta_m"),
    "w_stderr": ("1", "standard error of w"),
    "t_y": ("nm-1", "offset of the cosine of the slope"),
    "t_y_stderr": ("nm-1", "standard error of t_y"),
}


@takes_nodes
def fit_local_shift(
    data: xr.Dataset,
    material: str | Material | None = "Al",
    p: float | str = "fit",
    wavelength_n_nm: float = WAVELENGTH_N_NM,
    p_bounds: tuple[float, float] = P_BOUNDS,
    wavelength_range_nm: tuple[float, float] | None = None,
) -> xr.Dataset:
    """Slope m and exponent p of every spectrum by itself (thesis 4.2), weighted by brdf_stderr where it is known.

    material : of the Fresnel reflectance F at the half-vector angle; None is F = 1 (thesis: p = 0, for dielectrics)
    p : "fit" within p_bounds, or a fixed exponent;  wavelength_n_nm : λ_n in nm, interpolated between samples
    wavelength_range_nm : nm, both ends included, None for all
    Returns slope, slope_stderr (nm⁻¹), p, p_stderr, r2 over (theta_i, theta_o or cell); attrs r2_above_0.95 and
    r2_above_0.90 are the shares of spectra (thesis: 88 % and 93 % of sample 1). Standard errors come from the
    scatter about the fit and include the error of f(λ_n); p_stderr is NaN where p is fixed or at a bound. Spectra
    without a positive f(λ_n) or with too few values are NaN, attrs["spectra_left_out"] counts them.
    Raises InputError for fewer than 3 wavelengths (5 where p is fitted) or λ_n outside them, MaterialError outside the
    material's table of all but two wavelengths; a few outside are left out, attrs["wavelengths_left_out"] says which.
    """
    s = normalised_spectra(data, material, wavelength_n_nm, wavelength_range_nm)
    free = p_is_free(s, p, p_bounds)
    exponent = best_exponents(s, p_bounds) if free else np.full(s.used.size, fixed_p(p))
    m, _ = profile(s, exponent)
    # a p that stopped at a bound still leaves the slope as uncertain as a free one does
    errors = standard_errors(s, m, exponent, free)
    errors[1] = np.where((exponent > p_bounds[0]) & (exponent < p_bounds[1]), errors[1], np.nan)
    left_out = ~s.used | (np.sum(s.weight > 0, axis=1) < (4 if free else 2))
    r2 = spectral_r2(s, normalised_model(s, m, exponent))
    fitted = {"slope": m, "slope_stderr": errors[0], "p": exponent, "p_stderr": errors[1], "r2": r2}
    return xr.Dataset(
        {name: _on_grid(s, np.where(left_out, np.nan, values), name) for name, values in fitted.items()},
        attrs={
            "model": "f/f(wavelength_n) = (1 + slope (wavelength - wavelength_n)) (F/F(wavelength_n))^p, thesis 4.2",
            "spectra_left_out": int(left_out.sum()),
            **_shares(np.where(left_out, np.nan, r2)),
            **_choices(material, p, free, p_bounds, wavelength_n_nm, data),
        },
    )


def _shares(r2: Floats) -> dict[str, float]:
    known = r2[np.isfinite(r2)]
    if not known.size:
        return {}
    return {f"r2_above_{limit:.2f}": float(np.mean(known > limit)) for limit in (0.95, 0.90)}


def fitted_spectra(data: xr.Dataset, fit: xr.Dataset, fresnel_only: bool = False) -> xr.Dataset:
    """The BRDF that a shift fit stands for: f(λ_n) of the data times the fitted normalised spectrum (figure 4.7).

    fit : of `fit_local_shift` (slope, p over the directions) or of a global one (slope_global, scalar p)
    fresnel_only : without the linear factor. Raises what the fit's own choices raise.
    """
    name = None if fit.attrs.get("material", "none").startswith("none") else fit.attrs["material"]
    s = normalised_spectra(data, name, float(fit.attrs["wavelength_n"]))
    dims = s.grid["brdf"].dims
    m = (fit["slope_global"] if "slope_global" in fit else fit["slope"]).transpose(*dims[:-1]).values.ravel()
    p = fit["p"].transpose(*dims[:-1]).values.ravel() if fit["p"].ndim else np.full(m.size, float(fit["p"]))
    values = normalised_model(s, np.zeros(m.size) if fresnel_only else m, p)
    scale = np.where(s.used, s.scale, np.nan)[:, None]
    shape = s.grid["brdf"].shape
    return s.grid[["brdf"]].assign(brdf=(dims, (values * scale).reshape(shape), s.grid["brdf"].attrs))


def _on_grid(s: Spectra, values: Floats, name: str) -> xr.DataArray:
    return labelled(s.on_grid(values), name, *_LABELS[name])


def _scalar(value: float, name: str) -> xr.DataArray:
    return labelled(xr.DataArray(float(value)), name, *_LABELS[name])


def _choices(
    material: Any, p: float | str, free: bool, p_bounds: tuple[float, float], wavelength_n_nm: float, data: xr.Dataset
) -> dict[str, Any]:
    return {
        "wavelength_n": float(wavelength_n_nm),
        "material": "none (F = 1)" if material is None else str(getattr(material, "name", material)),
        "p": f"fitted within {p_bounds[0]:g} to {p_bounds[1]:g}" if free else f"fixed at {fixed_p(p):g}",
        "weights": "brdf_stderr" if "brdf_stderr" in data else "equal",
        "wavelengths_left_out": inside_table(data, material)[1],
    }


@takes_nodes
def fit_global_shift(
    data: xr.Dataset,
    material: str | Material | None = "Al",
    p: float | str = "fit",
    t_y: float | str = "fit",
    wavelength_n_nm: float = WAVELENGTH_N_NM,
    p_bounds: tuple[float, float] = P_BOUNDS,
    w_bounds: tuple[float, float] = W_BOUNDS,
    wavelength_range_nm: tuple[float, float] | None = None,
) -> xr.Dataset:
    """One slope function m(i, o) = h cos(w θ_m) + t_y for all spectra (thesis 4.3–4.5), fitted with lmfit.

    material, wavelength_n_nm, wavelength_range_nm : as in `fit_local_shift`;  p, t_y : "fit" or fixed (t_y in nm⁻¹)
    Returns scalars h, t_y (nm⁻¹), w, p, each with its standard error, r2 of all normalised spectra, and the maps
    slope_global (nm⁻¹) and theta_m (degree) over (theta_i, theta_o or cell). Standard errors take every spectrum as one
    observation (sandwich estimate, White 1980, Liang and Zeger 1986): noise that a whole spectrum shares, as that of
    f(λ_n), is counted once. They are NaN for what is fixed, at a bound, or cannot be told from the data.
    Raises InputError when fewer than 5 spectra can be used and as `fit_local_shift`.
    """

    s = normalised_spectra(data, material, wavelength_n_nm, wavelength_range_nm)
    free_p = p_is_free(s, p, p_bounds)
    if t_y != "fit" and (isinstance(t_y, str) or not np.isfinite(t_y)):
        raise InputError(f"t_y = {t_y!r}: a number in nm⁻¹ or 'fit' is allowed")
    if not 0 < w_bounds[0] < w_bounds[1]:
        raise InputError(f"w_bounds = {w_bounds}: 0 < lower < upper is needed")
    used = s.used & (np.sum(s.weight > 0, axis=1) >= 2)
    if used.sum() < 5:
        raise InputError(f"a global shift needs at least 5 usable spectra, {used.sum()} of {used.size} are")
    fixed = {"p": None if free_p else fixed_p(p), "t_y": None if isinstance(t_y, str) else float(t_y)}
    found = solve(s, used, fixed, p_bounds, w_bounds)
    m = slope(s.theta_m, found["h"], found["w"], found["t_y"])
    fitted = normalised_model(s, m, np.full(m.size, found["p"]))
    return xr.Dataset(
        {
            **{name: _scalar(value, name) for name, value in found.items()},
            "r2": _scalar(total_r2(s, used, fitted), "r2"),
            "slope_global": _on_grid(s, m, "slope_global"),
            "theta_m": _on_grid(s, np.rad2deg(s.theta_m), "theta_m"),
        },
        attrs={
            "model": "slope = h cos(w theta_m) + t_y, thesis 4.3 to 4.5",
            "spectra_used": int(used.sum()),
            "spectra_left_out": int((~used).sum()),
            "aic": aic(s, used, fitted, 2 + free_p + (fixed["t_y"] is None)),
            "t_y": "fitted" if fixed["t_y"] is None else f"fixed at {fixed['t_y']:g} nm-1",
            "w": f"fitted within {w_bounds[0]:g} to {w_bounds[1]:g}",
            **_choices(material, p, free_p, p_bounds, wavelength_n_nm, data),
        },
    )
