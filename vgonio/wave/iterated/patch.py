"""Reflections of one window on a height field: points on a square grid, sight, vector fields of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...directions import s_axes
from ...errors import ToleranceError
from ...materials import Material
from ...surface.heightfield import Heightfield
from ..coherence import Window
from ..polarisation import _frame
from ..quadrature import Complex, Floats
from .blocks import LEAST, levels
from .far_waves import AZIMUTHS, Waves, horizon_map
from .pair_reference import seen_from
from .pairs import Grid, reflect_blocks, reflect_opencl

MOST_POINTS = 1_100_000  # of one patch, 80 µm at λ/7: 4 to 10 minutes for each reflection on two cores
CHECKED = (8, 400)  # points, and pairs of each, on which the rule of sight is compared with a march along the line


@dataclass(frozen=True, eq=False)
class Patch:
    """Points of a window on the interpolated surface.

    grid : heights, normals, pitch;  x, y : (n,) µm;  weight : (n, n) amplitude window;  area : ∫ w² dx dy in µm²
    wide : heights with `margin` more points on each side, NaN where there is no surface
    azimuth : (azimuths,) radians, ascending, of the map of horizons, whose sheets are made when they are first needed
    """

    grid: Grid
    x: Floats
    y: Floats
    weight: Floats
    area: float
    wide: Floats
    margin: int
    azimuth: Floats
    sheets: dict[int, NDArray[np.float32]] = field(default_factory=dict)

    @staticmethod
    def of(surface: Heightfield, window: Window, spacing: float, azimuth: float) -> Patch:
        """Points no more than `spacing` µm apart along x and y; shadows from as far as half the side beyond.

        azimuth : of the plane of incidence, one of those of the horizon map. Raises ToleranceError beyond MOST_POINTS.
        """
        side = 2 * window.half[0]
        count = int(np.ceil(side / spacing * (1 - 1e-9)))
        if count**2 > MOST_POINTS:
            least = side / int(MOST_POINTS**0.5)
            raise ToleranceError(
                f"a patch of {side:g} µm needs {count**2:.2g} points, at most {MOST_POINTS:.2g} (4 to 10 minutes "
                f"for a reflection): take window_um ≤ {np.floor(10 * side * spacing / least) / 10:g}, or "
                f"points_per_wavelength {np.ceil(100 * least / spacing) / 100:g} times smaller"
            )
        pitch, margin = side / count, count // 2
        (cy, cx), ip = window.centre, surface.interpolant
        at: Floats = (np.arange(-margin, count + margin, dtype=np.float64) + 0.5) * pitch - window.half[0]
        wide = _heights(surface, cy + at, cx + at)
        inner = slice(margin, margin + count)
        x, y, t = cx + at[inner], cy + at[inner], at[inner]
        zx, zy = ip.grid(y, x, dx=1), ip.grid(y, x, dy=1)
        normal = np.stack([-zx, -zy, np.ones_like(zx)])
        profile = window.profile(t, window.half[0])
        weight = np.outer(profile, profile)
        turns = azimuth + 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
        grid = Grid(wide[inner, inner], normal / np.linalg.norm(normal, axis=0), pitch)
        return Patch(grid, x, y, weight, float(np.sum(weight**2) * pitch**2), wide, margin, turns)

    @property
    def steepest(self) -> float:
        """Angle of the steepest point against the horizontal, radians."""
        return float(np.arccos(np.clip(self.grid.normal[2].min(), 0, 1)))

    def caught(self, wi: Floats) -> float:
        """Power that the points lit from wi (3,) receive, over that of the same window on a flat surface."""
        n = self.grid.normal
        received = self.weight**2 * self.seen(wi) * np.einsum("i,iyx->yx", wi, n) / n[2]
        return float(received.sum()) * self.grid.pitch**2 / (self.area * float(wi[2]))

    def again(self, wi: Floats) -> NDArray[np.bool_]:
        """(n,) where light from wi (n, 3) can meet the surface a second time: θ_i + 3 × the steepest slope ≥ 90°."""
        return np.arccos(np.clip(wi[:, 2], -1, 1)) + 3 * self.steepest >= np.pi / 2

    def horizon(self, i: int) -> NDArray[np.float32]:
        """(n, n) slope of the highest line of sight along azimuth[i]."""
        if i not in self.sheets:
            self.sheets[i] = horizon_map(self.wide, self.margin, self.grid.pitch, self.azimuth[i : i + 1])[0]
        return self.sheets[i]

    def seen(self, w: Floats) -> NDArray[np.bool_]:
        """(n, n) which points see the far direction w (3,)."""
        facing = np.einsum("i,iyx->yx", w, self.grid.normal) > 0
        across = float(np.hypot(w[0], w[1]))
        if across < 1e-9:
            return facing
        turn = (np.arctan2(w[1], w[0]) - self.azimuth[0]) / (2 * np.pi) % 1.0 * AZIMUTHS
        i, f = int(np.rint(turn)) if abs(turn - np.rint(turn)) < 1e-6 else int(turn), turn % 1.0
        horizon = self.horizon(i % AZIMUTHS)
        if 1e-6 < f < 1 - 1e-6:
            horizon = (1 - f) * horizon + f * self.horizon((i + 1) % AZIMUTHS)
        return facing & (w[2] >= horizon * across)

    def far(self, w: Floats) -> tuple[Waves, NDArray[np.int32], Floats]:
        """What gives the waves towards w (m, 3); (m, 2) its horizons below and above their azimuths, (m,) shares of the
        latter."""
        turn = (np.arctan2(w[:, 1], w[:, 0]) - self.azimuth[0]) / (2 * np.pi) % 1.0 * AZIMUTHS
        below = np.floor(turn + 1e-6)
        share = np.where(turn - below > 1e-6, turn - below, 0.0)
        sheet = np.stack([below, below + (share > 0)], axis=1).astype(np.int32) % AZIMUTHS
        needed, local = np.unique(sheet, return_inverse=True)
        waves = Waves(self.grid, np.stack([self.horizon(int(i)) for i in needed]))
        return waves, local.reshape(sheet.shape).astype(np.int32), share

    @cached_property
    def sight_error(self) -> float:
        """Share of pairs that face each other on which the kernel's rule of sight and a march along the line differ."""
        rng = np.random.default_rng(0)
        wrong = total = 0
        n = len(self.grid.z)
        for iy, ix in rng.integers(0, n, (CHECKED[0], 2)):
            rule = seen_from(self.grid, int(iy), int(ix))
            jy, jx = rng.integers(0, n, (2, CHECKED[1]))
            clear, facing = self._clear(iy, ix, jy, jx)
            wrong += int(np.count_nonzero((rule[jy, jx] != clear) & facing))
            total += int(np.count_nonzero(facing))
        return wrong / max(total, 1)

    def _clear(self, iy: int, ix: int, jy: Floats, jx: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which lines from one point to others (m,) stay above the bilinear surface; and whether both ends face."""
        from scipy.ndimage import map_coordinates

        z, h = self.grid.z, self.grid.pitch
        d = np.stack([(jx - ix) * h, (jy - iy) * h, z[jy, jx] - z[iy, ix]])
        own, other = self.grid.normal[:, iy, ix], self.grid.normal[:, jy, jx]
        facing = (own @ d > 0) & (np.sum(other * d, axis=0) < 0)
        steps = 2 * int(np.max(np.hypot(jx - ix, jy - iy)))
        t = (np.arange(1, steps) / steps)[:, None]
        line = z[iy, ix] + t * d[2]
        ground = map_coordinates(z, [iy + t * (jy - iy), ix + t * (jx - ix)], order=1)
        return np.all(ground <= line + 1e-9, axis=0), facing


def _heights(surface: Heightfield, y: Floats, x: Floats) -> Floats:
    """Heights, NaN beyond the edges of a finite surface."""
    if surface.periodic:
        return surface.interpolant.grid(y, x)
    inside = [(t >= 0) & (t <= size) for t, size in zip((y, x), surface.size_um)]
    z = np.full((len(y), len(x)), np.nan)
    z[np.ix_(*inside)] = surface.interpolant.grid(y[inside[0]], x[inside[1]])
    return z


def first_fields(
    patch: Patch, wi: Floats, k: float, material: Material, wavelength_nm: float, phi_deg: float
) -> Floats:
    """(2, 12, n, n) N × E and N × H of the first reflection for s and p incident from wi (3,), where it is seen."""
    n, d = patch.grid.normal, -wi
    c = np.einsum("i,iyx->yx", wi, n)
    s = np.cross(np.broadcast_to(d[:, None, None], n.shape), n, axis=0)
    length = np.linalg.norm(s, axis=0)
    s = np.where(length > 1e-9, s / np.maximum(length, 1e-300), s_axes(wi[None], phi_deg)[0][:, None, None])
    p, t = np.cross(np.broadcast_to(d[:, None, None], n.shape), s, axis=0), np.cross(n, s, axis=0)
    rs, rp = material.amplitudes(np.clip(c, 0, 1), wavelength_nm)
    phase = patch.x * wi[0] + (patch.y * wi[1])[:, None] + patch.grid.z * wi[2]
    wave = patch.weight * patch.seen(wi) * np.exp(-1j * k * phase)
    found = []
    for e in _frame(wi[None], s_axes(wi[None], phi_deg)):
        on_s, on_p = (wave * np.einsum("iyx,i->yx", axis, e[0]) for axis in (s, p))
        a = (1 - rp) * c * on_p * s + (1 + rs) * on_s * t
        b = (1 - rs) * c * on_s * s - (1 + rp) * on_p * t
        found.append(np.concatenate([a, b]))
    return as_reals(np.stack(found) / n[2])


def as_reals(fields: Complex) -> Floats:
    """(sides, 12, …) of (sides, 6, …): real and imaginary parts alternate."""
    return np.stack([fields.real, fields.imag], axis=2).reshape(len(fields), 12, *fields.shape[2:])


def all_reflections(
    patch: Patch, wi: Floats, k: float, material: Material, wavelength_nm: float, phi_deg: float, bounces: int,
    tol: float, blocks: bool = False, progress: Callable[[float], None] | None = None,
) -> tuple[list[Floats], float]:  # fmt: skip
    """Fields (2, 12, n, n) of each reflection of light from wi, up to `bounces` or until the mean square of the next is
    no more than `tol` of the first; and the largest error of one by taking `blocks` together, 0 by all pairs."""
    found, worst = [first_fields(patch, wi, k, material, wavelength_nm, phi_deg)], 0.0
    if not patch.again(wi[None])[0]:
        return found, worst
    index = None if material.perfect else complex(material.index(wavelength_nm))
    first = float(np.sum(found[0] ** 2))
    while len(found) < bounces:
        done = len(found) - 1
        step = (lambda f, done=done: progress((done + f) / (bounces - 1))) if progress else None  # type: ignore[misc]
        more, error = _next(patch.grid, found[-1], k, index, max(tol, LEAST) if blocks else None, step)
        more = more / patch.grid.normal[2]
        if np.sum(more**2) <= tol * first:
            break
        found.append(more)
        worst = max(worst, error)
    return found, worst


def _next(
    grid: Grid, source: Floats, k: float, index: complex | None, error: float | None,
    progress: Callable[[float], None] | None,
) -> tuple[Floats, float]:  # fmt: skip
    """One more reflection and its error: by blocks, more and more carefully until it is below `error`, or by all
    pairs."""
    for rules in levels(error, grid.pitch) if error is not None else []:
        found, made = reflect_blocks(grid, source, k, index, rules, progress)
        if made <= error:  # type: ignore[operator]
            return found, made
    return reflect_opencl(grid, source, k, index, progress), 0.0
