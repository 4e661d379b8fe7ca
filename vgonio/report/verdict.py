"""The verdict at the top of the page: what the data say, in words and numbers, and how far they can be trusted."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from ..compare.alike import unlike
from ..compare.significance import SIGMAS
from . import quantities as q
from .agreement import Agreement
from .content import Content
from .shifts import in_words, mean_shift, signed
from .style import angle
from .tables import first, number, percent
from .trusted import advice
from .wave_reflections import reflections_in_words

LOST = 0.005  # of the light beside a cone, from which on it is worth a sentence
SUM_TOLERANCE = 1e-6  # the white furnace and every tally close to rounding; this is far above it


@dataclass
class Card:
    """One key figure."""

    what: str
    value: str
    note: str = ""


@dataclass
class Verdict:
    """Alarms come first and are red, cards show the key figures, statements say it in sentences, cautions warn."""

    alarms: list[str] = field(default_factory=list)
    cards: list[Card] = field(default_factory=list)
    statements: list[str] = field(default_factory=list)
    cautions: list[str] = field(default_factory=list)

    def add(self, statement: str | None) -> None:
        if statement:
            self.statements.append(statement)

    def __str__(self) -> str:
        """Plain text: alarms, statements, cautions, an item each."""
        marked = [*(f"! {a}" for a in self.alarms), *(f"- {s}" for s in self.statements)]
        lines = [*marked, *(f"? {c}" for c in self.cautions)]
        return "\n".join(textwrap.fill(line, 110, subsequent_indent="  ", break_on_hyphens=False) for line in lines)


def verdict(
    content: Content,
    slopes: Mapping[str, xr.Dataset],
    agreements: Sequence[Agreement],
) -> Verdict:
    """All that can be said of a result.

    slopes : per result the local shift fits, see `shifts.shift_slopes`;  agreements : from `pairs`
    """
    made, results = Verdict(), content.results
    if "rays" in results and "brdf_by_bounce" in results["rays"]:
        reflections(made, results["rays"], content.theta_i)
    for name, data in results.items():
        made.add(reflections_in_words(name, data) if name.startswith("waves") else None)
    for name, data in slopes.items():
        shift(made, results, name, data)
    for pair in agreements:
        agreement_of(made, results, pair)
    made.add(largest_error(results))
    if "rays" in results:
        energy_of_rays(made, results["rays"])
        made.add(mirrored_sides(results["rays"]))
    for name, data in results.items():
        energy_of_waves(made, name, data)
        made.add(lost_beside_cones(name, data, content.surface))
    made.cautions += cautions(content)
    told = advice(results, content.surface, agreements)
    if told:
        made.statements[:0] = [told.first, *told.more]
    if not (made.statements or made.alarms):
        made.add("The result holds nothing that can be judged yet: no rays, no waves, no measurement.")
    return made


def cautions(content: Content) -> list[str]:
    """What the measured file says of itself, and the warnings of the plan."""
    found = []
    if "measured" in content.results:
        a = content.results["measured"].attrs
        told = first(a, "provenance", "comment")
        if told:
            found.append(f"The measurement ({first(a, 'source', default='its file')}) says of itself: {told}")
    warnings = [str(w) for w in content.plan.get("warnings") or []]
    turned = content.results["rays"].attrs.get("edges_caution") if "rays" in content.results else None
    if turned and turned not in warnings:  # the plan has foretold it, but of big samples
        warnings.append(str(turned))
    return found + [w[:1].upper() + w[1:] + ("" if w.endswith(".") else ".") for w in warnings]


# ---- energy
def energy_of_rays(made: Verdict, rays: xr.Dataset) -> None:
    if "energy_by_bounce" not in rays:
        return
    total = q.tallies(rays)["sum"]
    off = float(abs(total - 1).max())
    lost = float(rays["energy_lost"].max()) if "energy_lost" in rays else 0.0
    white = "material" in rays.attrs and str(rays.attrs["material"]) == "perfect"
    if not off <= SUM_TOLERANCE:
        what = "white furnace of the rays fails" if white else "energy tallies of the rays do not close"
        worst = float(total["theta_i"].values[abs(total - 1).max("wavelength").values.argmax()])
        made.alarms.append(
            f"The {what}: reflected, absorbed and lost power add up to {percent(float(total.max()), 7)} … "
            f"{percent(float(total.min()), 7)} (worst at θᵢ = {angle(worst)}); they should give 100 %. "
            "Do not trust the rays of this result."
        )
        made.cards.append(Card("Energy tallies of the rays", "open", f"off by {number(off, 2)} of the incident power"))
        return
    made.cards.append(Card("Energy tallies of the rays", "closed", f"sum is 1 within {number(max(off, 1e-16), 1)}"))
    if lost > 0.01:
        made.add(
            f"Up to {percent(lost)} of the power of the rays is lost through the sides of the sample or at the limit "
            "of bounces; the BRDF is low by at most that share."
        )


def energy_of_waves(made: Verdict, name: str, data: xr.Dataset) -> None:
    if "energy_reflected" not in data:
        return
    energy = data["energy_reflected"]
    most = float(energy.max())
    if most <= 1 + SUM_TOLERANCE:
        return
    above = energy["theta_i"].values[(energy.max("wavelength") > 1 + SUM_TOLERANCE).values]
    made.alarms.append(
        f"{q.title(name, data)}: more power is reflected than falls on the surface, by up to {percent(most - 1)}, at "
        f"θᵢ = {', '.join(angle(float(t)) for t in above)}. Tangent-plane theories without shadowing do so at grazing "
        "incidence: it is a property of the theory, and the BRDF there is too high."
    )


def lost_beside_cones(name: str, data: xr.Dataset, surface: xr.Dataset | None) -> str | None:
    """How much light of a profile the window across the plane of incidence takes out of a detector's cones."""
    from ..wave.closed_forms import lost_across

    profile = surface is not None and "z" in surface and bool(np.ptp(surface["z"].values, axis=0).max() == 0)
    known = {"coherence_um", "aperture_deg"} <= set(data.attrs) and data.attrs.get("solver") == "Kirchhoff"
    if not (profile and known and q.in_plane(data)):
        return None
    ends = [float(w) for w in (data["wavelength"].min(), data["wavelength"].max())]
    lost = [lost_across(float(data.attrs["coherence_um"]), float(data.attrs["aperture_deg"]), w) for w in ends]
    if max(lost) < LOST:
        return None
    told = f"{percent(lost[0])} at {number(ends[0])} nm" + (
        f" and {percent(lost[1])} at {number(ends[1])} nm" if ends[1] > ends[0] else ""
    )
    return (
        f"{q.title(name, data)} loses {told} of the light of this profile beside the detector's cones, because its "
        "coherence window ends across the plane of incidence as well; full wave and iterated Kirchhoff do not. Compare "
        "after dividing that out, or take a larger coherence_um or aperture_deg."
    )


