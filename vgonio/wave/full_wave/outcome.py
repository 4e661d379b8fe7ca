"""What one wavelength of `scatter` is asked, and what it comes to, whichever way it was found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ...directions import Detector, Incoming
from ...surface.heightfield import Heightfield
from ...units import radians
from .panels import Floats

if TYPE_CHECKING:
    from .solver import FullWave


@dataclass(frozen=True, eq=False)
class Task:
    """One wavelength of `FullWave.scatter`. sign : cos φ_i, 1 or −1;  tell : takes the share that is done."""

    solver: FullWave
    surface: Heightfield
    incoming: Incoming
    detector: Detector
    wavelength_nm: float
    polarisations: tuple[str, ...]
    sign: float
    tell: Callable[[float], None]

    @property
    def theta(self) -> Floats:
        """(n,) signed angles of incidence in the cross-section, radians."""
        return self.sign * radians(self.incoming.theta_deg)


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
