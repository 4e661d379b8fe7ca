"""What an HDF5 file (NetCDF-4, MATLAB 7.3, some instruments) may not do: read other files, run in circles, fill memory.

HDF5 has links into other files, data sets that lie in other files, and shapes that need no byte of storage. Files are
looked through before anything of them is read.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

from .errors import FileFormatError

SIGNATURE = b"\x89HDF\r\n\x1a\n"
# deflate makes at most 1032 bytes of one; small arrays may be declared without being stored
MOST_RATIO = 1100
UNSTORED = 50_000_000
MOST_OBJECTS = 100_000
MOST_DEPTH = 32


def require_harmless(path: str | os.PathLike[str]) -> None:
    """FileFormatError for an HDF5 file that names other files, holds itself, or declares more than it can hold.

    A file of another kind passes. Raises FileFormatError for one that HDF5 itself cannot open.
    """
    path = Path(path)
    if not _is_hdf5(path):
        return
    import h5py

    try:
        with h5py.File(path, "r") as file:
            require_harmless_groups(file, path)
    except FileFormatError:
        raise
    except Exception as e:  # damaged HDF5 fails in as many ways as there are bytes
        raise FileFormatError(f"{path} is a damaged HDF5 file ({e or type(e).__name__})") from None


def _is_hdf5(path: Path) -> bool:
    """Does the signature stand where HDF5 looks for it: at 0, 512, 1024, …, since other programs put a head before?"""
    with open(path, "rb") as stream:
        size, at = os.fstat(stream.fileno()).st_size, 0
        while at + len(SIGNATURE) <= size:
            stream.seek(at)
            if stream.read(len(SIGNATURE)) == SIGNATURE:
                return True
            at = max(512, 2 * at)
    return False


def require_harmless_groups(file: Any, path: Path) -> None:
    """The same for a file that is open already (h5py.File)."""
    _look_through(file, path, file.name, [0], frozenset({_identity(file)}))


def _identity(item: Any) -> tuple[int, int]:
    """Which object it is, whatever name it was found under."""
    import h5py

    found = h5py.h5o.get_info(item.id)
    return found.fileno, found.addr


def _look_through(group: Any, path: Path, place: str, count: list[int], above: frozenset[tuple[int, int]]) -> None:
    import h5py

    for name in group:
        here = f"{place.rstrip('/')}/{name}"
        count[0] += 1
        if count[0] > MOST_OBJECTS or len(above) > MOST_DEPTH:
            raise FileFormatError(f"{path} holds more objects than any result: it is damaged")
        link = group.get(name, getlink=True)
        if isinstance(link, h5py.ExternalLink):
            raise FileFormatError(
                f"{path}: {here} lies in another file ({link.filename}): nothing but the file named is read, copy it in"
            )
        try:
            item = group[name]
        except KeyError:
            continue  # a link to nothing
        if isinstance(item, h5py.Group):
            identity = _identity(item)
            if identity in above:
                raise FileFormatError(f"{path}: the group {here} holds itself: the file is damaged")
            _look_through(item, path, here, count, above | {identity})
        elif isinstance(item, h5py.Dataset):
            _require_own(item, path, here)


def _require_own(data: Any, path: Path, place: str) -> None:
    if data.is_virtual or data.external:
        raise FileFormatError(
            f"{path}: the values of {place} lie in other files: nothing but the file named is read, copy them in"
        )
    stored = data.id.get_storage_size()
    # a chunk is read as a whole, and may be larger than the array
    declared = max(int(data.nbytes or 0), math.prod(data.chunks or (0,)) * data.dtype.itemsize)
    if declared > UNSTORED + MOST_RATIO * stored:
        raise FileFormatError(
            f"{path}: {place} declares {declared / 1e6:.0f} MB and stores {stored / 1e6:.3g} MB: the file is damaged"
        )
