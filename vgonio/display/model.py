"""The display model of thesis section 5.2: black plus three primaries of constant spectrum, one tone curve each.

It leaves out what the thesis leaves out: the lens of a headset, and differences from place to place on the panel.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, VgonioWarning, nearest
from .colorimetry import delta_e, spectra_to_xyz
from .readings import CHANNELS, Readings
from .tone import ToneCurve, tone_curve

Floats = NDArray[np.float64]
GAMUT = ("clip", "desaturate")
# linear signals this far outside 0 … 1 are rounding
IN_GAMUT = 1e-6
# primaries of one direction in XYZ: beyond the first the inverse makes noise large, beyond the second there is none
LARGE_CONDITION, LARGEST_CONDITION = 50.0, 1e7
FEW_LEVELS = 10  # below, what lies between the levels of a tone curve is a guess that is told


@dataclass(frozen=True)
class Controls:
    """What to send to a display for wanted colours, and what it costs.

    rgb : (…, 3) signals in 0 … 1, never NaN;  linear : (…, 3) linear light asked for, before clipping
    in_gamut : (…) bool;  cost : (…) ΔE₀₀ between what was wanted and what the model then shows, 0 in gamut
    """

    rgb: Floats
    linear: Floats
    in_gamut: NDArray[np.bool_]
    cost: Floats

    def report(self) -> dict[str, float]:
        """Colours in all, how many out of gamut, largest excess of linear light, mean and largest ΔE₀₀ of those."""
        out = ~self.in_gamut
        excess = np.maximum(self.linear - 1, -self.linear).max(axis=-1)
        return {
            "colours": int(out.size),
            "out_of_gamut": int(out.sum()),
            "largest_excess": float(np.max(excess[out], initial=0.0)),
            "mean_cost": float(self.cost[out].mean()) if out.any() else 0.0,
            "largest_cost": float(np.max(self.cost[out], initial=0.0)),
        }


@dataclass(frozen=True)
class DisplayModel:
    """One display, or one eye of a headset.

    wavelength_nm : (n_λ,);  black : (n_λ,) and primaries : (3, n_λ) at full signal, above black, in W/(sr m² nm)
    curves : three tone curves;  white : (n_λ,) the measured white, black included;  notes : what to be wary of
    """

    wavelength_nm: Floats
    black: Floats
    primaries: Floats
    curves: tuple[ToneCurve, ToneCurve, ToneCurve]
    white: Floats
    eye: str = ""
    notes: tuple[str, ...] = ()

    @cached_property
    def matrix(self) -> Floats:
        """(3, 3) XYZ of the primaries above black in columns, cd/m² (thesis 5.4)."""
        return spectra_to_xyz(self.primaries, self.wavelength_nm).T

    @cached_property
    def black_xyz(self) -> Floats:
        """(3,) of the measured black, in cd/m²."""
        return spectra_to_xyz(self.black, self.wavelength_nm)

    @cached_property
    def white_xyz(self) -> Floats:
        """(3,) of the measured white; `xyz([1, 1, 1])` is the simulated one."""
        return spectra_to_xyz(self.white, self.wavelength_nm)

    @cached_property
    def condition(self) -> float:
        """Condition number of the matrix with columns of length 1: how nearly parallel the primaries are in XYZ."""
        each = self.matrix / np.abs(self.matrix).max(axis=0)  # whose squares are numbers, however bright it is
        return float(np.linalg.cond(each / np.linalg.norm(each, axis=0)))

    def linear(self, rgb: ArrayLike) -> Floats:
        """Linear light (…, 3) in 0 … 1 of signals (…, 3)."""
        v = np.asarray(rgb, float)
        return np.stack([curve(v[..., c]) for c, curve in enumerate(self.curves)], axis=-1)

    def spectra(self, rgb: ArrayLike) -> Floats:
        """Spectra (…, n_λ) in W/(sr m² nm) of signals (…, 3) in 0 … 1: thesis equation 5.1."""
        return self.black + self.linear(rgb) @ self.primaries

    def xyz(self, rgb: ArrayLike) -> Floats:
        """XYZ (…, 3) in cd/m² of signals (…, 3) in 0 … 1: thesis equation 5.3."""
        return self.black_xyz + self.linear(rgb) @ self.matrix.T

    def backward(self, xyz: ArrayLike, gamut: str = "clip") -> Controls:
        """Signals for wanted XYZ (…, 3) in cd/m²: thesis equation 5.4 and the inverse tone curves.

        gamut : what becomes of colours that the display cannot show
            "clip"        each channel's linear light is cut to 0 … 1: nearest in the primaries, hue may change
            "desaturate"  moved straight towards the grey of the same luminance (at most white, at least black) until
                          it can be shown: hue and, inside that range, luminance stay
        Raises InputError for values that are not finite, for an unknown choice and for primaries without an inverse.
        """
        if gamut not in GAMUT:
            raise InputError(f"gamut {gamut!r} is unknown: {nearest(gamut, GAMUT)}")
        wanted = np.asarray(xyz, dtype=np.float64)
        if wanted.shape[-1:] != (3,) or not np.all(np.isfinite(wanted)):
            raise InputError(f"XYZ of shape {wanted.shape}: (…, 3) finite numbers in cd/m² are needed")
        if self.condition > LARGEST_CONDITION:
            raise InputError(
                f"the primaries are parallel in XYZ (condition number {self.condition:.3g}): no signal can be found "
                "for a colour. Is the same channel in the readings twice?"
            )
        above = wanted.reshape(-1, 3) - self.black_xyz
        linear = np.linalg.solve(self.matrix, above.T).T.astype(np.float64)
        shown = np.clip(linear if gamut == "clip" else self._desaturated(linear), 0.0, 1.0)
        rgb = np.stack([curve.inverse(shown[:, c]) for c, curve in enumerate(self.curves)], axis=-1)
        inside = np.all((linear >= -IN_GAMUT) & (linear <= 1 + IN_GAMUT), axis=-1)
        cost = np.zeros(len(linear))
        if not inside.all():
            got = self.black_xyz + shown[~inside] @ self.matrix.T
            cost[~inside] = delta_e(got, wanted.reshape(-1, 3)[~inside], self.white_xyz)
        shape = wanted.shape[:-1]
        return Controls(rgb.reshape(*shape, 3), linear.reshape(*shape, 3), inside.reshape(shape), cost.reshape(shape))

    def _desaturated(self, linear: Floats) -> Floats:
        """Linear light (n, 3) moved towards the grey of the same luminance until all of it lies in 0 … 1."""
        share = self.matrix[1] / self.matrix[1].sum()
        grey = np.clip(linear @ share, 0.0, 1.0)[:, None]
        step = linear - grey
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(step > 0, (1 - grey) / step, np.where(step < 0, -grey / step, np.inf))
        return grey + np.clip(room.min(axis=1, keepdims=True), 0.0, 1.0) * step


def fit(readings: Readings) -> DisplayModel:
    """The display model of measured spectra: black, white, and a ramp of levels of each channel alone.

    The spectrum of a primary is that along which its levels differ (first principal component of the ramp), its light
    the projection of what is above black on it, so noise averages out. Repeated readings are averaged, colours other
    than black, white and the ramps ignored.
    Warns (VgonioWarning) of few levels, clipped or drowned levels, nearly parallel primaries and odd luminances.
    Raises InputError where black, white or a channel's levels are missing or give no light, or white is no brighter
    than black.
    """
    black = readings.mean_spectrum(np.zeros(3), "black (RGB 0, 0, 0)")
    white = readings.mean_spectrum(np.ones(3), "white (full RGB)")
    found = [_channel(readings.ramp(c), black, name) for c, name in enumerate(CHANNELS)]
    curves = (found[0][0], found[1][0], found[2][0])
    model = DisplayModel(
        readings.wavelength_nm, black, np.array([p for _, p in found]), curves, white, readings.eye, ()
    )
    if not model.white_xyz[1] > max(model.black_xyz[1], 0.0):
        raise InputError(
            f"{readings.eye + ' eye: ' if readings.eye else ''}white of {model.white_xyz[1]:.3g} cd/m² is no brighter "
            f"than {'black' if model.white_xyz[1] > 0 else 'nothing'}: the spectra are no radiances of a display"
        )
    notes = tuple(_notes(model))
    for note in notes:
        warnings.warn(f"{readings.eye + ' eye: ' if readings.eye else ''}{note}", VgonioWarning, stacklevel=2)
    return DisplayModel(model.wavelength_nm, model.black, model.primaries, model.curves, model.white, model.eye, notes)


def _channel(ramp: Readings, black: Floats, name: str) -> tuple[ToneCurve, Floats]:
    """Tone curve and spectrum (n_λ,) at full signal of one channel."""
    level, above = ramp.rgb.max(axis=1), ramp.spectra - black
    if not np.any(level > 0):
        raise InputError(f"no reading of {name} alone: show rising levels of each channel with the others at 0")
    # centred: the noise of black, common to all levels, has no part in it
    common = np.linalg.svd(above - above.mean(axis=0), full_matrices=False)[2][0]
    common = common * np.sign(above[level.argmax()] @ common)
    try:
        curve, top = tone_curve(level, above @ common)
    except InputError as e:
        raise InputError(f"{name}: {e}") from None
    return curve, top * common


def _notes(model: DisplayModel) -> list[str]:
    """What a user should know about a fit."""
    found = []
    for name, curve in zip(CHANNELS, model.curves):
        if curve.level.size < FEW_LEVELS:
            found.append(f"{name}: {curve.level.size} levels, black among them; 10 or more are better")
        if curve.saturates_at < 0.98:
            found.append(f"{name}: clipped, no more light from level {255 * curve.saturates_at:.0f} of 255 on")
        if curve.dark_until > 0:
            found.append(f"{name}: no light above black up to level {255 * curve.dark_until:.0f} of 255")
        if curve.departure > 0.01:
            found.append(
                f"{name}: measured levels leave the rising curve by up to {curve.departure:.1%} of full light: a curve "
                "that falls, or noise"
            )
    if model.condition > LARGE_CONDITION:
        found.append(
            f"the primaries are nearly parallel in XYZ (condition number {model.condition:.3g}; sRGB has 3): small "
            "errors become large in the signals"
        )
    luminance = model.white_xyz[1]
    if not 1 <= luminance <= 2e4:
        found.append(f"white of {luminance:.3g} cd/m² is implausible: are the spectra in W/(sr m² nm)?")
    if model.black_xyz[1] < 0:
        found.append(f"black of {model.black_xyz[1]:.2g} cd/m² is negative: the meter's noise")
    return found