# ---- reflections
def reflections(made: Verdict, rays: xr.Dataset, theta_i: float) -> None:
    """Share of multiple reflections: of all reflected light, in the mirror direction and in back-scattering."""
    one = q.incidence(q.near(rays), theta_i, tolerance=90.0)
    sides = {"the mirror direction": -theta_i} | ({"back-scattering": theta_i} if theta_i else {})
    shares = {} if one is None else {side: share_at(one, theta_o) for side, theta_o in sides.items()}
    if one is None or not shares:
        return
    known = {side: share for side, share in shares.items() if math.isfinite(share[0])}
    dark = " and in ".join(side for side in shares if side not in known)
    where = f"rays, {number(float(one['wavelength']))} nm, θᵢ = {angle(theta_i)}"
    total = q.total_share(rays, theta_i)
    parts = [f"{percent(total)} of all reflected light"] if math.isfinite(total) else []
    parts += [f"{share_text(*share)} of the light in {side}" for side, share in known.items()]
    if parts:
        said = f"Multiple reflections make {', '.join(parts)} ({where}){crossing(one, theta_i)}"
        made.add(said + (f"; in {dark} too few rays were caught to tell." if dark else "."))
        short = ", ".join(f"{percent(share[0])} in {side}" for side, share in known.items())
        what = "of all reflected light" if math.isfinite(total) else ""
        note = "; ".join(text for text in (what, short) if text)
        value = percent(total if math.isfinite(total) else next(iter(known.values()))[0])
        made.cards.append(Card("Reflected more than once", value, f"{note} ({where})"))


def share_at(one: xr.Dataset, theta_o: float) -> tuple[float, float]:
    """Share and its error in the nearest direction; NaN where too few rays were caught."""
    here = q.direction(one, theta_o)
    if here is None:
        return math.nan, math.nan
    share, error = q.multiple_share(here)
    return float(share), float(error)


def share_text(share: float, error: float) -> str:
    return percent(share) + (f" (± {percent(error, 1)})" if math.isfinite(error) and error > 0 else "")


def crossing(one: xr.Dataset, theta_i: float) -> str:
    """From which angle on multiple reflections dominate on the side of the source, in plane."""
    if not q.in_plane(one):
        return ""
    share, _ = q.multiple_share(one)
    side = share.where(share["theta_o"] * np.sign(theta_i) > -abs(theta_i), drop=True)
    beyond = side["theta_o"].values[(side > 0.5).values]
    if beyond.size == 0:
        return ""
    nearest = beyond.min() if theta_i > 0 else beyond.max()
    return f"; they dominate from θₒ = {angle(float(nearest))} on"


