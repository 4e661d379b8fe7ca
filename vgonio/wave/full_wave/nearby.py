"""Local corrections: the integral over a panel for a target on it or close to it.

The density on the panel is its interpolating polynomial; the kernel is integrated against it with an auxiliary Gauss
rule that is broken at the point closest to the target. On the panel itself a power law crowds the points there (the
kernels are logarithmic), beside it the sinh map of Johnston and Elliott (2005) does so on the scale of the distance.
Nothing is assumed of the kernel but where it peaks, so that any wavenumber, also that of a metal, is served.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .kernels import Complex, single, slope
from .panels import Floats, Panels, legendre

POINTS = 28  # of the auxiliary rule, on each side of the closest point
POWER = 5  # of the crowding on a panel itself
SHORT = 0.02  # differences of the panel's parameter
CHUNK = 400_000  # auxiliary points at a time
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Near:
    """Pairs of a target node and a panel close to it: target (m,), panel (m,), s (m,) the closest parameter,
    distance (m,) from there in units of s, 0 on the panel itself."""

    target: Ints
    panel: Ints
    s: Floats
    distance: Floats


def reach(p: int) -> float:
    """Distance in panel lengths beyond which the panel's own p nodes integrate to about 1e-9."""
    return 0.5 if p >= 10 else 5.0 / p


