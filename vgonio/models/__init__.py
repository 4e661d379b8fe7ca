"""BRDF formulas, one author and year a file, behind one table.

>>> evaluate("cook-torrance-1982", [0, 30], range(-80, 81, 10), [450, 550, 650], alpha=0.3, material="Al")
>>> for row in table(): print(*row)
>>> physics("clausen-2022", [400, 700], alpha=0.3, h=5e-3, w=3).attrs["broken"]
"""

from . import (
    beckmann_1963,
    clausen_2022,
    cook_torrance_1982,
    harvey_1976,
    krywonos_2011,
    lambert_1760,
    oren_nayar_1994,
    two_shifts,
    walter_2007,
)
from .checks import directional_albedo, physics
from .evaluation import brdf, evaluate
from .geometry import Geometry
from .half_angle import half_angles
from .registry import MODELS, RANGES, Model, Range, find, table

__all__ = [
    "MODELS",
    "RANGES",
    "Geometry",
    "Model",
    "Range",
    "beckmann_1963",
    "brdf",
    "clausen_2022",
    "cook_torrance_1982",
    "directional_albedo",
    "evaluate",
    "find",
    "half_angles",
    "harvey_1976",
    "krywonos_2011",
    "lambert_1760",
    "oren_nayar_1994",
    "physics",
    "table",
    "two_shifts",
    "walter_2007",
]
