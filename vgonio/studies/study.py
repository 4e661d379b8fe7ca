"""A study: a scene and what varies in it. A TOML file names both; its points are scenes like any other."""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from .. import __version__
from ..errors import FileFormatError, InputError, VgonioError, nearest
from ..file_kinds import require_kind
from ..files import require_file, settings_of
from ..scene import Scene, changed_scene, expand, load_scene

KEYS = ("scene", "title", "zip", "vary")
# of a scene: a list of them is one point, and an axis of its result
AXES = ("light.theta_i_deg", "light.wavelength_nm", "detector.theta_o_deg")
KEPT = {"output", "title"}  # of a scene: not what a point is
RANGE = {"start", "stop", "step"}
TRIED = 50  # points looked at for one that is valid, before the study is refused as a whole


@dataclass(frozen=True)
class Study:
    """A scene and the values that its keys take: all combinations, or side by side where `zipped`."""

    scene: Scene
    vary: Mapping[str, list[Any]]
    zipped: bool = False
    title: str = ""

    @property
    def shape(self) -> tuple[int, ...]:
        """Points along each key, in the order of the file; one length where they go side by side."""
        lengths = tuple(len(v) for v in self.vary.values())
        return lengths[:1] if self.zipped else lengths

    def __len__(self) -> int:
        return math.prod(self.shape)

    def values(self) -> Iterator[dict[str, Any]]:
        """What each point has, the last key fastest."""
        combined = zip(*self.vary.values()) if self.zipped else itertools.product(*self.vary.values())
        for values in combined:
            yield dict(zip(self.vary, values))

    def point(self, values: Mapping[str, Any]) -> Scene:
        """The scene of one point; InputError where its values are not allowed."""
        return changed_scene(self.scene, values)


def load_study(source: str | os.PathLike[str] | Mapping[str, Any], overrides: Iterable[str] = ()) -> Study:
    """The study of a TOML file, or of a dictionary of the same shape; `overrides` ("table.key=value") change its scene.

    Keys: scene (a file, relative to the study's), [vary] ("table.key" = list or {start, stop, step}), zip, title.
    Raises FileFormatError for a file that cannot be read, InputError for what is wrong in it, for a key that no scene
    has, and where none of the first points is a valid scene.
    """
    data, folder, name = _read(source)
    for key in data:
        if key not in KEYS:
            raise InputError(f"{name}: unknown key {key!r}: {nearest(key, KEYS)}")
    scene = data.get("scene")
    if not isinstance(scene, (str, os.PathLike, Mapping, Scene)):
        raise InputError(f'{name}: scene = "scene.toml" is missing: a study varies a scene')
    base = load_scene(folder / scene if isinstance(scene, (str, os.PathLike)) else scene, overrides)
    zipped, title = data.get("zip", False), data.get("title", "")
    if not isinstance(zipped, bool) or not isinstance(title, str):
        raise InputError(f"{name}: zip has to be true or false, title a text; got {zipped!r}, {title!r}")
    study = Study(base, _vary(data.get("vary"), name), zipped, title or Path(name).stem)
    _check_lengths(study, name)
    _check_points(study, name)
    return study


def _read(source: str | os.PathLike[str] | Mapping[str, Any]) -> tuple[dict[str, Any], Path, str]:
    if isinstance(source, Mapping):
        return dict(source), Path("."), "study"
    path = Path(source)
    require_kind(path, "study")
    return settings_of(path, "study file"), path.parent, path.name


