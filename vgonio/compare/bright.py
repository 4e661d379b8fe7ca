"""Where a BRDF catches light: elsewhere its colour, and a relative difference from it, says nothing."""

from __future__ import annotations

import numpy as np
import xarray as xr

from ..dataset import takes_nodes
from .colour import delta_e_2000
from .metrics import align

DIM = 1e-3  # of the largest value over the detector: down to there an error is promised


def numerical_floor(data: xr.Dataset) -> float:
    """Share of the largest value over the detector below which the numerical error of waves leaves nothing; else 0."""
    error = data.attrs.get("error_achieved") if "theory" in data.attrs else None
    known = isinstance(error, (int, float, np.number)) and np.isfinite(error)
    return float(error) if known and error is not None else 0.0


def bright(data: xr.Dataset) -> xr.DataArray:
    """Where brdf exceeds 10⁻³ of its largest value over the detector, the part for which an error is promised.

    Neither is a value bright below the numerical error of waves, nor, of rays and measurements, one that does not
    exceed its own standard error; the speckle of waves is as bright as it is.
    """
    dim = "theta_o" if "theta_o" in data["brdf"].dims else "cell"
    seen = data["brdf"] > max(DIM, numerical_floor(data)) * data["brdf"].max(dim)
    if "brdf_stderr" in data and "theory" not in data.attrs:
        seen &= ~(data["brdf"] <= data["brdf_stderr"])
    return seen


def bright_spectra(data: xr.Dataset) -> xr.DataArray:
    """Where at least half of the spectrum is `bright`: elsewhere its colour says nothing."""
    return bright(data).mean("wavelength") >= 0.5


def both_bright(reference: xr.Dataset, predicted: xr.Dataset) -> xr.DataArray:
    """Where the spectra of two aligned BRDFs are both bright, (theta_i, theta_o or cell)."""
    seen = [bright_spectra(d) for d in (reference, predicted)]
    return (seen[0] & seen[1]).drop_vars("solid_angle", errors="ignore")


@takes_nodes
def colour_difference(reference: xr.Dataset, predicted: xr.Dataset, scale: str) -> xr.DataArray:
    """`delta_e_2000`; of the colour alone, "normalised", only where both catch light.

    attrs["dark"] counts the pairs of directions left out for that. Raises InputError as `delta_e_2000`.
    """
    difference = delta_e_2000(reference, predicted, scale)
    if scale != "normalised":
        return difference
    both = both_bright(*align(reference, predicted))
    return difference.where(both).assign_attrs(difference.attrs | {"dark": int(np.sum(~both.values))})
