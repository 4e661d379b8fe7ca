"""One-dimensional profiles of height fields, as panels: one period of a grating, or a part of a finite profile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ...surface.heightfield import Heightfield
from . import panels
from .panels import Floats, Panels

SHARP = ((0.5, 1), (1.2, 2))  # panels shrink so many times towards a kink of at least so many radians


@dataclass(frozen=True)
class Resolution:
    """How finely a profile is cut: longest panel and what its polynomials may miss, µm; nodes of a panel; how many
    times more panels shrink towards corners."""

    longest: float
    miss: float
    order: int = 10
    deeper: int = 0


def require_profile(surface: Heightfield) -> None:
    """Raise InputError unless the surface is the same for all y, without missing points."""
    surface.require_complete()
    if not surface.is_profile and bool(np.all(surface.z == surface.z[:, :1])):
        raise InputError(
            f"{surface.name or 'the surface'} varies along y alone: the full-wave solver takes profiles along x, turn "
            "it by 90° (the transposed heights and pitch)"
        )
    if not surface.is_profile:
        raise InputError(
            f"{surface.name or 'the surface'} varies along y: the full-wave solver takes one-dimensional profiles, "
            "height fields whose rows are all equal (for example Heightfield(surface.z[:1], …), one row of it); "
            "for surfaces in three dimensions use Kirchhoff"
        )


def period_of(surface: Heightfield, wavelength: float) -> float:
    """Period in µm; a flat surface repeats at any distance, half a wavelength is taken."""
    if surface.period_um is not None:
        return surface.period_um
    return min(surface.size_um[1], wavelength / 2)


def fewest_nodes(surface: Heightfield, start: float, stop: float, how: Resolution) -> int:
    """Nodes that panels of the profile from x = start to stop have at least, before any is made: chords between points
    half a pitch apart are no longer than the profile."""
    x = np.linspace(start, stop, 2 * int(np.ceil((stop - start) / surface.dx)) + 2)
    z = surface.interpolant.grid(surface.y[:1], x)[0]
    return how.order * int(np.ceil(float(np.hypot(np.diff(x), np.diff(z)).sum()) / how.longest * (1 - 1e-6)))


def cut(surface: Heightfield, start: float, stop: float, how: Resolution) -> Panels:
    """Panels of the profile from x = start to stop, µm; a periodic one continues beyond its domain."""
    if surface.interpolation == "cubic" and surface.interpolant.x_axis.degree == 3:
        curve = _spline(surface)
        return panels.on_curve(
            curve, panels.smooth_edges(curve, start, stop, how.longest, how.order, how.miss), how.order
        )
    x, z = _vertices(surface, start, stop)
    x, z = _without_straight(x, z)
    turn = _turns(x, z, surface.periodic)
    levels = np.array([_levels(t, how.deeper) for t in turn])
    return panels.polygon(x, z, how.longest, levels, how.order)


def one_period(surface: Heightfield, wavelength: float, how: Resolution) -> Panels:
    """Panels of one period."""
    return cut(surface, *period_span(surface, wavelength), how)


def period_span(surface: Heightfield, wavelength: float) -> tuple[float, float]:
    """Start and end of one period in µm, which begins where the profile is straight."""
    start = 0.0
    if surface.interpolation == "nearest":
        start = surface.dx / 2
    elif surface.interpolation == "linear":
        start = surface.dx  # halfway between the first two samples
    return start, start + period_of(surface, wavelength)


def _spline(surface: Heightfield) -> panels.Curve:
    ip, y = surface.interpolant, surface.y[:1]

    def curve(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        return t, ip.grid(y, t)[0], np.ones_like(t), ip.grid(y, t, dx=1)[0]

    return curve


def _vertices(surface: Heightfield, start: float, stop: float) -> tuple[Floats, Floats]:
    """Corners of a profile of straight lines, both ends included."""
    ip, y, h = surface.interpolant, surface.y[:1], surface.dx
    if surface.interpolation == "nearest" or ip.x_axis.degree == 0:
        wall = np.arange(np.floor(start / h) + 1, np.ceil(stop / h)) * h
        wall = wall[(wall > start + 1e-9 * h) & (wall < stop - 1e-9 * h)]
        edges = np.concatenate([[start], wall, [stop]])
        height = ip.grid(y, (edges[1:] + edges[:-1]) / 2)[0]
        x = np.stack([edges[:-1], edges[1:]], axis=1).ravel()
        return x, np.repeat(height, 2)
    first, last = np.ceil(start / h - 0.5), np.floor(stop / h - 0.5)
    knots = (np.arange(first, last + 1) + 0.5) * h
    if not surface.periodic:
        knots = knots[(knots > 1.2 * h) & (knots < surface.size_um[1] - 1.2 * h)]  # the last slopes are continued
    knots = knots[(knots > start + 1e-9 * h) & (knots < stop - 1e-9 * h)]
    x = np.concatenate([[start], knots, [stop]])
    return x, ip.grid(y, np.clip(x, start, stop))[0]


def _without_straight(x: Floats, z: Floats) -> tuple[Floats, Floats]:
    """The same line without repeated vertices and those at which it goes straight on."""
    keep = np.concatenate([[True], np.hypot(np.diff(x), np.diff(z)) > 1e-12])
    x, z = x[keep], z[keep]
    turn = _turns(x, z, False)
    keep = np.abs(turn) > 1e-9
    keep[[0, -1]] = True
    return x[keep], z[keep]


def _turns(x: Floats, z: Floats, periodic: bool) -> Floats:
    """(V,) angles in radians by which the line turns at each vertex; 0 at the ends, which are straight or open."""
    direction = np.arctan2(np.diff(z), np.diff(x))
    turn = np.zeros(len(x))
    turn[1:-1] = (np.diff(direction) + np.pi) % (2 * np.pi) - np.pi
    if periodic:
        turn[[0, -1]] = (direction[0] - direction[-1] + np.pi) % (2 * np.pi) - np.pi
    return turn


def _levels(turn: float, deeper: int) -> int:
    found = max((levels for least, levels in SHARP if abs(turn) >= least), default=0)
    return max(found + deeper, 1) if found else 0
