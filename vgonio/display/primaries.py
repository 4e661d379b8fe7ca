"""Emission spectra of primaries: a wide-gamut set of narrow bands, colour-science's, and files."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..compare.colour import _colour
from ..errors import FileFormatError, InputError, nearest
from ..files import is_file, text_of

Floats = NDArray[np.float64]
# centre and full width at half maximum in nm: chosen so that the chromaticities lie near those of Adobe RGB (1998), as
# those of the emissive headset of thesis figure 5.4 do
WIDE_GAMUT = ((617.0, 40.0), (530.5, 48.0), (465.0, 28.0))
# name: data set of colour-science (a CRT after Machado 2010; an LCD of Fairchild and Wyble 1998)
COLOUR_SCIENCE = {"crt-brainard": "Typical CRT Brainard 1997", "lcd-apple": "Apple Studio Display"}
NAMES = ("wide-gamut", *COLOUR_SCIENCE)


@dataclass(frozen=True)
class Primaries:
    """wavelength_nm : (n_λ,);  spectra : (3, n_λ) red, green, blue in one relative unit."""

    wavelength_nm: Floats
    spectra: Floats


def primaries(name: str | os.PathLike[str]) -> Primaries:
    """Primaries by name (`NAMES`) or from a file of rows "wavelength in nm, R, G, B".

    Negative values, noise of the meter, count as zero. Raises InputError for an unknown name, FileFormatError for a
    file that cannot be read.
    """
    if str(name) == "wide-gamut":
        nm = np.arange(380.0, 781.0, 2.0)
        return Primaries(nm, np.array([_band(nm, *band) for band in WIDE_GAMUT]))
    if str(name) in COLOUR_SCIENCE:
        data = _colour().MSDS_DISPLAY_PRIMARIES[COLOUR_SCIENCE[str(name)]]
        return Primaries(np.asarray(data.wavelengths, float), np.clip(data.values.T, 0, None))
    path = Path(name)
    if not is_file(path):
        raise InputError(f"primaries {str(name)!r} are neither a file nor known: {nearest(name, NAMES)}")
    return _from_file(path)


def _band(nm: Floats, centre: float, width: float) -> Floats:
    return np.exp(-4 * np.log(2) * ((nm - centre) / width) ** 2)


def _from_file(path: Path) -> Primaries:
    try:
        table = np.loadtxt(text_of(path, "table of primaries").splitlines(), delimiter=",", comments="#", ndmin=2)
    except ValueError as e:
        raise FileFormatError(f"{path} has no rows of wavelength in nm, R, G, B: {e}") from None
    if table.shape[1] != 4 or not np.all(np.isfinite(table)) or not np.all(np.diff(table[:, 0]) > 0):
        raise FileFormatError(
            f"{path} has {table.shape[1]} columns: rows of wavelength in nm, R, G, B with rising wavelength are needed"
        )
    return Primaries(table[:, 0], np.clip(table[:, 1:].T, 0, None))
