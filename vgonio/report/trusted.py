"""Which method of a result to trust at which angles, and why: the first lines of the verdict.

From the summary of the surface, what the solvers remark and the evidence of `wave.trust`, the same as the plan's;
ranges are those of docs/theory.md, docs/trust.md and docs/multiple_scattering.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import xarray as xr

from ..wave import trust
from ..wave.theories import THEORIES as SCALAR
from . import evidence
from . import quantities as q
from .agreement import Agreement
from .judgement import Ground, Judgement, judge
from .style import angle
from .tables import number, percent

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


@dataclass
class Advice:
    """first : one sentence, which method to trust where;  more : what that rests on, and the other theories"""

    first: str
    more: list[str] = field(default_factory=list)
    trusted: dict[str, dict[float, Judgement]] = field(default_factory=dict)


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


def _angles(theta: list[float]) -> str:
    return ", ".join(angle(t) for t in theta) if len(theta) < 5 else f"{angle(theta[0])} … {angle(theta[-1])}"
