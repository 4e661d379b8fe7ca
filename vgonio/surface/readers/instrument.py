"""Files of surface instruments, read by SurfaceTopography.

Its arrays are (nx, ny) with y growing along the second index; ours are z[iy, ix]. Its readers are tried by suffix, and
whatever goes wrong inside them becomes one line.
"""

from __future__ import annotations

import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import FileFormatError, InputError
from ...hdf5 import require_harmless
from ...units import to_um
from . import matlab
from .common import Format, RawSurface, require_points

# suffix → name; a test compares this with the library, which is slow to import
SUFFIXES: dict[str, str] = {
    **dict.fromkeys((".001", ".002", ".003", ".004", ".005", ".spm"), "Bruker NanoScope"),
    ".al3d": "Alicona AL3D",
    ".apx": "Sensofar PLU",
    ".asc": "text",
    ".bcr": "BCR-STM",
    ".bcrf": "BCR-STM",
    ".cur": "WSxM",
    ".dat": "Zygo MetroPro or text",
    ".datx": "Zygo DATX",
    ".ezd": "Nanosurf",
    ".frt": "FRT MicroProf",
    ".gwy": "Gwyddion",
    ".h5": "HDF5",
    ".hfm": "xyz text",
    ".ibw": "Igor binary wave",
    ".jpk": "JPK image scan",
    ".lext": "Olympus LEXT",
    ".mat": "MATLAB",
    ".mdt": "NT-MDT",
    ".mi": "Molecular Imaging",
    ".mnt": "Digital Surf MNT",
    ".nc": "NetCDF",
    ".nid": "Nanosurf",
    ".nms": "NanoFocus NMS",
    ".oir": "Olympus OIR",
    ".opd": "Wyko OPD",
    ".opdx": "Bruker OPDx",
    ".os3d": "Digital Metrology OmniSurf3D",
    ".plu": "Sensofar PLU",
    ".plux": "Sensofar PLUX",
    ".poir": "Olympus POIR",
    ".qep": "QEP",
    ".sdf": "ISO 25178-71 SDF",
    ".stp": "WSxM",
    ".sur": "Digital Surf SUR",
    ".tif": "Park Systems",
    ".tiff": "Park Systems",
    ".tmd": "TrueMap TMD",
    ".tom": "WSxM",
    ".top": "WSxM",
    ".txt": "text",
    **dict.fromkeys((".vk3", ".vk4", ".vk6", ".vk7"), "Keyence VK"),
    ".x3p": "ISO 25178-72 X3P",
    ".xyz": "xyz text",
    ".csv": "xyz text",
    ".zmg": "Zeta ZMG",
    ".zon": "Keyence ZON",
}
# a deflated byte holds at most 1032 heights of one byte: a header that declares more than that lies
_POINTS_PER_BYTE = 1032
# members of archives that are read as a whole; numbers written as text shrink to a tenth at the best
_DESCRIPTIONS = {".xml", ".json", ".txt", ".properties", ".dsc", ".hex", ".ini"}
_MOST_DESCRIPTION = 10_000_000
_MOST_RATIO = 100
_REMEDY = " (a matrix of heights is read where every line holds numbers only, at least four: without names or an index)"


def read(path: Path) -> RawSurface:
    """RawSurface of the first height channel of an instrument file; FileFormatError where none can be read."""
    require_harmless(path)
    if path.suffix.lower() == ".mat":
        matlab.require_sound(path)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        _require_no_bomb(path)
        reader = _reader(path)
        try:
            return _surface(reader, path)
        except FileFormatError:
            raise
        except Exception as e:  # forty readers fail in as many ways on damaged files
            raise FileFormatError(f"{path}: the {SUFFIXES[path.suffix.lower()]} file is damaged ({_line(e)})") from None
        finally:
            reader.close()


def _require_no_bomb(path: Path) -> None:
    """FileFormatError for an archive whose descriptions unpack to far more than descriptions do."""
    if not zipfile.is_zipfile(path):
        return
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
    except Exception:
        return  # damaged: its reader says how
    for member in members:
        text = Path(member.filename).suffix.lower() in _DESCRIPTIONS
        if text and member.file_size > max(_MOST_DESCRIPTION, _MOST_RATIO * member.compress_size):
            size = f"{member.compress_size} bytes for {member.file_size / 1e6:.0f} MB"
            raise FileFormatError(f"{path}: {member.filename!r} in it is no description ({size}): not read")


