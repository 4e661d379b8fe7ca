"""What a scene will do before it is done: every stage with its reason, library and rough cost, and what to be wary of.

Planning reads the surface (and a measured file) but simulates nothing and loads no ray or wave library.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any

from .. import assembly
from ..accuracy.calibration import calibration
from ..scene import Scene, load_scene
from . import stages
from .cautions import warnings_of
from .outputs import check_output, check_outputs, with_folder
from .parts import forecasts
from .plans import Plan, Stage
from .sizes import detector_elements, refinement, result_groups

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


def plan(scene: str | os.PathLike[str] | Mapping[str, Any] | Scene, overrides: Iterable[str] = ()) -> Plan:
    """The plan of a scene: what is done, left out and why, rough costs, warnings. Nothing is simulated.

    Raises what `simulate` would raise for bad input: InputError, FileFormatError, MaterialError.
    """
    checked = load_scene(scene, overrides)
    check_outputs(checked)
    return plan_of(checked, assembly.gather(checked))


def plan_of(scene: Scene, inputs: assembly.Inputs) -> Plan:
    """The plan of a checked scene whose inputs were read already."""
    on = calibration()
    expected = forecasts(scene, inputs.source, inputs.surface, on)
    found = [
        *stages.start_stages(),
        *stages.surface_stages(scene, inputs.source),
        *stages.ray_stages(scene, inputs.surface),
        *stages.wave_stages(scene, inputs.surface),
        *stages.verdict_stages(scene),
        *stages.output_stages(scene),
    ]
    made = stages.with_forecasts(found, expected)
    return Plan(scene.name, tuple(made), tuple(warnings_of(scene, inputs, expected)), str(on))
