"""Seconds, memory and error of one part of a run, from counts of its work and the speeds of a machine."""

from __future__ import annotations

from dataclasses import dataclass

MB = 1e6
LEAST_WAVE_TOL = 1e-12  # below, double precision decides: transforms reach 1e-13, and the sums of windows more


@dataclass(frozen=True)
class Forecast:
    """seconds : wall-clock, on a machine that does nothing else;  memory_bytes : beside what is there before
    error : the figure that the solver states as `error_achieved`, None where there is none
    rough : factors on the error between which it lies, where only a range is known
    loading : of the seconds, those that libraries take which a process loads once
    how : what was done to know that, in words
    speckle : relative standard error of the waves in the brightest cones, from the windows; None for other parts
    """

    seconds: float
    memory_bytes: float
    error: float | None = None
    speckle: float | None = None
    rough: tuple[float, float] | None = None
    how: str = ""
    loading: float = 0.0
