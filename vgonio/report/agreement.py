"""How far results of one scene are apart, pair by pair, and how much of that their noise explains."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from ..compare.metrics import align, nrmse
from ..errors import InputError
from . import quantities as q

ALIKE = 0.01  # relative difference of lengths and cones that is none


@dataclass(frozen=True)
class Agreement:
    """How far two results are apart. Medians are of |a − b|/b where b exceeds 10⁻³ of its largest value."""

    names: tuple[str, str]
    nrmse: float  # over all common directions and wavelengths
    noise: float  # the NRMSE that the standard errors alone would give; NaN where there are none
    median: float
    mirror_side: float  # the median where θ_o and θ_i lie on different sides of the normal, in plane
    source_side: float
    within: float  # share of the directions that differ by less than a tenth, averaged over the spectrum
    directions: int


def pairs(results: Mapping[str, xr.Dataset]) -> list[Agreement]:
    """Every pair of results that have directions and wavelengths in common; the second, the reference, is the later."""
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
    spread = relative.mean("wavelength")
    known = np.isfinite(spread)
    mirror_side = source_side = math.nan
    if q.in_plane(y):
        side = y["theta_o"] * y["theta_i"]
        mirror_side, source_side = (float(relative.where(chosen).median()) for chosen in (side < 0, side > 0))
    return Agreement(
        (a, b),
        float(nrmse(results[b], results[a])),
        # two theories of one surface see the same windows: their speckle is no difference between them
        math.nan if a.startswith("waves") and b.startswith("waves") else noise_of(x, y, both),
        float(relative.median()),
        mirror_side,
        source_side,
        float((spread < 0.1).where(known).mean()),
        int(known.sum()),
    )


def noise_of(x: xr.Dataset, y: xr.Dataset, both: Any) -> float:
    """NRMSE that the standard errors alone would give; y is the reference."""
    parts = [(d["brdf_stderr"] ** 2).where(both) for d in (x, y) if "brdf_stderr" in d]
    mean = float(y["brdf"].where(both).mean())
    return float(np.sqrt(sum(float(p.mean()) for p in parts)) / mean) if parts and mean > 0 else math.nan


def unlike(x: xr.Dataset, y: xr.Dataset) -> str:
    """What two results were not simulated alike in, so that their difference is not one of theories; "" for none.

    That is the coherence length, the part of the surface that coherence windows light, and the detector's cones.
    """
    found = []
    lengths = [_number(d.attrs.get("coherence_um")) for d in (x, y)]
    if all(map(math.isfinite, lengths)) and not math.isclose(*lengths, rel_tol=ALIKE):
        found.append(f"coherence_um is {lengths[0]:.3g} and {lengths[1]:.3g} µm, so that one's lobes are broader")
    used, tiled = ([_number(d.attrs.get(name)) for d in (x, y)] for name in ("windows_used", "windows_tiled"))
    if not found and all(map(math.isfinite, used)) and used[0] != used[1] and tiled[0] == tiled[1]:
        found.append(f"they saw {used[0]:g} and {used[1]:g} coherence windows of the surface, whose speckle differs")
    cones = [_cone(d) for d in (x, y)]
    if all(map(math.isfinite, cones)) and not math.isclose(*cones, rel_tol=ALIKE):
        found.append(f"their detector cones have {cones[0]:.3g} and {cones[1]:.3g} sr")
    if not found:
        return ""
    return f"This does not blame a theory: {', and '.join(found)}; compare them simulated alike."


def _number(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        return math.nan


def _cone(data: xr.Dataset) -> float:
    """Median solid angle of the detector's elements in sr; NaN where unknown."""
    return float(np.median(data["solid_angle"])) if "solid_angle" in data.coords else math.nan
