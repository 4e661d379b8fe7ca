"""What a formula keeps of physics: energy, reciprocity, positivity. Reported, never repaired."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ..dataset import label
from ..directions import angle_list, wavelength_list
from ..units import radians
from .evaluation import brdf
from .geometry import Geometry
from .registry import find

Floats = NDArray[np.float64]
THETA_I = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0)
RADII, TURNS = 80, 128  # the lobe of α = 0.005 is integrated to 10⁻³ by these


def disc_rule(theta_i: float, radii: int = RADII, turns: int = TURNS) -> tuple[Geometry, Floats]:
    """Points and weights (m,) over all ω_o with Σ w f = ∫ f cos θ_o dω_o, dense about the mirror direction of θ_i.

    In direction cosines cos θ dω is the area of the unit disc: polar coordinates about the mirror point, with
    radii that grow exponentially to the rim. theta_i : radians.
    """
    t, dt = np.polynomial.legendre.leggauss(radii)
    t, dt = (t + 1) / 2, dt / 2
    kappa = 9.0  # the innermost radii are e⁻⁹ = 10⁻⁴ of the rim's
    psi = (np.arange(turns) + 0.5) / turns * 2 * np.pi
    x0 = -np.sin(theta_i)
    rim = -x0 * np.cos(psi) + np.sqrt(1 - (x0 * np.sin(psi)) ** 2)
    r = rim[:, None] * np.expm1(kappa * t) / np.expm1(kappa)
    weight = rim[:, None] * kappa * np.exp(kappa * t) / np.expm1(kappa) * dt * r * 2 * np.pi / turns
    x, y = x0 + r * np.cos(psi)[:, None], r * np.sin(psi)[:, None]
    sine = np.minimum(np.hypot(x, y), 1 - 1e-12)
    return Geometry.of(theta_i, np.arcsin(sine).ravel(), 0.0, np.arctan2(y, x).ravel()), weight.ravel()


def directional_albedo(model: str, theta_i_deg: ArrayLike, wavelength_nm: ArrayLike, **parameters: Any) -> xr.DataArray:
    """∫ f cos θ_o dω_o over the hemisphere, dims (theta_i, wavelength); 1 is all of the incident power."""
    theta_i, wavelength = angle_list(theta_i_deg, "theta_i_deg"), wavelength_list(wavelength_nm)
    found = np.empty((theta_i.size, wavelength.size))
    for row, angle in zip(found, radians(theta_i)):
        geometry, weight = disc_rule(float(angle))
        row[:] = weight @ brdf(model, geometry, wavelength, **parameters)
    return xr.DataArray(
        found,
        {"theta_i": theta_i, "wavelength": wavelength},
        ("theta_i", "wavelength"),
        "albedo",
        {"units": "1", "long_name": "directional albedo: share of the incident power that is reflected"},
    )


def physics(model: str, wavelength_nm: ArrayLike, theta_i_deg: ArrayLike = THETA_I, **parameters: Any) -> xr.Dataset:
    """Energy, reciprocity and positivity of a model with these parameters.

    Returns albedo (theta_i, wavelength), NaN where the model is known in plane only; attrs `albedo_largest`,
    `reciprocity_error` (largest |f(i, o) − f(o, i)| over the larger of the two), `brdf_minimum` (sr⁻¹) with the
    degrees and nm where it lies, `negative_share` of 2° in-plane grid points, and `broken`, JSON list of sentences:
    where the formula breaks energy conservation, reciprocity or positivity, empty where it keeps them.
    """
    wavelength = wavelength_list(wavelength_nm)
    in_plane_only = isinstance(parameters.get("single_share"), xr.DataArray)
    theta_i = angle_list(theta_i_deg, "theta_i_deg")
    if in_plane_only:
        albedo = xr.DataArray(
            np.full((theta_i.size, wavelength.size), np.nan),
            {"theta_i": theta_i, "wavelength": wavelength},
            ("theta_i", "wavelength"),
            "albedo",
        )
    else:
        albedo = directional_albedo(model, theta_i, wavelength, **parameters)
    attrs = _reciprocity(model, wavelength, in_plane_only, parameters) | _positivity(model, wavelength, parameters)
    largest = float(np.nan if in_plane_only else albedo.max())
    attrs |= {"model": model, "source": find(model).source, "albedo_largest": largest}
    attrs["broken"] = json.dumps(_sentences(albedo, attrs), ensure_ascii=False)
    return label(xr.Dataset({"albedo": albedo}, attrs=attrs))


def _reciprocity(model: str, wavelength: Floats, in_plane: bool, parameters: dict[str, Any]) -> dict[str, Any]:
    rng = np.random.default_rng(0)
    theta_i, theta_o = np.arccos(rng.uniform(0.05, 1, (2, 200)))
    phi = np.where(rng.uniform(size=200) < 0.5, 0.0, np.pi) if in_plane else rng.uniform(0, 2 * np.pi, 200)
    if in_plane:
        theta_o, phi = np.where(phi > 0, -theta_o, theta_o), np.zeros(200)
    pairs = Geometry.of(theta_i, theta_o, 0.0, phi)
    a, b = (brdf(model, g, wavelength, **parameters) for g in (pairs, pairs.swapped))
    size = np.maximum(np.abs(a), np.abs(b))
    return {"reciprocity_error": float(np.max(np.abs(a - b) / np.where(size > 0, size, 1.0)))}


def _positivity(model: str, wavelength: Floats, parameters: dict[str, Any]) -> dict[str, Any]:
    angles = np.arange(-88.0, 89, 2)
    values = brdf(model, Geometry.of(radians(angles)[:, None], radians(angles)[None, :]), wavelength, **parameters)
    i, o, w = np.unravel_index(int(values.argmin()), values.shape)
    return {
        "brdf_minimum": float(values[i, o, w]),
        "minimum_theta_i": float(angles[i]),
        "minimum_theta_o": float(angles[o]),
        "minimum_wavelength": float(wavelength[w]),
        "negative_share": float(np.mean(values < 0)),
    }


def _sentences(albedo: xr.DataArray, attrs: dict[str, Any]) -> list[str]:
    found = []
    # the quadrature is good to 10⁻³
    if attrs["albedo_largest"] > 1.002:
        at = albedo.where(albedo == albedo.max(), drop=True)
        found.append(
            f"reflects {attrs['albedo_largest']:.4g} of the incident power at theta_i = {float(at.theta_i[0]):g}°, "
            f"{float(at.wavelength[0]):g} nm"
        )
    if attrs["reciprocity_error"] > 1e-9:
        found.append(f"is not reciprocal: f(i, o) and f(o, i) differ by up to {attrs['reciprocity_error']:.3g}")
    if attrs["negative_share"] > 0:
        found.append(
            f"is negative at {attrs['negative_share']:.1%} of the in-plane points, least {attrs['brdf_minimum']:.3g} "
            f"sr-1 at theta_i = {attrs['minimum_theta_i']:g}°, theta_o = {attrs['minimum_theta_o']:g}°, "
            f"{attrs['minimum_wavelength']:g} nm"
        )
    return found
