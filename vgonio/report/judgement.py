"""Whether one method may be trusted on a surface at one angle of incidence, and why; `trusted` chooses among them.

From the summary of the surface, what the solver remarks and the evidence of `wave.trust`, the same as the plan's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr

from ..wave import slightly_rough, trust
from ..wave.iterated.limits import GRATING_PERIOD
from . import evidence
from . import quantities as q
from .style import angle
from .tables import first, number, percent


@dataclass(frozen=True)
class Judgement:
    """ok : whether to trust it here;  why : for or against;  off : expected error, NaN where nothing says it

    theta_o : signed directions to trust it in;  tests : the expectations it rests on
    """

    ok: bool
    why: str
    off: float = math.nan
    theta_o: tuple[float, float] | None = None
    tests: tuple[trust.Expectation, ...] = ()
    outside: str = ""


@dataclass(frozen=True)
class Ground:
    """What a summary tells of a surface: Sq in µm, RMS slope along the steeper axis, Beckmann's α, steep share."""

    sq: float
    slope: float
    alpha: float
    steep: float
    profile: bool
    walls: bool

    @staticmethod
    def of(surface: xr.Dataset | None) -> Ground | None:
        """None without a summary, and where it lacks the parameters."""
        needed = {"Sq", "alpha", "alpha_x", "alpha_y"}
        if surface is None or not needed <= set(surface.attrs) or "slope_density" not in surface:
            return None
        a = surface.attrs
        profile = bool(np.ptp(surface["z"].values, axis=0).max() == 0)
        steep = abs(surface["slope"]) > math.tan(math.radians(trust.STEEP_DEG))
        density = surface["slope_density"]
        share = float(density.where(steep, 0.0).sum() / max(float(density.sum()), 1e-300))
        walls = a.get("interpolation") == "nearest"
        return Ground(float(a["Sq"]), trust.steepest_slope(a), float(a["alpha"]), share, profile, walls)

    @property
    def grating(self) -> tuple[str, float, float]:
        """(shape, depth, period) as `trust.equivalent_grating` of a smooth surface has it."""
        return "sinusoidal", 2 * math.sqrt(2) * self.sq, 2 * math.pi * self.sq / max(self.slope, 1e-300)

    @property
    def smith_deg(self) -> float:
        """Angle beyond which shadows matter."""
        return math.degrees(math.atan(1 / (trust.SMITH_LIMIT * max(self.alpha, 1e-300))))


def judge(theory: str, data: xr.Dataset, ground: Ground | None, rays: xr.Dataset | None, theta: float) -> Judgement:
    """Of one method of a result at θᵢ = `theta` in degrees."""
    if theory == "full-wave":
        return _rigorous(data)
    if theory == "iterated-kirchhoff":
        remarks = _remarks(data)
        if remarks:
            return Judgement(False, remarks[0])
        if data.attrs.get("sweeps_done", 0) and not data.attrs.get("diffraction_left_out"):
            return Judgement(
                True, "multiple reflections with diffraction, 0.8 to 1.7 % from the full wave on profiles in its range"
            )
        theory = "kirchhoff"  # what is left of it: good where the light is reflected once
    if ground is None:
        return Judgement(False, "the result carries no summary of its surface to judge it by")
    if ground.sq == 0:
        return Judgement(True, "the surface is flat")
    nm = data["wavelength"].values
    if theory == "rays":
        return _rays(ground, float(nm.max()) * 1e-3, theta)
    return _once(theory, data, ground, rays, theta, sorted({float(nm.min()), float(nm.max())}))


def _rigorous(data: xr.Dataset) -> Judgement:
    error = float(first(data.attrs, "error_achieved", default=math.nan))
    if not error <= trust.NOTABLE:
        return Judgement(False, f"its numerical error is {percent(error)}")
    remarks = _remarks(data)
    return Judgement(
        True,
        f"rigorous, numerical error {percent(error)} of the largest BRDF"
        + (f"; mind: {remarks[0]}" if remarks else ""),
    )


