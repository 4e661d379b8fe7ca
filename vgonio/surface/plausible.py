"""What an import shows, and the warnings about what no microscope would deliver."""

from __future__ import annotations

import warnings

import numpy as np

from ..errors import VgonioWarning
from .filter import level
from .heightfield import Heightfield

# limits outside which a unit was probably misread: optical topography of scattering surfaces
PITCH_UM = (1e-3, 100.0)
SIDE_UM = (1.0, 20_000.0)
SQ_UM = (1e-5, 100.0)
RMS_SLOPE = 3.0
GENERATED_SLOPE = 10.0  # gratings have walls; vertical ones do not count


def describe_import(surface: Heightfield) -> str:
    """One line with points, pitch, size, Sq and missing points, as shown after reading a file.

    Sq is that of the heights as they are and, where a tilt is part of it, of those without their plane.
    """
    ny, nx = surface.shape
    ly, lx = surface.size_um
    missing = f", {surface.missing / surface.z.size:.2%} missing" if surface.missing else ""
    return (
        f"{surface.name or 'surface'}: {nx} × {ny} points, pitch {surface.dx:.4g} × {surface.dy:.4g} µm, "
        f"size {lx:.4g} × {ly:.4g} µm, {_sq_in_words(surface)}{missing}"
    )


def _sq_in_words(surface: Heightfield) -> str:
    as_read = f"Sq {np.nanstd(surface.z):.4g} µm"
    if surface.periodic or surface.missing == surface.z.size:
        return as_read
    levelled = f"{np.nanstd(level(surface, 'plane').z):.4g} µm"
    return as_read if as_read == f"Sq {levelled}" else f"{as_read} as read, {levelled} levelled"


def implausible(surface: Heightfield) -> list[str]:
    """What is implausible about pitch, size, Sq and slope, in words; empty when nothing is."""
    sq = float(np.nanstd(surface.z))
    found = []
    for pitch in dict.fromkeys(surface.pitch_um):
        if not PITCH_UM[0] <= pitch <= PITCH_UM[1]:
            found.append(f"a pitch of {pitch:.4g} µm (expected {PITCH_UM[0]:g} to {PITCH_UM[1]:g} µm)")
    repeated = (surface.is_profile, False)  # rows that are all equal say nothing of a size along y
    for side, n in dict.fromkeys((side, n) for side, n, no in zip(surface.size_um, surface.shape, repeated) if not no):
        if n > 1 and not SIDE_UM[0] <= side <= SIDE_UM[1]:
            found.append(f"a side of {side:.4g} µm (expected {SIDE_UM[0]:g} to {SIDE_UM[1]:g} µm)")
    if sq and not SQ_UM[0] <= sq <= SQ_UM[1]:
        found.append(f"Sq of {sq:.4g} µm (expected {SQ_UM[0]:g} to {SQ_UM[1]:g} µm)")
    slope = rms_step_slope(surface)
    if slope > RMS_SLOPE:
        found.append(f"an RMS slope of {slope:.3g} between neighbours (expected below {RMS_SLOPE:g})")
    return found


def rms_step_slope(surface: Heightfield) -> float:
    """RMS of the height steps between neighbours over the pitch, the steeper axis; missing points left out."""
    steepest = 0.0
    for axis, pitch in enumerate(surface.pitch_um):
        steps = np.diff(surface.z, axis=axis)
        valid = steps[np.isfinite(steps)]
        if valid.size:
            steepest = max(steepest, float(np.sqrt(np.mean(valid**2))) / pitch)
    return steepest


def implausible_in_words(surface: Heightfield, generated: bool = False) -> str:
    """What is implausible, and what to do, in a line; "" where nothing is.

    generated : the numbers were typed, not read: only heights out of all proportion are told
    """
    name = surface.name or "surface"
    if not generated:
        found = implausible(surface)
        return f"{name} has {'; '.join(found)}: if a unit was misread, give pitch_um or height_unit" if found else ""
    sq, slope = float(np.nanstd(surface.z)), rms_step_slope(surface)
    steep = slope > GENERATED_SLOPE and surface.interpolation != "nearest"
    if sq <= SQ_UM[1] and not steep:
        return ""
    return (
        f"{name} has Sq of {sq:.4g} µm and an RMS slope of {slope:.3g} between neighbours: heights, lengths and "
        f"pitch_um of a generated surface are in µm; is the unit right? ({sq:.3g} nm is {sq * 1e-3:.3g} µm)"
    )


def warn_implausible(surface: Heightfield, generated: bool = False) -> None:
    told = implausible_in_words(surface, generated)
    if told:
        warnings.warn(told, VgonioWarning, stacklevel=3)
