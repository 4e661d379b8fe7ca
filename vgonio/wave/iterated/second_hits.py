"""Where mirrored rays meet the surface again: inside the patches that are computed, outside, or nowhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from ...surface.heightfield import Heightfield
from ..coherence import Window
from ..quadrature import Floats

RAYS = 4000  # of one angle of incidence, all windows together
STEPS = 4000  # of one ray, at most
HALVINGS = 20  # of the last step, down to the surface


def second_hits(
    surface: Heightfield, windows: list[Window], length: float, wi: Floats, seed: int
) -> tuple[float, float]:
    """(share of the light on the patches that meets the surface again, share of that which does so outside its patch).

    length : ℓ of the Gaussian windows;  wi : (3,) towards the source
    Rays start where a Gaussian beam of that window falls, march to the surface, are mirrored and march on, in steps of
    half a pitch on the bilinear surface. What leaves a finite sample sideways, still among its heights, counts as
    outside.
    """
    of = np.arange(max(RAYS, len(windows))) % len(windows)
    centre = np.array([w.centre[::-1] for w in windows])[of]
    half = np.array([w.half[::-1] for w in windows])[of]
    rng = np.random.default_rng(seed)
    top = float(surface.z.max()) + 1e-6
    start = np.empty((len(of), 3))
    spread = length / np.sqrt(2)  # of the intensity
    for axis in (0, 1):
        start[:, axis] = centre[:, axis] + np.clip(rng.normal(0, spread, len(of)), -half[:, axis], half[:, axis])
    start[:, 2] = 0.0
    start += wi * ((top - start[:, 2]) / wi[2])[:, None]
    place, hit = _march(surface, start, np.broadcast_to(-wi, start.shape))
    place, centre, half = place[hit], centre[hit], half[hit]
    normal = _normals(surface, place)
    d = -wi - 2 * (normal @ -wi)[:, None] * normal
    again, met = _march(surface, place + 1e-3 * min(surface.pitch_um) * normal, d)
    low = (again[:, 2] < top) & ~met  # left sideways
    outside = np.zeros(len(place), bool)
    for axis in (0,) if surface.is_profile else (0, 1):
        outside |= np.abs(again[:, axis] - centre[:, axis]) > half[:, axis]
    second = met | low
    share = float(second.mean()) if len(second) else 0.0
    return share, float((outside & second).sum() / second.sum()) if second.any() else 0.0


def _heights(surface: Heightfield, p: Floats) -> Floats:
    at = [p[:, 1] / surface.dy - 0.5, p[:, 0] / surface.dx - 0.5]
    if surface.is_profile:
        at[0] = np.zeros(len(p))
    mode = "grid-wrap" if surface.periodic else "nearest"
    order = 0 if surface.interpolation == "nearest" else 1
    return map_coordinates(surface.z, at, order=order, mode=mode)


def _normals(surface: Heightfield, p: Floats) -> Floats:
    n = np.zeros(p.shape)
    n[:, 2] = 1.0
    for axis in (0, 1):
        if axis == 1 and surface.is_profile:
            continue
        e = np.zeros(3)
        e[axis] = surface.pitch_um[1 - axis] / 2
        n[:, axis] = -(_heights(surface, p + e) - _heights(surface, p - e)) / (2 * e[axis])
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def _march(surface: Heightfield, start: Floats, d: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Last places of rays, and whether they met the surface there."""
    p, hit = start.copy(), np.zeros(len(start), bool)
    top, size = float(surface.z.max()), np.array(surface.size_um[::-1])
    step = 0.5 * (surface.dx if surface.is_profile else min(surface.pitch_um))
    alive = np.arange(len(p))
    for _ in range(STEPS):
        if not alive.size:
            break
        p[alive] += step * d[alive]
        q = p[alive]
        below = q[:, 2] < _heights(surface, q)
        hit[alive[below]] = True
        gone = (q[:, 2] > top) & (d[alive, 2] >= 0)
        if not surface.periodic:
            axes = slice(0, 1) if surface.is_profile else slice(0, 2)
            gone |= np.any((q[:, axes] < 0) | (q[:, axes] > size[axes]), axis=1)
        alive = alive[~below & ~gone]
    p[hit] = _back_up(surface, p[hit], d[hit], step)
    return p, hit


def _back_up(surface: Heightfield, p: Floats, d: Floats, step: float) -> Floats:
    """Places just above the surface on the last step of rays that ended below it, by halving."""
    above, below = p - step * d, p
    for _ in range(HALVINGS):
        middle = (above + below) / 2
        under = (middle[:, 2] < _heights(surface, middle))[:, None]
        above, below = np.where(under, above, middle), np.where(under, middle, below)
    return above
