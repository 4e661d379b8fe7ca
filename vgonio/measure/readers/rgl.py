"""RGL `.bsdf` (Dupuy and Jakob 2018): spectral or RGB, isotropic or at one azimuth; needs no renderer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ...errors import FileFormatError
from .. import tensor_file
from ..isotropic import IsotropicBrdf, sampled
from ..rgl_brdf import evaluator
from .channels import nominal
from .checks import Repairs, check_values


def sniff(head: bytes) -> bool:
    return head.startswith(tensor_file.MAGIC)


def read(
    path: Path,
    repairs: Repairs,
    *,
    theta_i_deg: ArrayLike | None = None,
    theta_o_deg: ArrayLike | None = None,
    resolution_deg: float | None = None,
) -> xr.Dataset:
    """The dataset at the angles asked for (`measure.isotropic.sampled`), at the wavelengths of the file.

    Anisotropic files are read at the azimuth 0 of incidence.
    """
    brdf, attrs = load(path)
    attrs = {"source": path.name} | attrs
    return sampled(brdf, theta_i_deg, theta_o_deg, resolution_deg, attrs).sortby("wavelength")


def load(path: Path) -> tuple[IsotropicBrdf, dict[str, Any]]:
    """The BRDF of the file as a function of two directions, and its description.

    Raises FileFormatError for damaged files and those that are no BRDF of RGL.
    """
    fields = tensor_file.read(path)
    attrs: dict[str, Any] = {}
    if "description" in fields:
        attrs["description"] = bytes(fields["description"].astype(np.uint8)).decode("utf-8", "replace").strip("\0 ")
    if "spectra" in fields and "wavelengths" in fields:
        wavelength, spectra = fields["wavelengths"].astype(float).ravel(), fields["spectra"]
    elif "rgb" in fields:
        wavelength, attrs["channels"] = nominal(["R", "G", "B"], str(path))
        spectra = fields["rgb"]
    else:
        raise FileFormatError(
            f"{path} has neither 'spectra' with 'wavelengths' nor 'rgb', only {', '.join(fields)[:200]}"
        )
    check_values(np.zeros(0), wavelength, str(path))
    return evaluator(fields, wavelength, spectra, str(path)), attrs
