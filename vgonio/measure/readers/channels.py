"""Colour channels that some formats have in place of wavelengths, and the nominal wavelengths they are read at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...errors import FileFormatError, InputError

# R, G, B: dominant wavelengths of the primaries of sRGB (IEC 61966-2-1, with D65);  X, Y, Z: peaks of the CIE 1931
# functions. A channel is no wavelength: these are labels that sort right, good for a look and not for colour.
NOMINAL_NM = {"R": 611.0, "G": 549.0, "B": 464.0, "X": 599.0, "Y": 555.0, "Z": 446.0}
RGB_NM = (NOMINAL_NM["R"], NOMINAL_NM["G"], NOMINAL_NM["B"])


def mixture(wavelength_nm: NDArray[np.float64], rgb_nm: Sequence[float]) -> NDArray[np.float64]:
    """(n_λ, 3) weights that take a spectrum at three wavelengths, linear between its own; one serves all three.

    Raises InputError for channels outside the wavelengths.
    """
    w, rgb = np.asarray(wavelength_nm, float), np.asarray(rgb_nm, float)
    outside = rgb.shape != (3,) or np.any(~((rgb >= w[0] - 1e-6) & (rgb <= w[-1] + 1e-6)))
    if rgb.shape != (3,) or (outside and w.size > 1):
        raise InputError(f"rgb_nm = {rgb.tolist()}: three wavelengths within {w[0]:g} … {w[-1]:g} nm are needed")
    return np.stack([np.interp(rgb, w, row) for row in np.eye(w.size)])


def nominal(names: list[str], where: str) -> tuple[NDArray[np.float64], str]:
    """(3,) nominal wavelengths of channels named R, G, B (or red …) or X, Y, Z, and a note for the attributes."""
    letters = [n.strip().upper()[:1] for n in names]
    if sorted(letters) not in (["B", "G", "R"], ["X", "Y", "Z"]):
        raise FileFormatError(
            f"{where}: the columns {', '.join(names)[:100]} are neither wavelengths nor R, G, B or X, Y, Z"
        )
    nm = np.array([NOMINAL_NM[n] for n in letters])
    return nm, ", ".join(f"{n} at nominal {v:g} nm" for n, v in zip(letters, nm))
