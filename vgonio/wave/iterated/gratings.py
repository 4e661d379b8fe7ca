"""Gratings: one period sees itself and its neighbours, whose fields differ by a phase (Floquet); efficiencies."""

from __future__ import annotations

import json
import time
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ...dataset import label, plain, versions
from ...errors import VgonioWarning
from ...materials import Material
from ...surface.heightfield import Heightfield
from ...units import radians
from ..orders import Orders
from ..quadrature import Complex, Floats
from .curve import Curve, joined, sample_curve
from .diffraction import SETTLED
from .equation import Equation, Images, rule_of
from .far_field import far_amplitudes
from .limits import limits
from .propagate import POLARISATIONS, Pairs, pair_operators
from .sight import Sight, look
from .sweeps import sweep

if TYPE_CHECKING:
    from .solver import IteratedKirchhoff

NEIGHBOURS = 4  # periods on each side that a period sees
BLOCK = 1500  # points of a period up to which its fields are solved for together, without sweeps


def orders(solver: IteratedKirchhoff, surface: Heightfield, theta_i_deg: Any) -> xr.Dataset:
    """`efficiency (theta_i, order, wavelength, polarisation)`: reflected power of the order over incident power.

    Order m leaves at sin θ_o = −sin θ_i − mλ/P. Beside it `efficiency_single`, of the first reflection alone, where it
    is seen by the detector. Raises InputError for a surface that is not one periodic profile along x.
    """
    start = time.perf_counter()
    found = Orders.of(surface, theta_i_deg, solver.wavelength_nm)
    period, theta, wavelength = found.period, found.theta_i, found.wavelength
    efficiency = np.zeros((2, *found.sine.shape, 2))
    for w, one in enumerate(wavelength):
        curve, sight = _one_period(surface, period, one * 1e-3 / solver.per(surface))
        for p, polarisation in enumerate(POLARISATIONS):
            for i, t in enumerate(radians(theta)):
                there = found.there[i, :, w]
                to = np.arcsin(found.sine[i, there, w])
                efficiency[:, i, there, w, p] = _efficiencies(
                    solver, curve, sight, period, float(one), polarisation, float(t), to
                )
    reasons = limits(surface, theta, wavelength)
    if reasons:
        warnings.warn("iterated Kirchhoff: " + "; ".join(reasons), VgonioWarning, stacklevel=3)
    over = ("theta_i", "order", "wavelength", "polarisation")
    data = xr.Dataset(
        {"efficiency": (over, efficiency[1]), "efficiency_single": (over, efficiency[0])},
        coords=found.coords | {"polarisation": list(POLARISATIONS)},
        attrs={
            "method": f"waves: iterated Kirchhoff, at most {solver.bounces} reflections, {2 * NEIGHBOURS + 1} periods",
            "theory": "iterated-kirchhoff",
            "period_um": period,
            "material": solver.material.name,  # type: ignore[union-attr]
            "remarks": json.dumps(reasons, ensure_ascii=False),
            "seconds": time.perf_counter() - start,
            "versions": versions(),
        },
    )  # fmt: skip
    data.attrs = {key: plain(value) for key, value in data.attrs.items()}
    return label(data)


def _one_period(surface: Heightfield, period: float, spacing: float) -> tuple[Curve, Sight]:
    """Points of one period, and what they see of that and its neighbours: sources are counted from the leftmost."""
    start = {"nearest": 0.5, "linear": 1.0}.get(surface.interpolation, 0.0) * surface.dx  # where no wall or edge is
    curve = sample_curve(surface, start, start + period, spacing)
    wide = joined([curve.moved(n * period) for n in range(-NEIGHBOURS, NEIGHBOURS + 1)])
    first = NEIGHBOURS * len(curve)
    return curve, look(wide, first, first + len(curve))


