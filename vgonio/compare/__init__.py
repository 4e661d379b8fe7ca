"""4. The verdict: errors, colour and linear wavelength shift between results, simulated or measured.

Importing this package loads neither colour-science nor lmfit; the functions that need them do.
"""

from .colour import delta_e_2000, rgb_map, xyz
from .comparison import compare
from .fit_files import evaluate_fit, fit_parameters, open_fit, save_fit
from .metrics import align, nrmse, nse, rmse
from .model_fit import fit_model
from .shift import fit_global_shift, fit_local_shift, fitted_spectra
from .summary import summary
from .two_shift_fit import fit_two_shifts, single_share

__all__ = [
    "align",
    "compare",
    "delta_e_2000",
    "evaluate_fit",
    "fit_global_shift",
    "fit_local_shift",
    "fit_model",
    "fit_parameters",
    "fit_two_shifts",
    "fitted_spectra",
    "nrmse",
    "nse",
    "open_fit",
    "rgb_map",
    "rmse",
    "save_fit",
    "single_share",
    "summary",
    "xyz",
]
