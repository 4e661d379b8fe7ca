"""Values between the cells of a hemisphere and between angles of incidence, for isotropic samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..directions import half_vectors, unit_vectors
from ..errors import InputError
from ..units import degrees, radians

Floats = NDArray[np.float64]
LOWEST_COS = float(np.cos(radians(89.5)))
SAME_POINT = 1e-6  # rad
# cells a ring, on average, from which on the directions count as rings of equal polar angle
RINGED = 2.5


@dataclass(frozen=True)
class Row:
    """One angle of incidence θ ≥ 0, radians, and its values at directions (n, 3), the light coming from +x."""

    theta: float
    at: Callable[[Floats], Floats]


def interp(x: Floats, xp: Floats, fp: Floats) -> Floats:
    """Linear interpolation of (n, n_λ) values, held beyond the ends."""
    if xp.size == 1:
        return np.repeat(fp, x.size, axis=0)
    k = np.clip(np.searchsorted(xp, x), 1, xp.size - 1)
    t = np.clip((x - xp[k - 1]) / (xp[k] - xp[k - 1]), 0.0, 1.0)[:, None]
    return (1 - t) * fp[k - 1] + t * fp[k]


def closeness(axis: Floats, k: int, low: NDArray[np.intp], theta: Floats) -> Floats:
    """Weight of the k-th of two neighbouring angles of incidence."""
    if axis.size == 1:
        return np.ones(theta.size)
    t = np.clip((theta - axis[low]) / (axis[low + 1] - axis[low]), 0.0, 1.0)
    return np.where(low == k, 1 - t, t)


def rows(data: xr.Dataset) -> list[Row]:
    """One interpolant for each angle of incidence of a dataset over cells; light from −θ_i is turned by 180°.

    Raises InputError where fewer than four cells have values.
    """
    values = data["brdf"].transpose("theta_i", "cell", "wavelength").values
    plane = float(data["phi_i"]) if "phi_i" in data.coords else 0.0
    theta, phi = radians(data["theta_o"].values), radians(data["phi_o"].values - plane)
    found: dict[float, Row] = {}
    for t, f in sorted(zip(radians(data["theta_i"].values), values), key=lambda r: float(r[0])):
        kept = np.isfinite(f).all(axis=1)
        if kept.sum() < 4:
            raise InputError(f"θ_i = {degrees(t):g}°: {kept.sum()} cells with values, a hemisphere needs four and more")
        turned = phi[kept] + (np.pi if t < 0 else 0.0)
        # isotropic samples are symmetric about the plane of incidence: one half says all
        half = np.abs((turned + np.pi) % (2 * np.pi) - np.pi)
        ringed = kept.sum() >= RINGED * np.unique(np.round(theta[kept], 5)).size
        found[round(abs(float(t)), 9)] = Row(
            abs(float(t)), (_rings if ringed else _scattered)(theta[kept], half, f[kept])
        )
    return [found[k] for k in sorted(found)]


def _rings(theta: Floats, phi: Floats, f: Floats) -> Callable[[Floats], Floats]:
    """Linear along rings of equal polar angle, then between rings; φ in 0 … π, held at its ends."""
    order = np.argsort(theta)
    theta, phi, f = theta[order], phi[order], f[order]
    starts = np.flatnonzero(np.concatenate([[True], np.diff(theta) > SAME_POINT]))
    rings = []
    for part in np.split(np.arange(theta.size), starts[1:]):
        part = part[np.argsort(phi[part])]
        # cells on both sides of the plane that are each other's image are one
        first = np.flatnonzero(np.concatenate([[True], np.diff(phi[part]) > SAME_POINT]))
        size = np.diff(np.append(first, part.size))[:, None]
        rings.append((phi[part][first], np.add.reduceat(f[part], first, axis=0) / size))
    axis = theta[starts]

    def at(w: Floats) -> Floats:
        polar, azimuth = np.arccos(np.clip(w[:, 2], -1, 1)), np.abs(np.arctan2(w[:, 1], w[:, 0]))
        low = np.clip(np.searchsorted(axis, polar, side="right") - 1, 0, max(axis.size - 2, 0))
        total = np.zeros((len(w), f.shape[1]))
        for k, (angles, values) in enumerate(rings):
            near = np.flatnonzero((low == k) | (low + 1 == k))
            if near.size:
                weight = closeness(axis, k, low[near], polar[near])
                total[near] += weight[:, None] * interp(azimuth[near], angles, values)
        return total

    return at


def _scattered(theta: Floats, phi: Floats, f: Floats) -> Callable[[Floats], Floats]:
    """Linear over triangles of the azimuthal equidistant map, the nearest value beyond them."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
    from threadpoolctl import threadpool_limits

    half = np.stack([theta * np.cos(phi), theta * np.sin(phi)], axis=1)
    both = np.concatenate([np.ones(len(half), bool), half[:, 1] > SAME_POINT])
    points, values = np.concatenate([half, half * [1, -1]])[both], np.concatenate([f, f])[both]
    # thousands of 2 × 2 systems: threads that wait for one another make seconds out of milliseconds
    with threadpool_limits(1, user_api="blas"):
        inside, outside = LinearNDInterpolator(points, values), NearestNDInterpolator(points, values)
        _ = inside.tri.transform

    def at(w: Floats) -> Floats:
        polar, azimuth = np.arccos(np.clip(w[:, 2], -1, 1)), np.arctan2(w[:, 1], w[:, 0])
        p = np.stack([polar * np.cos(azimuth), polar * np.sin(azimuth)], axis=1)
        found = inside(p)
        lost = ~np.isfinite(found).all(axis=1)
        found[lost] = outside(p[lost])
        return found

    return at


def between(rows: list[Row], wi: Floats, wo: Floats) -> Floats:
    """Values at any pair: linear in θ_i at the same half vector."""
    theta_i = np.arccos(np.clip(wi[:, 2], -1, 1))
    phi = np.arctan2(wi[:, 1], wi[:, 0])
    c, s = np.cos(phi), np.sin(phi)
    local = np.stack([wo[:, 0] * c + wo[:, 1] * s, wo[:, 1] * c - wo[:, 0] * s, wo[:, 2]], axis=1)
    h = half_vectors(unit_vectors(theta_i), local)
    axis = np.array([r.theta for r in rows])
    low = np.clip(np.searchsorted(axis, theta_i, side="right") - 1, 0, max(axis.size - 2, 0))
    total: Floats | None = None
    weight = np.zeros(len(wi))
    for k, row in enumerate(rows):
        near = np.flatnonzero((low == k) | (low + 1 == k))
        if not near.size:
            continue
        w = unit_vectors(row.theta)
        at = 2 * (h[near] @ w)[:, None] * h[near] - w
        below = at[:, 2] <= LOWEST_COS
        at[below] = local[near][below]
        t = closeness(axis, k, low[near], theta_i[near]) * np.where(below, 1e-6, 1.0)
        found = row.at(at)
        total = np.zeros((len(wi), found.shape[1])) if total is None else total
        total[near] += t[:, None] * found
        weight[near] += t
    assert total is not None  # one of the rows is near
    return total / np.maximum(weight, 1e-300)[:, None]
