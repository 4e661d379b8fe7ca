"""4. The verdict: errors, colour and linear wavelength shift between results, simulated or measured.

Importing this package loads neither colour-science nor lmfit; the functions that need them do.
"""

from .colour import delta_e_2000, rgb_map, xyz
from .comparison import compare
from .explained import explained_shares
from .exponent import check_p
from .fit_files import broken_physics, evaluate_fit, fit_parameters, open_fit, save_fit
from .gloss import gloss, haze
from .gratings import order_errors
from .looks import appearance
from .metrics import align, nrmse, nse, rmse
from .model_fit import fit_model
from .model_table import fit_models, model_table
from .reflectances import reflectance, total_integrated_scatter
from .shift import fit_global_shift, fit_local_shift, fitted_spectra
from .summary import summary
from .two_shift_fit import fit_two_shifts, single_share

__all__ = [
    "align",
    "appearance",
    "broken_physics",
    "check_p",
    "compare",
    "delta_e_2000",
    "evaluate_fit",
    "explained_shares",
    "fit_global_shift",
    "fit_local_shift",
    "fit_model",
    "fit_models",
    "fit_parameters",
    "fit_two_shifts",
    "fitted_spectra",
    "gloss",
    "haze",
    "model_table",
    "nrmse",
    "nse",
    "open_fit",
    "order_errors",
    "reflectance",
    "rgb_map",
    "rmse",
    "save_fit",
    "single_share",
    "summary",
    "total_integrated_scatter",
    "xyz",
]
