"""What happens at the sides of a finite sample: a guard band or, as the last resort, its mirror images."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..directions import Incoming
from ..surface.heightfield import Heightfield
from ..surface.mesh import mirrored
from ..surface.symmetry import leaning, leaning_in_words
from .beam import Scene

if TYPE_CHECKING:
    from .rays import RayOptics

Mask = NDArray[np.bool_]
LOST_ENOUGH = 5e-4  # of a trial's rays through the sides, from which on a sample is mirrored that looks alike then
LOST_RATHER = 0.01  # and one whose slopes lean to one side: to lose so much is the lesser evil, and energy_lost tells
TRIAL = 20_000  # rays at an angle of incidence
PERIODIC, GUARD, MIRROR = "periodic", "guard band", "mirrored 2 × 2 supercell"
NAMED = 4  # angles of incidence that are named one by one


def scenes(solver: RayOptics, surface: Heightfield, incoming: Incoming) -> tuple[list[Scene], Mask]:
    """(t,) mesh and tracer for every angle of incidence, and (t,) where they are those of the mirrored supercell."""
    n = len(incoming.theta_deg)
    if surface.periodic:
        return [Scene.of(surface, solver.refinement, solver.tracer)] * n, np.zeros(n, bool)
    own = None if solver.edges == "mirror" else Scene.of(surface, solver.refinement, solver.tracer)
    mirror = np.ones(n, bool) if own is None else _need_mirrors(solver, own, surface, incoming)
    if own is not None and not mirror.any():
        return [own] * n, mirror
    twin = Scene.of(mirrored(surface), solver.refinement, solver.tracer)
    return [twin if m or own is None else own for m in mirror], mirror


def mirrored_at(solver: RayOptics, surface: Heightfield, incoming: Incoming) -> Mask:
    """(t,) at which angles of incidence a run of the solver will continue the sample by its mirror images."""
    n = len(incoming.theta_deg)
    if surface.periodic or solver.edges != "auto":
        return np.full(n, not surface.periodic and solver.edges == "mirror")
    return _need_mirrors(solver, Scene.of(surface, solver.refinement, solver.tracer), surface, incoming)


def _need_mirrors(solver: RayOptics, own: Scene, surface: Heightfield, incoming: Incoming) -> Mask:
    """(t,) where the guard band loses too much. All is well where the steepest and the most oblique light say so."""
    n = len(incoming.theta_deg)
    if solver.edges == "guard":
        return np.zeros(n, bool)
    allowed = LOST_RATHER if leaning(surface) else LOST_ENOUGH
    oblique = np.abs(incoming.theta_deg)
    lost = {i: _loses(own, incoming, i, solver.max_bounces) for i in {int(oblique.argmax()), int(oblique.argmin())}}
    if max(lost.values()) < allowed:
        return np.zeros(n, bool)
    every = (lost[i] if i in lost else _loses(own, incoming, i, solver.max_bounces) for i in range(n))
    return np.array([share >= allowed for share in every])


def _loses(scene: Scene, incoming: Incoming, i: int, max_bounces: int) -> float:
    """Share of a trial of rays that leaves through the sides; 1 where no ray can start."""
    if scene.start_area(incoming, i) is None:
        return 1.0
    paths = scene.paths(incoming, i, TRIAL, np.random.default_rng(0), max_bounces, 5000)
    # what the limit of reflections stops would be stopped on the mirrored sample as well
    return sum(int((~p.escaped & (p.bounces < max_bounces)).sum()) for p in paths) / TRIAL


def edges_in_words(surface: Heightfield, incoming: Incoming, mirror: Mask) -> str:
    """Which of the three was used, at which angles of incidence."""
    if surface.periodic:
        return PERIODIC
    if not mirror.any():
        return GUARD
    return MIRROR if mirror.all() else f"{MIRROR} at {_angles(incoming, mirror)}, else {GUARD}"


def caution(surface: Heightfield, incoming: Incoming, mirror: Mask) -> str:
    """What mirror images do to the result of a surface whose slopes lean to one side; empty where they do no harm."""
    if not mirror.any():
        return ""
    lean = leaning_in_words(surface)
    if not lean:
        return ""
    return (
        f"rays at {_angles(incoming, mirror)}: too much light leaves through the sides of this sample, so it was "
        f"continued by its mirror images, but its slopes lean to one side {lean}: what is computed there is the "
        "surface and its mirror images in one, symmetric where the surface is not; take a larger sample, "
        "periodic = true if it repeats, or smaller angles of incidence"
    )


def _angles(incoming: Incoming, mirror: Mask) -> str:
    found = [f"{t:g}" for t in np.asarray(incoming.theta_deg)[mirror]]
    if len(found) > NAMED:
        return f"{len(found)} of {len(mirror)} θ_i, {found[0]}° … {found[-1]}°"
    return f"θ_i = {', '.join(found)}°"
