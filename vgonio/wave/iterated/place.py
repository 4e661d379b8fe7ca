"""Where the windows of the iterated Kirchhoff approximation lie, how large they are and how many of them count."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ...surface.heightfield import Heightfield
from ..coherence import REACH, Window, independent, spread, tile

PATCH_UM = 20.0  # side of a three-dimensional patch where none is asked for
PROFILE_UM = 200.0  # window on a periodic profile where none is asked for, at most, or one length of it
WIDEST_UM = 60.0  # side of a patch up to which it is a matter of hours at most
PATCHES = 1  # of them that are computed where no number is asked for


@dataclass(frozen=True)
class Places:
    """Windows of one size; `independent` is their effective number, `tiled` how many would cover the surface.

    cut : that the light's coherence length is not taken but a smaller one, and why; "" where it is taken
    """

    windows: list[Window]
    independent: float
    tiled: int
    window_um: float
    length_um: float
    cut: str = ""

    @staticmethod
    def of(surface: Heightfield, window_um: float | None, coherence_um: float | None, most: int | None) -> Places:
        """Windows of full side `window_um` over the surface; a profile's lie along x alone.

        The amplitude falls as exp(−r²/2ℓ²), ℓ the coherence length, at most a sixth of the side: what lies beyond takes
        part in further reflections. None takes six coherence lengths, of a periodic surface several periods of it if
        need be; a finite sample, PATCH_UM and PROFILE_UM may hold less.
        """
        asked = window_um
        sides = (surface.dx,) if surface.is_profile else surface.pitch_um
        extent = surface.size_um[1] if surface.is_profile else min(surface.size_um)
        if window_um is None:
            window_um = np.inf if coherence_um is None else 2 * REACH * coherence_um
            window_um = min(window_um, _most(surface, extent, coherence_um))
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
        cut = ""
        if coherence_um is not None:
            if length < coherence_um * (1 - 1e-9):
                cut = _cut(surface, extent, coherence_um, window_um, asked)
            length = min(length, coherence_um)
        tiled = len(covering)
        if most is None and not surface.is_profile:
            most = PATCHES
        windows = [Window(length, w.half, w.centre) for w in spread(covering, surface, most)]
        return Places(windows, independent(windows, surface), tiled, float(window_um), float(length), cut)


def _most(surface: Heightfield, extent: float, coherence_um: float | None) -> float:
    """Side of the largest window that is taken where none is asked for."""
    if not surface.is_profile:
        return min(extent, PATCH_UM)
    return max(extent, PROFILE_UM) if surface.periodic and coherence_um is not None else extent


def _cut(surface: Heightfield, extent: float, coherence_um: float, window_um: float, asked: float | None) -> str:
    wanted = 2 * REACH * coherence_um
    if asked is not None:
        why = "the window_um asked for"
    elif window_um >= extent * (1 - 1e-9):
        why = "the size of the surface"
    else:
        why = f"at most {PROFILE_UM if surface.is_profile else PATCH_UM:g} µm where no window_um is asked for"
    most = np.inf if surface.is_profile else WIDEST_UM
    fits = wanted <= (most if surface.periodic else min(extent * (1 + 1e-9), most))
    wider = f"window_um = {wanted:g} or " if fits else ""
    return (
        f"the coherence length is {window_um / (2 * REACH):.3g} µm instead of the light's {coherence_um:g} µm, a sixth "
        f"of the window of {window_um:g} µm ({why}): its lobes are broader than those of theories that take "
        f"{coherence_um:g} µm; to compare them take {wider}light.coherence_um = {window_um / (2 * REACH):.3g}"
    )
