"""Surface files: one format a module, found by suffix and first bytes.

>>> surface = vg.surface.read("sample.x3p")
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ...errors import FileFormatError, InputError, nearest
from ...file_kinds import require_kind
from ...files import require_file
from ...units import to_um
from ..checks import pitch_pair
from ..heightfield import Heightfield
from ..interpolant import KINDS
from . import ascii_matrix, csv_grid, instrument, matrix, npz, usurf_text, vgms
from .common import Format, RawSurface

OURS: tuple[Format, ...] = (npz.FORMAT, vgms.FORMAT, usurf_text.FORMAT, ascii_matrix.FORMAT, csv_grid.FORMAT)
_GIVE_UNIT = "give height_unit (um, nm, …)"


def formats() -> dict[str, str]:
    """Suffix → name of the format that reads it, ours first."""
    table = dict(instrument.SUFFIXES)
    for known in (matrix.NPY, *reversed(OURS)):
        table.update(dict.fromkeys(known.suffixes, known.name))
    return dict(sorted(table.items()))


def read(
    path: str | os.PathLike[str],
    pitch_um: float | ArrayLike | None = None,
    height_unit: str | None = None,
    interpolation: str | None = None,
    periodic: bool | None = None,
) -> Heightfield:
    """Height field from any known surface file.

    pitch_um : number or (dy, dx) instead of what the file says
    height_unit : the numbers in the file are heights in this unit ("nm", "um", "mm", …), whatever the file says
    interpolation, periodic : instead of the defaults ("cubic", not periodic) or what a `.npz` says

    The history says what was read and overridden. A `VgonioWarning` tells of an implausible pitch, size or roughness.
    Raises FileFormatError for a missing, truncated or unknown file and one without pitch when none is given.
    """
    from ..plausible import warn_implausible

    path = Path(path)
    known = _format_of(path)
    raw = known.read(path)
    surface = _heightfield(raw, path, pitch_um, height_unit, interpolation, periodic)
    warn_implausible(surface)
    return surface


def _format_of(path: Path) -> Format:
    require_file(path, "surface file")
    require_kind(path, "surface")
    try:
        with open(path, "rb") as stream:
            start = stream.read(64)
    except OSError as e:
        raise FileFormatError(f"cannot read {path}: {e.strerror or e}") from None
    if not start:
        raise FileFormatError(f"{path} is empty")
    suffix = path.suffix.lower()
    for known in OURS:
        if suffix in known.suffixes and (not known.magic or start.startswith(known.magic)):
            return known
    for known in OURS:
        # the first bytes decide before a suffix that several programs use; "PK" begins every zip archive
        if known.magic and start.startswith(known.magic) and known is not npz.FORMAT:
            return known
    if suffix in matrix.NPY.suffixes and start.startswith(matrix.NPY.magic):
        return matrix.NPY
    if matrix.is_matrix(path):
        return matrix.FORMAT
    if suffix in instrument.SUFFIXES:
        return instrument.FORMAT
    named = next((known for known in (*OURS, matrix.NPY) if suffix in known.suffixes), None)
    if named is not None:
        raise FileFormatError(f"{path} is not a {named.name} file: it begins with {start[:8]!r}")
    raise FileFormatError(f"{path}: unknown suffix {path.suffix!r}: known are {' '.join(formats())}")


def _heightfield(
    raw: RawSurface,
    path: Path,
    pitch_um: float | ArrayLike | None,
    height_unit: str | None,
    interpolation: str | None,
    periodic: bool | None,
) -> Heightfield:
    steps = [*raw.history, f"read {path.name} as {raw.format}", *raw.notes]
    if pitch_um is not None:
        was = "none" if raw.pitch_um is None else f"{raw.pitch_um[1]:g} × {raw.pitch_um[0]:g} µm"
        pitch = pitch_pair(pitch_um)
        steps.append(f"pitch set to {pitch[1]:g} × {pitch[0]:g} µm (file: {was})")
    elif raw.pitch_um is None:
        raise _lacking(raw, path, height_unit)
    else:
        pitch = _pitch_of_file(raw, path)
    factor = _height_factor(raw, path, height_unit)
    if height_unit is not None:
        steps.append(f"heights taken as {height_unit} (file: {raw.height_unit or 'no unit'})")
    if interpolation is not None and interpolation not in KINDS:
        raise InputError(f"interpolation {interpolation!r}: {nearest(str(interpolation), KINDS)}")
    heights = np.where(np.isfinite(raw.heights), raw.heights, np.nan) * factor
    if np.isnan(heights).all():
        raise FileFormatError(f"{path}: all {heights.size} points are missing: there is no surface in it")
    try:
        return Heightfield(
            heights,
            pitch,
            periodic=raw.periodic if periodic is None else bool(periodic),
            interpolation=interpolation or raw.interpolation,
            name=raw.name or path.stem,
            history=tuple(steps),
            meta={**raw.meta, "file": path.name, "format": raw.format},
        )
    except InputError as e:
        raise FileFormatError(f"{path}: {e}") from None


def _lacking(raw: RawSurface, path: Path, height_unit: str | None) -> FileFormatError:
    """What to say of a file without pitch: all that has to be given, at once."""
    if height_unit is None and raw.height_unit is None:
        return FileFormatError(
            f"{path}: this {raw.format} file has no pitch and no unit of heights: {_GIVE_UNIT} and pitch_um (µm)"
        )
    return FileFormatError(f"{path}: this {raw.format} file has no pitch: give pitch_um (µm)")


def _height_factor(raw: RawSurface, path: Path, height_unit: str | None) -> float:
    """Micrometres per unit of the numbers in the file."""
    if height_unit is not None:
        return to_um(height_unit)
    if raw.height_unit is None:
        raise FileFormatError(f"{path}: this {raw.format} file has no unit of heights: {_GIVE_UNIT}")
    try:
        return to_um(raw.height_unit)
    except InputError:
        raise FileFormatError(
            f"{path}: heights are in {raw.height_unit!r}, which is no known length: give height_unit"
        ) from None


def _pitch_of_file(raw: RawSurface, path: Path) -> tuple[float, float]:
    try:
        return pitch_pair(raw.pitch_um)  # type: ignore[arg-type]
    except InputError:
        raise FileFormatError(
            f"{path}: the file gives a pitch of {raw.pitch_um} µm, which is none: give pitch_um (µm)"
        ) from None
