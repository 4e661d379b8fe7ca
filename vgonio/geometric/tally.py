"""Book-keeping of power: what leaves upward after how many reflections, what is absorbed, what is lost."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..directions import Detector
from .fresnel_table import FresnelTable
from .mueller import mirror, path_matrices, slices, turn
from .trace import Paths

Floats = NDArray[np.float64]
STOKES_Q = {"unpolarised": 0.0, "s": 1.0, "p": -1.0}


@dataclass
class Tally:
    """Sums over rays of unit power. bounce = 0 … kept − 1 stands for 1 … kept reflections, the last for all higher."""

    rays: int
    caught: Floats  # (bounce, element, w) power in each detector element
    caught_variance: Floats  # (bounce, element, w) variance of `caught`, estimated
    upward: Floats  # (bounce, w) power that left upward
    absorbed: Floats  # (w,)
    lost: Floats  # (w,)
    mueller: Floats  # (element, stokes_out, stokes_in, w) of all paths together; no elements unless asked for
    mueller_variance: Floats  # variance of `mueller`, estimated
    multiple: Floats  # (w,) power that left upward after two and more reflections
    averaged: Floats  # (w,) the same by the shortcut: the product of the unpolarised reflectances

    @staticmethod
    def empty(kept: int, elements: int, wavelengths: int, polarised: bool = False) -> Tally:
        cube = (kept, elements, wavelengths)
        one = np.zeros(wavelengths)
        matrix = np.zeros((elements if polarised else 0, 4, 4, wavelengths))
        caught, upward = (np.zeros(cube), np.zeros(cube)), np.zeros((kept, wavelengths))
        return Tally(0, *caught, upward, one, one.copy(), matrix, matrix.copy(), one.copy(), one.copy())

    def __iadd__(self, other: Tally) -> Tally:
        self.rays += other.rays
        for sums in fields(self)[1:]:
            getattr(self, sums.name).__iadd__(getattr(other, sums.name))
        return self


def tally(
    paths: Paths,
    table: FresnelTable,
    detector: Detector,
    polarisation: str,
    kept: int,
    polarised: bool = False,
    phi_i_deg: float = 0.0,
) -> Tally:
    """Power of every path at every wavelength, sorted by fate and number of reflections.

    polarisation : of the source;  polarised : Mueller matrices as well, in frames that at the pole turn with phi_i_deg

    A path counts `paths.weight` times. The variance of what is caught is that of independent rays, or
    Σ variance · power² where `paths.variance` says by how much the weights vary.
    """
    wavelengths = table.table.shape[2]
    out = Tally.empty(kept, len(detector), wavelengths, polarised)
    out.rays = round(float(paths.times.sum()))
    stray = ~paths.escaped & (paths.bounces == 0)
    out.lost += paths.times[stray].sum()
    if not paths.hits:
        return out
    ray, element = detector.catch(paths.direction)
    use = paths.escaped[ray] & (paths.bounces[ray] > 0)
    if paths.counted is not None:
        use &= paths.counted[ray]
    ray, element = ray[use], element[use]
    once = paths.bounces[ray] == 1
    _tally_single(out, paths, table, polarisation, ray[once], element[once])
    if len(paths.hits) > 1:
        _tally_multiple(out, paths, table, polarisation, kept, ray[~once], element[~once])
    if polarised:
        _tally_mueller(out, paths, table, detector, ray, element, phi_i_deg)
    rays = out.rays if paths.of_rays is None else paths.of_rays
    if paths.variance is None and rays > 1:
        out.caught_variance = _independent(out.caught_variance, out.caught, rays)
        out.mueller_variance = _independent(out.mueller_variance, out.mueller, rays)
    return out


def _tally_single(
    out: Tally, paths: Paths, table: FresnelTable, polarisation: str, ray: NDArray, element: NDArray
) -> None:
    """First reflections of all paths; `ray`, reflected once only, falls into `element` (n,).

    Sums over the nodes of the table: wavelengths enter last.
    """
    first, weight = paths.hits[0], paths.times
    q = STOKES_Q[polarisation] * first.cos_2psi
    single = paths.bounces[first.ray] == 1
    ends, lost_ends = single & paths.escaped[first.ray], single & ~paths.escaped[first.ray]
    source_is_polarised = polarisation != "unpolarised"
    times = weight[first.ray]

    def reflected(mask: NDArray[np.bool_]) -> Floats:
        power = table.summed(first.cos_i[mask], times[mask], 0)
        return power + table.summed(first.cos_i[mask], times[mask] * q[mask], 1) if source_is_polarised else power

    out.upward[0] += reflected(ends)
    out.lost += reflected(lost_ends)
    out.absorbed += times.sum() - reflected(np.ones(len(first.ray), bool))
    place = np.full(len(paths.bounces), -1, np.int64)
    place[first.ray] = np.arange(len(first.ray))
    at = place[ray]
    variance = weight if paths.variance is None else paths.variance
    # power a + qb and its square, summed over the rays of each element
    for into, of_ray, columns in ((out.caught, weight, table.powers), (out.caught_variance, variance, table.squares)):
        for power, column in enumerate(columns if source_is_polarised else columns[:1]):
            share = of_ray[ray] * q[at] ** power
            into[0] += table.histogram(first.cos_i[at], share, element, out.caught.shape[1]) @ column


def _independent(squares: Floats, total: Floats, rays: int) -> Floats:
    """Variance of a sum over independent rays: Σx² − (Σx)²/n."""
    return np.maximum(squares - total**2 / rays, 0) * (rays / (rays - 1))


def _tally_mueller(
    out: Tally, paths: Paths, table: FresnelTable, detector: Detector, ray: NDArray, element: NDArray, phi_i_deg: float
) -> None:
    """Matrices of the paths that were caught, added up per detector element."""
    shape = (len(detector), -1)
    for part in slices(len(ray), table.table.shape[2]):
        r = ray[part]
        m = path_matrices(paths, table, r, detector, element[part], phi_i_deg).reshape(len(r), -1)
        weight = np.ones(len(r)) if paths.weight is None else paths.weight[r]
        variance = weight if paths.variance is None else paths.variance[r]
        out.mueller.reshape(shape)[:] += _gathering(element[part], weight, len(detector)) @ m
        out.mueller_variance.reshape(shape)[:] += _gathering(element[part], variance, len(detector)) @ m**2


def _tally_multiple(
    out: Tally, paths: Paths, table: FresnelTable, polarisation: str, kept: int, ray: NDArray, element: NDArray
) -> None:
    """Paths of two and more reflections: the Stokes vector goes from hit to hit, per ray and wavelength."""
    weight = paths.times
    variance = weight if paths.variance is None else paths.variance
    members = paths.hits[1].ray
    row = np.full(len(paths.bounces), -1, np.int64)
    row[members] = np.arange(len(members))
    first = paths.hits[0]
    position = np.full(len(paths.bounces), -1, np.int64)
    position[first.ray] = np.arange(len(first.ray))
    power = np.empty((len(members), table.table.shape[2]))
    longer = np.ones(len(members), bool)
    if polarisation == "unpolarised":
        # most end with the second reflection, which depends on I and Q alone: a₁a₂ + b₁b₂ cos 2ψ
        double = paths.bounces[members] == 2
        second, at = paths.hits[1], position[members[double]]
        m = table.elements(first.cos_i[at], 2)
        before = m[:, 0].copy()
        m *= table.elements(second.cos_i[double], 2)
        m[:, 1] *= second.cos_2psi[double, None]
        power[double] = m[:, 0] + m[:, 1]
        out.averaged += np.where(paths.escaped[members[double]], weight[members[double]], 0.0) @ m[:, 0]
        out.absorbed += weight[members[double]] @ (before - power[double])
        longer = ~double
    power[longer] = _power_of_stokes(out, paths, table, polarisation, members[longer], position, weight)
    count = np.minimum(paths.bounces[members], kept) - 1
    gone = paths.escaped[members]
    for b in range(min(1, kept - 1), kept):
        use = gone & (count == b)
        upward = weight[members[use]] @ power[use]
        out.upward[b] += upward
        out.multiple += upward
    out.lost += weight[members[~gone]] @ power[~gone]
    bounce = np.minimum(paths.bounces[ray], kept) - 1
    for b in np.unique(bounce):
        use = ray[bounce == b]
        _catch(out, int(b), element[bounce == b], power[row[use]], weight[use], variance[use])


def _power_of_stokes(
    out: Tally,
    paths: Paths,
    table: FresnelTable,
    polarisation: str,
    members: NDArray,
    position: NDArray,
    weight: Floats,
) -> Floats:
    """(m, w) power of the rays `members` (m,) after their last reflection.

    What the later reflections absorb, and the product of the unpolarised reflectances, goes to `out`.
    """
    first, at = paths.hits[0], position[members]
    m = table.elements(first.cos_i[at], 4)
    q, u = STOKES_Q[polarisation] * first.cos_2psi[at, None], -STOKES_Q[polarisation] * first.sin_2psi[at, None]
    # (rays, 4, wavelengths): I, Q, U, V
    stokes = np.stack([m[:, 0] + m[:, 1] * q, m[:, 1] + m[:, 0] * q, m[:, 2] * u, -m[:, 3] * u], axis=1)
    averaged = m[:, 0].copy()
    row = np.full(len(paths.bounces), -1, np.int64)
    row[members] = np.arange(len(members))
    for hits in paths.hits[1:]:
        use = np.flatnonzero(row[hits.ray] >= 0)
        at = row[hits.ray[use]]
        before, m = stokes[at], table.elements(hits.cos_i[use])
        after = mirror(turn(before, hits.cos_2psi[use], hits.sin_2psi[use]), m)
        out.absorbed += weight[hits.ray[use]] @ (before[:, 0] - after[:, 0])
        stokes[at] = after
        averaged[at] *= m[:, 0]
    out.averaged += np.where(paths.escaped[members], weight[members], 0.0) @ averaged
    return stokes[:, 0]


def _catch(out: Tally, bounce: int, element: NDArray, power: Floats, weight: Floats, variance: Floats) -> None:
    """Add power (n, w) of paths that fell into `element` (n,), each `weight` (n,) times, Σ variance · power² beside."""
    if len(element) == 0:
        return
    elements = out.caught.shape[1]
    out.caught[bounce] += _gathering(element, weight, elements) @ power
    out.caught_variance[bounce] += _gathering(element, variance, elements) @ power**2


def _gathering(element: NDArray, weight: Floats, elements: int) -> sp.csr_array:
    """(elements, n) matrix that adds up, weighted, what belongs to the same element."""
    return sp.csr_array((weight, (element, np.arange(len(element)))), shape=(elements, len(element)))
