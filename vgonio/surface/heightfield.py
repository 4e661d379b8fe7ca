"""The height field: heights on a regular grid with pitch, missing points and history."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, nearest
from .checks import heights, pitch_pair
from .filter import fill, level
from .interpolant import KINDS, Interpolant

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Heightfield:
    """Heights z[iy, ix] in µm at cell centres x = (ix + ½)·dx, y = (iy + ½)·dy; z up; NaN marks missing points.

    z : (ny, nx) float64, from anything that is such an array (`checks.heights`);  pitch_um : number or (dy, dx)
    periodic : the field continues by itself, domain nx·dx × ny·dy
    interpolation : "cubic" (spline), "linear" or "nearest" (vertical walls)
    name : for people;  history : what was done to it, oldest first;  meta : further facts of the source

    Raises InputError for a shape that is not two-dimensional, a bad pitch, infinite heights or nothing but NaN; warns
    of heights that single precision has rounded to coarse steps.
    """

    z: Floats
    pitch_um: Any
    periodic: bool = False
    interpolation: str = "cubic"
    name: str = ""
    history: tuple[str, ...] = ()
    meta: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        z = heights(self.z)
        if self.interpolation not in KINDS:
            raise InputError(f"interpolation {self.interpolation!r}: {nearest(str(self.interpolation), KINDS)}")
        z.flags.writeable = False
        object.__setattr__(self, "z", z)
        object.__setattr__(self, "pitch_um", pitch_pair(self.pitch_um))

    # ---- geometry
    @property
    def dy(self) -> float:
        """Pitch along y in µm."""
        return self.pitch_um[0]

    @property
    def dx(self) -> float:
        """Pitch along x in µm."""
        return self.pitch_um[1]

    @property
    def shape(self) -> tuple[int, int]:
        """(ny, nx)."""
        return self.z.shape  # type: ignore[return-value]

    @property
    def size_um(self) -> tuple[float, float]:
        """(Ly, Lx), the extent of the domain in µm."""
        return self.shape[0] * self.dy, self.shape[1] * self.dx

    @property
    def area_um2(self) -> float:
        """Area of the domain in µm²."""
        return self.size_um[0] * self.size_um[1]

    @property
    def x(self) -> Floats:
        """(nx,) centres of the samples in µm."""
        return (np.arange(self.shape[1], dtype=np.float64) + 0.5) * self.dx

    @property
    def y(self) -> Floats:
        """(ny,) centres of the samples in µm."""
        return (np.arange(self.shape[0], dtype=np.float64) + 0.5) * self.dy

    @cached_property
    def missing(self) -> int:
        """Number of missing points."""
        return int(np.isnan(self.z).sum())

    @cached_property
    def is_profile(self) -> bool:
        """One profile repeated along y (a grating)."""
        return bool(self.shape[0] == 1 or np.all(self.z == self.z[:1]))

    @cached_property
    def interpolant(self) -> Interpolant:
        """The surface between samples; InputError while points are missing."""
        self.require_complete()
        return Interpolant(self.z, self.pitch_um, self.periodic, self.interpolation)

    def require_complete(self) -> None:
        """Raises InputError, which says how to fill them, where points are missing."""
        if self.missing:
            raise InputError(
                f"{self.name or 'the surface'} has {self.missing} missing points of {self.z.size} "
                f'({self.missing / self.z.size:.2%}): fill them, with surface.filled("interpolate") '
                'or fill = "interpolate" in the scene'
            )

    @cached_property
    def period_um(self) -> float | None:
        """Smallest period along x of a periodic field in µm, from the common divisor of its harmonics."""
        if not self.periodic:
            return None
        spectrum = np.abs(np.fft.rfft(self.z - self.z.mean(), axis=1)).max(axis=0)
        rounding = self.shape[1] * float(np.spacing(np.abs(self.z).max()))
        strong = 1 + np.flatnonzero(spectrum[1:] > max(1e-9 * spectrum.max(), rounding))  # without the means of rows
        return self.size_um[1] / int(np.gcd.reduce(strong)) if strong.size else None

    # ---- making others
    def with_history(self, z: Floats, step: str, **changes: Any) -> Heightfield:
        """A new field with other heights z (ny, nx) in µm and one more line of history."""
        return replace(self, z=z, history=(*self.history, step), **changes)

    def replace(self, **changes: Any) -> Heightfield:
        """A copy with some attributes changed."""
        return replace(self, **changes)

    def filled(self, method: str = "interpolate") -> Heightfield:
        """Missing points filled; see `vgonio.surface.filter.fill`."""
        return fill(self, method)

    def levelled(self, method: str = "plane") -> Heightfield:
        """Mean, plane or quadratic form removed; see `vgonio.surface.filter.level`."""
        return level(self, method)

    def cropped(self, size_um: float | ArrayLike, centre: bool = True) -> Heightfield:
        """The central (or first) part of (Ly, Lx) or one side length in µm; the result is not periodic.

        Raises InputError for sizes that are none or larger than the field.
        """
        try:
            want = np.broadcast_to(np.asarray(size_um, dtype=float), (2,))
        except (TypeError, ValueError):
            want = np.array([np.nan, np.nan])
        if not np.all(np.isfinite(want)):
            raise InputError(f"crop_um = {size_um!r}: give one side length or (Ly, Lx), in µm")
        n = [int(round(w / p)) for w, p in zip(want, self.pitch_um)]
        for have, get, side in zip(self.shape, n, want):
            if not 2 <= get <= have:
                raise InputError(
                    f"crop_um = {side:g} µm is outside the surface of {self.size_um[0]:g} × {self.size_um[1]:g} µm"
                )
        start = [(have - get) // 2 if centre else 0 for have, get in zip(self.shape, n)]
        z = self.z[start[0] : start[0] + n[0], start[1] : start[1] + n[1]]
        whole = tuple(n) == self.shape
        return self.with_history(z, f"crop {want[0]:g} × {want[1]:g} µm", periodic=self.periodic and whole)

    def __repr__(self) -> str:
        ny, nx = self.shape
        ly, lx = self.size_um
        missing = f", {self.missing} missing" if self.missing else ""
        kind = ", periodic" if self.periodic else ""
        return (
            f"<Heightfield {self.name or 'unnamed'}: {nx} × {ny} points, pitch {self.dx:g} × {self.dy:g} µm, "
            f"{lx:g} × {ly:g} µm, Sq {np.nanstd(self.z):.4g} µm{missing}{kind}, {self.interpolation}>"
        )
