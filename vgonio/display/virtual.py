"""A virtual display: measured or narrow-band primaries, a tone curve, and deviations from the model that can be set."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, nearest
from .colorimetry import emission_weights
from .primaries import primaries
from .readings import Readings, check_signals, quantise

Floats = NDArray[np.float64]


def _srgb(v: Floats) -> Floats:
    """IEC 61966-2-1, continued beyond 1."""
    return np.where(v <= 0.04045, v / 12.92, ((np.maximum(v, 0) + 0.055) / 1.055) ** 2.4)


def _s_curve(v: Floats) -> Floats:
    """Native response of a twisted nematic cell: a power law below, saturating above (Kwak and MacDonald 2000)."""
    return 1.6 * v**2.8 / (1 + 0.6 * v**3.5)


TONES: dict[str, Callable[[Floats], Floats]] = {"srgb": _srgb, "s-curve": _s_curve}


@dataclass(frozen=True)
class VirtualDisplay:
    """wavelength_nm : (n_λ,);  spectra : (3, n_λ) primaries at full drive and black : (n_λ,), in W/(sr m² nm).

    tone : "srgb", "s-curve" or a number, the exponent of a power law
    bits : of the signal; None takes it as it is
    Deviations from the model, all zero by default:
        crosstalk : share of the other channels' mean signal that is added to a channel's own, or a (3, 3) matrix of
            shares [which, from which]: the signal of one sub-pixel's line reaches the next
        loading : share of all light that is lost when all channels are at full drive (the supply gives way)
        white_boost : share of the light of the common part min(R, G, B) that a fourth, white sub-pixel adds
        shift_nm : by how much the bands wander between no drive and full drive
        drift : relative loss of light after 100 readings
        noise : relative standard deviation of a spectral value;  floor : standard deviation at no light, W/(sr m² nm)
    seed : of the noise. A display is the same whenever it is asked the same.
    """

    wavelength_nm: Floats
    spectra: Floats
    black: Floats
    tone: str | float = "srgb"
    bits: int | None = None
    crosstalk: float | ArrayLike = 0.0
    loading: float = 0.0
    white_boost: float = 0.0
    shift_nm: float = 0.0
    drift: float = 0.0
    noise: float = 0.0
    floor: float = 0.0
    seed: int = 0

    def drive(self, rgb: ArrayLike) -> Floats:
        """Linear light (n, 3) of signals (n, 3), crosstalk and loading included."""
        v = quantise(np.atleast_2d(np.asarray(rgb, dtype=np.float64)), self.bits)
        check_signals(v)
        c = np.asarray(self.crosstalk, dtype=np.float64)
        mix = c if c.ndim else c / 2 * (1 - np.eye(3))
        linear = _tone(self.tone)(np.maximum(v @ (np.eye(3) + mix).T, 0.0))
        return linear * (1 - self.loading * linear.mean(axis=1, keepdims=True))

    def show(self, rgb: ArrayLike, start: int = 0) -> Floats:
        """Spectra (n, n_λ) that a meter reads for signals (n, 3), as the readings number `start`, `start` + 1, …"""
        linear = self.drive(rgb)
        light = linear @ self.spectra if not self.shift_nm else self._shifted(linear)
        light = light + self.white_boost * linear.min(axis=1)[:, None] * self.spectra.sum(axis=0)
        number = start + np.arange(len(linear))
        light = self.black + light * (1 - self.drift * number[:, None] / 100)
        if not (self.noise or self.floor):
            return light
        # one stream for each reading, so a reading does not depend on which others were asked for with it
        normal = np.array(
            [np.random.default_rng([self.seed, int(n)]).standard_normal((2, light.shape[1])) for n in number]
        )
        return light * (1 + self.noise * normal[:, 0]) + self.floor * normal[:, 1]

    def _shifted(self, linear: Floats) -> Floats:
        nm = self.wavelength_nm
        each = [
            [np.interp(nm - self.shift_nm * (1 - drive), nm, band) * drive for drive, band in zip(row, self.spectra)]
            for row in linear
        ]
        return np.array(each).sum(axis=1)

    def measure(self, rgb: ArrayLike, start: int = 0, eye: str = "") -> Readings:
        """Readings of signals (n, 3)."""
        return Readings(np.atleast_2d(np.asarray(rgb, float)), self.show(rgb, start), self.wavelength_nm, eye)


def _tone(tone: str | float) -> Callable[[Floats], Floats]:
    if isinstance(tone, str):
        if tone not in TONES:
            raise InputError(f"tone {tone!r} is unknown: {nearest(tone, TONES)}, or a number, the exponent")
        return TONES[tone]
    if not 0.2 < tone < 5:
        raise InputError(f"tone = {tone}: an exponent between 0.2 and 5 is needed")
    return lambda v: v**tone


def virtual_display(
    name: str | os.PathLike[str] = "wide-gamut",
    white_cd_m2: float = 130.0,
    black_cd_m2: float = 0.04,
    white_xy: tuple[float, float] | None = (0.3127, 0.3290),
    **deviations: object,
) -> VirtualDisplay:
    """A virtual display from primaries by name or file (see `primaries`), with the luminance of white and of black.

    white_xy : chromaticity of white, which sets how bright the primaries are beside each other; None keeps the file's
    deviations : fields of `VirtualDisplay`. Black has the spectrum of white, as light that leaks through a panel.
    The defaults are the luminances of the thesis' emissive headset (table 5.1); 80 and 0.21 are those of the other.
    Raises InputError for luminances that do not fit, a white that the primaries cannot give and unknown deviations.
    """
    if not (white_cd_m2 > black_cd_m2 >= 0):
        raise InputError(f"white {white_cd_m2} and black {black_cd_m2} cd/m²: white > black ≥ 0 is needed")
    allowed = set(VirtualDisplay.__dataclass_fields__) - {"wavelength_nm", "spectra", "black"}
    for key in set(deviations) - allowed:
        raise InputError(f"deviation {key!r} is unknown: {nearest(key, allowed)}")
    found = primaries(name)
    xyz = found.spectra @ emission_weights(found.wavelength_nm)
    share: Floats = np.ones(3)
    if white_xy is not None:
        x, y = white_xy
        if not (np.isfinite([x, y]).all() and y > 0):
            raise InputError(f"white_xy = {white_xy}: two chromaticities are needed, that of y above 0")
        share = np.linalg.solve(xyz.T, np.array([x / y, 1.0, (1 - x - y) / y])).astype(np.float64)
        if not np.all(share > 0):
            raise InputError(f"white at {white_xy} lies outside the triangle of the primaries {str(name)!r}")
    spectra = found.spectra * (share * (white_cd_m2 - black_cd_m2) / (share @ xyz)[1])[:, None]
    black = spectra.sum(axis=0) * black_cd_m2 / (white_cd_m2 - black_cd_m2)
    return replace(VirtualDisplay(found.wavelength_nm, spectra, black), **deviations)  # type: ignore[arg-type]
