"""Gratings through the common interface: efficiencies of the orders, and their BRDF under a coherence window."""

from __future__ import annotations

import json
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ...dataset import label, plain
from ...directions import angle_list
from ...errors import InputError
from ...surface.heightfield import Heightfield
from ...units import nm_to_um, radians
from . import effort, profile, remarks
from .detection import element_means
from .outcome import Outcome, Task
from .panels import Floats
from .periodic import Diffraction, Grating
from .windows import taper_of

if TYPE_CHECKING:
    from .solver import FullWave

Table = list[list[Diffraction]]  # by polarisation and angle of incidence


def solved(
    solver: FullWave, surface: Heightfield, theta: Floats, wavelength_nm: float, polarisations: tuple[str, ...],
    tell: effort.Part,
) -> tuple[Table, float]:  # fmt: skip
    """Orders of one wavelength for θ_i (radians), and the error of their efficiencies."""
    wavelength, index = float(nm_to_um(wavelength_nm)), solver.index(wavelength_nm)
    period = profile.period_of(surface, wavelength)

    def price(nodes: int) -> effort.Cost:
        return effort.cost(nodes, index, len(polarisations), len(theta), True)

    def run(round_: int, part: effort.Part) -> tuple[Floats, Table, float]:
        how = effort.resolution(surface, wavelength, index, solver.tol, round_)
        span, what = profile.period_span(surface, wavelength), f"a period of {period:.3g} µm at {wavelength_nm:g} nm"
        curve = effort.affordable(surface, span, how, price, what)
        with effort.threads(curve.size):
            grating = Grating.of(curve, period, wavelength, index, polarisations)
            found: list[list[Diffraction]] = []
            for t in theta:
                part((1 + len(found)) / (1 + len(theta)))
                found.append(grating.diffract(float(t), polarisations))
        table = [[one[p] for one in found] for p in range(len(polarisations))]
        every = [d for row in table for d in row]
        return _rows(every), table, max(abs(1 - d.reflected - d.absorbed) for d in every)

    _, table, error = effort.converged(run, solver.tol, tell)
    return table, error


def _rows(found: list[Diffraction]) -> Floats:
    """(r, m) efficiencies, zeros where a row has fewer orders."""
    out = np.zeros((len(found), max(len(d.efficiency) for d in found)))
    for row, d in zip(out, found):
        row[: len(d.efficiency)] = d.efficiency
    return out


def orders(solver: FullWave, surface: Heightfield, theta_i_deg: Any) -> xr.Dataset:
    """See `FullWave.orders`."""
    start = time.perf_counter()
    profile.require_profile(surface)
    if not surface.periodic:
        raise InputError(
            f"{surface.name or 'the surface'} is not periodic: orders are for gratings (periodic = true); use scatter"
        )
    theta = angle_list(theta_i_deg, "theta_i_deg")
    polarisations = ("TE", "TM") if solver.polarisation == "both" else (solver.polarisation,)
    wavelengths = np.asarray(solver.wavelength_nm, float)
    found = []
    for n, w in enumerate(wavelengths):
        found.append(solved(solver, surface, radians(theta), float(w), polarisations, solver.teller(n)))
        solver.teller(n)(1.0)
    said = [r for (table, _), w in zip(found, wavelengths) for r in _remarks(table, float(w), theta)]
    error = max(e for _, e in found)
    solver.warn(error, said)
    data = _orders_dataset([table for table, _ in found], theta, wavelengths, polarisations)
    data.attrs = solver.attributes(surface) | {
        "period_um": surface.period_um or surface.size_um[1],
        "unknowns": max(d.unknowns for table, _ in found for row in table for d in row),
        "error_achieved": error,
        "error_estimate": "largest difference from efficiencies on coarser panels, relative to the largest, "
        "or the error of the energy balance where that is larger",
        "remarks": json.dumps(said, ensure_ascii=False),
        "seconds": time.perf_counter() - start,
    }
    data.attrs = {key: plain(value) for key, value in data.attrs.items()}
    return label(data)


