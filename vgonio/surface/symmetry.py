"""Whether mirror images of a surface are like the surface: do its slopes lean to one side?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .heightfield import Heightfield

Floats = NDArray[np.float64]
PIECES = 5  # along each axis: their spread tells chance from leaning
LEANING = 0.1  # of the mean square slope, below which no BRDF shows it
CHANCES = 2.5  # standard errors
DIRECTIONS = ("along x", "along y", "across both axes at an angle")


def leaning(surface: Heightfield) -> dict[str, float]:
    """Direction → how far slopes there lean to one side, −1 to 1; only what chance does not explain.

    ⟨s|s|⟩/⟨s²⟩ of the slopes s along x and y, which mirroring that axis turns round, and the correlation of both,
    which mirroring one axis turns round. A blazed grating of flanks of 20 % and 80 % has 0.6, ridges at 45° have a
    correlation of 1, and what is drawn from a normal distribution has none. Beyond chance is what exceeds `CHANCES`
    standard errors of the mean of `PIECES`² pieces, and `LEANING`.
    """
    found = {}
    for name, (odd, even) in zip(DIRECTIONS, _moments(surface)):
        total = even.mean() if len(odd) > 1 else 0.0
        if not total > 0:
            continue
        share = odd.mean() / total
        # the pieces' own odd parts against the common mean square
        error = odd.std(ddof=1) / np.sqrt(len(odd)) / total
        if abs(share) > max(LEANING, CHANCES * error):
            found[name] = float(share)
    return found


def leaning_in_words(surface: Heightfield) -> str:
    """ "along x (57 %)", or nothing."""
    return ", ".join(f"{name} ({100 * abs(share):.0f} %)" for name, share in leaning(surface).items())


def _moments(surface: Heightfield) -> list[tuple[Floats, Floats]]:
    """For each direction the means over the pieces of what changes its sign, and of what it is compared with."""
    z = surface.z
    columns, rows = (np.array_split(np.arange(n - 1), min(PIECES, max(n - 1, 1))) for n in (z.shape[1], z.shape[0]))
    if surface.is_profile:
        rows = [np.arange(1)]
    parts = []
    for r in rows:
        for c in columns:
            if len(r) == 0 or len(c) == 0:
                continue
            piece = z[r[0] : r[-1] + 2, c[0] : c[-1] + 2]
            least = max(len(piece) - 1, 1)
            zx = np.diff(piece, axis=1)[:least] / surface.dx
            zy = np.diff(piece, axis=0)[:, :-1] / surface.dy if len(piece) > 1 else np.zeros_like(zx)
            products = zx * np.abs(zx), zy * np.abs(zy), zx * zy, zx**2, zy**2
            if all(np.isfinite(p).any() for p in products):  # else too much of the piece is missing
                parts.append([np.nanmean(p) for p in products])
    found = np.array(parts, float).reshape(-1, 5)
    both = np.sqrt(np.maximum(found[:, 3].mean() * found[:, 4].mean(), 0.0)) if len(found) else 0.0
    return [(found[:, 0], found[:, 3]), (found[:, 1], found[:, 4]), (found[:, 2], np.full(len(found), both))]
