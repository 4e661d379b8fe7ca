"""How accurate, and how long: every solver on cases whose answer is known, asked and achieved error beside the seconds.

>>> from vgonio.accuracy import run_cases
>>> table = run_cases(["sinusoid-nufft", "v-groove"])
"""

from .calibrating import Calibration, calibrate, calibration, calibration_path
from .cases import CASES, Case, Outcome
from .measuring import machine, run_cases, select
from .speeds import Speeds

__all__ = [
    "CASES",
    "Calibration",
    "Case",
    "Outcome",
    "Speeds",
    "calibrate",
    "calibration",
    "calibration_path",
    "machine",
    "run_cases",
    "select",
]
