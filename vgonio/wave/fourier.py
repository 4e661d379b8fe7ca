"""S(q) = ∫ w(x, y) exp(−i q · (x, y, z(x, y))) dx dy over the interpolated surface, to a tolerance."""

from __future__ import annotations

import importlib
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..errors import BackendError, InputError, VgonioWarning, nearest, relative_tolerance
from ..surface.heightfield import Heightfield
from ..surface.interpolant import Interpolant
from . import nufft
from .quadrature import Complex, Floats, Points, axis_rule, choose_rule, fewest, finer, rates, require_affordable

METHODS = ("auto", "nufft", "opencl", "reference")
STEP = 1.4  # closer points, where a grid did not suffice
CHECKED = 48  # scattering vectors whose integral is computed again on a finer grid
MAX_POINTS = 60_000_000  # of one refined grid: 1.4 GB with weights
OPENCL_RATE = 2e9  # terms per second of the direct sum on two cores, only to choose between methods
OPENCL_TOL = 1e-5  # what single precision reaches with phases reduced to a cycle
CHECK_SECONDS = 1.5  # that the direct sum may take for the check
REFERENCE_RATE = 2e7  # terms per second of the reference in NumPy


@dataclass(frozen=True, eq=False)
class Transform:
    """S (m,) in µm² and how it was obtained."""

    S: Complex
    error: float  # estimated ‖ΔS‖₂ / ‖S‖₂
    method: str
    spacing_um: tuple[float, float]  # of the points along y and x
    points: int


def surface_fourier(
    surface: Heightfield, q: ArrayLike, window: ArrayLike | None = None, method: str = "auto", tol: float = 1e-6
) -> Complex:
    """(m,) complex128 S(q) in µm² at scattering vectors q (m, 3) float64 in rad/µm.

    window : None, or (ny, nx) weights at the samples, interpolated like z
    method : "nufft", "opencl" (precision 1e-5), "reference" (direct sum, double) or "auto"
    tol : ‖ΔS‖₂ ≤ tol·‖S‖₂ over the q asked for; the refinement of the grid follows from it

    Raises InputError for bad shapes or missing points, BackendError where a method cannot run; warns (VgonioWarning)
    with the reason and the estimated error where the tolerance is not met.
    """
    return evaluate(surface, q, window, method, tol).S


def evaluate(
    surface: Heightfield, q: ArrayLike, window: ArrayLike | None = None, method: str = "auto", tol: float = 1e-6
) -> Transform:
    """As `surface_fourier`, with the estimated error, the method taken and the grid."""
    vectors = _vectors(q)
    w = _window(surface, window)
    if method not in METHODS:
        raise InputError(f"method {method!r}: {nearest(str(method), METHODS)}")
    relative_tolerance(tol)
    surface.require_complete()
    if len(vectors) == 0:
        return Transform(np.zeros(0, np.complex128), 0.0, method, surface.pitch_um, 0)
    rule = _rule(surface, vectors, w, tol)
    spacing = _first_spacing(surface, vectors, rule, tol)
    chosen = _choose(method, surface, vectors, spacing, tol)
    if rule != "cells" and len(vectors) > 4 * CHECKED:
        spacing = _tried(surface, vectors, spacing, rule, w, tol)
    eps, discretisation, rounding = tol / 10, np.inf, 0.0
    for attempt in range(8):
        points = sample(surface, spacing, rule, w)
        S = apply(chosen, points, vectors, eps)
        some = _subset(S, vectors)
        fine = points if rule == "cells" else sample(surface, finer(surface, spacing, rule), rule, w)
        check = check_method(chosen, fine, vectors[some], tol)
        # the same grid again by another method, then a finer grid: two errors, each with its own remedy
        again = S[some] if check == chosen == "reference" else apply(check, points, vectors[some], eps / 100)
        rounding = _distance(S, S[some], again, some)
        before, discretisation = discretisation, 0.0
        if rule != "cells":
            discretisation = _distance(S, again, apply(check, fine, vectors[some], eps / 100), some)
        if max(rounding, discretisation) <= tol / 2 or attempt == 7 or 4 * fine.size > MAX_POINTS:
            break
        if discretisation > tol / 2:
            panels = _first_spacing(surface, vectors, "gauss", tol)
            fewer = rule == "uniform" and _fewer(surface, w, panels, spacing, discretisation, before, tol)
            rule, spacing = ("gauss", panels) if fewer else (rule, spacing / STEP)
        if rounding > tol / 2:
            eps /= 10
    floor = _floor(chosen, points, vectors)
    total = float(np.hypot(discretisation, max(rounding, floor)))
    if total > tol:
        why = (
            f"single precision of {chosen}"
            if floor > discretisation
            else f"a grid of {points.size:.3g} points is not enough"
        )
        warnings.warn(f"surface_fourier: {total:.1e} instead of {tol:.1e}: {why}", VgonioWarning, stacklevel=3)
    return Transform(S, total, chosen, (float(spacing[0]), float(spacing[1])), points.size)


