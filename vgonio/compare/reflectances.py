"""Directional reflectance and total integrated scatter of any BRDF that covers the hemisphere.

Where a simulation has summed up all reflected light itself, by rays or quasi-random directions, that is its
reflectance; else f cos θ is integrated, with the error of it (`quadrature` for data in plane), and refused where the
directions do not tell.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import ascending, check, takes_nodes
from ..directions import cone_projected_solid_angle, frames, unit_vectors
from ..errors import InputError
from ..models import Geometry, directional_albedo
from ..models.evaluation import brdf
from ..units import radians
from .cells import cell_rule, over_cells
from .explained import kind_of
from .fit_files import fit_parameters
from .metrics import SAME_ANGLE_DEG, detector_dim, labelled, matches
from .quadrature import Integral, Plane, outside, unresolved_words, whole

Floats = NDArray[np.float64]
SPECULAR_DEG = 2.0  # half-angle of the cone that is specular (instruments after ASTM F1048 leave out 2° to 3°)
FARTHEST_DEG = 75.0  # in-plane data have to reach so far; the rest is f of the last angle
# where an integral comes from
ENERGIES, OWN_CONE = "energies summed up by the simulation", "the cone in the mirror direction"
IN_PLANE = "directions in plane at θ_i = 0, taken as isotropic"
_TEXTS = {
    "reflectance": "directional-hemispherical reflectance",
    "tis": "total integrated scatter: share of the reflected light outside the specular cone",
}


@takes_nodes
def reflectance(data: xr.Dataset) -> xr.DataArray:
    """Directional-hemispherical reflectance ∫ f cos θ_o dω_o, dims (theta_i, wavelength), without a unit.

    data : a simulation that has summed up its energies; or on a hemisphere; or in plane at θ_i = 0 only, where an
    isotropic sample scatters alike all round (both sides are averaged); or a fit of `fit_model`, which is integrated as
    a formula.
    The coordinate `error` is the error of it: of the quadrature, without what brdf_stderr makes of it, or of the
    energies; attrs["source"] says which.
    Raises InputError where the data do not cover that, and where the steps of θ_o are too coarse for the lobe.
    """
    if data.attrs.get("method") == "fit":
        return _labelled(_of_fit(data, None), "reflectance", "the formula")
    data = ascending(check(data))
    known = energies(data)
    if known is not None:
        return _labelled(known, "reflectance", ENERGIES)
    if detector_dim(data) == "cell":
        found = _with_error(*over_cells(data, None), data)
        return _labelled(found, "reflectance", "cells of the hemisphere")
    plane, at = in_plane(data)
    return _labelled(_told(whole(plane), plane, data, at), "reflectance", IN_PLANE)


@takes_nodes
def total_integrated_scatter(data: xr.Dataset, specular_deg: float = SPECULAR_DEG) -> xr.DataArray:
    """Share of the reflected light further than specular_deg from the mirror direction, dims (theta_i, wavelength).

    In plane, at θ_i = 0; but where the detector's cone is the specular cone (aperture_deg = 2 specular_deg) and a
    simulation has summed up its energies, at every θ_i whose mirror direction is among the directions.
    The coordinate `error` is that of the quadrature. Raises InputError unless 0 < specular_deg < 90, and where the
    directions do not tell (as `reflectance`).
    """
    if not 0 < specular_deg < 90:
        raise InputError(f"specular_deg = {specular_deg}: the half-angle of the specular cone lies within 0 to 90°")
    cone = float(radians(specular_deg))
    attrs = {"specular_deg": float(specular_deg)}
    if data.attrs.get("method") == "fit":
        everything = _of_fit(data, None)
        found = 1 - _of_fit(data, cone) / everything.where(everything > 0)
        return _labelled(found, "tis", "the formula", **attrs)
    data = ascending(check(data))
    if detector_dim(data) == "cell":
        return _labelled(_with_error(*over_cells(data, cone), data), "tis", "cells of the hemisphere", **attrs)
    known = energies(data)
    if known is not None and np.isclose(half_angle(data), cone, rtol=1e-3):
        return _labelled(_outside_own_cone(data, known), "tis", OWN_CONE, **attrs)
    plane, at = in_plane(data)
    energy = None if known is None else known.isel(theta_i=at).values
    share = _told(outside(plane, cone, energy), plane, data, at)
    return _labelled(share, "tis", IN_PLANE, **attrs)


def _labelled(found: xr.DataArray, name: str, source: str, **attrs: object) -> xr.DataArray:
    made = labelled(found, name, "1", _TEXTS[name], source=source, **attrs)
    if "error" not in made.coords:
        made = made.assign_coords(error=(made.dims, np.zeros(made.shape)))
    made["error"].attrs = {"units": "1", "long_name": f"error of {name}"}
    return made


def _with_error(value: Floats, error: Floats, data: xr.Dataset, rows: Any = slice(None)) -> xr.DataArray:
    """(θ_i, λ) with the coordinate `error`; rows : which θ_i of the data."""
    dims = ("theta_i", "wavelength")
    coords = {"theta_i": data["theta_i"].values[rows], "wavelength": data["wavelength"].values, "error": (dims, error)}
    return xr.DataArray(value, coords, dims)


def energies(data: xr.Dataset) -> xr.DataArray | None:
    """All reflected light over the incident, (theta_i, wavelength), where the simulation has summed it up itself.

    Its coordinate `error`: the stated standard error of waves; of rays the most that their number leaves open.
    """
    if "energy_reflected" in data:
        e = data["energy_reflected"] * (data["renormalisation"] if "renormalisation" in data else 1.0)
        error = data["energy_reflected_stderr"] if "energy_reflected_stderr" in data else xr.zeros_like(e)
    elif kind_of(data) == "rays" and "energy_by_bounce" in data:
        e = data["energy_by_bounce"].sum("bounce")
        count = data["rays"] if "rays" in data else float(data.attrs.get("rays_asked", 1))
        error = (e * (1 - e)).clip(0.0) ** 0.5 / count**0.5
    else:
        return None
    if set(e.dims) != {"theta_i", "wavelength"}:
        return None
    e, error = (v.transpose("theta_i", "wavelength") for v in xr.broadcast(e, error))
    return _with_error(e.values, error.values, data)


def half_angle(data: xr.Dataset) -> float:
    """Half-angle of the detector's cones in rad, 0 where it is not known: values are taken as of directions then."""
    if "aperture_deg" in data.attrs:
        return float(radians(float(data.attrs["aperture_deg"]))) / 2
    if "solid_angle" in data.coords and data["solid_angle"].size:
        return float(np.arccos(1 - float(np.median(data["solid_angle"])) / (2 * np.pi)))
    return 0.0


