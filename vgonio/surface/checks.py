"""Checks of pitches, shapes and parameters of generators, so that a scene with a wrong value gets one clear line."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError

# a 10,000 × 10,000 field is 0.8 GB
MAX_POINTS = 10**8


def pitch_pair(pitch_um: float | ArrayLike) -> tuple[float, float]:
    """(dy, dx) in µm from a number or a pair; InputError unless positive and finite."""
    try:
        p = np.broadcast_to(np.asarray(pitch_um, dtype=np.float64), (2,))
    except (TypeError, ValueError):
        raise InputError(f"pitch_um = {pitch_um!r}: give one number or (dy, dx), in µm") from None
    if not np.all(np.isfinite(p) & (p > 0)):
        raise InputError(f"pitch_um = {pitch_um!r} µm: the pitch has to be positive and finite")
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
