"""Which method of a result to trust at which angles, and why: the first line of the verdict.

From the summary of the surface, what the solvers remark and the measured ranges of docs/theory.md, docs/trust.md and
docs/multiple_scattering.md; no threshold is made here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from ..wave import trust
from ..wave.iterated.limits import GRATING_PERIOD
from . import quantities as q
from .style import angle
from .tables import first, number, percent

# asked in this order, each judged on this surface: what has diffraction comes before rays. `compare.reference` ranks
# without a judgement, and there what holds on more surfaces comes first
RANK = ("full-wave", "iterated-kirchhoff", "generalized-harvey-shack", "kirchhoff", "harvey-shack", "rays")


@dataclass(frozen=True)
class Judgement:
    """ok : whether to trust it here;  why : for or against"""

    ok: bool
    why: str


@dataclass(frozen=True)
class Ground:
    """What a summary tells of a surface: Sq in µm, RMS slope along one axis, Beckmann's α, share that is steep."""

    sq: float
    slope: float
    alpha: float
    steep: float
    profile: bool
    walls: bool

    @staticmethod
    def of(surface: xr.Dataset | None) -> Ground | None:
        """None without a summary, and where it lacks the parameters."""
        if surface is None or not {"Sq", "Sdq", "alpha"} <= set(surface.attrs) or "slope_density" not in surface:
            return None
        a = surface.attrs
        profile = bool(np.ptp(surface["z"].values, axis=0).max() == 0)
        steep = abs(surface["slope"]) > math.tan(math.radians(trust.STEEP_DEG))
        density = surface["slope_density"]
        share = float(density.where(steep, 0.0).sum() / max(float(density.sum()), 1e-300))
        slope = float(a["Sdq"]) / (1.0 if profile else math.sqrt(2))
        return Ground(float(a["Sq"]), slope, float(a["alpha"]), share, profile, a.get("interpolation") == "nearest")

    @property
    def grating(self) -> tuple[str, float, float]:
        """(shape, depth, period) as `trust.equivalent_grating` of a smooth surface has it."""
        return "sinusoidal", 2 * math.sqrt(2) * self.sq, 2 * math.pi * self.sq / max(self.slope, 1e-300)

    @property
    def smith_deg(self) -> float:
        """Angle beyond which shadows matter."""
        return math.degrees(math.atan(1 / (trust.SMITH_LIMIT * max(self.alpha, 1e-300))))


def recommendation(results: Mapping[str, xr.Dataset], surface: xr.Dataset | None) -> str | None:
    """In one paragraph; None for a result without simulations."""
    theories = {name: _theory(name, data) for name, data in results.items() if name != "measured"}
    known = sorted((n for n, t in theories.items() if t in RANK), key=lambda n: RANK.index(theories[n]))
    if not known:
        return None
    ground = Ground.of(surface)
    trusted: dict[str, dict[float, str]] = {}
    refused: dict[float, list[str]] = {}
    for theta in sorted({float(t) for n in known for t in results[n]["theta_i"].values}):
        against = []
        for name in known:
            if q.incidence(results[name], theta) is None:
                continue
            found = judge(theories[name], results[name], ground, results.get("rays"), theta)
            if found.ok:
                trusted.setdefault(name, {})[theta] = found.why
                break
            against.append(f"{q.in_words(name, results[name])}: {found.why}")
        else:
            refused[theta] = against
    everywhere = len(trusted) == 1 and not refused
    parts = [
        f"{'Trust' if i == 0 else 'trust'} {q.in_words(name, results[name])} at "
        f"{'all θᵢ' if everywhere else 'θᵢ = ' + _angles(list(whys))}: {whys[max(whys, key=abs)]}"
        for i, (name, whys) in enumerate(trusted.items())
    ]
    if refused:
        where = "" if not trusted else f" at θᵢ = {_angles(list(refused))}"
        reasons = list(dict.fromkeys(line for lines in refused.values() for line in lines))
        parts.append(
            f"{'none of the methods' if trusted else 'None of the methods'} of this result may be trusted{where} "
            f"({'; '.join(reasons)}). {_remedy(ground, set(theories.values()))}"
        )
    return "; ".join(parts).rstrip(".") + "."


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
    return _once(theory, ground, rays, theta, sorted({float(nm.min()), float(nm.max())}))


