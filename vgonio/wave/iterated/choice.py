"""All pairs or blocks on a patch: from what a few of its points see of each other on a coarse grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ...surface.heightfield import Heightfield
from .blocks import BLOCK, FEWEST, WHOLE
from .pair_reference import seen_from
from .patch import Patch
from .place import Places

COARSE = 64  # points along the side of the coarse grid
LOOKED = 5  # by as many of its points look around, spread evenly


class _Solver(Protocol):
    @property
    def method(self) -> str: ...

    @property
    def wavelength_nm(self) -> Any: ...

    def per(self, surface: Heightfield) -> float: ...


@dataclass(frozen=True)
class Choice:
    """blocks : whether blocks of points are taken together;  why : in words
    visible : share of the pairs that see each other;  whole : share of these in blocks seen as a whole"""

    blocks: bool
    why: str
    visible: float
    whole: float

    @property
    def name(self) -> str:
        return "blocks" if self.blocks else "pairs"


def choose(solver: _Solver, surface: Heightfield, places: Places) -> Choice:
    """How the solver will sum over the patches of `places`: from the first of them, at its shortest wavelength."""
    across = places.window_um * solver.per(surface) / (min(solver.wavelength_nm) * 1e-3)
    visible, whole = shares(surface, places, across / COARSE)
    sees = f"{visible:.0%} of the pairs see each other, {whole:.0%} of these in blocks seen as a whole"
    if solver.method != "auto":
        return Choice(solver.method == "blocks", f"as asked for; {sees}", visible, whole)
    if across**2 < FEWEST:
        return Choice(False, f"{across**2:,.0f} points are few; {sees}", visible, whole)
    return Choice(whole > WHOLE, sees, visible, whole)


def shares(surface: Heightfield, places: Places, coarser: float) -> tuple[float, float]:
    """(visible, whole) of `Choice`, from points `coarser` times as far apart: about ± a tenth of themselves.

    A cell counts as whole where all those around it are seen too that a block and a vector of observers reach to.
    """
    from scipy.ndimage import minimum_filter

    grid = Patch.of(surface, places.windows[0], places.window_um / COARSE, 0.0).grid
    n = len(grid.z)
    reach = max(1, round(1.5 * BLOCK / coarser))
    visible, whole = 0, 0
    at = (np.arange(LOOKED) + 0.5) / LOOKED * n
    x, y = np.meshgrid(np.arange(n) * grid.pitch, np.arange(n) * grid.pitch)
    for iy in at.astype(int):
        for ix in at.astype(int):
            r = np.stack([x - x[iy, ix], y - y[iy, ix], grid.z - grid.z[iy, ix]])
            seen = seen_from(grid, iy, ix) & (np.sum(r * grid.normal, axis=0) < 0)
            seen &= np.einsum("iyx,i->yx", r, grid.normal[:, iy, ix]) > 0
            visible += int(seen.sum())
            whole += int(minimum_filter(seen, 2 * reach + 1, mode="constant").sum())
    return visible / (LOOKED**2 * n**2), whole / max(visible, 1)
