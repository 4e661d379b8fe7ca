"""Book-keeping of power: what leaves upward after how many reflections, what is absorbed, what is lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..directions import Detector
from .fresnel_table import FresnelTable
from .trace import Paths

Floats = NDArray[np.float64]
STOKES_Q = {"unpolarised": 0.0, "s": 1.0, "p": -1.0}


@dataclass
class Tally:
    """Sums over rays of unit power. bounce = 0 … kept − 1 stands for 1 … kept reflections, the last for all higher."""

    rays: int
    caught: Floats  # (bounce, element, w) power in each detector element
    caught_squared: Floats  # (bounce, element, w) Σ power² per ray
    upward: Floats  # (bounce, w) power that left upward
    absorbed: Floats  # (w,)
    lost: Floats  # (w,)

    @staticmethod
    def empty(kept: int, elements: int, wavelengths: int) -> Tally:
        cube = (kept, elements, wavelengths)
        one = np.zeros(wavelengths)
        return Tally(0, np.zeros(cube), np.zeros(cube), np.zeros((kept, wavelengths)), one, one.copy())

    def __iadd__(self, other: Tally) -> Tally:
        self.rays += other.rays
        for name in ("caught", "caught_squared", "upward", "absorbed", "lost"):
            getattr(self, name).__iadd__(getattr(other, name))
        return self


def tally(paths: Paths, table: FresnelTable, detector: Detector, polarisation: str, kept: int) -> Tally:
    """Power of every path at every wavelength, sorted by fate and number of reflections."""
    wavelengths = table.table.shape[2]
    out = Tally.empty(kept, len(detector), wavelengths)
    out.rays = len(paths.bounces)
    stray = ~paths.escaped & (paths.bounces == 0)
    out.lost += np.count_nonzero(stray)
    if not paths.hits:
        return out
    ray, element = detector.catch(paths.direction)
    use = paths.escaped[ray] & (paths.bounces[ray] > 0)
    ray, element = ray[use], element[use]

    # one reflection: sums over the table's nodes; wavelengths enter last
    first = paths.hits[0]
    q = STOKES_Q[polarisation] * first.cos_2psi
    single = paths.bounces[first.ray] == 1
    ends, lost_ends = single & paths.escaped[first.ray], single & ~paths.escaped[first.ray]
    polarised = polarisation != "unpolarised"

    def reflected(mask: NDArray[np.bool_]) -> Floats:
        power = table.summed(first.cos_i[mask], None, 0)
        return power + table.summed(first.cos_i[mask], q[mask], 1) if polarised else power

    out.upward[0] += reflected(ends)
    out.lost += reflected(lost_ends)
    out.absorbed += len(first.ray) - reflected(np.ones(len(first.ray), bool))
    place = np.full(len(paths.bounces), -1, np.int64)
    place[first.ray] = np.arange(len(first.ray))
    once = paths.bounces[ray] == 1
    at = place[ray[once]]
    m = table.elements(first.cos_i[at], 2)
    _catch(out, 0, element[once], m[:, 0] + q[at, None] * m[:, 1])

    if len(paths.hits) > 1:
        _tally_multiple(out, paths, table, polarisation, kept, ray[~once], element[~once])
    return out


def _tally_multiple(
    out: Tally, paths: Paths, table: FresnelTable, polarisation: str, kept: int, ray: NDArray, element: NDArray
) -> None:
    """Paths of two and more reflections: the Stokes vector goes from hit to hit, per ray and wavelength."""
    row = np.full(len(paths.bounces), -1, np.int64)
    members = paths.hits[1].ray
    row[members] = np.arange(len(members))
    first = paths.hits[0]
    position = np.full(len(paths.bounces), -1, np.int64)
    position[first.ray] = np.arange(len(first.ray))
    at = position[members]
    m = table.elements(first.cos_i[at], 4)
    q, u = STOKES_Q[polarisation] * first.cos_2psi[at, None], -STOKES_Q[polarisation] * first.sin_2psi[at, None]
    # (rays, 4, wavelengths): I, Q, U, V
    stokes = np.stack([m[:, 0] + m[:, 1] * q, m[:, 1] + m[:, 0] * q, m[:, 2] * u, -m[:, 3] * u], axis=1)
    for hits in paths.hits[1:]:
        at = row[hits.ray]
        before = stokes[at]
        after = _reflect(before, table.elements(hits.cos_i), hits.cos_2psi, hits.sin_2psi)
        out.absorbed += (before[:, 0] - after[:, 0]).sum(axis=0)
        stokes[at] = after
    power = stokes[:, 0]
    count = np.minimum(paths.bounces[members], kept) - 1
    gone = paths.escaped[members]
    for b in range(min(1, kept - 1), kept):
        out.upward[b] += power[gone & (count == b)].sum(axis=0)
    out.lost += power[~gone].sum(axis=0)
    bounce = np.minimum(paths.bounces[ray], kept) - 1
    for b in np.unique(bounce):
        _catch(out, int(b), element[bounce == b], power[row[ray[bounce == b]]])


def _reflect(stokes: Floats, m: Floats, cos_2psi: Floats, sin_2psi: Floats) -> Floats:
    """Turn the frame by ψ, then reflect: stokes (n, 4, w), m (n, 4, w) the elements a, b, c, d of the facets."""
    i, q0, u0, v = (stokes[:, j] for j in range(4))
    c, s = cos_2psi[:, None], sin_2psi[:, None]
    q, u = c * q0 + s * u0, c * u0 - s * q0
    a, b, e, f = (m[:, j] for j in range(4))
    return np.stack([a * i + b * q, b * i + a * q, e * u + f * v, e * v - f * u], axis=1)


def _catch(out: Tally, bounce: int, element: NDArray, power: Floats) -> None:
    """Add power (n, w) of rays that fell into `element` (n,)."""
    if len(element) == 0:
        return
    shape = (out.caught.shape[1], len(element))
    gather = sp.csr_array((np.ones(len(element)), (element, np.arange(len(element)))), shape=shape)
    out.caught[bounce] += gather @ power
    out.caught_squared[bounce] += gather @ power**2
