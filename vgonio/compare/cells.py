"""Integrals over the cells of a hemisphere, with what their size leaves open."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..directions import unit_vectors
from ..errors import InputError
from ..units import radians
from .quadrature import LARGEST_ERROR, SMALLEST_ERROR

Floats = NDArray[np.float64]


def over_cells(data: xr.Dataset, cone: float | None) -> tuple[Floats, Floats]:
    """The integral over cells, or the share of it outside of a cone, and its error, (θ_i, λ) each.

    Cells of a simulation hold all the light that goes into them. Of others, values at their middles, half of what a
    mix with the six nearest cells moves is taken as the error; of a cone half of what lies in the cells that it cuts.
    Raises InputError where that is too much.
    """
    weight = cell_rule(data, None)
    f = data["brdf"].transpose("theta_i", "cell", "wavelength").values
    value = integrated(f, weight)
    error = np.zeros_like(value)
    if "solver" not in data.attrs:
        directions = unit_vectors(radians(data["theta_o"].values), radians(data["phi_o"].values))
        mixed = f[:, _nearest_cells(directions)].mean(axis=2)
        error = integrated(np.abs(mixed - f), weight) / 2
    if cone is not None:
        inside, cut = cell_rule(data, cone), _cut_cells(data, cone)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = 1 - integrated(f, inside) / value
            error = np.hypot(integrated(f, weight * cut) / 2 / value, error / value * share)
        value = share
    least = 0.0 if cone is None else SMALLEST_ERROR
    if np.any((np.sum(error, 1) > LARGEST_ERROR * np.abs(np.sum(value, 1))) & (np.mean(error, 1) > least)):
        raise InputError("the lobe is narrower than the cells of the hemisphere tell: take a finer resolution_deg")
    return value, error


def _nearest_cells(directions: Floats) -> NDArray[np.intp]:
    """(m, 6) which cells lie nearest to each."""
    from scipy.spatial import cKDTree

    count = min(7, len(directions))
    return np.asarray(cKDTree(directions).query(directions, count)[1])[:, 1:]


def cell_rule(data: xr.Dataset, cone: float | None) -> Floats:
    """(θ_i, cell) weights with Σ w f = ∫ f cos θ_o dω_o, over all cells or those in a cone about the mirror direction.

    cone : its half-angle in rad. Raises InputError for cells without a size or a value, or wider than the cone.
    """
    theta = radians(data["theta_o"].values)
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
        share = (_cosine_to_mirror(data) >= np.cos(cone)).astype(float)
    if np.isnan(data["brdf"].values).any():
        raise InputError("cells of the hemisphere hold no value: its reflectance is not known")
    return share * weight


def _cosine_to_mirror(data: xr.Dataset) -> Floats:
    """(θ_i, cell) cosine of the angle from a cell's middle to the mirror direction."""
    theta, phi = radians(data["theta_o"].values), radians(data["phi_o"].values)
    phi_i = radians(float(data["phi_i"].values.ravel()[0])) if "phi_i" in data.coords else 0.0
    ti = radians(data["theta_i"].values)[:, None]
    return np.cos(ti) * np.cos(theta) - np.sin(ti) * np.sin(theta) * np.cos(phi - phi_i)


def _cut_cells(data: xr.Dataset, cone: float) -> NDArray[np.bool_]:
    """(θ_i, cell) whether the edge of the cone runs through the cell, a disc of its size."""
    size = np.sqrt(data["solid_angle"].values / np.pi)
    return np.abs(np.arccos(np.clip(_cosine_to_mirror(data), -1.0, 1.0)) - cone) < size * (1 - 1e-9)


def integrated(f: Floats, weight: Floats) -> Floats:
    """(m, n_λ) integrals of f (m, directions, n_λ); a direction of weight 0 may lack its value."""
    return np.einsum("idw,id->iw", np.where(weight[..., None] == 0, 0.0, f), weight)
