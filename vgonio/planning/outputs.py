"""Where results go: checked before any work is done, so that none is done in vain."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..files import PAGE_ENDINGS, RESULT_ENDINGS
from ..scene import Scene


def check_outputs(scene: Scene) -> None:
    """Raise InputError for an output that could not be written, or that would overwrite an input."""
    for name, endings in ((scene.output.file, RESULT_ENDINGS), (scene.output.report, PAGE_ENDINGS)):
        if name is not None:
            check_output(scene.resolve(name), endings, scene.inputs)


def check_output(path: Path, endings: tuple[str, ...], inputs: Iterable[Path] = ()) -> None:
    """Raise InputError unless `path` has one of the endings and its folder is, or can be made, writable.

    Where the system says so only when asked to write, as in /proc, a file without a name is written and gone at once.
    Of the folders one may be missing, which is made when the result is written; more, and one at the root of the file
    system, are taken for a slip.
    """
    if path.suffix.lower() not in endings:
        raise InputError(f"output {path.name!r}: the name has to end in {' or '.join(endings)}")
    if path.is_dir():
        raise InputError(f"output {path} is a folder: name a file in it")
    if any(path.resolve() == other.resolve() for other in inputs):
        raise InputError(f"output {path} would overwrite an input of the scene")
    folder = _existing(path)
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        raise InputError(f"output {path} cannot be written: {folder} is not a writable folder")
    _require_few_missing(path)
    _try_writing(path, folder)


def _existing(path: Path) -> Path:
    """The nearest folder above an output that is there."""
    return next(p for p in path.resolve().parents if p.exists())


def _require_few_missing(path: Path) -> None:
    """Raise InputError where more is missing than the last folder of a path, or where that is one of the root."""
    parent, folder = path.resolve().parent, _existing(path)
    if folder not in (parent, parent.parent):
        raise InputError(
            f"output {path}: {parent.parent} is not there; one new folder is made, not several: make it first"
        )
    if folder != parent and folder == folder.parent:
        raise InputError(
            f"output {path}: {parent} is not there; no folder is made at the root of the file system, check the path"
        )


def _try_writing(path: Path, folder: Path) -> None:
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as e:
        raise InputError(f"output {path} cannot be written: {folder} takes no files ({e.strerror or e})") from None


def page_asked(scene: Scene, output: str | os.PathLike[str] | None, report: Any) -> Any:
    """The page's path where it is asked for apart from the scene: given, or beside another result than the scene's.

    None leaves the scene's own output.report; with it in place, a result elsewhere would overwrite the page of another.
    """
    if report is not None or output is None or scene.output.report is None:
        return report
    return Path(output).with_suffix(".html")


def with_folder(path: Path) -> Path:
    """The same path, its folder made where only that was missing; InputError where it cannot be, as `check_output`."""
    _require_few_missing(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise InputError(f"cannot make the folder {path.parent}: {e.strerror or e}") from None
    return path
