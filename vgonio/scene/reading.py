"""Scene files, dictionaries and overrides become checked scenes."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import InputError
from ..file_kinds import require_kind
from ..files import settings_of
from .messages import first_error
from .tables import Scene


def load_scene(source: str | os.PathLike[str] | Mapping[str, Any] | Scene, overrides: Iterable[str] = ()) -> Scene:
    """The scene of a TOML file, of a dictionary of the same shape, or a scene again, with overrides "table.key=value".

    An override's value is TOML; a bare word is taken as a string. Raises FileFormatError for a file that cannot be
    read and InputError, one line, for what is wrong in it.
    """
    overrides = list(overrides)
    if isinstance(source, Scene):
        if not overrides:
            return source
        return _build(_overridden(source.to_dict(), overrides), source.folder, source._name, source._shown)
    if isinstance(source, Mapping):
        return _build(_overridden(dict(source), overrides), Path("."), "scene", "scene")
    path = Path(source)
    return _build(_overridden(_read(path), overrides), path.parent, path.stem, path.name)


def changed_scene(scene: Scene, values: Mapping[str, Any]) -> Scene:
    """The scene with some keys ("table.key") at other values; InputError for what a scene does not allow."""
    data: Mapping[str, Any] = scene.to_dict()
    for key, value in values.items():
        data = _with(data, key.split("."), value, f"{key} = {value!r}")
    return _build(data, scene.folder, scene._name, scene._shown)


def without_output(scene: Scene) -> Scene:
    """The scene without its [output]: simulated, it writes nothing."""
    data = {k: v for k, v in scene.to_dict().items() if k != "output"}
    return _build(data, scene.folder, scene._name, scene._shown)


def _read(path: Path) -> dict[str, Any]:
    require_kind(path, "scene")
    return settings_of(path, "scene file", f" (`vgonio init {path.name}` writes one to start from)")


def parse_override(text: str) -> tuple[list[str], Any]:
    """("table.key=value") → (["table", "key"], value)."""
    key, equals, value = text.partition("=")
    keys = [k.strip() for k in key.split(".")]
    if not equals or not all(keys):
        raise InputError(f"--set {text!r} is not of the form table.key=value")
    value = value.strip()
    try:
        parsed = tomllib.loads(f"value = {value}")
        if list(parsed) == ["value"]:
            return keys, parsed["value"]
    except (ValueError, RecursionError):  # no TOML, or a number or a date that cannot be
        pass
    if not value or value[0] in "[{\"'+-0123456789" and not _looks_like_path(value):
        raise InputError(f"--set {text!r}: {value!r} is no TOML value (quote strings, write lists as [1, 2])")
    return keys, value


def _looks_like_path(value: str) -> bool:
    return value[0] not in "[{\"'" and any(c.isalpha() for c in value)


def _overridden(data: dict[str, Any], overrides: Iterable[str]) -> dict[str, Any]:
    for text in overrides:
        keys, value = parse_override(text)
        data = _with(data, keys, value, f"--set {text!r}")
    return data


def _with(data: Mapping[str, Any], keys: list[str], value: Any, text: str) -> dict[str, Any]:
    """`data` with one nested key replaced; nothing is changed in place."""
    if len(keys) == 1:
        return {**data, keys[0]: value}
    inner = data.get(keys[0], {})
    if not isinstance(inner, Mapping):
        raise InputError(f"{text}: {keys[0]} is {inner!r}, not a table")
    return {**data, keys[0]: _with(inner, keys[1:], value, text)}


def _build(data: Mapping[str, Any], folder: Path, name: str, shown: str) -> Scene:
    try:
        scene = Scene.model_validate(dict(data))
    except ValidationError as e:
        raise InputError(f"{shown}: {first_error(e)}") from None
    scene._folder, scene._name, scene._shown = folder, name, shown
    return scene
