"""Whether a fitted height of the slope is a shift at all: where it is none any w fits, and w means nothing.

Every table and sentence on a fitted shift asks here: what `fit` and `compare` print, and the page.
"""

from __future__ import annotations

import numpy as np

HEIGHT_OF = {"w": "h", "w1": "h1", "w2": "h2"}
NO_SHIFT = "no significant shift"
NO_FORM = "no shift of this form"
SIGMAS = 3.0  # standard errors: by chance once in 370 times
SMALLEST_NM = 1e-6  # nm⁻¹: 0.01 % per 100 nm, far below what any instrument or eye tells
# r² of the normalised spectra: below, most of their variation is something else (speckle, noise, another form), and the
# standard errors, which take spectra as independent, say nothing of that
LEAST_R2 = 0.5


def is_shift(height: float, error: float, r2: float = np.nan) -> bool:
    """Whether a fitted height of the slope, nm⁻¹, with the fit's r² of the normalised spectra, is a shift.

    3 standard errors from zero or more, at least 10⁻⁶ nm⁻¹, and half of the variation described. What is NaN, not
    known, is not asked for.
    """
    return no_shift(height, error, r2) == ""


def no_shift(height: float, error: float, r2: float = np.nan) -> str:
    """Why a fitted height is no shift, in words for a table; "" where it is one."""
    if abs(height) < SMALLEST_NM or abs(height) < SIGMAS * error:
        return NO_SHIFT
    return f"{NO_FORM} (r² = {r2:.2f})".replace("-", "−") if r2 < LEAST_R2 else ""


def no_figures(height: float, error: float, r2: float) -> str:
    """Why a global fit is not to be quoted at all: `no_shift`, where it does not describe half of the variation."""
    return no_shift(height, error, r2) if r2 < LEAST_R2 else ""


def in_sigmas(sigma: float) -> str:
    """3.2 σ, 31 σ; beyond 100 no digit of it means anything."""
    return "> 100 σ" if sigma > 100 else f"{sigma:.{1 if sigma < 10 else 0}f} σ"
