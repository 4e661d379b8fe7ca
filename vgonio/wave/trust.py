"""How far the scalar theories are from rigorous solutions, and what that says of a surface: one evidence for the plan
and the verdict.

Two tables. `rigorous_gratings.csv`: for every order of aluminium gratings the rigorous efficiency in TE and TM (RCWA by
two independent codes; coordinate method of Chandezon) and what the three theories make of it, made by
`benchmarks/rigorous_gratings.py`. `rigorous_profiles.csv`: errors of the theories on ensembles of Gaussian profiles
against the full-wave solver, made by `benchmarks/rigorous_profiles.py`. The theories know no polarisation: they are
compared with the mean of TE and TM.
"""

from __future__ import annotations

import csv
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from ..surface.heightfield import Heightfield
from ..surface.statistics import parameters
from .theories import THEORIES

FILE = Path(__file__).with_name("rigorous_gratings.csv")
PROFILES = Path(__file__).with_name("rigorous_profiles.csv")
NEAR = 3  # lines of the tables that an expectation is made from
SCALE_DEG = 25.0  # a difference of the angle of incidence that counts as much as a factor 2 in depth or period
ALIKE = 2.0  # a surface is like a tested one whose depth, period and slope are within this factor
OUTSIDE_DEG = 5.0  # and whose angles end no further below
METAL = 0.4  # reflectance at normal incidence from which on a material counts as a metal
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
    """One line of the tables; depth and period in wavelengths, RMS slope (infinite for walls).

    A Gaussian profile has the depth and period of the sinusoid of its Sq and slope, see `equivalent_grating`.
    error : by theory, Σ|scalar − rigorous| / Σ rigorous over orders or directions, rigorous the mean of TE and TM
    polarisation : Σ|TE − TM| / Σ (TE + TM), what no scalar theory can tell apart; NaN for profiles
    back_share, back : light on the side of the source, and the theories' errors there; NaN and empty for gratings
    reach : decades below the peak down to which Kirchhoff is within a factor 1.25 everywhere; NaN for gratings
    """

    shape: str
    depth: float
    period: float
    slope: float
    theta_i_deg: float
    error: dict[str, float]
    polarisation: float = math.nan
    metal: bool = True
    back_share: float = math.nan
    back: dict[str, float] = field(default_factory=dict)
    reach: float = math.nan

    @property
    def sq(self) -> float:
        """Sq over λ."""
        return self.depth / (2 * math.sqrt(2) if self.shape != "lamellar" else 2.0)

    @property
    def correlation(self) -> float:
        """T over λ of the Gaussian surface of the same Sq and slope, √2 Sq/slope."""
        return self.period / (math.sqrt(2) * math.pi)

    def __str__(self) -> str:
        what = "profiles" if self.shape == "gaussian" else f"a {self.shape} grating"
        slope = f"slope {self.slope:.2g}" if math.isfinite(self.slope) else f"period/λ {self.period:.2g}"
        return f"{what} of Sq/λ {self.sq:.2g}, {slope} at θ_i = {self.theta_i_deg:g}°"


