"""Which method of a result to trust at which angles, and why: the first lines of the verdict.

From the summary of the surface, what the solvers remark and the evidence of `wave.trust`, the same as the plan's;
ranges are those of docs/theory.md, docs/trust.md and docs/multiple_scattering.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from ..wave import slightly_rough, trust
from ..wave.iterated.limits import GRATING_PERIOD
from ..wave.theories import THEORIES as SCALAR
from . import evidence
from . import quantities as q
from .agreement import Agreement
from .style import angle
from .tables import first, number, percent

# asked in this order, each judged on this surface: what has diffraction comes before rays, and of the theories of
# single reflections the one with the smallest error on tested surfaces like this one comes first. `compare.reference`
# ranks without a judgement, and there what holds on more surfaces comes first
RANK = ("full-wave", "iterated-kirchhoff", *SCALAR, "rays")
# a measurement contradicts where its NRMSE is this many times what noise and the error of the theory explain, and above
# half of the measurement's mean: below, cones, alignment and the sample's other places explain it as well
CONTRADICTS, LEAST_CONTRADICTION = 3.0, 0.5
SAME_OFF = 0.01  # errors on tested surfaces that differ by less do not rank two theories: the order of RANK does
SAME_WIDTH_DEG = 30.0  # nor ranges of θ_o whose widths differ by less
SAME_DEG = 10.0  # ranges of θ_o that differ by less are told as one


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


@dataclass
class Advice:
    """first : one sentence, which method to trust where;  more : what that rests on, and the other theories"""

    first: str
    more: list[str] = field(default_factory=list)
    trusted: dict[str, dict[float, Judgement]] = field(default_factory=dict)


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


def recommendation(results: Mapping[str, xr.Dataset], surface: xr.Dataset | None) -> str | None:
    """The first sentence of `advice`."""
    made = advice(results, surface)
    return made.first if made else None


def advice(
    results: Mapping[str, xr.Dataset], surface: xr.Dataset | None, agreements: Sequence[Agreement] = ()
) -> Advice | None:
    """What to trust where; None for a result without simulations."""
    theories = {name: _theory(name, data) for name, data in results.items() if name != "measured"}
    known = sorted((n for n, t in theories.items() if t in RANK), key=lambda n: RANK.index(theories[n]))
    if not known:
        return None
    ground = Ground.of(surface)
    judged: dict[float, dict[str, Judgement]] = {}
    for theta in sorted({float(t) for n in known for t in results[n]["theta_i"].values}):
        here = [n for n in known if q.incidence(results[n], theta) is not None]
        judged[theta] = {n: judge(theories[n], results[n], ground, results.get("rays"), theta) for n in here}
    trusted: dict[str, dict[float, Judgement]] = {}
    refused: dict[float, dict[str, Judgement]] = {}
    for theta, found in judged.items():
        best = _best(found, theories)
        if best:
            trusted.setdefault(best, {})[theta] = found[best]
        else:
            refused[theta] = found
    trusted = _one_for_all(trusted, judged, theories)
    parts = _trusted_parts(trusted, refused, results)
    if refused:
        parts.append(_refused_part(refused, results, bool(trusted), _remedy(ground, set(theories.values()))))
    parts += _contradicted(trusted, results, agreements)
    more = [*_evidence(trusted, ground), *_others(trusted, judged, theories, results, agreements)]
    return Advice("; ".join(parts).rstrip(".") + ".", more, trusted)


def _best(found: Mapping[str, Judgement], theories: Mapping[str, str]) -> str | None:
    """The first of RANK that is fit, among theories of single reflections the one with the smallest expected error."""
    fit = [name for name, j in found.items() if j.ok]
    if not fit or theories[fit[0]] not in SCALAR:
        return fit[0] if fit else None
    once = [n for n in fit if theories[n] in SCALAR]
    widest = max(_width(found[n]) for n in once)
    once = [n for n in once if _width(found[n]) >= widest - SAME_WIDTH_DEG]
    offs = {n: found[n].off if math.isfinite(found[n].off) else 0.0 for n in once}
    return next(n for n in once if offs[n] <= min(offs.values()) + SAME_OFF)


def _one_for_all(
    trusted: dict[str, dict[float, Judgement]],
    judged: Mapping[float, Mapping[str, Judgement]],
    theories: Mapping[str, str],
) -> dict[str, dict[float, Judgement]]:
    """The same, but one theory of single reflections, or the rays, where it is fit wherever several take turns;
    the one that was best at more angles is asked first."""
    if len(trusted) < 2 or any(theories[n] not in (*SCALAR, "rays") for n in trusted):
        return trusted
    angles = sorted(t for found in trusted.values() for t in found)
    for name in sorted(trusted, key=lambda n: (-len(trusted[n]), RANK.index(theories[n]))):
        if all(name in judged[t] and judged[t][name].ok for t in angles):
            return {name: {t: judged[t][name] for t in angles}}
    return trusted


def _width(found: Judgement) -> float:
    """Degrees of θ_o in which to trust it."""
    low, high = found.theta_o or (-90.0, 90.0)
    return high - low


def _trusted_parts(
    trusted: Mapping[str, Mapping[float, Judgement]], refused: Mapping[float, object], results: Mapping[str, xr.Dataset]
) -> list[str]:
    everywhere = len(trusted) == 1 and not refused
    parts = []
    for i, (name, found) in enumerate(trusted.items()):
        where = "all θᵢ" if everywhere else "θᵢ = " + _angles(list(found))
        worst = max(found.values(), key=lambda j: j.off if math.isfinite(j.off) else -1.0)
        span = _spans({t: j.theta_o for t, j in found.items() if j.theta_o})
        parts.append(f"{'trust' if i else 'Trust'} {q.in_words(name, results[name])} at {where}{span}: {worst.why}")
    return parts


def _refused_part(
    refused: Mapping[float, Mapping[str, Judgement]], results: Mapping[str, xr.Dataset], some: bool, remedy: str
) -> str:
    where = f" at θᵢ = {_angles(list(refused))}" if some else ""
    reasons = dict.fromkeys(
        f"{q.in_words(n, results[n])}: {j.why}" for found in refused.values() for n, j in found.items()
    )
    who = "none of the methods" if some else "None of the methods"
    return f"{who} of this result may be trusted{where} ({'; '.join(reasons)}). {remedy}"


def _spans(ranges: Mapping[float, tuple[float, float]]) -> str:
    """The directions to trust, one range where they are nearly the same at every θ_i."""
    if not ranges:
        return ""
    low, high = max(r[0] for r in ranges.values()), min(r[1] for r in ranges.values())
    if all(low - a <= SAME_DEG and b - high <= SAME_DEG for a, b in ranges.values()):
        return f" for θₒ = {_span(low, high)}"
    told = list(ranges) if len(ranges) < 4 else [min(ranges), max(ranges)]
    return " for θₒ = " + ", ".join(f"{_span(*ranges[t])} (θᵢ = {angle(t)})" for t in told)


def _span(low: float, high: float) -> str:
    return f"{number(low, 2)} … {angle(round(high))}"


def _contradicted(
    trusted: Mapping[str, Mapping[float, Judgement]], results: Mapping[str, xr.Dataset], agreements: Sequence[Agreement]
) -> list[str]:
    """What the measurement says against the methods that are trusted, see CONTRADICTS."""
    said = []
    for pair in agreements:
        name = next((n for n in pair.names if n in trusted), None)
        if name is None or "measured" not in pair.names:
            continue
        off = max((j.off for j in trusted[name].values() if math.isfinite(j.off)), default=0.0)
        explained = math.hypot(off, *(e for e in (pair.noise,) if math.isfinite(e)))
        if pair.nrmse.value > max(CONTRADICTS * explained, LEAST_CONTRADICTION):
            said.append(
                f"but the measurement contradicts {q.in_words(name, results[name])}: NRMSE "
                f"{percent(pair.nrmse.value)} of its mean, noise and theory explain {percent(explained)}; check that "
                "it is of this sample, material and scale"
            )
    return said


def _evidence(trusted: Mapping[str, Mapping[float, Judgement]], ground: Ground | None) -> list[str]:
    """What the trust in a theory of single reflections rests on, a sentence for the most used one."""
    told = []
    for found in trusted.values():
        tests = [e for j in found.values() for e in j.tests]
        if tests and ground is not None:
            told.append(evidence.rests_on(tests, ground.sq, ground.slope))
        told += list(dict.fromkeys(j.outside for j in found.values() if j.outside))[-1:]
    return told


def _others(
    trusted: Mapping[str, Mapping[float, Judgement]],
    judged: Mapping[float, Mapping[str, Judgement]],
    theories: Mapping[str, str],
    results: Mapping[str, xr.Dataset],
    agreements: Sequence[Agreement],
) -> list[str]:
    """Which other methods would do as well as the theory of single reflections that is trusted, and how they differ."""
    chosen = next((n for n in trusted if theories[n] in SCALAR), None)
    if chosen is None:
        return _also_waves(judged, theories, results) if set(trusted) == {"rays"} else []
    said = []
    rays = [found.get("rays") for t, found in judged.items() if t in trusted[chosen]]
    if all(j is not None and j.ok for j in rays):
        said.append(f"The rays would serve as well: {rays[0].why if rays[0] else ''}.")
    for name in (n for n, t in theories.items() if t in SCALAR and n not in trusted):
        both = [
            (found[name], trusted[chosen][t]) for t, found in judged.items() if name in found and t in trusted[chosen]
        ]
        pair = next((p for p in agreements if set(p.names) == {name, chosen}), None)
        if both:
            words = (q.title(name, results[name]), q.in_words(chosen, results[chosen]))
            said.append(_other(words, both, pair))
    return said


def _also_waves(
    judged: Mapping[float, Mapping[str, Judgement]], theories: Mapping[str, str], results: Mapping[str, xr.Dataset]
) -> list[str]:
    """Where a theory of single reflections would do as well as the rays that are trusted."""
    said = []
    for name in (n for n, t in theories.items() if t in SCALAR):
        fit = {t: found[name] for t, found in judged.items() if name in found and found[name].ok}
        if fit:
            worst = max(fit.values(), key=lambda j: j.off if math.isfinite(j.off) else -1.0)
            said.append(
                f"{q.title(name, results[name])} would serve as well at θᵢ = {_angles(list(fit))}: {worst.why}."
            )
    return said


def _other(words: tuple[str, str], both: Sequence[tuple[Judgement, Judgement]], pair: Agreement | None) -> str:
    """One theory beside the one that is trusted, both at the same angles; `words` name them."""
    apart = f"; the two differ by {pair.median.percent} in the median here" if pair else ""
    bad = next((a for a, _ in both if not a.ok), None)
    if bad is not None:
        return f"{words[0]} is not as good here: {bad.why}{apart}."
    offs = [max((j.off for j in side if math.isfinite(j.off)), default=0.0) for side in zip(*both)]
    narrower = min(_width(a) - _width(b) for a, b in both) < -SAME_WIDTH_DEG
    apart_by = pair.median.value if pair and pair.median.known else 0.0
    second = narrower or apart_by > max(trust.NOTABLE, *offs)
    as_good = "comes second" if second else "would serve as well"
    where = " (it holds in fewer directions)" if narrower else ""
    tests = f"off by {percent(max(offs[0], 1e-3))} of the light in the same tests, {words[1]} by"
    return f"{words[0]} {as_good}{where}: {tests} {percent(max(offs[1], 1e-3))}{apart}."


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