def _orders_dataset(tables: list[Table], theta: Floats, wavelengths: Floats, polarisations: tuple) -> xr.Dataset:
    every = [(w, p, t, d) for w, table in enumerate(tables) for p, row in enumerate(table) for t, d in enumerate(row)]
    most = max(int(np.abs(d.order).max(initial=0)) for *_, d in every)
    shape = (len(theta), 2 * most + 1, len(wavelengths), len(polarisations))
    efficiency, sine = np.zeros(shape), np.full(shape[:3], np.nan)
    names = ("reflected", "absorbed", "transmitted", "condition", "residual")
    single = {name: np.empty((len(theta), len(wavelengths), len(polarisations))) for name in names}
    for w, p, t, d in every:
        efficiency[t, d.order + most, w, p] = d.efficiency
        sine[t, d.order + most, w] = d.sine
        for name in names:
            single[name][t, w, p] = getattr(d, name)
    over = ("theta_i", "wavelength", "polarisation")
    variables = {
        "efficiency": (("theta_i", "order", "wavelength", "polarisation"), efficiency),
        "energy_reflected": (over, single["reflected"]),
        "energy_absorbed": (over, single["absorbed"]),
        "energy_transmitted": (over, single["transmitted"]),
        "energy_balance": (over, single["reflected"] + single["absorbed"]),
        "condition_number": (over, single["condition"]),
        "residual": (over, single["residual"]),
    }
    coords = {
        "theta_i": theta,
        "order": np.arange(-most, most + 1),
        "wavelength": wavelengths,
        "polarisation": list(polarisations),
        "theta_o": (("theta_i", "order", "wavelength"), np.degrees(np.arcsin(np.clip(sine, -1, 1)))),
    }
    return xr.Dataset(variables, coords)


def _remarks(table: Table, wavelength_nm: float, theta: Floats) -> list[str]:
    every = [d for row in table for d in row]
    worst = remarks.Quality.worst(
        [remarks.Quality(d.unknowns, d.condition, d.residual, abs(1 - d.reflected - d.absorbed)) for d in every]
    )
    said = worst.remarks()
    for i, t in enumerate(theta):
        said += remarks.of_grating([row[i] for row in table], wavelength_nm * 1e-3, float(t))
    return said


def scattered(task: Task) -> Outcome:
    """One wavelength of `scatter`: every order a Gaussian lobe, as wide as the coherence window diffracts.

    Efficiencies are those of the middle of the beam's spectrum, and the mean over all places of the window.
    """
    surface, nm = task.surface, task.wavelength_nm
    table, error = solved(task.solver, surface, task.theta, nm, task.polarisations, task.tell)
    task.tell(1.0)
    k, taper = 2 * np.pi / float(nm_to_um(nm)), taper_of(task.incoming, surface)

    def means(d: Diffraction) -> Floats:
        return element_means(task.detector, task.sign, k, taper, _lobes(d, k * taper), 8 * k * taper)[0]

    brdf = np.stack([np.concatenate([means(d) for d in row]) for row in table])
    arrays = {
        name: np.array([[getattr(d, name) for d in row] for row in table])
        for name in ("reflected", "absorbed", "condition", "residual")
    }
    return Outcome(
        brdf=brdf,
        lost=np.zeros(brdf.shape[:2]),
        stderr=np.broadcast_to(error * brdf.max(axis=-1, keepdims=True), brdf.shape),
        unknowns=max(d.unknowns for row in table for d in row),
        error=error,
        remarks=_remarks(table, nm, task.incoming.theta_deg),
        attrs={
            "coherence_um": taper,
            "period_um": surface.period_um or surface.size_um[1],
            "stderr_estimate": "numerical, an ideal grating has no spread: error_achieved of the largest value",
            "edges": "periodic: orders of the grating, spread by the coherence window",
        },
        **arrays,
    )


def _lobes(d: Diffraction, width: float) -> Any:
    """Power per unit of s_x of the orders: |window|² is Gaussian, exp(−(kℓ Δs)²), `width` = kℓ."""

    def p(sine: Floats) -> Floats:
        away = np.exp(-((width * (sine[:, None] - d.sine)) ** 2))
        return (away @ d.efficiency * width / np.sqrt(np.pi))[None]

    return p
