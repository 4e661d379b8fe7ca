"""From readings, or from a virtual display, to all that can be said of a display: model, framework 1, framework 2."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .model import DisplayModel, fit
from .patches import Patches
from .readings import SAME_SIGNAL, Readings, grid_colours, ramp_colours
from .verification import CalibrationCheck, ModelCheck, check_calibration, check_model, looked_up, targets
from .virtual import VirtualDisplay

STEP = 85  # of 255: the grid of thesis section 5.3


@dataclass(frozen=True)
class Examined:
    """All that is known of one display or eye: its model and, where there were test colours, frameworks 1 and 2."""

    model: DisplayModel
    check: ModelCheck | None = None
    calibration: CalibrationCheck | None = None


def examine(
    readings: Readings, tests: Readings | None = None, patches: Patches | None = None, bits: int = 8
) -> Examined:
    """Fit the model to readings, and verify it with test colours where there are any.

    tests : further readings. None takes those among `readings` that lie on the grid of step 85, if several channels
        are on in some; those that the model was fitted to then count too. Repeated colours are averaged. Tests on the
        grid count for framework 1, or all where fewer than 10 lie on it.
    patches : of framework 2; the signals that `targets` gives for them must be among the tests. None leaves it out.
    Raises InputError where readings for a part that was asked for are missing.
    """
    model = fit(readings)
    colours = (readings if tests is None else tests).averaged()
    on_grid = colours.where(np.flatnonzero(_on_grid(colours)))
    chosen = on_grid if len(on_grid) >= 10 else colours
    several = (chosen.rgb > SAME_SIGNAL).sum(axis=1) > 1
    white = np.all(chosen.rgb > 1 - SAME_SIGNAL, axis=1)
    check = check_model(model, readings, chosen) if tests is not None or np.any(several & ~white) else None
    calibration = None
    if patches is not None:
        calibration = check_calibration(targets(model, patches, bits), looked_up(colours))
    return Examined(model, check, calibration)


def _on_grid(readings: Readings) -> np.ndarray:
    steps = readings.rgb * 255 / STEP
    return np.all(np.abs(steps - np.round(steps)) < 255 / STEP * SAME_SIGNAL, axis=1) if len(readings) else np.array([])


def examine_virtual(
    display: VirtualDisplay,
    patches: Patches | None = None,
    levels: int = 18,
    bits: int | None = 8,
    eye: str = "",
) -> tuple[Examined, Readings]:
    """Characterise and verify a virtual display as one would a real one, reading after reading; also all readings.

    bits : of the signals sent, those of framework 2 too; None does not round them. Raises InputError for more bits than
    the display takes.
    """
    if bits is not None and display.bits is not None and display.bits < bits:
        raise InputError(f"signals of {bits} bits to a display of {display.bits}: take bits = {display.bits}")
    ramps = display.measure(ramp_colours(levels, bits), eye=eye)
    grid = display.measure(grid_colours(STEP), start=len(ramps), eye=eye)
    model = fit(ramps)
    check = check_model(model, ramps, grid)
    shown = [ramps, grid]
    calibration = None
    if patches is not None:

        def measure(rgb: np.ndarray) -> np.ndarray:
            shown.append(display.measure(rgb, start=sum(map(len, shown)), eye=eye))
            return shown[-1].xyz

        calibration = check_calibration(targets(model, patches, bits), measure)
    everything = Readings(
        np.concatenate([r.rgb for r in shown]), np.concatenate([r.spectra for r in shown]), display.wavelength_nm, eye
    )
    return Examined(model, check, calibration), everything
