"""The cases: what is simulated, what the right answer is and where it comes from.

A case is run at several settings, from cheap to dear. At each it gives the error achieved relative to the largest
value, the error that the solver stated, and the one that was asked for where one can ask.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

NAN = math.nan


@dataclass(frozen=True)
class Outcome:
    """Relative errors of one run: asked for (NaN where one cannot ask), stated by the solver (NaN), achieved."""

    asked: float
    stated: float
    achieved: float


@dataclass(frozen=True)
class Case:
    """One known answer: `run(setting)` simulates and compares. `quick` settings take about a second together."""

    name: str
    solver: str
    answer: str
    unit: str
    settings: tuple[float, ...]
    quick: tuple[float, ...]
    run: Callable[[float], Outcome]


# ---- the surface integral
PERIOD_UM, AMPLITUDE_UM = 2.0, 0.15


def _grating_vectors(orders: np.ndarray) -> np.ndarray:
    """(n, 3) scattering vectors of orders of a 2 µm grating at q_z of 400 to 700 nm, in rad/µm."""
    qz = 2 * np.pi * np.array([2.0, 1.6, 1.2]) / np.array([0.4, 0.55, 0.7])
    m, z = (a.ravel() for a in np.meshgrid(orders, qz))
    return np.stack([2 * np.pi * m / PERIOD_UM, np.zeros(m.size), z], axis=1)


def _sinusoid(method: str) -> Callable[[float], Outcome]:
    def run(tol: float) -> Outcome:
        from scipy.special import jv

        from ..surface import sinusoid
        from ..wave.fourier import evaluate

        surface = sinusoid(
            period_um=PERIOD_UM, amplitude_um=AMPLITUDE_UM, shape=(4, 1600), pitch_um=0.0125
        )  # its spline errs by 5e-10
        q = _grating_vectors(np.arange(-6, 7))
        found = evaluate(surface, q, None, method, tol)
        order = np.round(q[:, 0] * PERIOD_UM / (2 * np.pi)).astype(int)
        # crest at x = 0; S = area · (−i)^m J_m(q_z a)
        expected = surface.area_um2 * (-1j) ** np.abs(order) * jv(np.abs(order), q[:, 2] * AMPLITUDE_UM)
        return Outcome(tol, found.error, _distance(found.S, expected))

    return run


def _lamellar(tol: float) -> Outcome:
    from ..surface import lamellar
    from ..wave.fourier import evaluate

    depth, shape, pitch = 0.25, (8, 400), 0.05
    surface = lamellar(period_um=PERIOD_UM, depth_um=depth, shape=shape, pitch_um=pitch)
    q = _grating_vectors(np.arange(-6, 7))
    found = evaluate(surface, q, None, "nufft", tol)
    # every texel is a flat square: its own transform, summed over one period in closed form
    x, z = surface.x, surface.z[0]
    texel = pitch * np.sinc(q[:, 0] * pitch / (2 * np.pi)) * surface.size_um[0]
    expected = texel * np.exp(-1j * (q[:, :1] * x + q[:, 2:] * z)).sum(axis=1)
    return Outcome(tol, found.error, _distance(found.S, expected))


def _distance(found: np.ndarray, expected: np.ndarray) -> float:
    """‖Δ‖₂ / ‖expected‖₂, the measure in which the integral's tolerance is meant."""
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


# ---- solvers of waves
def _gaussian_ensemble(points: float) -> Outcome:
    """Mean over windows of a Gaussian surface against the ensemble's mean (Beckmann and Spizzichino 1963)."""
    from ..measure import Gonioreflectometer
    from ..surface import gaussian
    from ..wave import Kirchhoff
    from ..wave.closed_forms import beckmann

    rms, correlation, coherence, wavelength = 0.2, 2.0, 5.0, 550.0
    surface = gaussian(rms, correlation, shape=(int(points), int(points)), pitch_um=0.5, seed=3)
    gonio = Gonioreflectometer([30], np.arange(-60, 31, 10), aperture_deg=2.0, coherence_um=coherence)
    data = gonio.measure(surface, Kirchhoff("perfect", [wavelength], tol=1e-4)).isel(theta_i=0, wavelength=0)
    theta = np.deg2rad(data["theta_o"].values)
    wi = np.array([np.sin(np.deg2rad(30.0)), 0.0, np.cos(np.deg2rad(30.0))])
    wo = np.stack([np.sin(theta), 0 * theta, np.cos(theta)], axis=1)
    expected = beckmann("kirchhoff", wi, wo, wavelength, rms, correlation, coherence)
    scale = expected.max()
    stated = float(np.sqrt(np.mean(data["brdf_stderr"].values ** 2)) / scale)
    return Outcome(NAN, stated, float(np.sqrt(np.mean((data["brdf"].values - expected) ** 2)) / scale))


def _full_wave(tol: float) -> Outcome:
    """Energy of a loss-free grating, TE and TM: nothing but the discretisation makes it differ from 1."""
    from ..surface import sinusoid
    from ..wave import FullWave

    surface = sinusoid(period_um=PERIOD_UM, amplitude_um=0.3, shape=(1, 80), pitch_um=0.025)
    data = FullWave("perfect", [633.0], tol=tol).orders(surface, [0.0, 25.0])
    total = data["efficiency"].sum("order").values
    return Outcome(tol, float(data.attrs.get("error_achieved", NAN)), float(np.abs(total - 1).max()))


