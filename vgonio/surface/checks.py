"""Checks of pitches, shapes and parameters of generators, so that a scene with a wrong value gets one clear line."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, VgonioWarning

# a 10,000 × 10,000 field is 0.8 GB
MAX_POINTS = 10**8
# beyond, squares of heights, slopes and areas leave what double precision holds; nobody measures a fm or a Mm
PITCHES_UM = (1e-9, 1e12)
HIGHEST_UM = 1e12
COARSE_STEPS = 0.01  # of the RMS height: rounding of single precision that is warned of


def heights(values: Any) -> NDArray[np.float64]:
    """(ny, nx) float64 copy of heights in µm; what a masked array masks is missing (NaN).

    Labelled arrays (xarray) of dimensions x and y come with y first and with growing coordinates, whatever their order.
    Raises InputError for what is no two-dimensional array of real numbers, infinite or gigantic heights, and nothing
    but NaN; warns of single precision whose steps, large beside an offset, are a good part of the roughness.
    """
    if hasattr(values, "dims") and hasattr(values, "transpose"):
        values = _labelled(values)
    try:
        given = np.ma.filled(values.astype(np.float64), np.nan) if np.ma.isMaskedArray(values) else np.asarray(values)
        if given.dtype.kind in "cmMV":
            raise TypeError(f"{given.dtype} are no heights")
        z = np.array(given, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise InputError("heights have to be a two-dimensional array of real numbers in µm") from None
    if z.ndim != 2 or z.size < 2:
        raise InputError(f"heights have shape {z.shape}: (rows, columns) with at least two samples is needed")
    if np.isinf(z).any():
        raise InputError(f"{int(np.isinf(z).sum())} heights are infinite: mark missing points with NaN")
    if np.isnan(z).all():
        raise InputError(f"all {z.size} heights are missing (NaN): there is no surface")
    highest = float(max(np.nanmax(z), -np.nanmin(z)))
    if highest > HIGHEST_UM:
        raise InputError(
            f"heights of up to {highest:.3g} µm: at most {HIGHEST_UM:g} µm is possible; is the unit right?"
        )
    if given.dtype.kind == "f" and given.dtype.itemsize < 8:
        _warn_of_coarse_steps(z, float(np.spacing(given.dtype.type(highest))))
    return z


def _labelled(values: Any) -> Any:
    """A labelled array with its dimensions in the order (y, x) and growing coordinates; others as they are."""
    if set(values.dims) != {"y", "x"}:
        return values
    values = values.transpose("y", "x")
    for name in ("y", "x"):
        at = np.asarray(values[name]) if name in getattr(values, "coords", ()) else np.zeros(0)
        if at.size > 1 and at.dtype.kind in "iuf" and at[0] > at[-1]:
            values = values.isel({name: slice(None, None, -1)})
    return values


def _warn_of_coarse_steps(z: NDArray[np.float64], step: float) -> None:
    rms = float(np.nanstd(z))
    if step > COARSE_STEPS * rms > 0:
        warnings.warn(
            f"heights in single precision or less that come in steps of {step:.2g} µm, beside an Sq of {rms:.2g} µm: "
            "subtract their offset before they are rounded, or give float64",
            VgonioWarning,
            stacklevel=5,
        )


def pitch_pair(pitch_um: float | ArrayLike) -> tuple[float, float]:
    """(dy, dx) in µm from a number or a pair; InputError unless positive, finite and within PITCHES_UM."""
    try:
        p = np.broadcast_to(np.asarray(pitch_um, dtype=np.float64), (2,))
    except (TypeError, ValueError):
        raise InputError(f"pitch_um = {pitch_um!r}: give one number or (dy, dx), in µm") from None
    if not np.all(np.isfinite(p) & (p > 0)):
        raise InputError(f"pitch_um = {pitch_um!r} µm: the pitch has to be positive and finite")
    if p.min() < PITCHES_UM[0] or p.max() > PITCHES_UM[1]:
        low, high = PITCHES_UM
        raise InputError(f"pitch_um = {pitch_um!r} µm: allowed is {low:g} … {high:g} µm; is the unit right?")
    return float(p[0]), float(p[1])


def grid(shape: Sequence[int], pitch_um: float | ArrayLike) -> tuple[tuple[int, int], tuple[float, float]]:
    """((ny, nx), (dy, dx)) of a generator; InputError for anything else than two whole numbers and a pitch."""
    try:
        ny, nx = (int(n) for n in shape)
        whole = all(n == m for n, m in zip((ny, nx), shape))
    except (TypeError, ValueError):
        raise InputError(f"shape = {shape!r}: give (rows, columns)") from None
    if not whole or min(ny, nx) < 1 or not 2 <= ny * nx <= MAX_POINTS:
        raise InputError(
            f"shape = {shape!r}: (rows, columns), whole numbers, together from 2 to {MAX_POINTS:.0e} samples"
        )
    return (ny, nx), pitch_pair(pitch_um)


def number(name: str, value: float, low: float = -np.inf, high: float = np.inf, open_low: bool = False) -> float:
    """`value` as a float within [low, high], or (low, high] where `open_low`; InputError otherwise."""
    try:
        x = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {value!r}: a number is needed") from None
    if not np.isfinite(x) or not low <= x <= high or (open_low and x == low):
        above = "" if low == -np.inf else f", {'above' if open_low else 'at least'} {low:g}"
        below = "" if high == np.inf else f", at most {high:g}"
        raise InputError(f"{name} = {value!r}: it has to be finite{above}{below}")
    return x


def positive(name: str, value: float, high: float = np.inf) -> float:
    """`value` as a float above 0."""
    return number(name, value, 0.0, high, open_low=True)


def generator(seed: int) -> np.random.Generator:
    """The random numbers of a seed; InputError unless it is a whole number from 0 on."""
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise InputError(f"seed = {seed!r}: a whole number from 0 on is needed")
    return np.random.default_rng(int(seed))
