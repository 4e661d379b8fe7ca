"""The JSON schema of a study, made of that of a scene: what may vary is what a scene has, at values that it takes.

A study names it in its first line, `#:schema ./vgonio-study.schema.json`. A value that it marks makes points that fail;
a study of which every point fails is refused by `load_study` as well.
"""

from __future__ import annotations

from typing import Any

from ..scene.schema import scene_schema
from ..scene.tables import TABLES
from .study import KEPT

STUDY_SCHEMA_FILE = "vgonio-study.schema.json"
STUDY_SCHEMA_LINE = f"#:schema ./{STUDY_SCHEMA_FILE}"
Json = dict[str, Any]

NUMBER: Json = {"type": "number"}
RANGE: Json = {
    "type": "object",
    "properties": {"start": NUMBER, "stop": NUMBER, "step": {"type": "number", "not": {"const": 0}}},
    "required": ["start", "stop", "step"],
    "additionalProperties": False,
}
# parameters of generated surfaces depend on the kind, which may vary itself
GENERATED = r"\w+"


def study_schema() -> Json:
    """The schema of a study file as a dictionary ready for JSON, draft 7."""
    scene = scene_schema()
    keys = _keys(scene["$defs"])
    vary: Json = _tables(keys)
    vary["properties"] |= keys
    vary["patternProperties"] = {rf"^surface\.generate\.{GENERATED}$": _values({})}
    vary |= {"minProperties": 1, "description": 'what varies: "table.key" = list or { start, stop, step }'}
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "vgonio study",
        "description": "A study of vgonio: a scene and what varies in it.",
        "type": "object",
        "properties": {
            "scene": {"type": "string", "description": "the scene file, relative to this one"},
            "title": {"type": "string", "description": "of the result"},
            "zip": {
                "type": "boolean",
                "default": False,
                "description": "values side by side instead of all combinations",
            },
            "vary": vary,
        },
        "required": ["scene", "vary"],
        "additionalProperties": False,
        "$defs": scene["$defs"],
    }


def _keys(defs: Json) -> Json:
    """ "table.key" → what it may be: a list of what the key of a scene may be, or a range."""
    found: Json = {}
    for name, model in TABLES.items():
        if name.partition(".")[0] in KEPT:
            continue
        for key, value in defs[model.__name__]["properties"].items():
            found[f"{name}.{key}"] = _values(value)
    return found


def _values(each: Json) -> Json:
    described = {"description": each["description"]} if "description" in each else {}
    return {"anyOf": [{"type": "array", "items": each, "minItems": 1}, RANGE], **described}


def _tables(keys: Json) -> Json:
    """The same keys without quotes, as TOML nests them: vary.light.coherence_um."""
    made: Json = {}
    for key, value in keys.items():
        name, _, last = key.rpartition(".")
        made.setdefault(name, _table())["properties"][last] = value
    generated = _table() | {"patternProperties": {f"^{GENERATED}$": _values({})}}
    for name, table in [*made.items(), ("surface.generate", generated)]:
        parent, _, last = name.rpartition(".")
        if parent:
            # such a table may vary as a whole as well, as a list of tables
            owner = made[parent]["properties"]
            owner[last] = {"anyOf": [owner[last], table]}
    return _table() | {"properties": {name: table for name, table in made.items() if "." not in name}}


def _table() -> Json:
    return {"type": "object", "properties": {}, "additionalProperties": False}