def in_plane(data: xr.Dataset) -> tuple[Plane, int]:
    """f about the normal of in-plane data, and which θ_i is normal; InputError where they do not cover it."""
    at, known = _normal_incidence(data)
    one = data["brdf"].isel(theta_i=at).transpose("theta_o", "wavelength").values
    return Plane(radians(data["theta_o"].values[known]), one[known], half_angle(data)), at


def _told(found: Integral, plane: Plane, data: xr.Dataset, at: int) -> xr.DataArray:
    """The integral at normal incidence; InputError where the steps do not tell it."""
    if found.unresolved:
        raise InputError(unresolved_words(plane, "aperture_deg" in data.attrs))
    return _with_error(found.value[None], found.error[None], data, [at])


def _outside_own_cone(data: xr.Dataset, energy: xr.DataArray) -> xr.DataArray:
    """Share of all light that is not in the detector's cone about the mirror direction, of each θ_i that has one."""
    theta_i, theta_o = data["theta_i"].values, data["theta_o"].values
    rows, columns = matches(-theta_i, theta_o, SAME_ANGLE_DEG)
    if not rows.size:
        raise InputError("no θ_o is the mirror direction of a θ_i: total integrated scatter is about it")
    order = np.argsort(rows)
    rows, columns = rows[order], columns[order]
    dims = ("theta_i", "theta_o", "wavelength")
    f = data["brdf"].transpose(*dims).values
    stderr = np.nan_to_num(data["brdf_stderr"].transpose(*dims).values) if "brdf_stderr" in data else np.zeros_like(f)
    size = cone_projected_solid_angle(radians(theta_o[columns]), half_angle(data))[:, None]
    caught, noise = (v[rows, columns] * size for v in (f, stderr))
    known = energy.isel(theta_i=rows)
    error = np.hypot(known["error"].values * caught / known.values, noise) / known.values
    return _with_error(1 - caught / known.values, error, data, rows)


def hemisphere_rule(data: xr.Dataset, cone: float | None = None) -> tuple[NDArray[np.intp], Floats]:
    """Which θ_i (m,) can be integrated, and weights (m, directions) with Σ w f = ∫ f cos θ_o dω_o, see `integrated`.

    cone : half-angle in radians about the mirror direction, None for all
    Raises InputError where the data do not cover that.
    """
    if detector_dim(data) == "cell":
        return np.arange(data.sizes["theta_i"]), cell_rule(data, cone)
    return _in_plane(data, cone)


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


@lru_cache(maxsize=2)  # 800 points are an eigenvalue problem of half a second
def _rule(count: int) -> tuple[Floats, Floats]:
    """Nodes and weights of Gauss–Legendre on −1 … 1."""
    return np.polynomial.legendre.leggauss(count)


def _normal_incidence(data: xr.Dataset) -> tuple[int, NDArray[np.bool_]]:
    """Which θ_i is the normal, and where all wavelengths have a value there; InputError where the data do not reach."""
    theta_i = data["theta_i"].values
    at = int(np.abs(theta_i).argmin())
    if abs(theta_i[at]) > 0.5:
        raise InputError("in-plane data cover the hemisphere at normal incidence only, and θ_i = 0 is not among them")
    known = np.isfinite(data["brdf"].isel(theta_i=at).transpose("theta_o", "wavelength").values).all(axis=1)
    angle = np.abs(data["theta_o"].values)
    if known.sum() < 3 or angle[known].max() < FARTHEST_DEG:
        raise InputError(
            f"in-plane data at θ_i = 0 have to reach {FARTHEST_DEG:g}° to be integrated over the hemisphere"
        )
    return at, known


def _in_plane(data: xr.Dataset, cone: float | None) -> tuple[NDArray[np.intp], Floats]:
    at, known = _normal_incidence(data)
    angle = np.abs(radians(data["theta_o"].values))
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