def _rigorous(data: xr.Dataset) -> Judgement:
    error = float(first(data.attrs, "error_achieved", default=math.nan))
    if not error <= trust.NOTABLE:
        return Judgement(False, f"its numerical error is {percent(error)}")
    remarks = _remarks(data)
    return Judgement(True, f"rigorous, numerical error {percent(error)}" + (f"; mind: {remarks[0]}" if remarks else ""))


def _rays(ground: Ground, wavelength_um: float, theta: float) -> Judgement:
    wide = ground.grating[2] / wavelength_um
    deep = 4 * math.pi * ground.sq * math.cos(math.radians(theta)) / wavelength_um
    if ground.walls or wide < GRATING_PERIOD or deep < trust.ROUGH_PHASE:
        size = f"features are {number(wide, 2)} wavelengths wide and heights {number(ground.sq / wavelength_um, 2)}"
        return Judgement(False, f"no diffraction in it, and {size}")
    return Judgement(True, f"features are {number(wide, 2)} wavelengths wide, so that diffraction matters little")


def _once(theory: str, ground: Ground, rays: xr.Dataset | None, theta: float, nm: list[float]) -> Judgement:
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
    expected = [trust.expected(theory, *ground.grating, theta, w) for w in nm]
    inside = [e for e in expected if not e.outside]
    off = max((e.error[1] for e in inside), default=0.0)
    if off > trust.NOTABLE:
        return Judgement(False, f"likely off by {percent(off)} on rigorous gratings like this surface")
    up_to = f"up to θₒ = {number(ground.smith_deg, 2)}°" if ground.smith_deg < 80 else "away from grazing θₒ"
    if len(inside) == len(expected):
        return Judgement(
            True, f"{up_to}; likely within {percent(max(off, 1e-3))} as on rigorous gratings like this surface"
        )
    return _beyond(theory, ground, theta, up_to)


def _beyond(theory: str, ground: Ground, theta: float, up_to: str) -> Judgement:
    """Where the table of rigorous gratings holds none alike: its largest slope counts."""
    most = max(c.slope for c in trust.cases() if math.isfinite(c.slope))
    if theory == "harvey-shack" and 1 / math.cos(math.radians(theta)) > trust.PHASE:
        return Judgement(False, "its phase q_z = 2k holds near the normal only")
    if ground.slope > most * 1.005:
        return Judgement(False, f"RMS slope {number(ground.slope, 2)}, it is tested up to {number(most, 2)}")
    return Judgement(
        True, f"{up_to}; single reflections, RMS slope {number(ground.slope, 2)} (tested up to {number(most, 2)})"
    )


def _share(rays: xr.Dataset | None, theta: float) -> float:
    """Share of the rays' power that is reflected more than once; 0 where nobody counted."""
    share = math.nan if rays is None else q.total_share(rays, theta)
    return share if math.isfinite(share) else 0.0


def _remedy(ground: Ground | None, have: set[str]) -> str:
    if ground is not None and ground.profile and "full-wave" not in have:
        return 'The surface is a profile: add "full-wave" to wave.theory'
    if ground is None:
        return "Simulate from a scene with [surface], whose result keeps a summary of it"
    if ground.profile:
        return "Take a smaller wave.tol for the full wave"
    more = "" if "iterated-kirchhoff" in have else 'Add "iterated-kirchhoff" to wave.theory for multiple reflections. '
    return (
        f"{more}What diffraction does shows on a profile of the surface's slope and heights (all rows equal), with "
        'wave.theory = "full-wave"'
    )


def _theory(name: str, data: xr.Dataset) -> str:
    return "rays" if name == "rays" else str(data.attrs.get("theory", ""))


def _remarks(data: xr.Dataset) -> list[str]:
    """What the solver says against itself; a coherence length that was cut is no word against the theory."""
    found = q.text(data.attrs.get("remarks"), [])
    return [str(r) for r in found if not str(r).startswith("the coherence length")] if isinstance(found, list) else []


def _angles(theta: list[float]) -> str:
    return ", ".join(angle(t) for t in theta) if len(theta) < 5 else f"{angle(theta[0])} … {angle(theta[-1])}"
