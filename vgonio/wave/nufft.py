"""The everyday method: non-uniform fast Fourier transforms of type 3 by FINUFFT (Barnett 2019).

Scattering vectors that share a component across some direction in the plane make a row: with exp(−i q_v v) in the
strengths, what is left is two-dimensional in (u, z), and all angles and wavelengths of the row are its targets at once.
Vectors all over the hemisphere go through a three-dimensional transform, split into tiles so that memory stays bounded.
"""

from __future__ import annotations

import itertools
import os

import numpy as np
from numpy.typing import NDArray

from ..errors import BackendError, ToleranceError
from . import planes
from .quadrature import Complex, Floats, Points

STRIP = 4_000_000  # points of one transform: more are cut into strips along y, since the sum is a sum over strips
MEMORY = 1.5e9  # bytes that one transform's grid may take
ROW_LIMIT = 64  # more rows than this are better served by the three-dimensional transform
EPS_FLOOR = 1e-14  # of double precision: a smaller one asked of finufft gets no better
DIRECT = 20_000  # terms up to which the plain sum is quicker than a transform


def transform(points: Points, q: Floats, tol: float, azimuth: float | None = None) -> Complex:
    """(m,) sums of `points` at q (m, 3), relative error about `tol` in the 2-norm.

    azimuth : of the direction u along which rows run, radians; found from q where it is None, and rows are then
    used only where they are few
    """
    if points.size > STRIP and len(points.y) > 1:
        count = -(-points.size // STRIP)
        bounds = np.linspace(0, len(points.y), count + 1).astype(int)
        azimuth = common_azimuth(q) if azimuth is None and rows(q) <= ROW_LIMIT else azimuth
        total = np.zeros(len(q), np.complex128)
        for a, b in itertools.pairwise(bounds):
            total += transform(points.strip(a, b), q, tol, azimuth)
        return total
    given = azimuth is not None
    azimuth = common_azimuth(q) if azimuth is None else azimuth
    across = -np.sin(azimuth) * q[:, 0] + np.cos(azimuth) * q[:, 1]
    scale = max(float(np.abs(q).max()), 1e-300)
    key = np.round(across / scale * 1e12)
    levels, row = np.unique(key, return_inverse=True)
    if given or len(levels) <= ROW_LIMIT:
        s = _rows(points, q, levels * scale * 1e-12, row, azimuth, tol)
    else:
        grid = planes.applies(points) and planes.seconds(points, q, tol) < _tiles_seconds(points, q, tol)
        s = planes.transform(points, q, tol) if grid else _tiles(points, q, tol)
    return s * points.factor(q)


def common_azimuth(q: Floats) -> float:
    """Direction in the plane along which q spreads most: in-plane sets become a single row."""
    _, _, v = np.linalg.svd(q[:, :2], full_matrices=False)
    return float(np.arctan2(v[0, 1], v[0, 0])) if np.abs(q[:, :2]).max(initial=0.0) > 0 else 0.0


def plan(dim: int, eps: float):
    """A FINUFFT plan of type 3 with exp(−i …)."""
    # idle OpenMP threads that spin cost small transforms up to 60 times their time on a processor that others use too
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    try:
        import finufft
    except ImportError as e:
        raise BackendError(f"finufft cannot be loaded ({e}): pip install finufft, or use method = 'opencl'") from None
    # messages of FINUFFT about a tolerance near rounding go to stderr; ask for no less than it can do
    # the smaller oversampling is the faster one as long as its kernel reaches the tolerance (FINUFFT's manual, 1e-9)
    factor = 1.25 if eps >= 1e-8 else 2.0
    return finufft.Plan(3, dim, n_trans=1, eps=max(eps, EPS_FLOOR), isign=-1, upsampfac=factor)


def _rows(points: Points, q: Floats, level: Floats, row: NDArray[np.int64], azimuth: float, tol: float) -> Complex:
    c, s = np.cos(azimuth), np.sin(azimuth)
    used = points.weight != 0
    whole = bool(used.all())
    u = (c * points.x + s * points.y[:, None])[used]
    z = points.z[used]
    along = c * q[:, 0] + s * q[:, 1]
    out = np.zeros(len(q), np.complex128)
    flat = bool(np.ptp(z) == 0) if len(z) else True
    for i, qv in enumerate(level):
        target = np.flatnonzero(row == i)
        # exp(−i q_v v), v = c y − s x, is a product over the tensor grid
        turn = np.exp(-1j * qv * c * points.y)[:, None] * np.exp(1j * qv * s * points.x)
        strength = (points.weight * turn).ravel() if whole else (points.weight * turn)[used]
        if flat:
            flat_sum = _summed(strength, (u,), (along[target],), tol)
            out[target] = flat_sum * np.exp(-1j * q[target, 2] * (z[0] if len(z) else 0.0))
            continue
        out[target] = _summed(strength, (u, z), (along[target], q[target, 2]), tol)
    return out


def _summed(strength: Complex, at: tuple[Floats, ...], q: tuple[Floats, ...], tol: float) -> Complex:
    """(m,) sums of `strength` (n,) over points at coordinates (n,) for components (m,) of the scattering vectors.

    Raises ToleranceError where heights and wavelength ask for a grid that FINUFFT refuses.
    """
    p = plan(len(at), tol)
    try:
        p.setpts(*at, **{name: np.ascontiguousarray(component) for name, component in zip("stu", q)})
    except RuntimeError as e:
        extent = ", ".join(f"{np.ptp(a) * np.ptp(b):.2g}" for a, b in zip(at, q))
        raise ToleranceError(
            f"the transform of this surface is too large for FINUFFT ({e}): its phases range over {extent} rad along "
            "its axes, heights last; take a longer wavelength, lower heights or a smaller surface"
        ) from None
    return p.execute(strength)


def some(points: Points, which: NDArray[np.int64], q: Floats, tol: float, azimuth: float) -> Complex:
    """(m,) sums of the points of flat index `which` alone, at q (m, 3) in rows along `azimuth`."""
    c, s = np.cos(azimuth), np.sin(azimuth)
    iy, ix = np.divmod(which, points.z.shape[1])
    x, y, z = points.x[ix], points.y[iy], points.z.ravel()[which]
    weight = points.weight.ravel()[which]
    u, v = c * x + s * y, c * y - s * x
    along, across = c * q[:, 0] + s * q[:, 1], c * q[:, 1] - s * q[:, 0]
    scale = max(float(np.abs(q).max()), 1e-300)
    levels, row = np.unique(np.round(across / scale * 1e12), return_inverse=True)
    out = np.zeros(len(q), np.complex128)
    for i, level in enumerate(levels):
        target = np.flatnonzero(row == i)
        strength = weight * np.exp(-1j * level * scale * 1e-12 * v)
        if len(which) * len(target) < DIRECT:
            out[target] = np.exp(-1j * (np.outer(along[target], u) + np.outer(q[target, 2], z))) @ strength
            continue
        out[target] = _summed(strength, (u, z), (along[target], q[target, 2]), tol)
    return out * points.factor(q)


def grid_bytes(points: Points, q: Floats, tol: float) -> float:
    """Memory of the oversampled grid of a type-3 transform in space, from the extents of points and targets."""
    width = max(4, int(np.ceil(-np.log10(max(tol, EPS_FLOOR)))) + 2)
    extent = np.array([np.ptp(points.x), np.ptp(points.y), np.ptp(points.z)]) / 2
    band = np.ptp(q, axis=0) / 2
    return float(np.prod(2 * (2 * extent * band / np.pi + width + 1)) * 16)


def rows(q: Floats) -> int:
    """Number of rows that the scattering vectors make: the transforms that `transform` needs."""
    azimuth = common_azimuth(q)
    across = -np.sin(azimuth) * q[:, 0] + np.cos(azimuth) * q[:, 1]
    return len(np.unique(np.round(across / max(float(np.abs(q).max(initial=0.0)), 1e-300) * 1e12)))


def seconds(points: Points, q: Floats, tol: float) -> float:
    """Rough time on two cores, to choose between methods: 10⁷ points/s in a plane, kernel width cubed in space."""
    n = points.size
    count = rows(q)
    if count <= ROW_LIMIT:
        return count * (n / 2e7 + 0.01)
    direct = _tiles_seconds(points, q, tol)
    return min(direct, planes.seconds(points, q, tol)) if planes.applies(points) else direct


def _tiles_seconds(points: Points, q: Floats, tol: float) -> float:
    cells = grid_bytes(points, q, tol)
    return max(1.0, cells / MEMORY) * (points.size / 1.5e6 + min(cells, MEMORY) / 16 / 2e7)


def _tiles(points: Points, q: Floats, tol: float) -> Complex:
    """Transforms in space; a set of targets whose grid would be too large is halved across its longest side."""
    used = np.flatnonzero(points.weight.ravel())
    x, y = (a.ravel()[used] for a in np.broadcast_arrays(points.x[None, :], points.y[:, None]))
    z, strength = points.z.ravel()[used], points.weight.ravel()[used].astype(np.complex128)
    extent = np.array([np.ptp(a) if len(a) else 0.0 for a in (x, y, z)])
    out = np.zeros(len(q), np.complex128)
    stack = [np.arange(len(q))]
    while stack:
        t = stack.pop()
        if len(t) > 1 and grid_bytes(points, q[t], tol) > MEMORY:
            axis = int(np.argmax(np.ptp(q[t], axis=0) * extent))
            order = t[np.argsort(q[t, axis], kind="stable")]
            stack += [order[: len(t) // 2], order[len(t) // 2 :]]
            continue
        out[t] = _summed(strength, (x, y, z), (q[t, 0], q[t, 1], q[t, 2]), tol)
    return out
