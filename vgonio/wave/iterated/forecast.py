"""What iterated Kirchhoff will do and cost, for the plan: nothing is computed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...directions import Incoming
from ...surface.heightfield import Heightfield
from ...surface.visibility import single_reflections
from .choice import choose
from .equation import rule_of
from .far_patch import PER_SPECKLE
from .place import Places
from .solver import IteratedKirchhoff
from .sweeps import KEPT

SWEPT = {"perfect": 0.7, "impedance": 0.9, "media": 2.5}  # an entry of the matrices, in pairs of sight and reflections


@dataclass(frozen=True)
class Counts:
    """points : of one window at the shortest wavelength;  pairs : of points, all reflections, windows and wavelengths;
        those of sweeps are counted in pairs of sight and reflections of a profile, by what they take
    far : points × directions of the far fields of patches"""

    points: float
    pairs: float
    far: float
    windows: int
    window_um: float
    independent: float
    how: str = ""


VISITED = 0.03  # time to find that a pair of points of a patch does not see each other, over that to sum one that does
IN_BLOCKS = 0.3  # the same of a pair that is summed as part of a block


def counts(solver: IteratedKirchhoff, surface: Heightfield, incoming: Incoming) -> Counts:
    """What `scatter` will have to do; InputError where it would refuse the windows."""
    places = Places.of(surface, solver.window_um, incoming.coherence_um, solver.windows)
    many = int(np.count_nonzero(~np.asarray(single_reflections(surface, incoming.theta_deg))))
    points, pairs, far, share, how = 0.0, 0.0, 0.0, 1.0, ""
    per = solver.per(surface)
    if not surface.is_profile and many and solver.bounces > 1:
        chosen = choose(solver, surface, places)
        share = VISITED + chosen.visible * (1 - (1 - IN_BLOCKS) * chosen.whole * chosen.blocks)
        how = f"{chosen.name}: {chosen.why}"
    for w in np.asarray(solver.wavelength_nm) * 1e-3:
        along = places.window_um * per / w
        n = along if surface.is_profile else along**2
        points = max(points, n)
        pairs += n**2 * len(places.windows) * (1 if surface.is_profile else many * max(solver.bounces - 1, 0) * share)
        if surface.is_profile and many and solver.bounces > 1 and solver.sweeps:
            pairs += n**2 * len(places.windows) * _sweeping(solver, n, 1e3 * w, incoming.polarisation)
        if solver.energy and not surface.is_profile:
            far += n * np.pi * (PER_SPECKLE * places.length_um / w) ** 2 * len(places.windows) * len(incoming.theta_deg)
    return Counts(points, pairs, far, len(places.windows), places.window_um, places.independent, how)


def forecast(solver: IteratedKirchhoff, surface: Heightfield, incoming: Incoming) -> tuple[str, str]:
    """(what is done for which θ_i, what it costs); InputError where `scatter` would refuse the windows."""
    once = single_reflections(surface, incoming.theta_deg)
    many = [f"{t:g}°" for t, o in zip(incoming.theta_deg, once) if not o]
    single = [f"{t:g}°" for t, o in zip(incoming.theta_deg, once) if o]
    bounces = f"{solver.bounces} reflections at θ_i = {', '.join(many)}" if many and solver.bounces > 1 else ""
    one = f"one at {', '.join(single)}, where |θ_i| + 3 × the steepest slope stays below 90°" if single else ""
    swept = f"{solver.sweeps} sweeps for diffraction" if bounces and surface.is_profile and solver.sweeps else ""
    what = "; ".join(part for part in (bounces, swept, one) if part) or "one reflection"
    n = counts(solver, surface, incoming)
    where = "" if n.windows == 1 else f" in each of {n.windows} windows"
    return what, f"window_um = {n.window_um:g}, about {n.points:,.0f} points{where}, {n.pairs:.1e} pairs in all" + (
        f"; {n.how}" if n.how else ""
    )


def _sweeping(solver: IteratedKirchhoff, points: float, wavelength_nm: float, polarisation: str) -> float:
    """What the sweeps over one window take, over its pairs: matrices are made once, or in every pass if not kept."""
    rule, _ = rule_of(solver.material, wavelength_nm, solver.points_per_wavelength or 10.0)  # type: ignore[arg-type]
    if rule is None:
        return 0.0
    lights = 2 if polarisation == "unpolarised" or solver.polarised else 1
    kept = points**2 * (4 if rule == "media" else 1) <= KEPT
    return lights * SWEPT[rule] * (1 if kept else 2 * solver.sweeps)
