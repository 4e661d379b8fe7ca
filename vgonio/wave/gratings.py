"""Diffraction efficiencies of periodic profiles: the surface integral over one period, at the orders alone."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ..dataset import label, plain, versions
from ..directions import angle_list, half_vectors, unit_vectors
from ..errors import InputError
from ..surface.heightfield import Heightfield
from ..units import nm_to_um, radians, wavenumber
from .fourier import evaluate
from .outcome import renormalised
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
    if not (surface.periodic and surface.is_profile):
        raise InputError(
            f"{surface.name or 'the surface'} is not one periodic profile along x: orders are for gratings "
            "(periodic = true and all rows equal); use scatter for anything else"
        )
    period = surface.period_um or surface.size_um[1]
    theta = angle_list(theta_i_deg, "theta_i_deg")
    wavelength = np.asarray(solver.wavelength_nm, float)
    most = int(np.floor(2 * period / nm_to_um(wavelength).min()))
    m = np.arange(-most, most + 1)
    si = np.sin(radians(theta))[:, None, None]
    so = -si - m[:, None] * nm_to_um(wavelength) / period  # (theta_i, order, wavelength)
    there = np.abs(so) < 1 - 1e-12
    i, _, w = np.nonzero(there)
    wi = unit_vectors(radians(theta))[i]
    wo = np.stack([so[there], np.zeros(len(i)), np.sqrt(1 - so[there] ** 2)], axis=1)
    k = wavenumber(wavelength)[w]
    q = scattering_vector(solver.theory, k, wi, wo)
    q[:, 0] = -2 * np.pi * np.nonzero(there)[1].astype(float) / period  # exactly on the lattice of the period
    q[:, 0] += 2 * np.pi * most / period
    result = evaluate(surface, q, None, solver.method, solver.tol / 10)
    cos_h = np.clip(np.sum(half_vectors(wi, wo) * wi, axis=1), 0, 1)
    reflectance = np.array([solver.material.reflectance(c, wavelength[j]) for c, j in zip(cos_h, w)])  # type: ignore
    c = amplitude(solver.theory, wi, wo)
    efficiency = np.zeros(there.shape)
    efficiency[there] = c**2 * reflectance * np.abs(result.S / surface.area_um2) ** 2 / (wi[:, 2] * wo[:, 2])
    data = xr.Dataset(
        {"efficiency": (("theta_i", "order", "wavelength"), efficiency)},
        coords={
            "theta_i": theta,
            "order": m,
            "wavelength": wavelength,
            "theta_o": (
                ("theta_i", "order", "wavelength"),
                np.degrees(np.where(there, np.arcsin(np.clip(so, -1, 1)), np.nan)),
            ),
        },
        attrs={
            "method": f"waves: {DESCRIPTION[solver.theory]}",
            "theory": solver.theory,
            "period_um": period,
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
        macro = solver.material.reflectance(np.cos(radians(theta)), wavelength)  # type: ignore[union-attr]
        data["energy_reflected"], data["fresnel_macro"] = (over, efficiency.sum(axis=1)), (over, macro)
    if solver.renormalise:
        data = renormalised(data, ("efficiency",))
    data.attrs = {key: plain(value) for key, value in data.attrs.items()}
    return label(data)
