"""Diffraction efficiencies of periodic profiles: the surface integral over one period, at the orders alone."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ..dataset import label, plain, versions
from ..directions import half_vectors, unit_vectors
from ..surface.heightfield import Heightfield
from ..units import radians, wavenumber
from .fourier import Transform, evaluate
from .orders import Orders
from .outcome import renormalised
from .quadrature import Floats
from .theories import DESCRIPTION, amplitude, scattering_vector

if TYPE_CHECKING:
    from .kirchhoff import Kirchhoff


def orders(solver: Kirchhoff, surface: Heightfield, theta_i_deg: Any) -> xr.Dataset:
    """`efficiency (theta_i, order, wavelength)`: reflected power of the order over incident power.

    Order m leaves at sin θ_o = −sin θ_i − mλ/P. An order that cannot propagate carries nothing.
    Efficiency = C² R |S/A|² / (cos θ_i cos θ_o), from f with |S|² concentrated on the orders.
    Raises InputError for a surface that is not one periodic profile along x.
    """
    start = time.perf_counter()
    found = Orders.of(surface, theta_i_deg, solver.wavelength_nm)
    efficiency, result = _efficiency(solver, surface, found)
    data = xr.Dataset(
        {"efficiency": (("theta_i", "order", "wavelength"), efficiency)},
        coords=found.coords,
        attrs={
            "method": f"waves: {DESCRIPTION[solver.theory]}",
            "theory": solver.theory,
            "period_um": found.period,
            "material": solver.material.name,  # type: ignore[union-attr]
            "method_used": result.method,
            "tolerance_asked": solver.tol,
            "error_achieved": 2 * result.error,
            "error_estimate": "twice the estimated relative error of S in the 2-norm",
            "seconds": time.perf_counter() - start,
            "versions": versions(),
        },
    )
    if solver.energy or solver.renormalise:
        over = ("theta_i", "wavelength")
        macro = solver.material.reflectance(np.cos(radians(found.theta_i)), found.wavelength)  # type: ignore[union-attr]
        data["energy_reflected"], data["fresnel_macro"] = (over, efficiency.sum(axis=1)), (over, macro)
    if solver.renormalise:
        data = renormalised(data, ("efficiency",))
    data.attrs = {key: plain(value) for key, value in data.attrs.items()}
    return label(data)


def _efficiency(solver: Kirchhoff, surface: Heightfield, found: Orders) -> tuple[Floats, Transform]:
    """(theta_i, order, wavelength) efficiencies, 0 where nothing propagates, and the integral that they are from."""
    there, material = found.there, solver.material
    i, m, w = np.nonzero(there)
    sine = found.sine[there]
    wi = unit_vectors(radians(found.theta_i))[i]
    wo = np.stack([sine, np.zeros(len(i)), np.sqrt(1 - sine**2)], axis=1)
    q = scattering_vector(solver.theory, wavenumber(found.wavelength)[w], wi, wo)
    q[:, 0] = -2 * np.pi * found.m[m] / found.period  # exactly on the lattice of the period
    result = evaluate(surface, q, None, solver.method, solver.tol / 10)
    cos_h = np.clip(np.sum(half_vectors(wi, wo) * wi, axis=1), 0, 1)
    reflectance = np.array([material.reflectance(c, found.wavelength[j]) for c, j in zip(cos_h, w)])  # type: ignore
    c = amplitude(solver.theory, wi, wo)
    efficiency = np.zeros(there.shape)
    efficiency[there] = c**2 * reflectance * np.abs(result.S / surface.area_um2) ** 2 / (wi[:, 2] * wo[:, 2])
    return efficiency, result
