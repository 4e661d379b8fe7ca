"""What one wavelength of `scatter` comes to, whichever way it was found."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from .panels import Floats


@dataclass(frozen=True, eq=False)
class Outcome:
    """Arrays over (polarisation, theta_i) or, brdf and stderr, (polarisation, theta_i, element).

    absorbed : flux into the material, 0 for a perfect conductor;  lost : what leaves past the ends of a finite profile
    error : see `effort.converged`
    """

    brdf: Floats
    stderr: Floats
    reflected: Floats
    absorbed: Floats
    lost: Floats
    condition: Floats
    residual: Floats
    unknowns: int
    error: float
    remarks: list[str]
    attrs: dict[str, Any] = field(default_factory=dict)
