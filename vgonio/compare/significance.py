"""Whether a fitted height of the slope is a shift at all: where it is none any w fits, and w means nothing."""

from __future__ import annotations

HEIGHT_OF = {"w": "h", "w1": "h1", "w2": "h2"}
NO_SHIFT = "no significant shift"
SIGMAS = 3.0  # standard errors: by chance once in 370 times
SMALLEST_NM = 1e-6  # nm⁻¹: 0.01 % per 100 nm, far below what any instrument or eye tells


def is_shift(height: float, error: float) -> bool:
    """Whether a height of the slope, nm⁻¹, is 3 standard errors from zero or more, and at least 10⁻⁶ nm⁻¹.

    An error that is NaN, not known, leaves the second condition alone.
    """
    return abs(height) >= SMALLEST_NM and not abs(height) < SIGMAS * error
