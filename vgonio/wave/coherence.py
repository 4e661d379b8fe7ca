"""Coherence windows: Gaussian amplitude windows that tile the sample, and how many of them are independent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ToleranceError
from ..surface.heightfield import Heightfield
from .fourier import sample
from .quadrature import Floats, Points, axis_rule, fewest, require_affordable

REACH = 3.0  # a window ends at 3 ℓ, where the amplitude is 1 %; that is taken off, so that it ends at zero
PARABOLIC = 1e3  # ℓ over half the window, from which on its shape is the same to (1/PARABOLIC)²
MOST_ALONG = 150  # windows along one side
TRIAL_UM = 100.0  # side of the part of a whole sample on which the spacing of points is tried
SPACING = 2.0  # of window centres, in ℓ: neighbours then share 14 % of their intensity


@dataclass(frozen=True)
class Window:
    """The separable window g(x − x_c) g(y − y_c), g(t) = exp(−t²/2ℓ²) − exp(−R²/2ℓ²) for |t| < R.

    length : ℓ in µm;  half : (R_y, R_x) in µm;  centre : (y_c, x_c) in µm
    """

    length: float
    half: tuple[float, float]
    centre: tuple[float, float]

    def profile(self, t: Floats, half: float) -> Floats:
        if half > self.length:
            edge = np.exp(-(half**2) / (2 * self.length**2))
            return np.maximum(np.exp(-(t**2) / (2 * self.length**2)) - edge, 0.0)
        # where ℓ is many times what the sample holds of the window, that is a difference of two numbers that are nearly
        # 1: a parabola, which further coherence does not change but to make it vanish
        length = min(self.length, PARABOLIC * half)
        inside = np.maximum(half**2 - t**2, 0.0) / (2 * length**2)
        return np.exp(-(half**2) / (2 * length**2)) * np.expm1(inside)


def tile(surface: Heightfield, length: float) -> list[Window]:
    """Windows over the sample: any place on a periodic one; on a finite one inside it, shrunk where it is too small."""
    centres, half = [], []
    for side in surface.size_um:
        if surface.periodic:
            n = _affordable(side / (SPACING * length), length, side)
            half.append(REACH * length)
            centres.append((np.arange(n) + 0.5) * side / n)
            continue
        r = min(REACH * length, side / 2)
        n = 1 + _affordable((side - 2 * r) / (SPACING * length) - 0.5 + 1e-9, length, side, 0)
        half.append(r)
        centres.append(np.linspace(r, side - r, n) if n > 1 else np.array([side / 2]))
    return [Window(length, (half[0], half[1]), (y, x)) for y in centres[0] for x in centres[1]]


def _affordable(count: float, length: float, side: float, least: int = 1) -> int:
    """Windows along one side, rounded; ToleranceError before lists out of all proportion are made."""
    if count > MOST_ALONG:
        raise ToleranceError(
            f"coherence_um = {length:g} µm on a side of {side:g} µm makes {count:.3g} windows along it, at most "
            f"{MOST_ALONG}: take a larger coherence_um, or a part of the surface (crop_um)"
        )
    return max(least, round(count))


def spread(windows: list[Window], surface: Heightfield, most: int | None) -> list[Window]:
    """At most so many of the windows (None: all), spread evenly over the surface; a single one is the middle one."""
    if most is None or most >= len(windows):
        return windows
    if most > 1:
        return [windows[int(i)] for i in np.linspace(0, len(windows) - 1, most).round()]
    away = np.array([w.centre for w in windows]) - np.array(surface.size_um) / 2
    return [windows[int(np.argmin(np.sum(away**2, axis=1)))]]


def independent(windows: list[Window], surface: Heightfield) -> float:
    """Effective number of independent windows: n² / Σ ρ, ρ = exp(−d²/2ℓ²) the intensity correlation of two windows."""
    c = np.array([w.centre for w in windows])
    size = np.array(surface.size_um)
    total = 0.0
    for one in c:  # row by row: memory of one row, however many windows there are
        d = c - one
        if surface.periodic:
            d -= size * np.rint(d / size)
        total += float(np.exp(-np.sum(d**2, axis=-1) / (2 * windows[0].length ** 2)).sum())
    return len(c) ** 2 / total


def patch(surface: Heightfield, window: Window, spacing: tuple[float, float], rule: str) -> tuple[Points, float]:
    """Points of one window, counted from its centre, and A_w = ∫ |w|² dx dy in µm²."""
    ip = surface.interpolant
    sides = zip((ip.y_axis, ip.x_axis), window.half, spacing)
    rows, columns = (fewest(axis, 2 * half, step, rule) for axis, half, step in sides)
    require_affordable(1 if surface.is_profile else rows, columns)
    axes, profiles = [], []
    for axis, c, r, s in zip((ip.y_axis, ip.x_axis), window.centre, window.half, spacing):
        lo, hi = (c - r, c + r) if rule != "cells" else _whole_cells(c - r, c + r, axis.h, axis.n, surface.periodic)
        t, w = axis_rule(axis, lo, hi, s, rule)
        axes.append(t)
        profiles.append((w, window.profile(t - c, r)))
    (wy, gy), (wx, gx) = profiles
    cell = surface.pitch_um if rule == "cells" else (0.0, 0.0)
    x, y = axes[1] - window.centre[1], axes[0] - window.centre[0]
    area = float((wy @ gy**2) * (wx @ gx**2))
    if surface.is_profile:
        if rule == "cells":
            # a profile has no walls across y: the window is smooth there, whatever the interpolation
            y, wy = axis_rule(ip.y_axis, -window.half[0], window.half[0], spacing[0], "uniform")
            gy = window.profile(y, window.half[0])
        z = ip.grid(surface.y[:1], axes[1])
        return Points(x, np.zeros(1), z, (wx * gx)[None], (0.0, cell[1]), (y, wy * gy)), float(
            (wy @ gy**2) * (wx @ gx**2)
        )
    return Points(x, y, ip.grid(axes[0], axes[1]), np.outer(wy * gy, wx * gx), cell), area


def _whole_cells(lo: float, hi: float, h: float, n: int, periodic: bool) -> tuple[float, float]:
    a, b = np.floor(lo / h + 1e-9) * h, np.ceil(hi / h - 1e-9) * h
    return (a, b) if periodic else (max(a, 0.0), min(b, n * h))


@dataclass(frozen=True)
class WindowPlan:
    """The windows that are evaluated; None stands for the whole sample with weight one.

    independent : effective number;  step : of scattering vectors across a detector cone, rad/µm, no coarser than 1/ℓ
    """

    windows: list[Window | None]
    independent: float
    step: float
    attrs: dict[str, Any]

    @property
    def gaussian(self) -> list[Window]:
        return [w for w in self.windows if w is not None]

    @staticmethod
    def of(surface: Heightfield, length: float | None, most: int | None) -> WindowPlan:
        if length is None:
            step = np.pi / max(surface.size_um)
            return WindowPlan([None], 1.0, float(step), {"coherence_um": "whole sample", "windows": 1.0})
        every = tile(surface, length)
        windows, tiled = spread(every, surface, most), len(every)
        n = independent(windows, surface)
        attrs: dict[str, Any] = {
            "coherence_um": length,
            "windows": n,
            "windows_tiled": tiled,
            "windows_used": len(windows),
        }
        if min(windows[0].half) < REACH * length * (1 - 1e-9):
            attrs["window_note"] = (
                f"the sample is smaller than the window of ±{REACH * length:g} µm: "
                f"it ends at ±{min(windows[0].half):g} µm"
            )
        # a window that was cut to ±R resolves no more in q than one of ℓ = R/3
        return WindowPlan(list(windows), n, REACH / max(windows[0].half), attrs)

    def trial(self, surface: Heightfield) -> tuple[Heightfield, Window | None]:
        """A surface and a window of it on which the spacing is tried: the central ones, no larger than TRIAL_UM."""
        window = self.windows[len(self.windows) // 2]
        sides = np.minimum(surface.size_um, TRIAL_UM)
        if window is not None or surface.is_profile or np.array_equal(sides, surface.size_um):
            return surface, window
        return surface.cropped(np.maximum(sides, 4 * np.array(surface.pitch_um))), None

    def points(
        self, surface: Heightfield, window: Window | None, spacing: tuple[float, ...], rule: str
    ) -> tuple[Points, float]:
        """Points of one window and its area A_w in µm²."""
        if window is None:
            return sample(surface, spacing, rule), surface.area_um2
        return patch(surface, window, (spacing[0], spacing[1]), rule)