def _reader(path: Path) -> Any:
    """A SurfaceTopography reader that accepts the file: one of its suffix, else one whose first bytes match."""
    from SurfaceTopography.IO import readers
    from SurfaceTopography.IO.Reader import MagicMatch

    suffix = path.suffix.lower()
    with open(path, "rb") as stream:
        start = stream.read(512)
    of_suffix = [r for r in readers if suffix[1:] in r._file_extensions and r.can_read(start) != MagicMatch.NO]
    of_bytes = [r for r in readers if r not in of_suffix and r.can_read(start) == MagicMatch.YES]
    reason = "it does not begin like one"
    for candidate in (*of_suffix, *of_bytes):
        try:
            return candidate(str(path))
        except Exception as e:  # see above
            reason = _line(e)
    remedy = _REMEDY if "text" in SUFFIXES[suffix] else ""
    raise FileFormatError(f"{path} cannot be read as {SUFFIXES[suffix]}: {reason}{remedy}")


def _surface(reader: Any, path: Path) -> RawSurface:
    channel, notes = _channel(reader, path)
    points = channel.nb_grid_pts
    rows, columns = (points[1], points[0]) if len(points) == 2 else (1, points[0])
    require_points(rows, columns, path)
    if rows * columns > _POINTS_PER_BYTE * path.stat().st_size:
        raise FileFormatError(f"{path}: {columns} × {rows} points declared in {path.stat().st_size} bytes: damaged")
    unknown_size = channel.physical_sizes is None
    topography = channel.topography(**({"physical_sizes": tuple(float(n) for n in points)} if unknown_size else {}))
    if not topography.is_uniform:
        raise FileFormatError(f"{path}: the points do not lie on a regular grid: only regular grids are read")
    heights = np.ma.filled(np.ma.asarray(topography.heights()).astype(np.float64), np.nan)
    unit = topography.unit
    z = heights.T if heights.ndim == 2 else heights[None, :]
    return RawSurface(
        np.ascontiguousarray(z),
        unit,
        None if unknown_size else _pitch(topography, unit),
        SUFFIXES[path.suffix.lower()],
        notes=notes,
        periodic=bool(topography.is_periodic),
        meta=_instrument(topography),
    )


def _channel(reader: Any, path: Path) -> tuple[Any, tuple[str, ...]]:
    """The default channel when it holds heights, else the first that does, and which one it was where several are."""
    channels = [c for c in reader.channels if getattr(c.data_kind, "value", "height") == "height"]
    if not channels:
        raise FileFormatError(f"{path}: no channel of heights among {[c.name for c in reader.channels]}")
    chosen = reader.default_channel if reader.default_channel in channels else channels[0]
    if len(reader.channels) == 1:
        return chosen, ()
    names = ", ".join(c.name for c in reader.channels)
    return chosen, (f"channel {chosen.name!r} of {len(reader.channels)} ({names})",)


def _instrument(topography: Any) -> dict[str, str]:
    """What the file says about the instrument, as text."""
    found = dict(topography.info).get("instrument") or {}
    return {f"instrument_{k}": str(v) for k, v in dict(found).items() if isinstance(v, str | int | float)}


def _pitch(topography: Any, unit: str | None) -> tuple[float, float] | None:
    """(dy, dx) in µm, or None where the file's unit of length is missing or unknown: it has to be given then."""
    try:
        factor = to_um(unit or "")
    except InputError:
        return None
    pitch = [float(p) * factor for p in np.atleast_1d(topography.pixel_size)]
    return (pitch[1], pitch[0]) if len(pitch) == 2 else (pitch[0], pitch[0])


def _line(e: Exception) -> str:
    """The first line of a message, without the bytes of a damaged file that it may quote."""
    text = str(e).strip() or type(e).__name__
    return "".join(c if c.isprintable() else "?" for c in text.splitlines()[0])[:200]


FORMAT = Format("instrument", tuple(SUFFIXES), (), read)