def _vary(table: Any, name: str) -> dict[str, list[Any]]:
    if not isinstance(table, Mapping) or not table:
        raise InputError(f'{name}: [vary] is missing: what varies, as in "surface.generate.rms_um" = [0.5, 1, 2]')
    found = {}
    for key, value in _leaves(table):
        try:
            values = _range(value) if isinstance(value, Mapping) else value
        except InputError as e:
            raise InputError(f"{name}: vary {key!r}: {e}") from None
        if not isinstance(values, list) or not values:
            raise InputError(f"{name}: vary {key!r} needs a list of values or {{start, stop, step}}, got {value!r}")
        if any(isinstance(v, float) and not math.isfinite(v) for v in values):
            raise InputError(f"{name}: vary {key!r} has to hold finite numbers, got {values}")
        if key.split(".")[0] in KEPT:
            raise InputError(f"{name}: {key!r} does not change what a point computes: points are stored by the sweep")
        _check_axis(key, values, name)
        found[key] = values
    return found


def _check_axis(key: str, values: list[Any], name: str) -> None:
    """Points with an angle each would be laid out over all angles, empty but for the diagonal."""
    if key not in AXES or len(values) < 2:
        return
    lengths = {len(expand(v)) if isinstance(v, Mapping) else len(v) if isinstance(v, list) else 0 for v in values}
    if 0 in lengths:
        raise InputError(
            f"{name}: vary {key!r}: its values are an axis of each result: give the scene the list, {key} = "
            f"{json.dumps(values)[:60]}, and do not vary it; lists of equal length may vary, [[0, 30], [0, 60]]"
        )
    if len(lengths) > 1:
        raise InputError(f"{name}: vary {key!r}: lists, which are axes of the results, need equal length, got {values}")


def _range(value: Mapping[str, Any]) -> list[Any]:
    """Whole numbers stay whole: a seed is no 1.0."""
    numbers = expand(value)
    return [int(n) for n in numbers] if all(isinstance(v, int) for v in value.values()) else numbers


def _leaves(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Quoted "a.b" and TOML's own a.b mean the same."""
    for key, value in table.items():
        if isinstance(value, Mapping) and not set(value) <= RANGE:
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _check_lengths(study: Study, name: str) -> None:
    """Side by side, every key has a value for each point; in a grid no value may come twice."""
    lengths = {k: len(v) for k, v in study.vary.items()}
    for key, values in () if study.zipped else study.vary.items():
        if len({json.dumps(v, sort_keys=True, default=str) for v in values}) < len(values):
            raise InputError(f"{name}: vary {key!r} lists a value twice")
    if study.zipped and len(set(lengths.values())) > 1:
        raise InputError(f"{name}: zip = true takes values side by side, but their numbers differ: {lengths}")


def _check_points(study: Study, name: str) -> None:
    """A single bad value is that point's failure; where every point fails, something is wrong with the study."""
    first: VgonioError | None = None
    for values in itertools.islice(study.values(), TRIED):
        try:
            study.point(values)
            return
        except VgonioError as e:
            first = first or e
    raise InputError(f"{name}: no point of it is a valid scene: {first}")


# ---- the identity of a point
def content_key(scene: Scene) -> str:
    """Name of a point's result: what it computes, the bytes of the files it reads, and the version that computes it.

    32 hexadecimal digits of a SHA-256. Title and output do not count. FileFormatError where an input is missing.
    """
    content = scene.to_dict()
    for key in ("title", "output"):
        content.pop(key, None)
    named = _with_digests(content, scene)
    return hashlib.sha256(json.dumps([named, __version__], sort_keys=True).encode()).hexdigest()[:32]


def _with_digests(value: Any, scene: Scene) -> Any:
    if isinstance(value, list):
        return [_with_digests(v, scene) for v in value]
    if not isinstance(value, Mapping):
        return value
    return {k: _digest(scene.resolve(v)) if k == "file" else _with_digests(v, scene) for k, v in value.items()}


def _digest(path: Path) -> str:
    require_file(path, "input file")
    try:
        found = path.stat()
        return _digest_of(path, found.st_mtime_ns, found.st_size)
    except OSError as e:
        raise FileFormatError(f"cannot read {path}: {e.strerror or e}") from None


@lru_cache(maxsize=4096)
def _digest_of(path: Path, changed: int, size: int) -> str:
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
