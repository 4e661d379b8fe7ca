"""What both shift fits start from: spectra normalised at λ_n beside the normalised Fresnel reflectance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import check
from ..errors import InputError
from ..materials import Material, material
from ..models import half_angles
from ..units import meant_nm, radians
from .metrics import detector_dim, interpolate_wavelength

Floats = NDArray[np.float64]


DARK = 1e-9  # of a spectrum's largest value


@dataclass(frozen=True)
class Spectra:
    """n spectra over n_λ sorted wavelengths, flattened over (θ_i, detector direction).

    offset (n_λ,) : λ − λ_n, nm;  values (n, n_λ) : f/f(λ_n), 0 where not valid;  log_fresnel (n, n_λ) : ln F/F(λ_n)
    weight (n, n_λ) : 1/σ² of `values` relative to the median, 1 where σ is unknown, 0 where not valid or at λ_n itself
    anchor_variance (n,) : variance of the relative error of f(λ_n) in units of 1/weight
    theta_m, theta_d (n,) : half vector to the normal, light to the half vector, radians
    used (n,) : f(λ_n) positive and known;  scale (n,) : f(λ_n), 1 where not used
    """

    offset: Floats
    values: Floats
    log_fresnel: Floats
    weight: Floats
    anchor_variance: Floats
    theta_m: Floats
    theta_d: Floats
    used: NDArray[np.bool_]
    scale: Floats
    grid: xr.Dataset

    def on_grid(self, values: Floats) -> xr.DataArray:
        """(n,) values as an array over (theta_i, theta_o or cell)."""
        dims = ("theta_i", detector_dim(self.grid))
        shape = tuple(self.grid.sizes[d] for d in dims)
        coords = {k: v for k, v in self.grid.coords.items() if set(v.dims) <= set(dims)}
        return xr.DataArray(values.reshape(shape), coords, dims)


def normalised_spectra(
    data: xr.Dataset,
    reflector: str | Material | None,
    wavelength_n_nm: float,
    wavelength_range_nm: tuple[float, float] | None = None,
) -> Spectra:
    """Prepare a BRDF for the fits; F is taken at the half-vector angle, 1 where `reflector` is None.

    wavelength_range_nm : in nm, both ends included, what is outside is not used; None is all.

    Wavelengths outside of the material's table are left out (`inside_table`). Raises InputError for fewer than three
    wavelengths or λ_n outside them, MaterialError where fewer than three lie in the table.
    """
    dim = detector_dim(check(data))
    data = inside_table(data, reflector)[0].sortby("wavelength").transpose(..., "theta_i", dim, "wavelength")
    w = data["wavelength"].values
    if wavelength_range_nm is not None:
        data = data.isel(
            wavelength=np.flatnonzero((w >= wavelength_range_nm[0] - 1e-6) & (w <= wavelength_range_nm[1] + 1e-6))
        )
        w = data["wavelength"].values
    if w.size < 3:
        raise InputError(
            f"a linear shift needs at least 3 wavelengths, got {w.size} ({', '.join(f'{v:g}' for v in w)} nm)"
        )
    if not w[0] <= wavelength_n_nm <= w[-1]:
        raise InputError(
            f"wavelength_n_nm = {wavelength_n_nm:g} lies outside the wavelengths {w[0]:g} to {w[-1]:g} nm"
            + meant_nm(wavelength_n_nm, w[0], w[-1])
        )
    f = data["brdf"].values.reshape(-1, w.size)
    f_n = interpolate_wavelength(data[["brdf"]], np.array([wavelength_n_nm]))["brdf"].values.ravel()
    # a spectrum that all but vanishes at λ_n (the rounding of a grating's dark directions) cannot be normalised there
    used = np.isfinite(f_n) & (f_n > DARK * np.max(np.where(np.isfinite(f), f, 0.0), axis=1)) & (f_n > 0)
    scale = np.where(used, f_n, 1.0)
    values = f / scale[:, None]
    # the sample at λ_n is 1 by construction and says nothing
    valid = np.isfinite(values) & used[:, None] & (w != wavelength_n_nm)
    variances = _variances(data, scale)
    theta_m, theta_d = _angles(data, dim)
    return Spectra(
        w - wavelength_n_nm,
        np.where(valid, values, 0.0),
        _log_fresnel(reflector, theta_d, w, wavelength_n_nm),
        np.where(valid, 1.0 / variances, 0.0),
        _at_anchor(variances, w, wavelength_n_nm),
        theta_m,
        theta_d,
        used,
        scale,
        data,
    )


def inside_table(data: xr.Dataset, reflector: str | Material | None) -> tuple[xr.Dataset, str]:
    """The wavelengths that a material's table covers, and in words which are left out, "" for none.

    All of them where fewer than three would be left: what asks for F there says why it cannot.
    """
    if reflector is None:
        return data, ""
    source, w = material(reflector), data["wavelength"].values
    # half a picometre of slack, as the table itself gives
    inside = source.perfect | ((w >= source.range_nm[0] - 5e-4) & (w <= source.range_nm[1] + 5e-4))
    if np.all(inside) or np.sum(inside) < 3:
        return data, ""
    left = ", ".join(f"{v:g}" for v in w[~inside])
    low, high = source.range_nm
    words = f"{left} nm: the table of {source.name!r} ends there ({low:g} to {high:g} nm)"
    return data.isel(wavelength=np.flatnonzero(inside)), words


def _variances(data: xr.Dataset, scale: Floats) -> Floats:
    """(n, n_λ) variance of f/f(λ_n) from brdf_stderr, relative to the median; 1 where it is not known."""
    shape = (scale.size, data.sizes["wavelength"])
    if "brdf_stderr" not in data:
        return np.ones(shape)
    sigma = data["brdf_stderr"].transpose(*data["brdf"].dims).values.reshape(shape) / scale[:, None]
    known = np.isfinite(sigma) & (sigma > 0)
    if not np.any(known):
        return np.ones(shape)
    median = np.median(sigma[known])
    # an error far below the others is a lucky estimate from few samples: it must not rule the fit
    return (np.maximum(np.where(known, sigma, median), 0.01 * median) / median) ** 2


def _at_anchor(variances: Floats, w: Floats, wavelength_n_nm: float) -> Floats:
    """(n,) variance of f(λ_n) from those of the one or two samples that it is interpolated from."""
    right = int(np.clip(np.searchsorted(w, wavelength_n_nm), 1, w.size - 1))
    t = (wavelength_n_nm - w[right - 1]) / (w[right] - w[right - 1])
    return (1 - t) ** 2 * variances[:, right - 1] + t**2 * variances[:, right]


def _angles(data: xr.Dataset, dim: str) -> tuple[Floats, Floats]:
    """θ_m and θ_d of every spectrum, (n,) each, in radians."""
    theta_i, theta_o = radians(data["theta_i"].values), radians(data["theta_o"].values)
    if dim == "theta_o":
        theta_m, theta_d = half_angles(theta_i[:, None], theta_o[None, :])
    else:
        phi_i = radians(data["phi_i"].values) if "phi_i" in data.coords else np.zeros(())
        theta_m, theta_d = half_angles(
            theta_i[:, None], theta_o[None, :], phi_i.reshape(-1, 1), radians(data["phi_o"].values)
        )
    return theta_m.ravel(), theta_d.ravel()


def _log_fresnel(reflector: str | Material | None, theta_d: Floats, w: Floats, wavelength_n_nm: float) -> Floats:
    if reflector is None:
        return np.zeros((theta_d.size, w.size))
    source, cosine = material(reflector), np.cos(theta_d)
    return np.log(source.reflectance(cosine, w) / source.reflectance(cosine, np.array([wavelength_n_nm])))
