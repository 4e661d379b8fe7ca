"""The verdict at the top of the page: what the data say, in words and numbers, and how far they can be trusted."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from ..compare.metrics import align, nrmse
from . import quantities as q
from .style import angle
from .tables import first, number, percent

SUM_TOLERANCE = 1e-6  # the white furnace and every tally close to rounding; this is far above it
SIGNIFICANT = 3.0  # standard errors
NEGLIGIBLE = 1e-4  # nm⁻¹: 1 % per 100 nm is below what is seen as a colour


@dataclass
class Card:
    """One key figure."""

    what: str
    value: str
    note: str = ""


@dataclass
class Verdict:
    """Alarms come first and are red, cards show the key figures, statements say it in sentences."""

    alarms: list[str] = field(default_factory=list)
    cards: list[Card] = field(default_factory=list)
    statements: list[str] = field(default_factory=list)

    def add(self, statement: str | None) -> None:
        if statement:
            self.statements.append(statement)


@dataclass(frozen=True)
class Agreement:
    """How far two results are apart: NRMSE over all common directions and wavelengths; median of |a − b| over b."""

    names: tuple[str, str]
    nrmse: float
    median: float
    within: float  # share of the bright directions whose spectra differ by less than a tenth
    noise: float  # what the standard errors alone would give as NRMSE; NaN where neither has any
    directions: int


def verdict(
    results: Mapping[str, xr.Dataset],
    theta_i: float,
    slopes: Mapping[str, xr.Dataset],
    colour: Mapping[str, float],
    agreements: Sequence[Agreement],
) -> Verdict:
    """All that can be said of these results.

    theta_i : the angle of incidence to speak of;  slopes : per result the local shift fit (slope, slope_stderr)
    colour : mean ΔE₀₀ by pair, "rays and waves";  agreements : from `pairs`
    """
    made = Verdict()
    if "rays" in results and "brdf_by_bounce" in results["rays"]:
        reflections(made, results["rays"], theta_i)
    for name, data in slopes.items():
        shift(made, results, name, data, theta_i)
    for pair in agreements:
        agreement_of(made, results, pair, colour)
    made.add(largest_error(results))
    if "rays" in results:
        energy_of_rays(made, results["rays"])
    for name, data in results.items():
        energy_of_waves(made, name, data)
    if not (made.statements or made.alarms):
        made.add("The result holds nothing that can be judged yet: no rays, no waves, no measurement.")
    return made


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


# ---- reflections
def reflections(made: Verdict, rays: xr.Dataset, theta_i: float) -> None:
    """Share of multiple reflections in the mirror direction and in back-scattering."""
    one = q.incidence(q.near(rays), theta_i, tolerance=90.0)
    found = {} if one is None else {side: share_at(one, o) for side, o in (("mirror", -theta_i), ("back", theta_i))}
    known = {side: value for side, value in found.items() if value is not None}
    if one is None or "mirror" not in known:
        return
    where = f"rays, {number(float(one['wavelength']))} nm, θᵢ = {angle(theta_i)}"
    mirror = share_text(*known["mirror"])
    if theta_i == 0 or "back" not in known:
        made.cards.append(Card("Multiple reflections, mirror direction", short(known["mirror"]), where))
        made.add(f"Multiple reflections make {mirror} of the light in the mirror direction ({where}).")
        return
    mirror_and_back = f"{short(known['mirror'])} → {short(known['back'])}"
    made.cards.append(Card("Multiple reflections, mirror → back-scattering", mirror_and_back, where))
    back = share_text(*known["back"])
    made.add(
        f"Multiple reflections make {mirror} of the light in the mirror direction and {back} in back-scattering "
        f"({where}){crossing(one, theta_i)}."
    )


def share_at(one: xr.Dataset, theta_o: float) -> tuple[float, float] | None:
    here = q.direction(one, theta_o)
    if here is None:
        return None
    share, error = q.multiple_share(here)
    return float(share), float(error)


def share_text(share: float, error: float) -> str:
    if not math.isfinite(share):
        return "an unknown share (too few rays were caught)"
    return percent(share) + (f" (± {percent(error, 1)})" if math.isfinite(error) and error > 0 else "")


def short(found: tuple[float, float]) -> str:
    return percent(found[0]) if math.isfinite(found[0]) else "too few"


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
def pairs(results: Mapping[str, xr.Dataset]) -> list[Agreement]:
    """Every pair of results that have directions and wavelengths in common; the second, the reference, is the later."""
    from ..errors import InputError

    found = []
    for a, b in itertools.combinations(results, 2):
        try:
            found.append(agreement(results, a, b))
        except InputError:
            continue
    return found


def agreement(results: Mapping[str, xr.Dataset], a: str, b: str) -> Agreement:
    """NRMSE and more of `a` against the reference `b`; InputError where they have nothing in common."""
    x, y = align(results[a], results[b])
    both = np.isfinite(x["brdf"]) & np.isfinite(y["brdf"])
    relative = (abs(x["brdf"] - y["brdf"]) / y["brdf"]).where(both & q.bright(y))
    mean = float(y["brdf"].where(both).mean())
    spread = relative.mean("wavelength")
    known = np.isfinite(spread)
    return Agreement(
        (a, b),
        float(nrmse(results[b], results[a])),
        float(relative.median()),
        float((spread < 0.1).where(known).mean()),
        noise_of(x, y, both, mean),
        int(known.sum()),
    )


def noise_of(x: xr.Dataset, y: xr.Dataset, both: Any, mean: float) -> float:
    """NRMSE that the standard errors alone would give."""
    parts = [(d["brdf_stderr"] ** 2).where(both) for d in (x, y) if "brdf_stderr" in d]
    return float(np.sqrt(sum(float(p.mean()) for p in parts)) / mean) if parts else math.nan


def agreement_of(
    made: Verdict, results: Mapping[str, xr.Dataset], pair: Agreement, colour: Mapping[str, float]
) -> None:
    """One pair as a card and a sentence."""
    a, b = pair.names
    first_one, second = q.title(a, results[a]), q.in_words(b, results[b])
    delta = f", mean ΔE₀₀ {number(colour[f'{a} and {b}'], 2)}" if f"{a} and {b}" in colour else ""
    note = f"median difference {percent(pair.median)}{delta}"
    made.cards.append(Card(f"{first_one} against {second}", f"NRMSE {percent(pair.nrmse)}", note))
    noise = ""
    if math.isfinite(pair.noise):
        mostly = pair.noise**2 > 0.5 * pair.nrmse**2
        kind = "mostly noise" if mostly else "real"
        noise = f"; noise alone would give {percent(pair.noise)}, so the difference is {kind}"
    made.add(
        f"{first_one} and {second} differ by an NRMSE of {percent(pair.nrmse)}{delta}{noise}. Averaged over the "
        f"spectrum they agree within 10 % in {percent(pair.within)} of {pair.directions} pairs of directions."
    )


# ---- colour shift
def shift(made: Verdict, results: Mapping[str, xr.Dataset], name: str, slopes: xr.Dataset, theta_i: float) -> None:
    """Strength of the linear shift in the mirror direction and in back-scattering, with its significance."""
    asked = {"the mirror direction": -theta_i} | ({"back-scattering": theta_i} if theta_i else {})
    found = {side: slope_at(slopes, theta_i, theta_o) for side, theta_o in asked.items()}
    known = {side: value for side, value in found.items() if value is not None}
    if not known:
        return
    words = q.in_words(name, results[name]) if name in results else name
    sentence = "; ".join(f"{slope_text(*value)} in {side}" for side, value in known.items())
    made.add(f"Colour shift of {words} at θᵢ = {angle(theta_i)}: {sentence}.")
    if name == "waves" or (name == "measured" and "waves" not in results):
        what = f"Colour shift of {words}" + (", mirror → back-scattering" if len(known) > 1 else "")
        value = " → ".join(signed(m) for m, _ in known.values()) + " %"
        made.cards.append(Card(what, value, f"per 100 nm, θᵢ = {angle(theta_i)}"))


def slope_at(slopes: xr.Dataset, theta_i: float, theta_o: float, tolerance: float = 10.0) -> tuple[float, float] | None:
    """(m, its standard error) in nm⁻¹ at the nearest pair of directions that has a fit; None if there is none near."""
    if "theta_o" not in slopes["slope"].dims:
        return None
    one = slopes.isel(theta_i=int(np.abs(slopes["theta_i"].values - theta_i).argmin()))
    offset = np.where(np.isfinite(one["slope"].values), np.abs(one["theta_o"].values - theta_o), np.inf)
    if offset.min() > tolerance:
        return None
    here = one.isel(theta_o=int(offset.argmin()))
    return float(here["slope"]), float(here["slope_stderr"]) if "slope_stderr" in here else math.nan


def signed(m: float) -> str:
    """Slope in % per 100 nm with its sign."""
    return ("+" if m > 0 else "") + number(m * 1e4, 2)


def slope_text(m: float, error: float) -> str:
    """+9.1 ± 0.3 % per 100 nm, towards red (30 σ)."""
    if not (math.isfinite(error) and error > 0):
        return f"{signed(m)} % per 100 nm"
    value = f"{signed(m)} ± {number(error * 1e4, 1)} % per 100 nm"
    sigma = abs(m) / error
    if sigma < SIGNIFICANT:
        return f"{value}, not significant ({sigma:.1f} σ),"
    if abs(m) < NEGLIGIBLE:
        return f"{value}, practically none,"
    return f"{value}, towards {'red' if m > 0 else 'blue'} ({sigma:.0f} σ),"


# ---- what limits it
def largest_error(results: Mapping[str, xr.Dataset]) -> str | None:
    """Which known error is the largest, and what the others are beside it."""
    known = []
    for name, data in results.items():
        words = q.in_words(name, data)
        median = q.relative_error(data)
        if math.isfinite(median):
            kind = "speckle (few independent coherence windows)" if name.startswith("waves") else "noise"
            known.append((median, f"{kind} of {words}, median standard error {percent(median)} of the BRDF"))
        numerical = first(data.attrs, "error_achieved", "error")
        if name.startswith("waves") and isinstance(numerical, (int, float)) and math.isfinite(numerical):
            known.append((float(numerical), f"numerical error of {words}, {percent(float(numerical), 1)}"))
    if not known:
        return None
    known.sort(reverse=True, key=lambda item: item[0])
    rest = "; then " + ", ".join(text for _, text in known[1:]) if len(known) > 1 else ""
    return f"The largest known error is the {known[0][1]}{rest}. What the theories leave out is not counted here."
