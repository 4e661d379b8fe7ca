"""Reflectance spectra of patches, by name from colour-science or from a CSV file."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..compare.colour import _colour
from ..errors import FileFormatError, InputError, nearest
from ..files import is_file, text_of

Floats = NDArray[np.float64]
NAMES = ("colorchecker", "cie-224")


@dataclass(frozen=True)
class Patches:
    """names : of the m patches;  reflectance : (m, n_λ) at wavelength_nm (n_λ,)."""

    names: tuple[str, ...]
    wavelength_nm: Floats
    reflectance: Floats

    def at(self, wavelength_nm: Floats) -> Floats:
        """(m, n) reflectance at other wavelengths, linear between and constant beyond the ends."""
        return np.array([np.interp(wavelength_nm, self.wavelength_nm, row) for row in self.reflectance])


def patches(name: str | os.PathLike[str]) -> Patches:
    """Reflectances of "colorchecker" (24 patches, measured by Ohta 1997), "cie-224" (the 99 samples of CIE 224:2017) or
    a CSV file: a head "name,380,390,…" with wavelengths in nm, then a row for each patch.

    Raises InputError for an unknown name, FileFormatError for a file of another layout.
    """
    if str(name) == "colorchecker":
        data = _colour().SDS_COLOURCHECKERS["cc_ohta"]
        first = next(iter(data.values()))
        return Patches(tuple(data), np.asarray(first.wavelengths, float), np.array([s.values for s in data.values()]))
    if str(name) == "cie-224":
        return _cie_224()
    if not is_file(Path(name)):
        raise InputError(f"patches {str(name)!r} are neither a file nor known: {nearest(name, NAMES)}")
    return _from_csv(Path(name))


def _cie_224() -> Patches:
    colour = _colour()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from colour.quality.cfi2017 import load_TCS_CIE2017
    data = load_TCS_CIE2017(colour.SpectralShape(380, 780, 5))
    values = np.asarray(data.values, float).T
    return Patches(tuple(f"CES {i + 1:02d}" for i in range(len(values))), np.asarray(data.wavelengths, float), values)


def _from_csv(path: Path) -> Patches:
    try:
        rows = [line.split(",") for line in text_of(path, "table of patches").splitlines() if line.strip()]
        rows = [row for row in rows if not row[0].startswith("#")]
        if len(rows) < 2:
            raise ValueError("it is empty" if not rows else "it has a head alone")
        nm = np.array([float(x) for x in rows[0][1:]])
        values = np.array([[float(x) for x in row[1:]] for row in rows[1:]])
    except (ValueError, IndexError) as e:
        raise FileFormatError(
            f"{path} has no head of name and wavelengths in nm with rows of reflectance: {e}"
        ) from None
    if values.ndim != 2 or values.shape[1:] != nm.shape or not np.all(np.diff(nm) > 0):
        raise FileFormatError(f"{path}: rows of {values.shape} values under {nm.size} rising wavelengths are needed")
    if not np.all((values >= 0) & (values <= 1.2)):
        raise FileFormatError(f"{path}: reflectance from {values.min():g} to {values.max():g}; it is a share, 0 … 1")
    return Patches(tuple(row[0].strip() for row in rows[1:]), nm, values)