@dataclass(frozen=True)
class Expectation:
    """What rigorous solutions say of a theory on a surface.

    error : (least, likely, most) on the lines of the tables it rests on; NaN where there are none
    basis : "alike" (tested surfaces within ALIKE of this one), "harder" (none alike, but one at least as steep, as fine
        and lit at least as obliquely: its error bounds this one's, as theories of tangent planes get better the gentler
        and wider the features are, and exact in the limit), "none"
    beyond : how the surface differs from all that was tested, in words;  nearest : the line of the table most like it
    """

    theory: str
    theta_i_deg: float
    wavelength_nm: float
    error: tuple[float, float, float]
    basis: str
    beyond: tuple[str, ...]
    nearest: Case

    @property
    def off(self) -> float:
        """The likely error, NaN without a test that says it."""
        return self.error[1]

    @property
    def short(self) -> str:
        """In a few words, for a table."""
        if self.basis == "none":
            return f"{self.theory}: no test is like this surface at {self.theta_i_deg:g}° ({', '.join(self.beyond)})"
        sure = "likely" if self.basis == "alike" else "at most (on steeper and finer surfaces, none is alike)"
        return f"{self.theory} {sure} {self.off:.1%} of the light, worst at {self.theta_i_deg:g}°"

    def __str__(self) -> str:
        least, likely, most = self.error
        where = f"at θ_i = {self.theta_i_deg:g}°, {self.wavelength_nm:g} nm"
        if self.basis == "none":
            return f"{self.theory}: no test is like this surface {where}: {', '.join(self.beyond)}"
        if self.basis == "harder":
            return (
                f"{self.theory} is off by up to {likely:.1%} of the light {where}, as on steeper and finer "
                f"{self.nearest}; none is like this surface: {', '.join(self.beyond)}"
            )
        return (
            f"{self.theory} is likely off by {likely:.1%} ({least:.1%} … {most:.1%}) of the light {where}, as it is on "
            "the rigorous gratings and profiles most like this surface"
        )


@lru_cache(maxsize=1)
def profiles() -> tuple[Case, ...]:
    """The ensembles of Gaussian profiles, one for each angle."""
    with PROFILES.open(encoding="utf-8", newline="") as file:
        return tuple(_profile(line) for line in csv.DictReader(file))


