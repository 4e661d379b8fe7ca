"""Flat mirrors and gratings: profiles along x repeated along y, periodic, mean height 0, whole periods only."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from . import checks
from .heightfield import Heightfield


def flat(shape: tuple[int, int] = (64, 64), pitch_um: float | ArrayLike = 1.0) -> Heightfield:
    """A perfect mirror: height 0 everywhere, periodic."""
    shape, pitch = checks.grid(shape, pitch_um)
    return Heightfield(np.zeros(shape), pitch, periodic=True, name="flat", history=("generated: flat",))


def sinusoid(
    period_um: float,
    amplitude_um: float,
    shape: tuple[int, int] = (64, 1000),
    pitch_um: float | ArrayLike = 0.05,
    phase_deg: float = 0.0,
) -> Heightfield:
    """z = a·cos(2πx/P + phase) at cell centres, periodic; peak to valley 2a.

    Raises InputError for a period below two pitches and for a side that does not hold whole periods.
    """
    shape, (dy, dx) = checks.grid(shape, pitch_um)
    amplitude = checks.number("amplitude_um", amplitude_um, 0.0)
    phase = checks.number("phase_deg", phase_deg)
    periods = whole_periods(period_um, shape[1], dx)
    # x/P in whole numbers before the division: the heights of a period repeat to the last bit
    cycles = (2 * np.arange(shape[1]) + 1) * periods % (2 * shape[1]) / (2 * shape[1])
    profile = amplitude * np.cos(2 * np.pi * cycles + np.deg2rad(phase))
    step = f"generated: sinusoid period {period_um:g} µm, amplitude {amplitude:g} µm"
    return _grating(profile, shape, (dy, dx), "cubic", "sinusoid", step)


def lamellar(
    period_um: float,
    depth_um: float,
    duty: float = 0.5,
    shape: tuple[int, int] = (64, 1000),
    pitch_um: float | ArrayLike = 0.05,
) -> Heightfield:
    """Ridges with vertical walls ("nearest"): the first `duty` of each period is `depth_um` higher than the rest.

    Raises InputError unless both the period and the ridge are whole numbers of pitches.
    """
    shape, (dy, dx) = checks.grid(shape, pitch_um)
    depth = checks.number("depth_um", depth_um, 0.0)
    share = checks.number("duty", duty, 0.0, 1.0)
    samples = _samples_per_period(period_um, shape[1], dx)
    ridge = round(share * samples)
    if not 0 < ridge < samples or abs(ridge - share * samples) > 1e-6 * samples:
        best = min(max(ridge, 1), samples - 1) / samples
        raise InputError(
            f"duty = {duty!r}: the ridge is {share * samples:g} pitches wide, a whole number from 1 to {samples - 1} "
            f"is needed: take duty = {best:.6g} or a finer pitch"
        )
    profile = np.where(np.arange(shape[1]) % samples < ridge, depth, 0.0)
    step = f"generated: lamellar period {period_um:g} µm, depth {depth:g} µm, duty {share:g}"
    return _grating(profile - depth * ridge / samples, shape, (dy, dx), "nearest", "lamellar", step)


def blazed(
    period_um: float,
    depth_um: float | None = None,
    blaze_deg: float | None = None,
    shape: tuple[int, int] = (64, 1000),
    pitch_um: float | ArrayLike = 0.05,
) -> Heightfield:
    """Sawtooth: ramps that rise with x at the blaze angle and fall back within one pitch.

    depth_um or blaze_deg : one of them; depth = period · tan(blaze angle) is the ideal, sharp tooth's. A negative one
        makes the ramps fall with x.

    Interpolation is "linear": it keeps the ramps plane. A cubic spline would overshoot at the edges, "nearest" would
    make a staircase whose steps diffract. The price is a wall one pitch wide instead of a vertical one, so that the
    teeth of the surface are (n − 1)/n of the depth for n samples per period.

    Raises InputError unless the period is a whole number of at least 4 pitches and the side holds whole periods.
    """
    shape, (dy, dx) = checks.grid(shape, pitch_um)
    if (depth_um is None) == (blaze_deg is None):
        raise InputError("blazed: give either depth_um or blaze_deg")
    if blaze_deg is not None:
        slope = float(np.tan(np.deg2rad(checks.number("blaze_deg", blaze_deg, -85.0, 85.0))))
    else:
        slope = checks.number("depth_um", depth_um) / checks.positive("period_um", period_um)  # type: ignore[arg-type]
    samples = _samples_per_period(period_um, shape[1], dx)
    if samples < 4:
        raise InputError(f"period_um = {period_um:g} µm holds {samples} pitches: a sawtooth needs at least 4")
    profile = slope * dx * (np.arange(shape[1]) % samples - (samples - 1) / 2)
    angle = np.rad2deg(np.arctan(slope))
    step = f"generated: blazed period {period_um:g} µm, blaze angle {angle:.6g}°, walls one pitch wide"
    return _grating(profile, shape, (dy, dx), "linear", "blazed", step)


def whole_periods(period_um: float, nx: int, dx: float) -> int:
    """Number of periods over nx pitches; InputError that names the nearest possible period unless it is whole."""
    period = checks.positive("period_um", period_um)
    if period < 2 * dx * (1 - 1e-9):
        raise InputError(f"period_um = {period:g} µm is below two pitches ({2 * dx:g} µm): refine the pitch")
    side = nx * dx
    periods = max(round(side / period), 1)
    if abs(periods * period - side) > 1e-6 * side:
        raise InputError(
            f"period_um = {period:g} µm: {side:g} µm hold {side / period:.6g} periods, a whole number is needed for a "
            f"periodic field: the nearest possible period is {side / periods:.9g} µm"
        )
    return periods


def _samples_per_period(period_um: float, nx: int, dx: float) -> int:
    """Pitches per period; InputError unless a whole number that divides nx."""
    periods = whole_periods(period_um, nx, dx)
    if nx % periods:
        divisors = [n for n in range(1, nx // 2 + 1) if nx % n == 0]
        best = min(divisors, key=lambda n: abs(nx * dx / n - period_um))
        raise InputError(
            f"period_um = {period_um:g} µm is {nx / periods:.6g} pitches: edges have to fall between samples: the "
            f"nearest possible period is {nx * dx / best:.9g} µm"
        )
    return nx // periods


def _grating(
    profile: np.ndarray, shape: tuple[int, int], pitch: tuple[float, float], interpolation: str, name: str, step: str
) -> Heightfield:
    z = np.broadcast_to(profile, shape)
    return Heightfield(z, pitch, periodic=True, interpolation=interpolation, name=name, history=(step,))
