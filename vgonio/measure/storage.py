"""Results on disk: one NetCDF-4 file with a group for each part, written whole or not at all."""

from __future__ import annotations

import gc
import json
import os
import sys
import warnings
from pathlib import Path
from typing import Any

import xarray as xr

from ..dataset import check, plain
from ..errors import FileFormatError, InputError
from ..file_kinds import require_kind
from ..files import RESULT_ENDINGS, require_file, undisturbed, written_whole
from ..hdf5 import require_harmless

FORMAT = "vgonio result"
FORMAT_VERSION = 1
JSON_ATTRIBUTES = ("scene", "plan", "provenance", "seconds", "memory_bytes")
GROUPS = ("rays", "waves", "measured", "comparison")


def save(result: xr.DataTree | xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write a result to NetCDF-4 under a temporary name beside `path`, then rename; returns the path.

    A Dataset becomes the root group. Raises InputError for a name that does not end in .nc, .nc4 or .h5, or what is no
    result, FileFormatError where the folder cannot be written.
    """
    if not isinstance(result, (xr.DataTree, xr.Dataset)) or not isinstance(path, (str, os.PathLike)):
        got = f"{type(result).__name__}, {type(path).__name__}"
        raise InputError(f"save(result, path) takes a DataTree or Dataset and then a file name, got ({got})")
    path = Path(path)
    if path.suffix.lower() not in RESULT_ENDINGS:
        raise InputError(f"output {path.name!r}: the name has to end in {' or '.join(RESULT_ENDINGS)}")
    tree = result if isinstance(result, xr.DataTree) else xr.DataTree(result)
    tree = tree.copy()
    tree.attrs = {
        **{k: plain(v) for k, v in tree.attrs.items()},
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
    }
    encoding = {
        node.path: {str(v): {"zlib": True, "complevel": 4} for v in node.data_vars if node[str(v)].ndim}
        for node in tree.subtree
    }
    with undisturbed(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*Consolidated metadata.*")
        # in memory: HDF5 that meets a full disk takes the whole process with it
        content = tree.to_netcdf(None, engine="h5netcdf", encoding=encoding)
    with written_whole(path) as stream:
        stream.write(content)
    return path


def open(path: str | os.PathLike[str]) -> xr.DataTree:
    """Read a result into memory; FileFormatError for a missing or damaged file, or one of another program."""
    path = Path(path)
    require_file(path, "result file")
    require_kind(path, "result")
    require_harmless(path)
    loaded, reason = _loaded(path)
    if loaded is None:
        raise FileFormatError(f"{path} is not a NetCDF-4 file ({reason})")
    require_ours(loaded.attrs, path)
    # a dataset saved by itself has its seconds as a number, a scene's result those of its parts as JSON
    _require_json(loaded.attrs, [n for n in JSON_ATTRIBUTES if n != "seconds" or "brdf" not in loaded.data_vars], path)
    for node in loaded.subtree:
        if "brdf" in node.data_vars:
            check(node.to_dataset(), f"{path}, group {node.path}")
        elif node.path == "/surface":
            from .surface_summary import check_summary

            check_summary(node.to_dataset(), f"{path}, group {node.path}")
    return loaded


def _loaded(path: Path) -> tuple[xr.DataTree | None, str]:
    """The tree in memory, or None and the reason; what a half-open file says while it is thrown away is not shown."""
    hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        try:
            with xr.open_datatree(path, engine="h5netcdf") as tree:
                return tree.load(), ""
        except Exception as e:  # damaged HDF5 fails in as many ways as there are bytes
            reason = str(e).splitlines()[0] if str(e) else type(e).__name__
        gc.collect()
        return None, reason
    finally:
        sys.unraisablehook = hook


def _require_json(attrs: dict[Any, Any], names: list[str], path: Path) -> None:
    for name in set(names) & set(attrs):
        try:
            json.loads(attrs[name])
        except (TypeError, ValueError):
            raise FileFormatError(f"{path}: the attribute {name!r} is not JSON text: the file is damaged") from None


def require_ours(attrs: dict[Any, Any], path: Path) -> None:
    if str(attrs.get("format")) != FORMAT:
        raise FileFormatError(f"{path} is a result of another program: its attribute 'format' is not {FORMAT!r}")
    found = str(attrs.get("format_version", "none"))
    if not (found.isdecimal() and len(found) < 10 and int(found) > 0):
        raise FileFormatError(
            f"{path} has format version {found}, a whole number from 1 on is needed: the file is damaged"
        )
    if int(found) > FORMAT_VERSION:
        raise FileFormatError(
            f"{path} has format version {found}, this vgonio reads up to {FORMAT_VERSION}: upgrade it"
        )