def find(targets: Panels, sources: Panels, same: bool) -> Near:
    """Pairs that need correction; `same` says that both are the very same panels."""
    tx, tz = targets.point
    pairs: list[tuple[Ints, Ints, Floats, Floats]] = []
    limit = reach(sources.order) * sources.length
    box = [(a.min(axis=1) - limit, a.max(axis=1) + limit) for a in (sources.x, sources.z)]
    order = np.argsort(tx, kind="stable")
    first = np.searchsorted(tx[order], box[0][0])
    last = np.searchsorted(tx[order], box[0][1], side="right")
    for q in range(sources.count):
        some = order[first[q] : last[q]]
        some = some[(tz[some] > box[1][0][q]) & (tz[some] < box[1][1][q])]
        d = np.hypot(tx[some, None] - sources.x[q], tz[some, None] - sources.z[q])
        close = d.min(axis=1) < limit[q]
        start = legendre(sources.order)[0][d[close].argmin(axis=1)]
        pairs.append((some[close], np.full(int(close.sum()), q), start, np.zeros(int(close.sum()))))
    target, panel, s, distance = (np.concatenate(a) for a in zip(*pairs))
    itself = (target // targets.order == panel) if same else np.zeros(len(target), bool)
    s[~itself], distance[~itself] = _closest(tx[target], tz[target], sources, panel, s, ~itself)
    s[itself] = legendre(sources.order)[0][target[itself] % targets.order]
    return Near(target, panel, s, distance)


def _closest(tx: Floats, tz: Floats, sources: Panels, panel: Ints, s: Floats, which: NDArray) -> tuple[Floats, Floats]:
    """Parameter of the closest point of each pair's panel, by Newton's method on the squared distance."""
    tx, tz, panel, s = tx[which], tz[which], panel[which], s[which]
    p = sources.order
    coefficients = [(a @ legendre(p)[2].T)[panel] for a in (sources.x, sources.z, sources.dx, sources.dz)]
    for _ in range(6):
        v = vandermonde(s, p)
        x, z, dx, dz = (np.einsum("mp,mp->m", v, c) for c in coefficients)
        step = ((tx - x) * dx + (tz - z) * dz) / (dx**2 + dz**2)
        s = np.clip(s + step, -1, 1)
    v = vandermonde(s, p)
    x, z, dx, dz = (np.einsum("mp,mp->m", v, c) for c in coefficients)
    return s, np.maximum(np.hypot(tx - x, tz - z) / np.hypot(dx, dz), 1e-13)


def vandermonde(s: Floats, p: int) -> Floats:
    """(…, p) Legendre polynomials at s."""
    v = np.empty((*s.shape, p))
    v[..., 0] = 1.0
    if p > 1:
        v[..., 1] = s
    for n in range(2, p):
        v[..., n] = ((2 * n - 1) * s * v[..., n - 1] - (n - 1) * v[..., n - 2]) / n
    return v


def rule(s: Floats, distance: Floats) -> tuple[Floats, Floats]:
    """Parameters and weights (m, 2·POINTS) on [−1, 1], crowded around s (m,) on the scale `distance` (m,)."""
    u, w = (legendre(POINTS)[0] + 1) / 2, legendre(POINTS)[1] / 2
    points, weights = [], []
    for side in (-1.0, 1.0):
        room = 1 - side * s[:, None]
        d = np.where(distance > 0, distance, 1.0)[:, None]
        a = np.arcsinh(room / d)
        far = np.where(distance[:, None] > 0, d * np.sinh(a * u), room * u**POWER)
        jacobian = np.where(distance[:, None] > 0, d * a * np.cosh(a * u), room * POWER * u ** (POWER - 1))
        points.append(s[:, None] + side * far)
        weights.append(jacobian * w)
    return np.concatenate(points, axis=1), np.concatenate(weights, axis=1)


def correct(k: complex, targets: Panels, sources: Panels, near: Near, wanted: tuple[str, ...]) -> dict[str, Complex]:
    """(m, p) entries of the operators `wanted` for each near pair: "single", "double" (normal at the source),
    "adjoint" (normal at the target)."""
    p, m = sources.order, len(near.target)
    out = {name: np.empty((m, p), np.complex128) for name in wanted}
    to_coefficients = legendre(p)[2]
    tx, tz = targets.point
    nx, nz = targets.normal
    size = max(1, CHUNK // (2 * POINTS))
    for start in range(0, m, size):
        part = slice(start, start + size)
        i, q = near.target[part], near.panel[part]
        s, w = rule(near.s[part], near.distance[part])
        basis = vandermonde(s, p) @ to_coefficients  # (m, points, p)
        x, z, dx, dz = (np.einsum("map,mp->ma", basis, a[q]) for a in (sources.x, sources.z, sources.dx, sources.dz))
        rx, rz = tx[i, None] - x, tz[i, None] - z
        itself = near.distance[part] == 0
        _differences(sources, near.s[part], s, q, itself, rx, rz)
        r = np.maximum(np.hypot(rx, rz), 1e-300)
        values = _kernels(k, r, rx, rz, (-dz, dx), (nx[i, None], nz[i, None]), np.hypot(dx, dz), wanted)
        for name, f in values.items():
            f = f * w
            both = np.stack([f.real, f.imag], axis=1) @ basis
            out[name][part] = both[:, 0] + 1j * both[:, 1]
    return out


def _differences(sources: Panels, at: Floats, s: Floats, q: Ints, itself: NDArray, rx: Floats, rz: Floats) -> None:
    """On the panel itself, r − r' as the integral of the tangent, in place: subtracted positions would lose the small
    component along the normal (two Gauss points, for |Δs| < SHORT)."""
    step = at[:, None] - s
    a, b = np.nonzero(itself[:, None] & (np.abs(step) < SHORT))
    half = step[a, b] / 2
    for out, tangent in ((rx, sources.dx), (rz, sources.dz)):
        c = tangent[q[a]] @ legendre(sources.order)[2].T
        ends = [s[a, b] + half * (1 + g / np.sqrt(3)) for g in (-1, 1)]
        out[a, b] = half * sum(np.einsum("mp,mp->m", vandermonde(t, sources.order), c) for t in ends)


def _kernels(
    k: complex, r: Floats, rx: Floats, rz: Floats, source: tuple, target: tuple, speed: Floats, wanted: tuple[str, ...]
) -> dict[str, Complex]:
    """Kernels times the line element at auxiliary points; `source` is the normal times it, `target` a unit normal."""
    out = {}
    if "single" in wanted:
        out["single"] = single(k, r) * speed
    if "double" in wanted or "adjoint" in wanted:
        g = slope(k, r)
        if "double" in wanted:
            out["double"] = g * (source[0] * rx + source[1] * rz)
        if "adjoint" in wanted:
            out["adjoint"] = -g * (target[0] * rx + target[1] * rz) * speed
    return out
