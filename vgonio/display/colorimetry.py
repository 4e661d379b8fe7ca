"""From emission spectra to XYZ, normalised XYZ, L*a*b* and ΔE₀₀, and the RGB encodings that displays are driven with.

CIE 1931 2° observer. A spectrum is linear between its samples and zero beyond its ends; it is integrated in steps of
1 nm, so grids of 1 to 20 nm, regular or not, give the same XYZ as far as their samples say it.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..compare import colour as compared
from ..compare.colour import OBSERVER, _colour, lab
from ..errors import InputError, nearest

Floats = NDArray[np.float64]
# maximum luminous efficacy K_m of the CIE 1931 definition, lm/W (CIE 15:2018)
LUMENS_PER_WATT = 683.0
# every spectrum must reach at least from … to (nm): beyond it lie 5·10⁻⁴ of ȳ and 6·10⁻³ of z̄
MUST_COVER = (400.0, 700.0)
# name on the command line: name of colour-science
ENCODINGS = {"sRGB": "sRGB", "Adobe RGB": "Adobe RGB (1998)", "Display P3": "Display P3"}


@lru_cache(maxsize=32)
def _weights(wavelength: tuple[float, ...]) -> Floats:
    cmfs = _colour().MSDS_CMFS[OBSERVER]
    hats = np.stack(
        [np.interp(cmfs.wavelengths, wavelength, row, left=0, right=0) for row in np.eye(len(wavelength))], axis=1
    )
    return LUMENS_PER_WATT * (hats.T @ cmfs.values)


def emission_weights(wavelength_nm: ArrayLike) -> Floats:
    """Weights (n_λ, 3) that turn spectral radiance in W/(sr m² nm) at rising wavelengths (n_λ,) in nm into XYZ, cd/m².

    Raises InputError where the wavelengths do not rise or do not cover `MUST_COVER`.
    """
    w = np.asarray(wavelength_nm, dtype=np.float64)
    if w.ndim != 1 or w.size < 10 or not np.all(np.diff(w) > 0):
        raise InputError(f"wavelengths of shape {w.shape}: at least 10 rising values in nm are needed")
    if w[0] > MUST_COVER[0] or w[-1] < MUST_COVER[1]:
        raise InputError(
            f"spectra from {w[0]:g} to {w[-1]:g} nm: a display's colour needs {MUST_COVER[0]:g} to "
            f"{MUST_COVER[1]:g} nm at least"
        )
    return _weights(tuple(w.tolist()))


def spectra_to_xyz(spectra: ArrayLike, wavelength_nm: ArrayLike) -> Floats:
    """XYZ (…, 3) in cd/m² of spectra (…, n_λ) in W/(sr m² nm): thesis equation 5.2."""
    return np.asarray(spectra, dtype=np.float64) @ emission_weights(wavelength_nm)


def chromaticity(xyz: ArrayLike) -> Floats:
    """(x, y) of XYZ (…, 3); NaN for no light at all."""
    values = np.asarray(xyz, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        return values[..., :2] / values.sum(axis=-1, keepdims=True)


def d65() -> Floats:
    """(3,) XYZ of the white of sRGB and Adobe RGB, Y = 1."""
    colour = _colour()
    return colour.xy_to_XYZ(colour.RGB_COLOURSPACES["sRGB"].whitepoint)


def normalise(xyz: ArrayLike, black: ArrayLike, white: ArrayLike) -> Floats:
    """Absolute XYZ (…, 3) with the black and white of a display brought to 0 and to D65 with Y = 1.

    (X − X_K)/(X_W − X_K) times the white of the encoding, channel by channel (Adobe RGB (1998) colour image encoding,
    2005, section 4.2.2, as thesis chapter 5 uses it). Raises InputError where white is not brighter than black.
    """
    k, w = np.asarray(black, float), np.asarray(white, float)
    if not np.all(w > k):
        raise InputError(f"white XYZ {w.round(4).tolist()} is not above black {k.round(4).tolist()} cd/m²")
    return (np.asarray(xyz, float) - k) / (w - k) * d65()


def denormalise(xyz: ArrayLike, black: ArrayLike, white: ArrayLike) -> Floats:
    """The inverse of `normalise`: normalised XYZ (…, 3) to cd/m² on a display of that black and white."""
    k, w = np.asarray(black, float), np.asarray(white, float)
    return np.asarray(xyz, float) / d65() * (w - k) + k


def lab_relative(xyz: ArrayLike, white: ArrayLike) -> Floats:
    """L*a*b* (…, 3) of XYZ (…, 3) relative to a white (3,) in the same unit."""
    return lab(np.asarray(xyz, float) / np.asarray(white, float) * d65())


def delta_e(xyz: ArrayLike, reference: ArrayLike, white: ArrayLike) -> Floats:
    """ΔE₀₀ (…) between XYZ (…, 3) and reference (…, 3), both relative to a white (3,) (Sharma 2005)."""
    return compared.delta_e(lab_relative(reference, white), lab_relative(xyz, white))


def encoding(name: str) -> tuple[Floats, Floats]:
    """Primaries (3, 2) and linear RGB-to-XYZ matrix (3, 3) of an encoding; InputError for an unknown name."""
    if name not in ENCODINGS:
        raise InputError(f"encoding {name!r} is unknown: {nearest(name, ENCODINGS)}")
    colour = _colour()
    space = colour.RGB_COLOURSPACES[ENCODINGS[name]]
    # from the primaries: the printed matrices are rounded and would tint white
    return np.asarray(space.primaries), colour.normalised_primary_matrix(space.primaries, space.whitepoint)


def encode(xyz: ArrayLike, name: str) -> Floats:
    """RGB (…, 3) in 0 … 1 of normalised XYZ (…, 3) in an encoding ("sRGB", "Adobe RGB"); clipped to 0 … 1."""
    _, to_xyz = encoding(name)
    linear = np.clip(np.asarray(xyz, float) @ np.linalg.inv(to_xyz).T, 0.0, 1.0)
    return np.asarray(_colour().RGB_COLOURSPACES[ENCODINGS[name]].cctf_encoding(linear))


def decode(rgb: ArrayLike, name: str) -> Floats:
    """Normalised XYZ (…, 3) of RGB (…, 3) in 0 … 1 in an encoding."""
    _, to_xyz = encoding(name)
    return np.asarray(_colour().RGB_COLOURSPACES[ENCODINGS[name]].cctf_decoding(np.asarray(rgb, float))) @ to_xyz.T
