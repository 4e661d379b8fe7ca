"""How far the scalar theories are from rigorous efficiencies of gratings, and what that says of a surface.

The table `rigorous_gratings.csv` holds, for every order of aluminium gratings, the rigorous efficiency in TE and TM
(RCWA by two independent codes; coordinate method of Chandezon) and what the three theories make of it; it is made by
`benchmarks/rigorous_gratings.py`. The theories know no polarisation: they are compared with the mean of TE and TM.
"""

from __future__ import annotations

import csv
import itertools
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from ..surface.heightfield import Heightfield
from .theories import THEORIES

FILE = Path(__file__).with_name("rigorous_gratings.csv")
NEAR = 3  # gratings of the table that an expectation is made from
SCALE_DEG = 25.0  # a difference of the angle of incidence that counts as much as a factor 2 in depth or period
OUTSIDE = 1.25  # so much beyond the table's range of depth or period, as a factor, and there is no saying
OUTSIDE_DEG = 5.0  # and so much beyond its angles
STEEP_DEG = 30.0  # a facet steeper than this throws normally incident light onto a neighbour of the same slope
STEEP_SHARE = 0.01  # of the facets: a choice, so that a few noisy points of a smooth surface raise no alarm
SMITH_LIMIT = 1.6  # Walter et al. 2007: masking is negligible for 1/(α tan θ) ≥ 1.6
NOTABLE = 0.05  # error beside rigorous gratings that is worth a warning
# 4π Sq cos θ_i over λ from which on the mean lobe of Gaussian heights is that of their slopes alone, within NOTABLE:
# closed_forms.mean_intensity beside its limit (Beckmann and Spizzichino 1963); 6 % at 3.2, 0.6 % at 10
ROUGH_PHASE = 3.6
PHASE = 1.2  # of harvey-shack's phase over that of the other theories, from which on it is worth one


@dataclass(frozen=True)
class Case:
    """One grating of the table; depth and period in wavelengths, RMS slope (infinite for walls).

    error : by theory, Σ|scalar − rigorous| / Σ rigorous over the orders, rigorous the mean of TE and TM
    polarisation : Σ|TE − TM| / Σ (TE + TM), what no scalar theory can tell apart
    """

    shape: str
    depth: float
    period: float
    slope: float
    theta_i_deg: float
    error: dict[str, float]
    polarisation: float


@dataclass(frozen=True)
class Expectation:
    """Error (least, likely, most) of a theory on the most similar gratings, and where the table has none alike."""

    theory: str
    theta_i_deg: float
    wavelength_nm: float
    error: tuple[float, float, float]
    outside: tuple[str, ...]

    def __str__(self) -> str:
        least, likely, most = self.error
        return (
            f"{self.theory} is likely off by {likely:.1%} ({least:.1%} … {most:.1%}) at θ_i = {self.theta_i_deg:g}°, "
            f"{self.wavelength_nm:g} nm, as it is on the rigorous gratings most like this surface"
        )


@lru_cache(maxsize=1)
def cases() -> tuple[Case, ...]:
    """The gratings of the table."""
    with FILE.open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    keys = ("shape", "depth_um", "period_um", "wavelength_um", "theta_i_deg")
    lines.sort(key=lambda line: [line[k] for k in keys])
    return tuple(
        _case(key, list(group)) for key, group in itertools.groupby(lines, lambda line: [line[k] for k in keys])
    )


def _case(key: list[str], orders: list[dict[str, str]]) -> Case:
    shape, (depth, period, wavelength, theta) = key[0], (float(v) for v in key[1:])
    te, tm = (np.array([float(o[p]) for o in orders]) for p in ("TE", "TM"))
    rigorous = (te + tm) / 2
    error = {
        t: float(np.abs(np.array([float(o[t]) for o in orders]) - rigorous).sum() / rigorous.sum()) for t in THEORIES
    }
    # a sinusoid of amplitude depth/2 has the RMS slope 2π (depth/2)/(√2 period)
    slope = np.pi * depth / (np.sqrt(2) * period) if shape == "sinusoidal" else np.inf
    polarisation = float(np.abs(te - tm).sum() / (te + tm).sum())
    return Case(shape, depth / wavelength, period / wavelength, slope, theta, error, polarisation)


def equivalent_grating(surface: Heightfield) -> tuple[str, float, float]:
    """(shape, depth, period) in µm of the grating that has the surface's Sq and, for smooth ones, its RMS slope.

    A sinusoid has Sq = depth/(2√2) and RMS slope 2π Sq/period, a lamellar one Sq = depth/2 and its first harmonic where
    the spectral density, each frequency counted once, has its centre of gravity. Depth 0 for a plane.
    """
    sq = float(np.std(surface.z))
    if sq == 0:
        return "sinusoidal", 0.0, float(max(surface.size_um))
    if surface.interpolation == "nearest":
        return "lamellar", 2 * sq, surface.period_um or _dominant_period(surface)
    ip = surface.interpolant
    slopes = [np.sqrt(np.mean(ip.grid(surface.y, surface.x, **d) ** 2)) for d in ({"dx": 1}, {"dy": 1})]
    return "sinusoidal", 2 * np.sqrt(2) * sq, float(2 * np.pi * sq / max(slopes))


def _dominant_period(surface: Heightfield) -> float:
    """One over the mean frequency of the power along x, µm."""
    power = np.mean(np.abs(np.fft.rfft(surface.z - surface.z.mean(), axis=1)) ** 2, axis=0)[1:]
    frequency = np.fft.rfftfreq(surface.shape[1], surface.pitch_um[1])[1:]
    if power.sum() == 0:
        return float(surface.size_um[1])
    return float(power.sum() / (power @ frequency))


def expected(
    theory: str, shape: str, depth_um: float, period_um: float, theta_i_deg: float, wavelength_nm: float
) -> Expectation:
    """The error to expect of a theory on such a grating, from the NEAR most similar ones of the table.

    Likely is the mean weighted with one over the squared distance in log₂ depth/λ, log₂ period/λ and θ_i/SCALE_DEG.
    """
    wavelength = wavelength_nm * 1e-3
    depth, period, theta = depth_um / wavelength, period_um / wavelength, abs(theta_i_deg)
    known = [c for c in cases() if c.shape == shape]
    d, p, t = (np.array([getattr(c, name) for c in known]) for name in ("depth", "period", "theta_i_deg"))
    away = np.log2(max(depth, 1e-9) / d) ** 2 + np.log2(period / p) ** 2 + ((theta - t) / SCALE_DEG) ** 2
    near = np.argsort(away, kind="stable")[:NEAR]
    error = np.array([known[i].error[theory] for i in near])
    weight = 1 / (away[near] + 1e-6)
    outside = [
        f"{name} {value:.3g} (the table has {values.min():.2g} … {values.max():.2g})"
        for name, value, values in (("depth/λ", depth, d), ("period/λ", period, p))
        if not values.min() / OUTSIDE <= value <= values.max() * OUTSIDE
    ]
    if theta > t.max() + OUTSIDE_DEG:
        outside.append(f"θ_i {theta:g}° (the table ends at {t.max():g}°)")
    likely = float(weight @ error / weight.sum())
    return Expectation(theory, theta, wavelength_nm, (float(error.min()), likely, float(error.max())), tuple(outside))
