"""Surfaces from a formula or a seed; the random ones are here, gratings and sandblasting beside this file.

All are periodic unless said otherwise, have mean height 0 and state generator, parameters and seed in their history.
`shape` is (ny, nx), `pitch_um` a number or (dy, dx); samples sit at cell centres.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from . import checks
from .gratings import blazed, flat, lamellar, sinusoid
from .heightfield import Heightfield
from .sandblasting import sandblasted

__all__ = ["blazed", "flat", "gaussian", "lamellar", "power_law", "sandblasted", "sinusoid"]

Floats = NDArray[np.float64]
Shape = tuple[int, int]


def gaussian(
    rms_um: float,
    correlation_um: float,
    shape: Shape = (512, 512),
    pitch_um: float | ArrayLike = 0.2,
    seed: int = 0,
    exact: bool = True,
) -> Heightfield:
    """Periodic random surface with Gaussian heights and the autocorrelation Sq²·exp(−r²/T²), T = `correlation_um`.

    exact : True scales the field made to Sq = `rms_um` exactly; False leaves the expectation over seeds at `rms_um`
        (before the mean is removed), which is what an average over many seeds wants.

    Spectral synthesis: white noise is filtered with the square root of the power spectrum of the wrapped
    autocorrelation, so that the autocorrelation of the samples has no aliasing error. The slope α of the ensemble is
    2·Sq/T. `shape` (1, n) is a profile, as the wave solvers of one-dimensional profiles take it.
    Raises InputError for a correlation length below one pitch or above half the shorter side.
    """
    shape, (dy, dx) = checks.grid(shape, pitch_um)
    rms, correlation = checks.number("rms_um", rms_um, 0.0), checks.positive("correlation_um", correlation_um)
    pitches = [h for n, h in zip(shape, (dy, dx)) if n > 1] or [dx]
    side = min(n * h for n, h in zip(shape, (dy, dx)) if n > 1 or max(shape) == 1)
    if correlation < max(pitches):
        raise InputError(f"correlation_um = {correlation:g} µm is below the pitch of {max(pitches):g} µm: refine it")
    if correlation > side / 2:
        raise InputError(
            f"correlation_um = {correlation:g} µm does not fit a field of {side:g} µm: "
            f"at most half the shorter side, {side / 2:g} µm"
        )
    rho = [_wrapped_gaussian(n, h, correlation) for n, h in zip(shape, (dy, dx))]
    power = np.maximum(np.fft.fft(rho[0]).real[:, None] * np.fft.rfft(rho[1]).real[None], 0.0)
    z = _random_field(shape, np.sqrt(power), rms, seed, exact)
    step = f"generated: gaussian rms {rms:g} µm, correlation length {correlation:g} µm, seed {seed}"
    step += "" if exact else ", ensemble scale"
    return Heightfield(z, (dy, dx), periodic=True, name="gaussian", history=(step,))


def power_law(
    rms_um: float = 0.1,
    hurst: float = 0.8,
    shape: Shape = (512, 512),
    pitch_um: float | ArrayLike = 0.2,
    long_cutoff_um: float | None = None,
    short_cutoff_um: float | None = None,
    seed: int = 0,
    exact: bool = True,
) -> Heightfield:
    """Periodic self-affine surface: two-dimensional PSD ∝ f^(−2−2H) between the two cut-off wavelengths.

    hurst : H in (0, 1];  long_cutoff_um : the PSD is constant at longer wavelengths (default: the shorter side)
    short_cutoff_um : nothing at shorter wavelengths (default: four pitches, so that slopes are resolved)
    exact : scale to Sq = `rms_um` exactly, or only in the expectation over seeds

    Persson et al. 2005, J. Phys. Condens. Matter 17, R1. Raises InputError for cut-offs below two pitches, above the
    side, or in the wrong order.
    """
    shape, (dy, dx) = checks.grid(shape, pitch_um)
    rms, exponent = checks.number("rms_um", rms_um, 0.0), checks.positive("hurst", hurst, 1.0)
    side = min(shape[0] * dy, shape[1] * dx)
    long = side if long_cutoff_um is None else checks.positive("long_cutoff_um", long_cutoff_um)
    short = 4 * max(dx, dy) if short_cutoff_um is None else checks.positive("short_cutoff_um", short_cutoff_um)
    if not 2 * max(dx, dy) <= short < long <= side:
        raise InputError(
            f"cut-offs of {short:g} and {long:g} µm: short_cutoff_um has to be at least two pitches "
            f"({2 * max(dx, dy):g} µm), long_cutoff_um longer than that and at most the side ({side:g} µm)"
        )
    f = np.hypot(np.fft.fftfreq(shape[0], dy)[:, None], np.fft.rfftfreq(shape[1], dx)[None])
    amplitude = np.where(f <= 1 / short, np.maximum(f, 1 / long) ** (-1 - exponent), 0.0)
    amplitude[0, 0] = 0.0
    power = _mean_power(amplitude, shape)
    if power == 0:
        raise InputError(f"no wavelength of a field of {side:g} µm lies between {short:g} and {long:g} µm")
    z = _random_field(shape, amplitude / np.sqrt(power), rms, seed, exact)
    step = f"generated: power_law rms {rms:g} µm, H {exponent:g}, {short:g} to {long:g} µm, seed {seed}"
    step += "" if exact else ", ensemble scale"
    return Heightfield(z, (dy, dx), periodic=True, name="power_law", history=(step,))


def _wrapped_gaussian(n: int, h: float, correlation: float) -> Floats:
    """(n,) exp(−x²/T²) at the lags of a ring of n samples, summed over its turns; 1 across a profile."""
    if n == 1:
        return np.ones(1)
    side = n * h
    lag = np.arange(n) * h
    turns = np.arange(-int(np.ceil(7 * correlation / side)) - 1, int(np.ceil(7 * correlation / side)) + 2)
    return np.exp(-(((lag[:, None] + turns * side) / correlation) ** 2)).sum(axis=1)


def _random_field(shape: Shape, amplitude: Floats, rms: float, seed: int, exact: bool) -> Floats:
    """Unit white noise times `amplitude` (ny, nx // 2 + 1) in the frequency domain; mean 0, Sq `rms` where `exact`."""
    noise = checks.generator(seed).standard_normal(shape)
    z = np.fft.irfft2(np.fft.rfft2(noise) * amplitude, s=shape)
    z -= z.mean()
    return z * (rms / z.std() if exact else rms)


def _mean_power(amplitude: Floats, shape: Shape) -> float:
    """Variance of unit white noise after the filter: the mean of |amplitude|² over all frequencies of both signs."""
    twice = np.full(amplitude.shape[1], 2.0)
    twice[0] = 1.0
    if shape[1] % 2 == 0:
        twice[-1] = 1.0
    return float((amplitude**2 * twice).sum() / (shape[0] * shape[1]))
