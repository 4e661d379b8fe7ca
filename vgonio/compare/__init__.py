"""4. The verdict: errors, colour and linear wavelength shift between results, simulated or measured.

Importing this package loads neither colour-science nor lmfit; the functions that need them do.
"""

from .colour import delta_e_2000, rgb_map, xyz
from .comparison import compare
from .metrics import align, nrmse, nse, rmse
from .shift import fit_global_shift, fit_local_shift
from .summary import summary

__all__ = [
    "align",
    "compare",
    "delta_e_2000",
    "fit_global_shift",
    "fit_local_shift",
    "nrmse",
    "nse",
    "rgb_map",
    "rmse",
    "summary",
    "xyz",
]
