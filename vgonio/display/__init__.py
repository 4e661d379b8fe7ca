"""5. Use it: a colour that arrives. Characterisation and calibration of displays (thesis chapter 5).

>>> display = vg.display.virtual_display("wide-gamut", crosstalk=0.02)
>>> model = vg.display.fit(display.measure(vg.display.ramp_colours(levels=18)))
>>> model.backward([20.0, 21.0, 23.0]).rgb

The model has one colour for the whole panel and no lens in front of it, as the thesis'.
"""

from .assumptions import Assumptions
from .cube import lut, lut_error, write_cube
from .examination import Examined, examine, examine_virtual
from .files import read, write
from .icc import write_icc
from .model import Controls, DisplayModel, fit
from .patches import Patches, patches
from .primaries import Primaries, primaries
from .readings import Readings, grid_colours, quantise, ramp_colours
from .summary import coverage, summary
from .tone import ToneCurve, tone_curve
from .verification import (
    CalibrationCheck,
    ModelCheck,
    Targets,
    check_calibration,
    check_model,
    looked_up,
    targets,
)
from .virtual import VirtualDisplay, virtual_display

__all__ = [
    "Assumptions",
    "CalibrationCheck",
    "Controls",
    "DisplayModel",
    "Examined",
    "ModelCheck",
    "Patches",
    "Primaries",
    "Readings",
    "Targets",
    "ToneCurve",
    "VirtualDisplay",
    "check_calibration",
    "check_model",
    "coverage",
    "examine",
    "examine_virtual",
    "fit",
    "grid_colours",
    "looked_up",
    "lut",
    "lut_error",
    "patches",
    "primaries",
    "quantise",
    "ramp_colours",
    "read",
    "summary",
    "targets",
    "tone_curve",
    "virtual_display",
    "write",
    "write_cube",
    "write_icc",
]
