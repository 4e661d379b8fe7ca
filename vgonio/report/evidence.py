"""Rigorous solutions as evidence for a theory on the surface of a result, in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..wave import trust
from ..wave.trust import Expectation
from .style import angle
from .tables import number, percent


def bound(found: Expectation) -> str:
    """What the tests say of its error, relative to all light of the lobe."""
    off = percent(max(found.off, 1e-3))
    if found.basis == "harder":
        return f"no test is like this surface, on steeper and finer ones it is off by {off} of the light at most"
    return f"likely off by {off} of the light, as on tested surfaces like this one"


def rests_on(found: Sequence[Expectation], sq: float, slope: float) -> str:
    """What was tested and how this surface compares, from the expectations of one theory at its angles and λ.

    sq : µm;  slope : RMS along one axis
    """
    worst = max(found, key=lambda e: e.off)
    known = [c for c in (*trust.cases(), *trust.profiles()) if c.shape != "lamellar"]
    correlation = math.sqrt(2) * sq / max(slope, 1e-300)
    waves = sorted({e.wavelength_nm * 1e-3 for e in found}, reverse=True)
    here = (
        f"Sq/λ {_span([sq / w for w in waves])}, correlation length/λ {_span([correlation / w for w in waves])}, slope "
        f"{number(slope, 2)}, θᵢ up to {angle(max(e.theta_i_deg for e in found))}"
    )
    ranges = (
        f"Sq/λ {_span([min(c.sq for c in known), max(c.sq for c in known)])}, slope "
        f"{_span([min(c.slope for c in known), max(c.slope for c in known)])}, θᵢ up to "
        f"{angle(max(c.theta_i_deg for c in known))}"
    )
    tested = f"Tested by the full wave on Gaussian profiles and by rigorous gratings ({ranges})"
    beyond = list(dict.fromkeys(line for e in found for line in e.beyond))
    if beyond:
        text = "; ".join(beyond[:3]).replace("θ_i", "θᵢ")
        what = f"This surface ({here}) is not like any of them: {text}. The nearest that is steeper and finer: "
    else:
        what = f"This surface ({here}) is within that; the nearest: "
    near = f"{worst.nearest}".replace("θ_i", "θᵢ")
    return f"{tested}. {what}{near}{_depths(worst)}."


def _depths(worst: Expectation) -> str:
    """How dark the directions may be, where it was tested."""
    if worst.theory != "kirchhoff" or not worst.nearest.reach >= 1:
        return ""
    dark = number(10 ** -math.floor(worst.nearest.reach), 1).removeprefix("1·")
    return f". There it holds within a factor 1.25 down to {dark} of the lobe's peak; mistrust darker directions"


def _span(values: Sequence[float]) -> str:
    low, high = (number(v, 2) for v in (min(values), max(values)))
    return low if low == high else f"{low} … {high}"