# ---- agreement
def agreement_of(made: Verdict, results: Mapping[str, xr.Dataset], pair: Agreement) -> None:
    """One pair as a card and a sentence."""
    a, b = pair.names
    first_one, second = q.title(a, results[a]), q.in_words(b, results[b])
    of = f" (of {pair.colour_directions} directions where both are bright)" if pair.colour_directions else ""
    delta = f", mean ΔE₀₀ of the colour alone {pair.colour}{of}" if pair.colour.known else ""
    apart = unlike(results[a], results[b])
    note = f"NRMSE {pair.nrmse.percent}{delta}{'; not of the theories alone, see below' if apart else ''}"
    made.cards.append(Card(f"{first_one} against {second}, median difference", pair.median.percent, note))
    sides = ""
    if pair.mirror_side.known and pair.source_side.known:
        sides = f": {pair.mirror_side.percent} on the mirror's side, {pair.source_side.percent} on the source's side"
    noise = ""
    if math.isfinite(pair.noise):
        kind = "mostly noise" if pair.noise**2 > 0.5 * pair.nrmse.value**2 else "not noise"
        noise = f"; noise alone would give {percent(pair.noise)}, so that is {kind}"
    made.add(
        f"{first_one} and {second} differ by {pair.median.percent} in the median{sides}. NRMSE over the mean of "
        f"{second}, which the brightest directions rule: "
        f"{pair.nrmse.percent}{noise}.{delta[1:].replace(' mean', ' Mean') + '.' if delta else ''}"
        f"{' ' + apart if apart else ''}"
    )


# ---- colour shift
def shift(made: Verdict, results: Mapping[str, xr.Dataset], name: str, slopes: xr.Dataset) -> None:
    """Mean strength of the linear shift near the mirror direction and back-scattering, with its significance."""
    mirror, back = (mean_shift(slopes, side) for side in ("mirror", "back"))
    if mirror is None and back is None:
        return
    words = q.in_words(name, results[name]) if name in results else name
    made.add(
        f"Colour shift of {words}: {in_words(mirror)} around the mirror direction, {in_words(back)} around "
        "back-scattering."
    )
    if name == "waves" or (name == "measured" and "waves" not in results):
        value = " → ".join("?" if m is None else signed(m.slope) for m in (mirror, back)) + " %"
        note = "per 100 nm, from mirror direction to back-scattering"
        if not any(m is not None and abs(m.slope) >= SIGMAS * m.stderr for m in (mirror, back)):
            value, note = "not significant", f"{value} {note}"
        made.cards.append(Card(f"Colour shift of {words}", value, note))


# ---- what limits it
def largest_error(results: Mapping[str, xr.Dataset]) -> str | None:
    """Which known error is the largest, and what the others are beside it."""
    known = []
    for name, data in results.items():
        words = q.in_words(name, data)
        median = q.relative_error(data)
        if math.isfinite(median):
            kind = "speckle" if name.startswith("waves") else "noise"
            known.append(
                (median, f"{kind} of {words}, median standard error {percent(median)} of the BRDF where it is bright")
            )
        numerical = first(data.attrs, "error_achieved", "error")
        if name.startswith("waves") and isinstance(numerical, (int, float)) and math.isfinite(numerical):
            share = percent(float(numerical), 1)
            known.append((float(numerical), f"numerical error of {words}, {share} of the largest BRDF in θₒ"))
    facets = error_of_facets(results["rays"]) if "rays" in results else ""
    if not known:
        return facets or None
    known.sort(reverse=True, key=lambda item: item[0])
    rest = "; then " + ", ".join(text for _, text in known[1:]) if len(known) > 1 else ""
    said = f"The largest known error is the {known[0][1]}{rest}. What the theories leave out is not counted here."
    return " ".join(text for text in (said, facets) if text)


def error_of_facets(rays: xr.Dataset) -> str:
    """Where rays onto chosen facets leave nothing to chance: which error remains."""
    free = q.without_chance(rays)
    if not free > 0:
        return ""
    change = first(rays.attrs, "refinement_change")
    remains = f"on finer facets it changes by {change}" if change else "refinement_check = true tells how much"
    share = "all" if free == 1 else percent(free)
    return (
        f"In {share} of its bright directions the BRDF of the rays has no chance error: all light there comes from "
        f"facets that are known. What remains there is the error of the facets themselves; {remains}."
    )


def mirrored_sides(rays: xr.Dataset) -> str | None:
    """That rays met mirror images of the sample, where they do no harm; a caution says where they do."""
    edges = str(rays.attrs.get("edges", ""))
    if not edges.startswith("mirrored") or "edges_caution" in rays.attrs:
        return None
    return (
        f"The sample is finite and was continued for the rays: {edges}. Its slopes lean to no side, so its mirror "
        "images scatter as it does."
    )
