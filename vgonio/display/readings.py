"""Readings of a display: which RGB was shown and which spectrum came back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from .colorimetry import spectra_to_xyz

Floats = NDArray[np.float64]
CHANNELS = ("red", "green", "blue")
# signals closer than this are the same colour: an eighth of a 12-bit step
SAME_SIGNAL = 3e-5


@dataclass(frozen=True)
class Readings:
    """rgb : (n, 3) signals in 0 … 1;  spectra : (n, n_λ) W/(sr m² nm);  wavelength_nm : (n_λ,);  eye : a name or ""."""

    rgb: Floats
    spectra: Floats
    wavelength_nm: Floats
    eye: str = ""

    def __post_init__(self) -> None:
        for name in ("rgb", "spectra", "wavelength_nm"):
            object.__setattr__(self, name, np.array(getattr(self, name), dtype=np.float64))
        n = len(self.rgb)
        if self.rgb.shape != (n, 3) or self.spectra.shape != (n, self.wavelength_nm.size):
            raise InputError(
                f"readings with rgb {self.rgb.shape}, spectra {self.spectra.shape} and {self.wavelength_nm.size} "
                "wavelengths: (n, 3), (n, number of wavelengths) are needed"
            )
        check_signals(self.rgb)
        if not np.all(np.isfinite(self.spectra)):
            row = int(np.flatnonzero(~np.isfinite(self.spectra).all(axis=1))[0])
            raise InputError(
                f"reading {row + 1} of {n} has a value that is not finite: measure it again or leave it out"
            )

    def __len__(self) -> int:
        return len(self.rgb)

    @property
    def xyz(self) -> Floats:
        """(n, 3) cd/m²."""
        return spectra_to_xyz(self.spectra, self.wavelength_nm)

    def where(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> Readings:
        """The readings that `chosen` names, a mask (m,) or indices."""
        return Readings(self.rgb[chosen], self.spectra[chosen], self.wavelength_nm, self.eye)

    def averaged(self) -> Readings:
        """Each colour once, in the order of its first reading, with the mean of its spectra."""
        _, first, group = np.unique(np.round(self.rgb / SAME_SIGNAL), axis=0, return_index=True, return_inverse=True)
        order = np.argsort(first)
        spectra = np.array([self.spectra[group.ravel() == g].mean(axis=0) for g in order])
        return Readings(self.rgb[first[order]], spectra, self.wavelength_nm, self.eye)

    def index(self, rgb: ArrayLike) -> NDArray[np.intp]:
        """(m,) place of the first reading of each colour (m, 3), −1 where there is none."""
        wanted = np.atleast_2d(np.asarray(rgb, float))
        near = np.abs(wanted[:, None, :] - self.rgb[None]).max(axis=-1) < SAME_SIGNAL
        return np.where(near.any(axis=1), near.argmax(axis=1), -1)

    def mean_spectrum(self, rgb: ArrayLike, name: str) -> Floats:
        """(n_λ,) mean over all readings of one colour; InputError where it was not measured."""
        near = np.abs(self.rgb - np.asarray(rgb, float)).max(axis=-1) < SAME_SIGNAL
        if not near.any():
            raise InputError(
                f"no reading of {name}{f' of the {self.eye} eye' if self.eye else ''}: show it and measure it"
            )
        return self.spectra[near].mean(axis=0)

    def ramp(self, channel: int) -> Readings:
        """The readings of one channel alone, black among them."""
        others = [c for c in range(3) if c != channel]
        return self.where(np.flatnonzero(np.all(self.rgb[:, others] < SAME_SIGNAL, axis=1)))


def check_signals(rgb: Floats) -> None:
    """InputError unless all signals are numbers in 0 … 1."""
    if not np.all((rgb >= 0) & (rgb <= 1)):
        bad = rgb[~((rgb >= 0) & (rgb <= 1))][0]
        raise InputError(f"a signal of {bad:g}: RGB goes from 0 to 1 of full scale")


def quantise(rgb: ArrayLike, bits: int | None) -> Floats:
    """Signals (…, 3) in 0 … 1 rounded to the 2^bits codes that a display takes; as they are for None."""
    v = np.asarray(rgb, dtype=np.float64)
    if bits is None:
        return v
    codes = 2 ** check_bits(bits) - 1
    return np.round(v * codes) / codes


def check_bits(bits: int) -> int:
    """`bits` where it is a whole number from 6 to 16; InputError otherwise."""
    from ..errors import whole

    return whole("bits", bits, 6, 16)


def ramp_colours(levels: int = 18, bits: int | None = 8) -> Floats:
    """(3·levels − 1, 3) signals for a characterisation: black, `levels` rising levels of each channel, black counted
    among them, and white.

    Levels crowd towards the dark, as t^1.5 for even t, and are rounded to codes (fewer where two become one). The toe
    of a curve like that of sRGB lies below the second of ten even levels: they leave an error of 1.4 in L*, these 0.5.
    """
    from ..errors import whole

    steps = np.unique(quantise(np.linspace(0, 1, whole("levels", levels, 4, 1024)) ** 1.5, bits))[1:]
    single = [np.eye(3)[c] * s for c in range(3) for s in steps]
    return np.array([np.zeros(3), *single, np.ones(3)])


def grid_colours(step: int = 85) -> Floats:
    """(n, 3) signals on an RGB grid of step `step` of 255; step 85 gives the 64 colours of thesis section 5.3.

    Raises InputError where `step` does not divide 255.
    """
    from ..errors import whole

    if 255 % whole("step", step, 1, 255):
        raise InputError(
            f"step {step} of 255: a divisor is needed (85, 51, 17, 15, 5, 3, 1), so that white is a colour"
        )
    v = np.arange(0, 256, step) / 255
    return np.stack(np.meshgrid(v, v, v, indexing="ij"), axis=-1).reshape(-1, 3)
