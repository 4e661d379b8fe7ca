"""Orders of a grating: which there are at each angle of incidence and wavelength, and where they leave."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..directions import angle_list
from ..errors import InputError
from ..surface.heightfield import Heightfield
from ..units import degrees, nm_to_um, radians
from .quadrature import Floats


@dataclass(frozen=True, eq=False)
class Orders:
    """Order m (o,) leaves at sin θ_o = −sin θ_i − mλ/P, `sine` (t, o, w); beyond ±1 it cannot propagate.

    period : P in µm;  theta_i : (t,) degrees;  wavelength : (w,) nm
    """

    period: float
    theta_i: Floats
    m: NDArray[np.int64]
    wavelength: Floats
    sine: Floats

    @staticmethod
    def of(surface: Heightfield, theta_i_deg: Any, wavelength_nm: Any) -> Orders:
        """All orders that propagate at any of the angles; InputError for what is not one periodic profile along x."""
        if not (surface.periodic and surface.is_profile):
            raise InputError(
                f"{surface.name or 'the surface'} is not one periodic profile along x: orders are for gratings "
                "(periodic = true and all rows equal); use scatter for anything else"
            )
        period = surface.period_um or surface.size_um[1]
        theta, wavelength = angle_list(theta_i_deg, "theta_i_deg"), np.asarray(wavelength_nm, float)
        most = int(np.floor(2 * period / nm_to_um(wavelength).min()))
        m = np.arange(-most, most + 1)
        sine = -np.sin(radians(theta))[:, None, None] - m[:, None] * nm_to_um(wavelength) / period
        return Orders(period, theta, m, wavelength, sine)

    @property
    def there(self) -> NDArray[np.bool_]:
        """(t, o, w): which propagate."""
        return np.abs(self.sine) < 1 - 1e-12

    @property
    def coords(self) -> dict[str, Any]:
        """Coordinates of `efficiency (theta_i, order, wavelength)`; theta_o in degrees, NaN where nothing leaves."""
        leaving = degrees(np.where(self.there, np.arcsin(np.clip(self.sine, -1, 1)), np.nan))
        return {
            "theta_i": self.theta_i,
            "order": self.m,
            "wavelength": self.wavelength,
            "theta_o": (("theta_i", "order", "wavelength"), leaving),
        }