def _profile(line: dict[str, str]) -> Case:
    sigma, correlation, theta = (float(line[k]) for k in ("sigma", "correlation", "theta_i_deg"))
    return Case(
        "gaussian",
        2 * math.sqrt(2) * sigma,
        math.sqrt(2) * math.pi * correlation,
        math.sqrt(2) * sigma / correlation,
        theta,
        {t: float(line[t]) for t in THEORIES},
        metal=line["material"] != "SiO2",
        back_share=float(line["back_share"]),
        back={t: float(line[f"back_{t}"]) for t in THEORIES},
        reach=float(line["reach"]),
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
    return "sinusoidal", 2 * np.sqrt(2) * sq, 2 * np.pi * sq / max(steepest_slope(parameters(surface)), 1e-300)


def steepest_slope(known: Mapping[str, float]) -> float:
    """RMS slope along the steeper axis, from `surface.statistics.parameters` or a summary of them."""
    return max(float(known["alpha_x"]), float(known["alpha_y"])) / math.sqrt(2)


def _dominant_period(surface: Heightfield) -> float:
    """One over the mean frequency of the power along x, µm."""
    power = np.mean(np.abs(np.fft.rfft(surface.z - surface.z.mean(), axis=1)) ** 2, axis=0)[1:]
    frequency = np.fft.rfftfreq(surface.shape[1], surface.pitch_um[1])[1:]
    if power.sum() == 0:
        return float(surface.size_um[1])
    return float(power.sum() / (power @ frequency))


def is_metal(name: str | None, wavelength_nm: float) -> bool:
    """Whether a material reflects like one; True where that is not known."""
    from ..materials import material

    made = material(known_material(name, [wavelength_nm]))
    return float(np.max(made.reflectance(1.0, wavelength_nm))) >= METAL


def known_material(name: str | None, wavelength_nm: Sequence[float]) -> str:
    """The name, or "perfect" where no material of that name is known at these wavelengths (it was a file)."""
    from ..errors import VgonioError
    from ..materials import material

    try:
        made = material(name or "perfect")
        for w in wavelength_nm:
            made.reflectance(1.0, w)
    except (VgonioError, OSError, ValueError):
        return "perfect"
    return name or "perfect"


def expected(
    theory: str,
    shape: str,
    depth_um: float,
    period_um: float,
    theta_i_deg: float,
    wavelength_nm: float,
    metal: bool = True,
) -> Expectation:
    """The error to expect of a theory on a surface with such an `equivalent_grating`.

    Likely is the mean over the NEAR most similar lines of the tables (gratings with walls for these, sinusoids and
    Gaussian profiles for smooth surfaces), weighted with one over the squared distance in log₂ depth/λ, log₂ period/λ
    and θ_i/SCALE_DEG; where none is alike, the error of the most similar of those that are harder, see `Expectation`.
    """
    wavelength = wavelength_nm * 1e-3
    depth, period, theta = depth_um / wavelength, period_um / wavelength, abs(theta_i_deg)
    known = [
        c for c in (*cases(), *profiles()) if (c.shape == "lamellar") == (shape == "lamellar") and c.metal == metal
    ]
    if not known:  # walls of glass
        known = [c for c in cases() if c.shape == shape]
    d, p, t = (np.array([getattr(c, name) for c in known]) for name in ("depth", "period", "theta_i_deg"))
    deeper, wider = np.log2(max(depth, 1e-9) / d), np.log2(period / p)
    away = deeper**2 + wider**2 + ((theta - t) / SCALE_DEG) ** 2
    order = np.argsort(away, kind="stable")
    near, nearest = order[:NEAR], known[order[0]]
    steeper = deeper - wider
    alike = max(abs(c[order[0]]) for c in (deeper, wider, steeper)) <= np.log2(ALIKE) * (1 + 1e-6)
    if alike and theta <= t.max() + OUTSIDE_DEG:
        error = np.array([known[i].error[theory] for i in near])
        weight = 1 / (away[near] + 1e-6)
        found = (float(error.min()), float(weight @ error / weight.sum()), float(error.max()))
        return Expectation(theory, theta, wavelength_nm, found, "alike", (), nearest)
    beyond = _beyond(depth, period, theta, known, nearest)
    deep = min(depth, float(d.max())) / ALIKE  # shallower ones hide the error behind what no roughness touches
    harder = [i for i in order if steeper[i] <= 1e-6 and wider[i] >= 0 and t[i] >= theta - OUTSIDE_DEG and d[i] >= deep]
    oblique = theory == "harvey-shack" and 1 / np.cos(np.deg2rad(min(theta, 89.0))) > PHASE
    if oblique:  # its phase is wrong however wide the features
        beyond = ("harvey-shack's phase q_z = 2k holds near the normal only",)
    if not harder or shape == "lamellar" or oblique:
        return Expectation(theory, theta, wavelength_nm, (math.nan,) * 3, "none", beyond, nearest)
    bound = known[harder[0]]
    return Expectation(theory, theta, wavelength_nm, (0.0, *[bound.error[theory]] * 2), "harder", beyond, bound)


def _beyond(depth: float, period: float, theta: float, known: list[Case], nearest: Case) -> tuple[str, ...]:
    """How a surface differs from what was tested: quantities outside of all that was, else from the nearest."""
    here = Case(nearest.shape, depth, period, np.pi * depth / (np.sqrt(2) * period), theta, {})
    names = {"Sq/λ": "sq", "correlation length/λ": "correlation", "slope": "slope"}
    if nearest.shape == "lamellar":
        names = {"depth/λ": "depth", "period/λ": "period"}
    found = []
    for words, name in names.items():
        value, tested = getattr(here, name), [getattr(c, name) for c in known]
        least, most = min(tested), max(tested)
        if value > most * 1.005 or value < least / 1.005:
            factor = max(value / most, least / max(value, 1e-12))
            found.append(f"{words} {value:.2g} is {factor:.2g} times beyond the tested {least:.2g} … {most:.2g}")
    most = max(c.theta_i_deg for c in known)
    if theta > most + OUTSIDE_DEG:
        found.append(f"θ_i {theta:g}° is beyond the tested {most:g}°")
    if not found:
        found = [
            f"{words} {getattr(here, name):.2g} beside {getattr(nearest, name):.2g} of the nearest"
            for words, name in names.items()
            if abs(math.log2(getattr(here, name) / getattr(nearest, name))) > 0.5
        ]
    return tuple(found)