def _efficiencies(
    solver: IteratedKirchhoff, curve: Curve, sight: Sight, period: float, wavelength_nm: float, polarisation: str,
    theta: float, to: Floats,
) -> Floats:  # fmt: skip
    """(2, len(to)) efficiencies of the first reflection alone and of all."""
    k, n = 2 * np.pi / (wavelength_nm * 1e-3), len(curve)
    material = solver.material
    cosine = np.sin(theta) * curve.nx + np.cos(theta) * curve.nz
    r = material.amplitudes(np.clip(cosine, 0, 1), wavelength_nm)[POLARISATIONS[polarisation]]  # type: ignore[union-attr]
    lit = sight.seen(curve, np.array([theta]))[0] if solver.shadowing else np.ones(n, bool)
    wave = np.exp(-1j * k * (np.sin(theta) * curve.x + np.cos(theta) * curve.z))
    u, v = (1 + r) * lit * wave, (1 - r) * lit * wave * (-1j * k * cosine)
    seen = sight.seen(curve, to) if solver.shadowing else None
    first = far_amplitudes(curve, u, v, k, to, seen)
    total = first
    if solver.bounces > 1 and sight.row.size:
        incident = wave, wave * (-1j * k * cosine)
        wide = joined([curve.moved(m * period) for m in range(-NEIGHBOURS, NEIGHBOURS + 1)])
        pairs = pair_operators(wide, curve, sight, k, material, wavelength_nm, polarisation)  # type: ignore[arg-type]
        phases = np.exp(-1j * k * np.sin(theta) * period * np.arange(-NEIGHBOURS, NEIGHBOURS + 1))
        more, field = _further(solver, pairs, phases, curve, u, v, k, to, seen)
        images = Images(period, -k * np.sin(theta))
        swept = _swept(solver, curve, k, wavelength_nm, polarisation, images, incident, field)
        total = first + more if swept is None else far_amplitudes(curve, *swept, k, to, None)
    norm = 8 * np.pi * k / (2 * k * period) ** 2 / (np.cos(theta) * np.cos(to))
    return np.stack([np.abs(first) ** 2, np.abs(total) ** 2]) * norm


def _further(
    solver: IteratedKirchhoff, pairs: Pairs, phases: Complex, curve: Curve, u: Complex, v: Complex, k: float,
    to: Floats, seen: Any,
) -> tuple[Complex, tuple[Complex, Complex]]:  # fmt: skip
    """Far amplitudes of the second and all later reflections; u and v of all reflections."""
    total, every = np.zeros(len(to), np.complex128), (u, v)
    start = curve.ds @ (np.abs(u) ** 2 + np.abs(v / k) ** 2)
    for _ in range(1, solver.bounces):
        wide_u, wide_v = (np.outer(phases, f).ravel() for f in (u, v))
        new_u, new_v = pairs.next(wide_u, wide_v)
        # a block that is missing gives zeros of the wide shape
        u, v = (f if len(f) == len(curve) else np.zeros(len(curve), np.complex128) for f in (new_u, new_v))
        if curve.ds @ (np.abs(u) ** 2 + np.abs(v / k) ** 2) <= solver.tol * start:
            break
        total += far_amplitudes(curve, u, v, k, to, seen)
        every = every[0] + u, every[1] + v
    return total, every


def _swept(
    solver: IteratedKirchhoff, curve: Curve, k: float, wavelength_nm: float, polarisation: str, images: Images,
    incident: tuple[Complex, Complex], start: tuple[Complex, Complex],
) -> tuple[Complex, Complex] | None:  # fmt: skip
    """u and v after sweeps over one period, None where there are none or where they do not settle."""
    material: Material = solver.material  # type: ignore[assignment]
    rule, _ = rule_of(material, wavelength_nm, 2 * np.pi / k / float(curve.ds.max()))
    if not solver.sweeps or rule is None:
        return None
    equation = Equation.of(curve, k, material, wavelength_nm, polarisation, rule, images)
    light, fields = (tuple(f[:, None] for f in pair) for pair in (incident, start))
    found = sweep(equation, light, fields, solver.sweeps, solver.tol, BLOCK)  # type: ignore[arg-type]
    return (found.u[:, 0], found.v[:, 0]) if found.change[0] <= SETTLED else None
