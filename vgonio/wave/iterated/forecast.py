"""What iterated Kirchhoff will do and cost, for the plan: nothing is computed."""

from __future__ import annotations

import numpy as np

from ...directions import Incoming
from ...surface.heightfield import Heightfield
from ...surface.visibility import single_reflections
from .far_patch import PER_SPECKLE
from .place import Places
from .solver import IteratedKirchhoff

PROFILE_RATE = 1e7  # pairs a second of sight and one reflection of a profile, one processor
PATCH_RATE = 4e8  # pairs a second of a reflection of a patch, PoCL on two processors
FAR_RATE = 3e7  # points × directions a second of a patch's far field, two reflections


def forecast(solver: IteratedKirchhoff, surface: Heightfield, incoming: Incoming) -> tuple[str, str]:
    """(what is done for which θ_i, what it costs); InputError where `scatter` would refuse the windows."""
    places = Places.of(surface, solver.window_um, incoming.coherence_um, solver.windows)
    once = single_reflections(surface, incoming.theta_deg)
    many = [f"{t:g}°" for t, o in zip(incoming.theta_deg, once) if not o]
    single = [f"{t:g}°" for t, o in zip(incoming.theta_deg, once) if o]
    bounces = f"{solver.bounces} reflections at θ_i = {', '.join(many)}" if many and solver.bounces > 1 else ""
    one = f"one at {', '.join(single)}, where |θ_i| + 3 × the steepest slope stays below 90°" if single else ""
    what = "; ".join(part for part in (bounces, one) if part) or "one reflection"
    points, pairs, far = 0.0, 0.0, 0.0
    per = solver.per(surface)
    for w in np.asarray(solver.wavelength_nm) * 1e-3:
        along = places.window_um * per / w
        n = along if surface.is_profile else along**2
        points = max(points, n)
        pairs += n**2 * len(places.windows) * (1 if surface.is_profile else len(many) * max(solver.bounces - 1, 0))
        if solver.energy and not surface.is_profile:
            far += n * np.pi * (PER_SPECKLE * places.length_um / w) ** 2 * len(places.windows) * len(incoming.theta_deg)
    seconds = pairs / (PROFILE_RATE if surface.is_profile else PATCH_RATE) + far / FAR_RATE
    where = "" if len(places.windows) == 1 else f" in each of {len(places.windows)} windows"
    return what, (
        f"window_um = {places.window_um:g}, about {points:,.0f} points{where}, {pairs:.1e} pairs in all; about "
        f"{max(seconds, 0.1):.1g} s"
    )
