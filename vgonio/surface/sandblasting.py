"""Sandblasting: the spherical cavities that glass beads leave, one impact after the other.

Each bead indents the surface that it finds. With a constant indentation pressure p the kinetic energy of the bead is
p times the volume of the cavity, so that depth = v·R·√(2ρ/3p): the depth grows with the bead radius R and its speed v,
and a/R, which sets the slopes, depends on the speed alone (Johnson 1985, *Contact Mechanics*, section 11.4). Displaced
metal is not piled up around the cavity: the model is meant for coverages up to about ten.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from . import checks
from .gratings import flat
from .heightfield import Heightfield

Floats = NDArray[np.float64]


# some minutes of stamping; a blasted surface of 1 mm² has ten thousand
MOST_IMPACTS = 10**7


@dataclass(frozen=True)
class Impacts:
    """Where beads hit and what they leave: arrays (n,) of x, y, bead radius and cavity depth in µm, in time order."""

    x: Floats
    y: Floats
    radius: Floats
    depth: Floats


def sandblasted(
    shape: tuple[int, int] = (512, 512),
    pitch_um: float | ArrayLike = 0.625,
    bead_diameter_um: tuple[float, float] = (70.0, 100.0),
    depth_um: float = 3.0,
    depth_spread: float = 0.2,
    coverage: float = 3.0,
    resolution_um: float | None = None,
    base: Heightfield | None = None,
    seed: int = 0,
) -> Heightfield:
    """Random spherical cavities of glass beads, periodic; the defaults resemble strongly blasted aluminium.

    bead_diameter_um : smallest and largest bead, equally likely between
    depth_um : depth of the cavity of the mean bead at the mean speed, below the mean surface under its footprint
    depth_spread : relative standard deviation of the bead speed (log-normal), hence of the depth
    coverage : number of footprints over a point on average; exp(−coverage) of the area has none (less stays untouched:
        a bead that hits into a cavity takes away some of its rim)
    resolution_um : full width at half maximum of the Gaussian by which a microscope blurs the ridges (default: the
        larger pitch; 0 for none)
    base : a periodic surface to blast instead of a flat one; gives shape and pitch

    Raises InputError for impossible beads, depths or coverages.
    """
    if base is None:
        base = flat(shape, pitch_um)
    elif not isinstance(base, Heightfield) or not base.periodic:
        raise InputError(f"base = {base!r}: a periodic Heightfield is needed")
    base.require_complete()
    low, high = _beads(bead_diameter_um)
    depth = checks.positive("depth_um", depth_um, (low + high) / 4)
    spread = checks.number("depth_spread", depth_spread, 0.0, 1.0)
    covered = checks.positive("coverage", coverage, 100.0)
    blur = max(base.pitch_um) if resolution_um is None else checks.number("resolution_um", resolution_um, 0.0, 1e9)
    hits = impacts(base.size_um, (low, high), depth, spread, covered, seed)
    z = blurred(stamped(base.z, base.pitch_um, hits), base.pitch_um, blur)
    step = (
        f"generated: sandblasted, {hits.x.size} cavities of beads {low:g} to {high:g} µm, depth {depth:.6g} µm "
        f"± {spread:.0%}, coverage {covered:.6g}, resolution {blur:g} µm, seed {seed}"
    )
    history = (*base.history, step)
    return Heightfield(z - z.mean(), base.pitch_um, periodic=True, name="sandblasted", history=history)


def impacts(
    size_um: tuple[float, float],
    bead_diameter_um: tuple[float, float],
    depth_um: float,
    depth_spread: float,
    coverage: float,
    seed: int,
) -> Impacts:
    """Independent impacts, as many as give `coverage` for cavities of the mean bead at the mean speed."""
    ly, lx = size_um
    low, high = (d / 2 for d in bead_diameter_um)
    mean_radius = (low + high) / 2
    wanted = coverage * ly * lx / max(np.pi * (2 * mean_radius * depth_um - depth_um**2), np.finfo(float).tiny)
    if not wanted <= MOST_IMPACTS:
        raise InputError(
            f"{wanted:.2g} cavities of depth {depth_um:g} µm and beads of {2 * mean_radius:g} µm would cover "
            f"{ly:g} × {lx:g} µm {coverage:g} times, allowed are {MOST_IMPACTS:.0e}: take larger beads"
        )
    count = round(wanted)
    rng = checks.generator(seed)
    # one row an impact: more impacts of one seed continue the same sequence
    draw = rng.random((count, 4))
    radius = low + (high - low) * draw[:, 2]
    width = np.sqrt(np.log1p(depth_spread**2))
    speed = np.exp(width * _standard_normal(draw[:, 3]) - width**2 / 2)
    depth = np.minimum(depth_um * radius / mean_radius * speed, radius)
    return Impacts(draw[:, 0] * lx, draw[:, 1] * ly, radius, depth)


def stamped(z: Floats, pitch: tuple[float, float], hits: Impacts) -> Floats:
    """(ny, nx) heights after all impacts in turn on the periodic field z.

    Each bead goes `depth` below the mean height under its footprint and takes away what it meets, on its whole lower
    half: so the surface stays continuous.
    """
    z = z.copy()
    top = z.max()
    for i, (x, y, radius, depth) in enumerate(zip(hits.x, hits.y, hits.radius, hits.depth)):
        if i % 256 == 0:
            top = z.max()
        window, r2 = _window(z.shape, pitch, x, y, np.sqrt(2 * radius * depth - depth**2))
        under = z[window]
        foot = r2 <= 2 * radius * depth - depth**2
        bottom = (under[foot].mean() if foot.any() else under.mean()) - depth
        rise = min(top - bottom, radius)  # no point above this is met by the bead
        window, r2 = _window(z.shape, pitch, x, y, np.sqrt(rise * (2 * radius - rise)))
        bead = np.where(r2 < radius**2, bottom + radius - np.sqrt(np.maximum(radius**2 - r2, 0.0)), np.inf)
        z[window] = np.minimum(z[window], bead)
    return z


def blurred(z: Floats, pitch: tuple[float, float], width_um: float) -> Floats:
    """Periodic convolution with a Gaussian of full width at half maximum `width_um`."""
    if width_um == 0:
        return z
    f2 = np.fft.fftfreq(z.shape[0], pitch[0])[:, None] ** 2 + np.fft.rfftfreq(z.shape[1], pitch[1])[None] ** 2
    transfer = np.exp(-f2 * (np.pi * width_um) ** 2 / (4 * np.log(2)))
    return np.fft.irfft2(np.fft.rfft2(z) * transfer, s=z.shape)


def _window(
    shape: tuple[int, ...], pitch: tuple[float, float], x: float, y: float, reach: float
) -> tuple[tuple[Any, Any], Floats]:
    """Index of the samples within a square of half side `reach` around (x, y), wrapped, and their squared distance."""
    (rows, y2), (columns, x2) = (_span(n, h, c, reach) for n, h, c in zip(shape, pitch, (y, x)))
    r2 = y2[:, None] + x2[None]
    if isinstance(rows, slice) and isinstance(columns, slice):
        return (rows, columns), r2
    every = (np.arange(shape[0])[rows], np.arange(shape[1])[columns])
    return np.ix_(*every), r2  # type: ignore[return-value]


def _span(n: int, h: float, centre: float, reach: float) -> tuple[slice | NDArray[Any], Floats]:
    """Samples of one axis within `reach` of a centre: a slice where it does not wrap, and squared distances."""
    first, last = int(np.floor((centre - reach) / h)), int(np.ceil((centre + reach) / h))
    if last - first + 1 > n:
        # at most one turn: a bead wider than the field would otherwise write a sample twice
        first = int(np.floor(centre / h)) - n // 2
        last = first + n - 1
    i = np.arange(first, last + 1)
    square = np.square((i + 0.5) * h - centre, dtype=np.float64)
    return slice(first, last + 1) if first >= 0 and last < n else i % n, square


def _standard_normal(uniform: Floats) -> Floats:
    from scipy.special import ndtri

    return ndtri(np.clip(uniform, 1e-12, 1 - 1e-12))


def _beads(bead_diameter_um: tuple[float, float]) -> tuple[float, float]:
    try:
        low, high = (checks.positive("bead_diameter_um", d) for d in bead_diameter_um)
    except (TypeError, ValueError):
        low = high = np.nan
    if not low <= high:
        raise InputError(f"bead_diameter_um = {bead_diameter_um!r}: (smallest, largest), both positive, in µm")
    return low, high
