"""Where the windows of the iterated Kirchhoff approximation lie, how large they are and how many of them count."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ...surface.heightfield import Heightfield
from ..coherence import REACH, Window, independent, spread, tile

PATCH_UM = 20.0  # side of a three-dimensional patch where none is asked for
PATCHES = 1  # of them that are computed where no number is asked for


@dataclass(frozen=True)
class Places:
    """Windows of one size; `independent` is their effective number, `tiled` how many would cover the surface."""

    windows: list[Window]
    independent: float
    tiled: int
    window_um: float
    length_um: float

    @staticmethod
    def of(surface: Heightfield, window_um: float | None, coherence_um: float | None, most: int | None) -> Places:
        """Windows of full side `window_um` over the surface; a profile's lie along x alone.

        The amplitude falls as exp(−r²/2ℓ²), ℓ the coherence length, at most a sixth of the side: what lies beyond takes
        part in further reflections.
        """
        sides = (surface.dx,) if surface.is_profile else surface.pitch_um
        extent = surface.size_um[1] if surface.is_profile else min(surface.size_um)
        if window_um is None:
            window_um = np.inf if coherence_um is None else 2 * REACH * coherence_um
            window_um = min(window_um, extent, np.inf if surface.is_profile else PATCH_UM)
        if window_um > extent * (1 + 1e-9) and not surface.periodic:
            raise InputError(
                f"window_um = {window_um:g} µm is larger than the surface of {extent:g} µm: take a smaller one"
            )
        if window_um < 2 * max(sides) and np.ptp(surface.z) > 0:
            raise InputError(
                f"window_um = {window_um:g} µm holds less than two samples of the surface, {max(sides):g} µm apart"
            )
        length = window_um / (2 * REACH)
        covering = tile(surface.replace(z=surface.z[:1]) if surface.is_profile else surface, length)
        if surface.is_profile:
            centres = np.unique([w.centre[1] for w in covering])
            covering = [Window(length, (window_um / 2, window_um / 2), (0.0, float(c))) for c in centres]
        else:
            covering = [Window(length, (window_um / 2, window_um / 2), w.centre) for w in covering]
        if coherence_um is not None:
            length = min(length, coherence_um)
        tiled = len(covering)
        if most is None and not surface.is_profile:
            most = PATCHES
        windows = [Window(length, w.half, w.centre) for w in spread(covering, surface, most)]
        return Places(windows, independent(windows, surface), tiled, float(window_um), float(length))
