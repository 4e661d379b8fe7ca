"""Whether two results were simulated alike, so that their difference is one of theories."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr

ALIKE = 0.01  # relative difference of lengths and cones that is none


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