def _iterated(bounces: float) -> Outcome:
    """Windows of a steep loss-free rough profile against the rigorous solution: the error of the theory."""
    from ..measure import Gonioreflectometer
    from ..surface import gaussian
    from ..wave import FullWave, IteratedKirchhoff

    made = gaussian(0.5, 1.4, shape=(64, 160), pitch_um=0.15, seed=4)
    surface = made.replace(z=np.repeat(made.z[:1], 4, axis=0), periodic=False)
    gonio = Gonioreflectometer([20], range(-80, 81, 5), aperture_deg=5.0, coherence_um=3.0)
    exact = gonio.measure(surface, FullWave("perfect", [633.0], tol=1e-3))["brdf"].values
    found = gonio.measure(surface, IteratedKirchhoff("perfect", [633.0], bounces=int(bounces), beam="tapered"))[
        "brdf"
    ].values
    return Outcome(NAN, NAN, float(np.linalg.norm(found - exact) / np.linalg.norm(exact)))


# ---- rays
def _v_groove(rays: float) -> Outcome:
    """Share of double reflections in a 90° groove at 30°: 1 − tan θ_i."""
    from ..geometric import RayOptics
    from ..measure import Gonioreflectometer
    from ..surface import Heightfield

    surface = Heightfield(np.tile([0.0, 1.0], (4, 8)), pitch_um=1.0, periodic=True, interpolation="linear")
    data = Gonioreflectometer([30], [30], aperture_deg=5).measure(
        surface, RayOptics("perfect", wavelength_nm=[500.0], rays=int(rays), seed=1)
    )
    expected = 1 - math.tan(math.radians(30))
    found = float(data["energy_by_bounce"].sel(bounce=2).squeeze())
    return Outcome(NAN, math.sqrt(expected * (1 - expected) / rays), abs(found - expected))


def _furnace(rays: float) -> Outcome:
    """All tallies of a steep loss-free surface at 75° add up to 1."""
    from ..geometric import RayOptics
    from ..measure import Gonioreflectometer
    from ..surface import gaussian

    surface = gaussian(1.0, 2.5, shape=(64, 64), pitch_um=0.5, seed=2)
    data = Gonioreflectometer([75], [0]).measure(surface, RayOptics("perfect", [500.0], rays=int(rays), seed=1))
    total = data["energy_by_bounce"].sum("bounce") + data["energy_absorbed"] + data["energy_lost"]
    return Outcome(1e-6, NAN, float(abs(total - 1).max()))


def _ray_cone(tol: float) -> Outcome:
    """A 2° cone on a Gaussian surface to a standard error, against ten times as many rays of another seed."""
    from ..geometric import RayOptics
    from ..measure import Gonioreflectometer
    from ..surface import gaussian

    surface = gaussian(0.8, 4.0, shape=(96, 96), pitch_um=0.5, seed=5)
    gonio = Gonioreflectometer([30], range(-70, 71, 10), aperture_deg=2.0)
    data = gonio.measure(surface, RayOptics("Al", [550.0], tol=tol, rays=10**7, seed=1))
    exact = gonio.measure(surface, RayOptics("Al", [550.0], tol=0.003, rays=10**7, seed=2))["brdf"].values
    bright = exact > 1e-3 * exact.max()
    relative = (data["brdf"].values - exact)[bright] / exact[bright]
    stated = (data["brdf_stderr"].values[bright] / exact[bright]).max()
    return Outcome(tol, float(stated), float(np.sqrt(np.mean(relative**2))))


def _tolerances(least: int, most: int) -> tuple[float, ...]:
    return tuple(10.0**-n for n in range(least, most + 1))


J = "J_m(q_z a)², closed form"
#: Name → `Case`: every solver on a case whose answer is known, as `vgonio accuracy --list` prints them.
CASES: dict[str, Case] = {
    c.name: c
    for c in (
        Case("sinusoid-nufft", "surface_fourier, nufft", J, "tol", _tolerances(1, 8), (1e-2, 1e-6), _sinusoid("nufft")),
        Case(
            "sinusoid-opencl", "surface_fourier, opencl", J, "tol", _tolerances(1, 4), (1e-2, 1e-4), _sinusoid("opencl")
        ),
        Case(
            "sinusoid-reference", "surface_fourier, reference", J, "tol", _tolerances(1, 8), (1e-2, 1e-6),
            _sinusoid("reference"),
        ),
        Case("lamellar", "surface_fourier, nufft", "sum of flat texels", "tol", _tolerances(1, 8), (1e-3,), _lamellar),
        Case(
            "gaussian", "Kirchhoff", "ensemble mean (Beckmann–Spizzichino)", "points a side", (64, 128, 256, 512),
            (64, 128), _gaussian_ensemble,
        ),
        Case(
            "full-wave", "FullWave", "energy of a loss-free grating", "tol", _tolerances(1, 6), (1e-2, 1e-4), _full_wave
        ),
        Case(
            "steep-profile", "IteratedKirchhoff", "FullWave", "reflections", (1, 2, 3, 4), (1,), _iterated
        ),
        Case("v-groove", "RayOptics", "1 − tan θ_i", "rays", (1e3, 1e4, 1e5, 1e6), (1e3, 1e4), _v_groove),
        Case("furnace", "RayOptics", "1", "rays", (1e3, 1e4, 1e5), (1e3,), _furnace),
        Case(
            "ray-cone", "RayOptics", "a run to 0.3 % with another seed", "tol", (0.1, 0.03, 0.01), (0.1,), _ray_cone
        ),
    )
}  # fmt: skip


def as_text(setting: float, unit: str) -> str:
    return f"{unit} {setting:.0e}" if setting < 1 or setting >= 1e3 else f"{setting:g} {unit}"


def names() -> list[str]:
    return list(CASES)


def require(name: Any) -> Case:
    """The case of that name; InputError with the nearest one otherwise."""
    from ..errors import InputError, nearest

    if name not in CASES:
        raise InputError(f"unknown case {name!r}: {nearest(name, CASES)}")
    return CASES[name]
