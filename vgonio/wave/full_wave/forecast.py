"""What a full-wave solution of a scene will cost, for the plan: nothing is solved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...directions import Incoming
from ...surface.heightfield import Heightfield
from ...units import nm_to_um
from . import effort, profile
from .solver import FullWave
from .windows import centres, piece, taper_of


@dataclass(frozen=True)
class Forecast:
    """The dearest wavelength, how many windows it is solved for, and seconds of all wavelengths and windows."""

    price: effort.Cost
    wavelength_nm: float
    windows: int
    seconds: float

    @property
    def affordable(self) -> bool:
        return self.price.unknowns <= effort.MOST_UNKNOWNS

    @property
    def size(self) -> str:
        """The systems that are solved, in words."""
        each = "" if self.windows == 1 else f" in each of {self.windows} windows"
        return f"{self.price.unknowns:,} unknowns{each} at {self.wavelength_nm:g} nm, {self.price.bytes / 1e9:.2g} GB"

    def __str__(self) -> str:
        return f"{self.size}; about {self.seconds:.2g} s of a free core in all"


def forecast(solver: FullWave, surface: Heightfield, incoming: Incoming) -> Forecast:
    """Cost of `solver.scatter(surface, incoming, …)`; InputError where it would refuse the surface."""
    profile.require_profile(surface)
    taper = taper_of(incoming, surface)
    middles = [0.0] if surface.periodic else centres(surface, taper, solver.windows)[0]
    polarisations = len(solver.polarisations(incoming))
    prices = []
    for wavelength_nm in solver.wavelength_nm:
        wavelength, index = float(nm_to_um(wavelength_nm)), solver.index(wavelength_nm)
        how = effort.resolution(surface, wavelength, index, solver.tol, 1)
        if surface.periodic:
            span = profile.period_span(surface, wavelength)
        else:
            span = piece(surface, middles[len(middles) // 2], taper, wavelength)

        def price(nodes: int, index: complex | None = index) -> effort.Cost:
            return effort.cost(nodes, index, polarisations, len(incoming.theta_deg), surface.periodic)

        least = price(profile.fewest_nodes(surface, *span, how))  # which may be more than memory holds
        fits = least.unknowns <= effort.MOST_UNKNOWNS
        prices.append(price(profile.cut(surface, *span, how).size) if fits else least)
    dearest = int(np.argmax([p.unknowns for p in prices]))
    # the coarser solution beside it costs a third of one window
    seconds = sum(p.seconds for p in prices) * (len(middles) + 0.4)
    return Forecast(prices[dearest], float(solver.wavelength_nm[dearest]), len(middles), seconds)
