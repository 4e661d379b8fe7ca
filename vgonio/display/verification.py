"""Does the display obey the model, does the calibration work: frameworks 1 and 2 of the thesis (figures 5.2, 5.3).

The calibration is held against driving the display with sRGB or Adobe RGB values as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from .assumptions import Assumptions, assumptions
from .colorimetry import d65, delta_e, denormalise, encode, normalise, spectra_to_xyz
from .model import Controls, DisplayModel
from .patches import Patches
from .readings import SAME_SIGNAL, Readings, quantise

Floats = NDArray[np.float64]
MEASURED = "measured profile"
PROFILES = ("sRGB", "Adobe RGB", MEASURED)


def statistics(delta_e: Floats) -> dict[str, float]:
    """Mean, median, largest ΔE₀₀ and the shares above 1 and 2."""
    return {
        "mean": float(delta_e.mean()),
        "median": float(np.median(delta_e)),
        "max": float(delta_e.max()),
        "above_1": float((delta_e > 1).mean()),
        "above_2": float((delta_e > 2).mean()),
    }


@dataclass(frozen=True)
class ModelCheck:
    """Framework 1. measured, simulated : (n, n_λ) spectra of test colours rgb (n, 3);  delta_e : (n,) ΔE₀₀ relative to
    the measured white;  spectral_error : (n,) RMS of the difference of spectra over RMS of the measured one."""

    rgb: Floats
    measured: Floats
    simulated: Floats
    delta_e: Floats
    spectral_error: Floats
    assumptions: Assumptions

    def statistics(self) -> dict[str, float]:
        """Mean, median, largest and shares above 1 and 2 of ΔE₀₀; see `statistics`."""
        return statistics(self.delta_e)


def check_model(model: DisplayModel, ramps: Readings, tests: Readings) -> ModelCheck:
    """Compare test colours with their simulation, spectrum by spectrum and in ΔE₀₀; and test each assumption by itself.

    ramps : the readings that the model was fitted to;  tests : others, best those of `grid_colours(85)`.
    Raises InputError where the wavelengths differ.
    """
    if tests.wavelength_nm.shape != model.wavelength_nm.shape or np.any(tests.wavelength_nm != model.wavelength_nm):
        raise InputError(
            f"test colours at {tests.wavelength_nm.size} wavelengths, the model at {model.wavelength_nm.size}: "
            "measure both with the same instrument and settings"
        )
    simulated = model.spectra(tests.rgb)
    difference = delta_e(spectra_to_xyz(simulated, model.wavelength_nm), tests.xyz, model.white_xyz)
    size = np.sqrt((tests.spectra**2).mean(axis=1))
    error = np.sqrt(((simulated - tests.spectra) ** 2).mean(axis=1)) / np.where(size > 0, size, np.nan)
    return ModelCheck(tests.rgb, tests.spectra, simulated, difference, error, assumptions(model, ramps, tests))


@dataclass(frozen=True)
class Targets:
    """What to show in framework 2.

    names : of the m patches;  reference : (m, 3) normalised XYZ;  rgb : by profile,
    signals (m, 3) as the display takes them;  black, white : (3,) cd/m² of the display;  controls : what the measured
    profile asked for;  illuminant : in words
    """

    names: tuple[str, ...]
    reference: Floats
    rgb: Mapping[str, Floats]
    black: Floats
    white: Floats
    controls: Controls
    illuminant: str

    def colours(self) -> Floats:
        """(3·m, 3) signals of all profiles, one after the other."""
        return np.concatenate([self.rgb[p] for p in PROFILES])


def targets(
    model: DisplayModel,
    patches: Patches,
    bits: int | None = 8,
    illuminant: tuple[ArrayLike, ArrayLike] | None = None,
    gamut: str = "clip",
) -> Targets:
    """Signals that show reflectance spectra on a display, by the sRGB, the Adobe RGB and the measured profile.

    illuminant : (wavelengths in nm, relative power); None is the display's own white, as in the thesis, so that all
    patches are in gamut. It is scaled so that a perfect diffuser is as bright as the display's white.
    The reference is normalised with the display's black and with the white of that diffuser (`normalise`), the wanted
    colour is that on the display's own black and white.
    """
    nm = model.wavelength_nm
    light = model.white if illuminant is None else _resampled(*illuminant, nm)
    reflected = spectra_to_xyz(patches.at(nm) * light, nm)
    diffuser = spectra_to_xyz(light, nm)
    scale = model.white_xyz[1] / diffuser[1]
    reference = normalise(reflected * scale, model.black_xyz, diffuser * scale)
    controls = model.backward(denormalise(reference, model.black_xyz, model.white_xyz), gamut)
    rgb = {name: quantise(encode(reference, name), bits) for name in PROFILES[:2]}
    rgb[MEASURED] = quantise(controls.rgb, bits)
    words = "the display's white" if illuminant is None else "an illuminant of the user"
    return Targets(patches.names, reference, rgb, model.black_xyz, model.white_xyz, controls, words)


def _resampled(wavelength_nm: ArrayLike, power: ArrayLike, nm: Floats) -> Floats:
    w, p = np.asarray(wavelength_nm, float), np.asarray(power, float)
    if w.shape != p.shape or w.ndim != 1 or not np.all(np.isfinite(p)) or p.max(initial=0) <= 0:
        raise InputError(f"illuminant of {w.shape} wavelengths and {p.shape} values: two equal lists are needed")
    return np.interp(nm, w, p)


@dataclass(frozen=True)
class CalibrationCheck:
    """Framework 2. shown : by profile (m, 3) normalised XYZ as measured;  delta_e : by profile (m,) ΔE₀₀ under D65."""

    targets: Targets
    shown: Mapping[str, Floats]
    delta_e: Mapping[str, Floats]

    def statistics(self) -> dict[str, dict[str, float]]:
        """The same for each way to drive the display."""
        return {name: statistics(d) for name, d in self.delta_e.items()}


def check_calibration(wanted: Targets, measure: Callable[[Floats], Floats]) -> CalibrationCheck:
    """ΔE₀₀ between patches and their reproduction. measure(rgb (m, 3)) gives XYZ (m, 3) in cd/m² of what was shown."""
    shown = {p: normalise(measure(wanted.rgb[p]), wanted.black, wanted.white) for p in PROFILES}
    white = d65()
    return CalibrationCheck(wanted, shown, {p: delta_e(s, wanted.reference, white) for p, s in shown.items()})


def looked_up(readings: Readings) -> Callable[[Floats], Floats]:
    """A `measure` for `check_calibration` that finds each signal among readings; InputError for those missing."""

    def measure(rgb: Floats) -> Floats:
        place = readings.index(rgb)
        missing = np.flatnonzero(place < 0)
        if missing.size:
            first = np.round(255 * rgb[missing[0]], 2).tolist()
            raise InputError(
                f"{missing.size} of {len(rgb)} colours were not measured, the first is RGB {first} of 255: show and "
                f"measure the colours that `vgonio display calibrate` lists (signals are compared to {SAME_SIGNAL:g})"
            )
        return readings.xyz[place]

    return measure
