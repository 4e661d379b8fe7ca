"""All figures of the report, each a function from a dataset to a matplotlib Figure; they work in a notebook too.

>>> tree = vg.open("result.nc")
>>> vg.report.figures.decomposition(tree["rays"].to_dataset())
"""

from .agreement_figures import agreement
from .brdf_figures import decomposition, energy, lobes, wave_energy
from .fit_figures import beside_measured, explained, models_beside, shift_parts
from .grating_figures import orders, theory_errors
from .hemisphere_figures import polar_decomposition, polar_maps
from .path_figures import mueller, ways
from .spectral_figures import delta_e_maps, rgb_maps, shift_slopes, spectra
from .surface_figures import height_histogram, psd, slope_histogram, surface_map

__all__ = [
    "agreement",
    "beside_measured",
    "decomposition",
    "delta_e_maps",
    "energy",
    "explained",
    "height_histogram",
    "lobes",
    "mueller",
    "models_beside",
    "orders",
    "polar_decomposition",
    "polar_maps",
    "psd",
    "rgb_maps",
    "shift_parts",
    "shift_slopes",
    "slope_histogram",
    "spectra",
    "surface_map",
    "theory_errors",
    "ways",
    "wave_energy",
]