def _rays(ground: Ground, wavelength_um: float, theta: float) -> Judgement:
    wide = ground.grating[2] / wavelength_um
    deep = 4 * math.pi * ground.sq * math.cos(math.radians(theta)) / wavelength_um
    if ground.walls or wide < GRATING_PERIOD or deep < trust.ROUGH_PHASE:
        size = f"features are {number(wide, 2)} wavelengths wide and heights {number(ground.sq / wavelength_um, 2)}"
        return Judgement(False, f"no diffraction in it, and {size}")
    return Judgement(True, f"features are {number(wide, 2)} wavelengths wide, so that diffraction matters little")


def _once(
    theory: str, data: xr.Dataset, ground: Ground, rays: xr.Dataset | None, theta: float, nm: list[float]
) -> Judgement:
    """Of a theory of single reflections."""
    many = _share(rays, theta)
    if ground.walls:
        return Judgement(False, "vertical walls, where tangent planes are off by 4 to 19 %")
    if ground.steep > trust.STEEP_SHARE or many > trust.NOTABLE:
        shown = many if many > trust.NOTABLE else ground.steep
        what = (
            "of the light is reflected more than once"
            if many > trust.NOTABLE
            else f"is steeper than {trust.STEEP_DEG:g}°"
        )
        return Judgement(False, f"single reflections only, and {percent(shown)} {what}")
    if abs(theta) > ground.smith_deg:
        return Judgement(False, f"beyond {number(ground.smith_deg, 2)}° shadows matter")
    return _tested(theory, data, ground, theta, nm)


def _tested(theory: str, data: xr.Dataset, ground: Ground, theta: float, nm: list[float]) -> Judgement:
    """By what rigorous solutions say of surfaces like this one, and of slightly rough ones."""
    name = str(data.attrs.get("material", "")) or None
    tests = tuple(trust.expected(theory, *ground.grating, theta, w, trust.is_metal(name, w)) for w in nm)
    none = [e for e in tests if e.basis == "none"]
    if none:
        return Judgement(False, f"no test is like this surface, {'; '.join(none[0].beyond)}".replace("θ_i", "θᵢ"))
    worst = max(tests, key=lambda e: e.off)
    if worst.off > trust.NOTABLE:
        return Judgement(False, evidence.bound(worst), worst.off)
    widest = min(ground.smith_deg, slightly_rough.WIDEST_DEG)
    if 4 * math.pi * ground.sq <= slightly_rough.SLIGHT_PHASE * min(nm) * 1e-3:
        light = str(data.attrs.get("polarisation", ""))
        light = light if light in ("s", "p") else "unpolarised"
        of = trust.known_material(name, nm)
        ends = [slightly_rough.directions(theory, theta, w, of, light) for w in nm]
        if any(e is None for e in ends):
            return Judgement(False, "on slightly rough surfaces it is wrong even in the mirror direction", worst.off)
        known = [e for e in ends if e is not None]
        theta_o = (max(-widest, *(e.low for e in known)), min(widest, *(e.high for e in known)))
        outside = (
            f"The surface is slightly rough: these θₒ are where {q.THEORIES[theory]} is within "
            f"{percent(slightly_rough.WITHIN)} of Rayleigh–Rice for {light} light on {of}, direction by direction; "
            f"beyond, up to ±{slightly_rough.WIDEST_DEG}°, it is {number(min(e.least for e in known), 2)} … "
            f"{number(max(e.most for e in known), 2)} times that (θᵢ = {angle(theta)})."
        )
        slight = f"there within {percent(slightly_rough.WITHIN)} of rigorous first-order theory, as heights are small"
        return Judgement(True, slight, worst.off, theta_o, tests, outside)
    return Judgement(True, evidence.bound(worst), worst.off, (-widest, widest), tests)


def _share(rays: xr.Dataset | None, theta: float) -> float:
    """Share of the rays' power that is reflected more than once; 0 where nobody counted."""
    share = math.nan if rays is None else q.total_share(rays, theta)
    return share if math.isfinite(share) else 0.0


def _remarks(data: xr.Dataset) -> list[str]:
    """What the solver says against itself; a coherence length that was cut is no word against the theory."""
    found = q.text(data.attrs.get("remarks"), [])
    return [str(r) for r in found if not str(r).startswith("the coherence length")] if isinstance(found, list) else []
