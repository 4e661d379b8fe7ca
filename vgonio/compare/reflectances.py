"""Directional reflectance and total integrated scatter of any BRDF that covers the hemisphere."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import ascending, check, takes_nodes
from ..directions import frames, unit_vectors
from ..errors import InputError
from ..models import Geometry, directional_albedo
from ..models.evaluation import brdf
from ..units import radians
from .fit_files import fit_parameters
from .metrics import detector_dim, labelled

Floats = NDArray[np.float64]
SPECULAR_DEG = 2.0  # half-angle of the cone that is specular (instruments after ASTM F1048 leave out 2° to 3°)
FARTHEST_DEG = 75.0  # in-plane data have to reach so far; the rest is f of the last angle
_TEXTS = {
    "reflectance": "directional-hemispherical reflectance",
    "tis": "total integrated scatter: share of the reflected light outside the specular cone",
}


@takes_nodes
def reflectance(data: xr.Dataset) -> xr.DataArray:
    """Directional-hemispherical reflectance ∫ f cos θ_o dω_o, dims (theta_i, wavelength), without a unit.

    data : on a hemisphere; in plane at θ_i = 0 only, where an isotropic sample scatters alike all round (both sides are
    averaged); or a fit of `fit_model`, which is integrated as a formula.
    Raises InputError where the data do not cover that.
    """
    return labelled(_integral(data, None), "reflectance", "1", _TEXTS["reflectance"])


@takes_nodes
def total_integrated_scatter(data: xr.Dataset, specular_deg: float = SPECULAR_DEG) -> xr.DataArray:
    """Share of the reflected light further than specular_deg from the mirror direction, dims (theta_i, wavelength).

    Raises InputError unless 0 < specular_deg < 90, and where the directions do not tell (as `reflectance`).
    """
    if not 0 < specular_deg < 90:
        raise InputError(f"specular_deg = {specular_deg}: the half-angle of the specular cone lies within 0 to 90°")
    everything = _integral(data, None)
    found = 1 - _integral(data, float(radians(specular_deg))) / everything.where(everything > 0)
    return labelled(found, "tis", "1", _TEXTS["tis"], specular_deg=float(specular_deg))


def _integral(data: xr.Dataset, cone: float | None) -> xr.DataArray:
    """∫ f cos θ_o dω_o over the hemisphere, or over the cone of that half-angle about the mirror direction."""
    if data.attrs.get("method") == "fit":
        return _of_fit(data, cone)
    data = ascending(check(data))
    rows, weight = hemisphere_rule(data, cone)
    f = data["brdf"].transpose("theta_i", detector_dim(data), "wavelength").values[rows]
    coords = {"theta_i": data["theta_i"].values[rows], "wavelength": data["wavelength"].values}
    return xr.DataArray(integrated(f, weight), coords, ("theta_i", "wavelength"))


def hemisphere_rule(data: xr.Dataset, cone: float | None = None) -> tuple[NDArray[np.intp], Floats]:
    """Which θ_i (m,) can be integrated, and weights (m, directions) with Σ w f = ∫ f cos θ_o dω_o, see `integrated`.

    cone : half-angle in radians about the mirror direction, None for all
    Raises InputError where the data do not cover that.
    """
    return _of_cells(data, cone) if detector_dim(data) == "cell" else _in_plane(data, cone)


def integrated(f: Floats, weight: Floats) -> Floats:
    """(m, n_λ) integrals of f (m, directions, n_λ); a direction of weight 0 may lack its value."""
    return np.einsum("idw,id->iw", np.where(weight[..., None] == 0, 0.0, f), weight)


def _of_fit(fit: xr.Dataset, cone: float | None) -> xr.DataArray:
    name, w = str(fit.attrs["model"]), fit["wavelength"].values
    parameters = fit_parameters(fit)
    if isinstance(parameters.get("single_share"), xr.DataArray):
        raise InputError("a fit with a share of single reflections in the plane of incidence has no hemisphere")
    theta_i = np.abs(fit["theta_i"].values)
    if cone is None:
        found = directional_albedo(name, np.unique(theta_i), w, **parameters)
        return found.sel(theta_i=theta_i).assign_coords(theta_i=fit["theta_i"].values)
    values = []
    for angle in radians(theta_i):
        geometry, weight = _cone_rule(float(angle), cone)
        values.append(weight @ brdf(name, geometry, w, **parameters))
    return xr.DataArray(
        np.array(values), {"theta_i": fit["theta_i"].values, "wavelength": w}, ("theta_i", "wavelength")
    )


def _cone_rule(theta_i: float, cone: float) -> tuple[Geometry, Floats]:
    """Points and weights (m,) over the cone about the mirror direction with Σ w f = ∫ f cos θ_o dω_o, dense inside."""
    t, dt = np.polynomial.legendre.leggauss(40)
    t, dt, kappa = (t + 1) / 2, dt / 2, 6.0
    r = cone * np.expm1(kappa * t) / np.expm1(kappa)
    weight = cone * kappa * np.exp(kappa * t) / np.expm1(kappa) * dt * np.sin(r)
    psi = (np.arange(64) + 0.5) / 64 * 2 * np.pi
    local = unit_vectors(r[:, None], psi).reshape(-1, 3)
    wo = local @ frames(unit_vectors(np.array([-theta_i])))[0].T
    above = np.maximum(wo[:, 2], 0.0)
    polar = np.minimum(np.arccos(np.clip(wo[:, 2], 0.0, 1.0)), np.pi / 2 - 1e-6)
    geometry = Geometry.of(theta_i, polar, 0.0, np.arctan2(wo[:, 1], wo[:, 0]))
    return geometry, np.repeat(weight, psi.size) * 2 * np.pi / psi.size * above


def _of_cells(data: xr.Dataset, cone: float | None) -> tuple[NDArray[np.intp], Floats]:
    theta, phi = radians(data["theta_o"].values), radians(data["phi_o"].values)
    if "projected_solid_angle" in data.coords:
        weight = data["projected_solid_angle"].values
    elif "solid_angle" in data.coords:
        weight = data["solid_angle"].values * np.cos(theta)
    else:
        raise InputError("the cells of the hemisphere have no solid_angle: their integral is not known")
    share = np.ones((data.sizes["theta_i"], theta.size))
    if cone is not None:
        width = float(np.sqrt(np.max(data["solid_angle"].values) / np.pi))
        if width > cone:
            raise InputError(
                f"cells of {np.degrees(2 * width):.1f}° are wider than the specular cone of "
                f"{np.degrees(2 * cone):.1f}°: give a larger specular_deg or simulate with a finer resolution_deg"
            )
        phi_i = radians(float(data["phi_i"].values.ravel()[0])) if "phi_i" in data.coords else 0.0
        ti = radians(data["theta_i"].values)[:, None]
        cosine = np.cos(ti) * np.cos(theta) - np.sin(ti) * np.sin(theta) * np.cos(phi - phi_i)
        share = (cosine >= np.cos(cone)).astype(float)
    if np.isnan(data["brdf"].values).any():
        raise InputError("cells of the hemisphere hold no value: its reflectance is not known")
    return np.arange(data.sizes["theta_i"]), share * weight


@lru_cache(maxsize=2)  # 800 points are an eigenvalue problem of half a second
def _rule(count: int) -> tuple[Floats, Floats]:
    """Nodes and weights of Gauss–Legendre on −1 … 1."""
    return np.polynomial.legendre.leggauss(count)


def _in_plane(data: xr.Dataset, cone: float | None) -> tuple[NDArray[np.intp], Floats]:
    theta_i = data["theta_i"].values
    at = int(np.abs(theta_i).argmin())
    if abs(theta_i[at]) > 0.5:
        raise InputError("in-plane data cover the hemisphere at normal incidence only, and θ_i = 0 is not among them")
    one = data["brdf"].isel(theta_i=at).transpose("theta_o", "wavelength").values
    angle = np.abs(radians(data["theta_o"].values))
    known = np.isfinite(one).all(axis=1)
    if known.sum() < 3 or angle[known].max() < radians(FARTHEST_DEG):
        raise InputError(
            f"in-plane data at θ_i = 0 have to reach {FARTHEST_DEG:g}° to be integrated over the hemisphere"
        )
    theta, place = np.unique(np.round(angle[known], 9), return_inverse=True)
    nodes, weight = _rule(800)
    top = np.pi / 2 if cone is None else cone
    x = (nodes + 1) / 2 * top
    weight = 2 * np.pi * weight / 2 * top * np.sin(x) * np.cos(x)
    # linear between the angles: what each of them weighs, shared by both sides where both are there
    each = np.array([weight @ np.interp(x, theta, row) for row in np.eye(theta.size)])
    found = np.zeros((1, angle.size))
    found[0, known] = (each / np.bincount(place))[place]
    return np.array([at]), found
