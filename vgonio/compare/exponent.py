"""The exponent p of the Fresnel reflectance in a linear shift (thesis 4.2): what is allowed, and when it is fitted."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from .spectra import Spectra

P_BOUNDS = (0.0, 5.0)  # p counts reflections (thesis, below 4.2): beyond five nothing is left to see
AT_BOUND = 1e-4  # a fitted exponent closer to a bound than that has stopped there
FEWEST_FOR_P = 5  # wavelengths: two parameters and the value at λ_n leave two to judge the fit by


def fixed_p(p: float | str) -> float:
    """The value of an exponent that is not fitted: 0 where "fit" was asked for but F is the same for all."""
    return 0.0 if isinstance(p, str) else float(p)


def bound_words(p: float, p_bounds: tuple[float, float] = P_BOUNDS) -> str:
    """ " (stopped at its bound 5)" for a fitted exponent that lies at one, so that it has no error; else ""."""
    at = next((b for b in p_bounds if abs(p - b) < AT_BOUND), None)
    return "" if at is None else f" (stopped at its bound {at:g})"


def check_p(p: float | str) -> None:
    """InputError unless p is "fit" or a number within `P_BOUNDS`."""
    if p == "fit":
        return
    if isinstance(p, str) or not P_BOUNDS[0] <= p <= P_BOUNDS[1]:
        raise InputError(f"p = {p}: a number from {P_BOUNDS[0]:g} to {P_BOUNDS[1]:g} or 'fit' is allowed")


def p_is_free(s: Spectra, p: float | str, p_bounds: tuple[float, float]) -> bool:
    """Whether p is a free parameter: asked for, and F depends on wavelength."""
    check_p(p)
    if p != "fit":
        return False
    if not 0 <= p_bounds[0] < p_bounds[1]:
        raise InputError(f"p_bounds = {p_bounds}: 0 ≤ lower < upper is needed")
    if np.abs(s.log_fresnel).max() < 1e-12:
        return False
    if s.offset.size < FEWEST_FOR_P:
        raise InputError(
            f"{s.offset.size} wavelengths are too few to fit p beside the slope, {FEWEST_FOR_P} are needed: fix it, p=1"
        )
    return True