def _first_spacing(surface: Heightfield, q: Floats, rule: str, tol: float) -> Floats:
    """(2,) one point a cycle of the fastest phase, and more the smaller the tolerance."""
    per_cycle = {"uniform": 1.1 + 0.15 * -np.log10(tol), "gauss": 2.5 + 0.4 * -np.log10(tol), "cells": 1.0}[rule]
    return 2 * np.pi / np.maximum(rates(surface, q), 1e-9) / per_cycle


def _fewer(
    surface: Heightfield, window: Interpolant | None, panels: Floats, spacing: Floats, error: float, before: float,
    tol: float,
) -> bool:  # fmt: skip
    """Whether panels between the samples take fewer points than midpoints will in the end.

    The spline's kinks make the error of midpoints fall as the fourth power of the spacing, unless it fell faster.
    """
    if not np.isfinite(before):
        return False
    steps = np.log(error / (tol / 2)) / np.log(max(before / max(error, 1e-300), STEP**4))
    points = [np.prod([len(w) for _, w in _axes(surface, s, rule, window)])
              for s, rule in ((panels, "gauss"), (spacing / STEP ** np.ceil(steps), "uniform"))]  # fmt: skip
    return bool(points[0] < points[1])


def _tried(
    surface: Heightfield, q: Floats, spacing: Floats, rule: str, window: Interpolant | None, tol: float
) -> Floats:
    """A spacing that some of many vectors find fine enough, by direct sums: so that all are summed once, not thrice."""
    part = min(CHECKED // 3, len(q))
    tilt = np.hypot(q[:, 0], q[:, 1]) / np.maximum(np.abs(q[:, 2]), 1e-300)
    near, far = np.argsort(tilt, kind="stable")[:part], np.argsort(-np.linalg.norm(q, axis=1), kind="stable")[:part]
    some = np.unique(np.concatenate([near, far, np.linspace(0, len(q) - 1, part).astype(int)]))
    coarse = sample(surface, spacing, rule, window)
    for _ in range(6):
        fine = sample(surface, finer(surface, spacing, rule), rule, window)
        check = check_method("nufft", fine, q[some], tol)
        if 4 * coarse.size > MAX_POINTS or check == "nufft":
            break
        S = apply(check, coarse, q[some], tol / 100)
        delta = np.abs(S - apply(check, fine, q[some], tol / 100))
        # the vectors that were not tried count as those in between
        rest = (len(q) - len(some)) / part
        between = np.isin(some, np.linspace(0, len(q) - 1, part).astype(int))
        norm = np.sum(np.abs(S) ** 2) + rest * np.sum(np.abs(S[between]) ** 2)
        if np.sum(delta**2) + rest * np.sum(delta[between] ** 2) <= (tol / 2.5) ** 2 * norm:
            break
        spacing, coarse = spacing / STEP, sample(surface, spacing / STEP, rule, window)
    return spacing


def sample(surface: Heightfield, spacing: ArrayLike, rule: str, window: Interpolant | None = None) -> Points:
    """Points and weights over the whole domain. One profile repeated costs one dimension where there is no window."""
    sy, sx = np.asarray(spacing, float)
    ly, lx = surface.size_um
    once = surface.is_profile and window is None
    ip = surface.interpolant
    require_affordable(1 if once else fewest(ip.y_axis, ly, sy, rule), fewest(ip.x_axis, lx, sx, rule))
    (y, wy), (x, wx) = _axes(surface, spacing, rule, window)
    cell = surface.pitch_um if rule == "cells" else (0.0, 0.0)
    weight = wy[:, None] * wx[None, :]
    if window is not None:
        weight = weight * window.grid(y, x)
    return Points(x, y, surface.interpolant.grid(y, x), weight, (ly, cell[1]) if once else cell)


def _axes(
    surface: Heightfield, spacing: ArrayLike, rule: str, window: Interpolant | None
) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    """Positions and weights along y and x."""
    ip, (sy, sx), (ly, lx) = surface.interpolant, np.asarray(spacing, float), surface.size_um
    along_x = axis_rule(ip.x_axis, 0.0, lx, sx, rule)
    if surface.is_profile and window is None:
        return (np.array([ly / 2]), np.array([ly])), along_x
    return axis_rule(ip.y_axis, 0.0, ly, sy, rule), along_x


def apply(method: str, points: Points, q: Floats, tol: float, azimuth: float | None = None) -> Complex:
    """The sum over `points` by the module of that name."""
    if method == "nufft":
        return nufft.transform(points, q, tol, azimuth)
    return importlib.import_module(f"vgonio.wave.{method}").transform(points, q, tol)


def _vectors(q: ArrayLike) -> Floats:
    vectors = np.ascontiguousarray(np.asarray(q, dtype=np.float64))
    if vectors.ndim != 2 or vectors.shape[1] != 3 or not np.isfinite(vectors).all():
        raise InputError(f"q has shape {vectors.shape}: (m, 3) finite scattering vectors in rad/µm are needed")
    return vectors


def _window(surface: Heightfield, window: ArrayLike | None) -> Interpolant | None:
    if window is None:
        return None
    w = np.asarray(window, dtype=np.float64)
    if w.shape != surface.shape or not np.isfinite(w).all():
        raise InputError(f"the window has shape {w.shape}: finite weights of shape {surface.shape} are needed")
    return Interpolant(w, surface.pitch_um, surface.periodic, surface.interpolation)


def _rule(surface: Heightfield, q: Floats, window: Interpolant | None, tol: float) -> str:
    """Midpoints need an integrand that vanishes at the ends, or one that repeats: then q lies on the field's orders."""
    ly, lx = surface.size_um
    turns = q[:, :2] * np.array([lx, ly]) / (2 * np.pi)
    # along a repeated profile without a window y is integrated in closed form
    axes = turns[:, :1] if surface.is_profile and window is None else turns
    repeats = surface.periodic and window is None and bool(np.all(np.abs(axes - np.rint(axes)) < 1e-9))
    vanishes = False
    if window is not None:
        edge = [window.grid(np.array([0, ly]), surface.x), window.grid(surface.y, np.array([0, lx])).T]
        vanishes = max(np.abs(e).max() for e in edge) < 1e-12 * np.abs(window.values).max()
    return choose_rule(surface, vanishes, repeats, tol)


def _choose(method: str, surface: Heightfield, q: Floats, spacing: Floats, tol: float) -> str:
    """The method that will do for the tolerance, and is expected to be the fastest."""
    if method != "auto":
        return method
    n = np.prod(np.maximum(np.asarray(surface.size_um) / spacing, 1))
    if n * len(q) < 2e6:
        return "reference"
    grid = [np.array([0.0, side]) for side in surface.size_um]
    z = np.array([[surface.z.min(), surface.z.max()]] * 2)
    proxy = Points(grid[1], grid[0], z, np.ones((2, 2)))
    rows = nufft.rows(q)
    # the proxy has the extents and a few points: what every point costs, in rows or in space, comes on top
    fast = nufft.seconds(proxy, q, tol) + (rows * n / 2e7 if rows <= nufft.ROW_LIMIT else n / 1.5e6)
    if tol >= OPENCL_TOL and n * len(q) / OPENCL_RATE < fast and _has_opencl():
        return "opencl"
    return "nufft" if fast < n * len(q) / REFERENCE_RATE else "reference"


def check_method(chosen: str, fine: Points, q: Floats, tol: float) -> str:
    """What computes the few vectors on the finer grid: the method itself, or the direct sum where that is quicker."""
    direct = "opencl" if tol >= 5 * OPENCL_TOL and _has_opencl() else "reference"
    rate = OPENCL_RATE if direct == "opencl" else REFERENCE_RATE
    return direct if fine.size * len(q) / rate < CHECK_SECONDS else "nufft"


def _has_opencl() -> bool:
    try:
        importlib.import_module("vgonio.wave.opencl").device()
    except BackendError:
        return False
    return True


def _subset(S: Complex, q: Floats) -> np.ndarray:
    """The strongest, the farthest, and twice as many in between: a sorted selection of at most CHECKED vectors."""
    m = len(q)
    if m <= CHECKED:
        return np.arange(m)
    strong = np.argsort(-np.abs(S))[: CHECKED // 4]
    far = np.argsort(-np.linalg.norm(q, axis=1))[: CHECKED // 4]
    return np.unique(np.concatenate([strong, far, _between(m)]))


def _between(m: int) -> np.ndarray:
    """Those of m vectors that stand for all that are not computed again."""
    return np.linspace(0, m - 1, CHECKED // 2).astype(int)


def _distance(S: Complex, a: Complex, b: Complex, some: np.ndarray) -> float:
    """‖a − b‖₂/‖S‖₂ with a, b at the vectors `some`; the vectors that were not computed again count as those in
    between (not as the farthest, at the edge of a transform's band, where its error is largest)."""
    total = np.linalg.norm(S)
    delta = np.abs(a - b)
    if total == 0:
        return float(np.linalg.norm(delta))
    rest = len(S) - len(some)
    typical = np.mean(delta[np.isin(some, _between(len(S)))] ** 2) if rest else 0.0
    return float(np.sqrt(np.sum(delta**2) + rest * typical) / total)


def _floor(method: str, points: Points, q: Floats) -> float:
    """Rounding that no refinement removes."""
    if method == "opencl":
        return OPENCL_TOL
    largest = np.abs(q[:, 2]).max() * np.abs(points.z).max(initial=0.0) + np.abs(q[:, 0]).max() * points.x.max()
    return float(4 * np.finfo(float).eps * max(largest, 1.0))
