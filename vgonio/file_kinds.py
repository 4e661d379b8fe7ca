"""What kind of file a file is, by its first bytes, so that the wrong one is refused by name and with what takes it.

Only what is certain is named: a file that none of the rules knows goes to its reader, which has its own words.
"""

from __future__ import annotations

import mmap
import os
import re
import shlex
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from .errors import FileFormatError

HEAD = 8192
# a table or a key of TOML at the beginning of a line
_TOML = re.compile(r"^\s*(?:\[([\w.\"]+)\]|(\w+)\s*=)", re.M)
_NUMBER = re.compile(r"\d+(\.\d+)?")


@dataclass(frozen=True)
class Kind:
    """What such a file is, and what takes it; FILE and STEM stand for its name with and without the ending."""

    what: str
    taken: str


KINDS = {
    "scene": Kind("a scene", "`vgonio simulate FILE -o STEM.nc` makes a result of it, `vgonio plan FILE` looks at it"),
    "study": Kind("a study", "`vgonio sweep FILE` simulates its points"),
    "normbox": Kind("a scene of the Normbox", "`vgonio validate FILE` takes it"),
    "surface": Kind(
        "a height field",
        "`vgonio surface info FILE` shows it, and a scene takes it as [surface] file",
    ),
    "measured": Kind(
        "a measured BRDF",
        "`vgonio measured info`, `compare`, `fit` and `render` take it, and a scene as [measured] file",
    ),
    "counts": Kind("a table of counts", "`vgonio measured calibrate FILE` makes a BRDF of it"),
    "readings": Kind("a table of readings of a display", "`vgonio display characterise FILE` takes it"),
    "colours": Kind("a list of colours to show", "measure them, and give the spectra to `vgonio display characterise`"),
    "result": Kind("a result", "`vgonio report`, `explore`, `compare`, `fit` and `render` take it"),
    "fit": Kind("a fitted model", "`vgonio render FILE` takes it"),
    "page": Kind("a page", "a browser shows it; the result that it was made of is what commands take"),
    "picture": Kind("a picture", "no command takes pictures"),
}


def kind_of(path: str | os.PathLike[str]) -> str | None:
    """One of KINDS, or None where it is not certain; no file that is damaged or cannot be read is an error."""
    path = Path(path)
    try:
        if not path.is_file():  # a pipe would be waited for
            return None
        with open(path, "rb") as stream:
            head = stream.read(HEAD)
        return _by_content(path, head)
    except (OSError, ValueError, zipfile.BadZipFile, NotImplementedError, RecursionError):
        return None


def require_kind(path: str | os.PathLike[str], *wanted: str) -> None:
    """FileFormatError for a file that is certainly of another kind than those `wanted`, with the command that takes it.

    What is no regular file is left to `files.require_file`.
    """
    path = Path(path)
    found = kind_of(path)
    if found is None or found in wanted:
        return
    taken = KINDS[found].taken.replace("FILE", shlex.quote(str(path))).replace("STEM", shlex.quote(path.stem))
    raise FileFormatError(f"{path} is {KINDS[found].what}, and {_listed(wanted)} is needed here: {taken}")


def _listed(wanted: Iterable[str]) -> str:
    return " or ".join(KINDS[k].what for k in wanted)


def _by_content(path: Path, head: bytes) -> str | None:
    if head.startswith(b"\x89HDF\r\n\x1a\n"):
        return _hdf5(path)
    if head.startswith(b"PK\x03\x04"):
        return _archive(path)
    if head.startswith((b"\x89PNG", b"\xff\xd8\xff", b"%PDF")):
        return "picture"
    if head.startswith(b"tensor_file\x00"):
        return "measured"
    if b"\x00" in head:
        return None
    return _by_text(path, head.decode("utf-8-sig", errors="replace"))


def _hdf5(path: Path) -> str | None:
    """A result says so in an attribute, wherever HDF5 put it; what other programs wrote is not ours to name."""
    with open(path, "rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
        return "result" if content.find(b"vgonio result") >= 0 else None


def _archive(path: Path) -> str | None:
    with zipfile.ZipFile(path) as archive:
        names = set(archive.namelist())
    return "surface" if {"z.npy", "pitch_um.npy"} <= names or "main.xml" in names else None


def _by_text(path: Path, text: str) -> str | None:
    suffix = path.suffix.lower()
    if text.lstrip()[:14].lower().startswith(("<!doctype html", "<html")):
        return "page"
    if suffix == ".toml":
        return _toml(text)
    if suffix == ".json":
        return _json(text)
    return _table(text) if suffix in (".csv", ".tsv") else None


def _toml(text: str) -> str | None:
    names = {(table or key).split(".")[0].strip('"') for table, key in _TOML.findall(text)}
    if {"scene", "vary"} <= names:
        return "study"
    if {"surface", "material"} <= names:
        return "scene"
    return "normbox" if "surface" not in names and names & {"render", "virtual", "box"} else None


def _json(text: str) -> str | None:
    if re.match(r"\s*\{", text) and re.search(r'"format"\s*:\s*"vgonio fit"', text):
        return "fit"
    return "measured" if re.match(r"\s*\[\s*\{", text) and '"wavelengths"' in text else None


def _table(text: str) -> str | None:
    if text.startswith("# vgonio surface"):
        return "surface"
    line = next((x for x in text.splitlines() if x.strip() and not x.startswith("#")), "")
    head = [h.strip().strip('"').lower() for h in re.split(r"[,;\t]", line)]
    angles = any(h.startswith("theta_i") for h in head)
    if angles and any(h.startswith("counts") for h in head):
        return "counts"
    if angles and any(h.startswith("brdf") for h in head):
        return "measured"
    after = head[1:] if head[:1] == ["eye"] else head
    if after[:3] != ["r", "g", "b"]:
        return None
    return "readings" if after[3:] and all(map(_NUMBER.fullmatch, after[3:])) else None if after[3:] else "colours"
