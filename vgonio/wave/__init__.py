"""2b. Waves: the surface integral S(q) by interchangeable methods, and three scalar theories on top of it."""

from __future__ import annotations

from dataclasses import dataclass

from .fourier import surface_fourier
from .full_wave import FullWave
from .iterated import IteratedKirchhoff
from .kirchhoff import Kirchhoff


@dataclass(frozen=True)
class GeneralizedHarveyShack(Kirchhoff):
    """`Kirchhoff` with the generalized Harvey–Shack factor, reciprocal form (Yan 2018: R-GHS)."""

    theory: str = "generalized-harvey-shack"


@dataclass(frozen=True)
class HarveyShack(Kirchhoff):
    """`Kirchhoff` with the original Harvey–Shack factor and q_z = 2k, reciprocal form (Yan 2018: R-OHS)."""

    theory: str = "harvey-shack"


__all__ = ["FullWave", "GeneralizedHarveyShack", "HarveyShack", "IteratedKirchhoff", "Kirchhoff", "surface_fourier"]
