"""Colour channels that some formats have in place of wavelengths, and the nominal wavelengths they are read at."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...errors import FileFormatError

# R, G, B: dominant wavelengths of the primaries of sRGB (IEC 61966-2-1, with D65);  X, Y, Z: peaks of the CIE 1931
# functions. A channel is no wavelength: these are labels that sort right, good for a look and not for colour.
NOMINAL_NM = {"R": 611.0, "G": 549.0, "B": 464.0, "X": 599.0, "Y": 555.0, "Z": 446.0}


def nominal(names: list[str], where: str) -> tuple[NDArray[np.float64], str]:
    """(3,) nominal wavelengths of channels named R, G, B (or red …) or X, Y, Z, and a note for the attributes."""
    letters = [n.strip().upper()[:1] for n in names]
    if sorted(letters) not in (["B", "G", "R"], ["X", "Y", "Z"]):
        raise FileFormatError(
            f"{where}: the columns {', '.join(names)[:100]} are neither wavelengths nor R, G, B or X, Y, Z"
        )
    nm = np.array([NOMINAL_NM[n] for n in letters])
    return nm, ", ".join(f"{n} at nominal {v:g} nm" for n, v in zip(letters, nm))
