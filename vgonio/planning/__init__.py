"""What a scene will do before it is done: every stage with its reason, library and rough cost, and what to be wary of.

Planning reads the surface (and a measured file) but simulates nothing and loads no ray or wave library, unless nothing
but a first look at some rays tells: how many a tolerance will take; whether a finite sample whose slopes lean to one
side has to be mirrored; what reflections and patches of iterated Kirchhoff leave out, where those are chosen. And
`plan` (not `simulate`, which plans as well) takes one where only that tells the error of the rays, into cones by chosen
facets, if it takes no more than half a second or a twentieth of the run: the plan says so.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from .. import assembly
from ..accuracy.calibrating import Calibration, calibration
from ..errors import ToleranceError, VgonioError
from ..scene import Scene, load_scene
from . import stages
from .cautions import refusal, warnings_of
from .forecast import LEAST_WAVE_TOL, Forecast
from .outputs import check_output, check_outputs, with_folder
from .parts import forecasts
from .plans import Plan, Stage
from .sizes import detector_elements, refinement, result_groups
from .slips import suspected

__all__ = [
    "Plan",
    "Stage",
    "check_output",
    "check_outputs",
    "detector_elements",
    "plan",
    "plan_of",
    "refinement",
    "result_groups",
    "with_folder",
]


def plan(
    scene: str | os.PathLike[str] | Mapping[str, Any] | Scene,
    overrides: Iterable[str] = (),
    max_seconds: float | None = None,
    tol: float | None = None,
    new_process: bool = False,
) -> Plan:
    """The plan of a scene: what is done, left out and why, seconds, memory and error, warnings. Nothing is simulated,
    but that a first look at some rays is taken where nothing else tells their number or their error.

    max_seconds, tol : choose methods and efforts that meet them, see `planning.choice`; the scene's own are replaced
    new_process : of a run in a process of its own, as of `vgonio simulate`, with the start of Python and all libraries;
        otherwise of one in this process, without what it has loaded already

    Raises what `simulate` would raise: InputError, FileFormatError and MaterialError for bad input, ToleranceError
    where no methods meet `max_seconds` and `tol`.
    """
    checked = load_scene(scene, overrides)
    check_outputs(checked)
    return plan_of(checked, assembly.gather(checked), max_seconds, tol, first_look=True, new_process=new_process)[1]


def plan_of(
    scene: Scene, inputs: assembly.Inputs, max_seconds: float | None = None, tol: float | None = None,
    first_look: bool = False, new_process: bool = False, on: Calibration | None = None,
) -> tuple[Scene, Plan]:  # fmt: skip
    """A checked scene whose inputs were read already, with what was chosen for time and tolerance, and its plan.

    first_look : at some rays, where only they tell what their error will be
    new_process : as `plan`;  on : the machine, by default this one with the threads of this process
    """
    try:
        return _plan_of(scene, inputs, max_seconds, tol, first_look, new_process, on)
    except VgonioError as e:
        raise type(e)(suspected(scene, inputs, str(e))) from None


def _plan_of(
    scene: Scene, inputs: assembly.Inputs, max_seconds: float | None, tol: float | None,
    first_look: bool, new_process: bool, on: Calibration | None,
) -> tuple[Scene, Plan]:  # fmt: skip
    if scene.wave is not None and scene.wave.tol < LEAST_WAVE_TOL:
        least = f"double precision gives {LEAST_WAVE_TOL:g} at best: take wave.tol = {LEAST_WAVE_TOL:g} or more"
        raise ToleranceError(f"wave.tol = {scene.wave.tol:g} cannot be met: {least}")
    on = calibration() if on is None else on
    chosen = None
    if max_seconds is not None or tol is not None:
        from .choice import choose

        chosen = choose(scene, inputs.surface, inputs.source, on, max_seconds, tol, new_process)
        scene = chosen.scene
    expected = forecasts(scene, inputs.source, inputs.surface, on, first_look=first_look, new_process=new_process)
    if chosen is not None:
        expected = _with_left_out(scene, expected, *chosen.left_out)
    found = [
        *stages.start_stages(new_process),
        *stages.surface_stages(scene, inputs.source, inputs.surface),
        *stages.ray_stages(scene, inputs.surface),
        *stages.wave_stages(scene, inputs.surface),
        *stages.verdict_stages(scene),
        *stages.output_stages(scene),
    ]
    made = Plan(
        scene.name,
        tuple(stages.with_forecasts(found, expected)),
        tuple(warnings_of(scene, inputs, expected)),
        str(on),
        chosen.settings if chosen else {},
        chosen.alternatives if chosen else (),
        suspected(scene, inputs, refusal(scene, expected)),
    )
    return scene, made


def _with_left_out(scene: Scene, expected: dict[str, Forecast], error: float, why: str) -> dict[str, Forecast]:
    """The same with the error of what a choice leaves out of iterated Kirchhoff, which the solver does not state."""
    iterated = [n for n, theory in assembly.wave_groups(scene).items() if theory == "iterated-kirchhoff" and why]
    changed = {n: replace(expected[n], error=max(error, expected[n].error or 0.0), how=f"left out is {why}")
               for n in iterated}  # fmt: skip
    return {**expected, **changed}
