"""The JSON schema of a scene: with it an editor completes keys, shows what they mean and marks mistakes.

A scene names it in its first line, `#:schema ./vgonio.schema.json`, which Taplo ("Even Better TOML") and others read.
Keys, types, words and ranges come from the models that check a scene, descriptions from the comments of the template
of `vgonio init`. What a schema cannot say (files that exist, grids that fit) is left to `vgonio plan`; what it
refuses, `load_scene` refuses too. Draft 7, which editors know best.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from pydantic import BaseModel

from ..directions import MIN_APERTURE_DEG, POLARISATIONS
from ..units import MICROMETRES
from .tables import TABLES, Scene
from .values import GENERATORS

SCHEMA_FILE = "vgonio.schema.json"
SCHEMA_LINE = f"#:schema ./{SCHEMA_FILE}"
Json = dict[str, Any]

ANGLE: Json = {"exclusiveMinimum": -90, "exclusiveMaximum": 90}
POSITIVE: Json = {"exclusiveMinimum": 0}
# lists that may be a number or a range as well, and what each number has to be
LISTS: dict[str, Json] = {"theta_i_deg": ANGLE, "theta_o_deg": ANGLE, "wavelength_nm": POSITIVE}
# checks that stand in functions (directions.py, units.py), which no schema can look into
RANGES: dict[tuple[str, str], Json] = {
    ("light", "coherence_um"): POSITIVE,
    ("light", "divergence_deg"): {"minimum": 0, "exclusiveMaximum": 90},
    ("light", "polarisation"): {"enum": list(POLARISATIONS)},
    ("detector", "aperture_deg"): {"minimum": MIN_APERTURE_DEG, "maximum": 90},
    ("detector", "resolution_deg"): {"minimum": 0.25, "maximum": 45},
    ("surface", "height_unit"): {"enum": list(MICROMETRES)},
}


def scene_schema() -> Json:
    """The schema of a scene file as a dictionary ready for JSON, draft 7."""
    made = Scene.model_json_schema()
    comments = template_comments()
    models: dict[str, type[BaseModel]] = {"": Scene, **TABLES}
    for name, model in models.items():
        table = made["$defs"][model.__name__] if name else made
        shown = comments.get(name.rpartition(".")[0] or name, {})
        table.pop("title", None)
        table.pop("description", None)
        if "" in shown and "." not in name:
            table["description"] = shown[""]
        parent = name.rpartition(".")[2] if "." in name else ""
        for key, value in table["properties"].items():
            description = shown.get(key) or shown.get(parent)
            table["properties"][key] = _property(name, key, value, description)
    _rules(made, {name: made["$defs"][model.__name__] for name, model in TABLES.items()})
    made["description"] = "A scene of vgonio: what is simulated, and how."
    return {"$schema": "http://json-schema.org/draft-07/schema#", "title": "vgonio scene", **made}


# ---- one key
def _property(table: str, key: str, value: Json, description: str | None) -> Json:
    """A key's schema without pydantic's nulls and titles; TOML has no null, a key is there or not."""
    kept = {k: v for k, v in value.items() if k != "title" and not (k == "default" and v is None)}
    kinds = [_plain(k) for k in kept.pop("anyOf", [kept]) if k.get("type") != "null"]
    lists = any(k.get("type") == "array" for k in kinds)
    if key in LISTS and lists:
        kinds = _numbers({} if table == "measured" else LISTS[key])  # its reader checks a measurement's
    elif (table, key) == ("wave", "theory"):
        kinds = [{**kinds[0]["items"]}, {**kinds[0], "minItems": 1, "uniqueItems": True}]
    elif (table, key) == ("material", "film"):
        kinds = [kinds[0]["items"], kinds[0]]
    elif key == "pitch_um":
        kinds = [k | POSITIVE if k["type"] == "number" else k | {"items": k["items"] | POSITIVE} for k in kinds]
    if "$ref" in kinds[0] and len(kinds) == 1:
        return {"$ref": kinds[0]["$ref"]}  # draft 7 reads nothing beside it
    made = {**kinds[0], **RANGES.get((table, key), {})} if len(kinds) == 1 else {"anyOf": kinds}
    if "default" in kept and kept["default"] not in ([], ""):
        made["default"] = kept["default"]
    return made | ({"description": description} if description else {})


def _plain(kind: Json) -> Json:
    names = {"ge": "minimum", "gt": "exclusiveMinimum"}  # of numbers that are rewritten before they are checked
    return {names.get(k, k): v for k, v in kind.items() if k not in ("title", "default", "anyOf")}


def _numbers(each: Json) -> list[Json]:
    """A number, a list of different ones, or a range, which may stop beyond what its last value is allowed to be."""
    number = {"type": "number", **each}
    ends = {"start": number, "stop": {"type": "number"}, "step": {"type": "number", "not": {"const": 0}}}
    listed: Json = {"type": "array", "items": number}
    listed |= {"minItems": 1, "uniqueItems": True} if each else {}
    return [number, listed, _table(ends, list(ends))]


def _table(properties: Mapping[str, Any], required: list[str]) -> Json:
    return {"type": "object", "properties": dict(properties), "required": required, "additionalProperties": False}


# ---- what keys have to do with each other, as the models' own checks say
def _rules(scene: Json, tables: dict[str, Json]) -> None:
    simulated = ["surface", "material", "light", "detector"]
    scene["dependencies"] = {"geometric": simulated, "wave": simulated}
    scene["anyOf"] = [{"required": ["surface"]}, {"required": ["measured"]}]
    for name, pair in (
        ("surface", ("file", "generate")),
        ("material", ("name", "file")),
        ("material.film", ("name", "file")),
    ):
        tables[name]["oneOf"] = [{"required": [key]} for key in pair]
    tables["surface"]["dependencies"] = {"generate": {"not": _any_of("pitch_um", "height_unit")}}
    tables["surface"]["properties"]["generate"] |= _generators()
    hemisphere = {"properties": {"kind": {"const": "hemisphere"}}, "required": ["kind"]}
    tables["detector"] |= {
        "if": hemisphere,
        "then": {"not": _any_of("theta_o_deg")},
        "else": {"required": ["theta_o_deg"], "not": _any_of("resolution_deg")},
    }
    iterated = {"required": ["theory"], "properties": {"theory": _holding("iterated-kirchhoff")}}
    tables["wave"]["dependencies"] = {"window_um": iterated}


def _any_of(*keys: str) -> Json:
    return {"anyOf": [{"required": [key]} for key in keys]}


def _holding(word: str) -> Json:
    return {"anyOf": [{"const": word}, {"type": "array", "contains": {"const": word}}]}


def _generators() -> Json:
    """For each kind of generated surface the parameters of its function."""
    from .. import surface

    cases = []
    for kind in GENERATORS:
        found = inspect.signature(getattr(surface, kind)).parameters
        named = {k: p for k, p in found.items() if p.kind is not p.VAR_KEYWORD}
        needed = [k for k, p in named.items() if p.default is p.empty]
        keys = {k: _parameter(p.default) for k, p in named.items()}
        wanted = {"properties": {"kind": {"const": kind}}}
        cases.append({"if": wanted, "then": _table({"kind": {"const": kind}, **keys}, needed)})
    kinds = {"type": "string", "enum": list(GENERATORS)}
    return {"properties": {"kind": kinds}, "required": ["kind"], "allOf": cases, "additionalProperties": True}


def _parameter(default: Any) -> Json:
    simple = isinstance(default, (bool, int, float, str)) and default == default
    return {"default": default} if simple else {}


# ---- what keys mean
def template_comments() -> dict[str, dict[str, str]]:
    """Comments of the template by table and key; "" is the table's own.

    A key is explained at the end of its line, in the lines of prose above it, or where another key's comment names it.
    """
    text = (files("vgonio") / "template.toml").read_text(encoding="utf-8")
    found: dict[str, dict[str, str]] = {}
    table, prose, mentions = "", "", []
    for line in text.splitlines():
        head = re.match(r"^(?:# )?\[(\w+)\]\s*(?:# (.*))?$", line)
        entry = re.match(r"^(?:# )?(\w+) = (.*?)(?:\s+# (.*))?$", line)
        if head:
            table, prose = head.group(1), ""
            found[table] = {"": head.group(2)} if head.group(2) else {}
        elif entry:
            words = entry.group(3) or prose
            if words:
                found.setdefault(table, {})[entry.group(1)] = words
                mentions.append((table, words))
            prose = ""
        else:
            prose = line.removeprefix("#").strip().rstrip(":")
    for name, words in mentions:
        for key in TABLES[name].model_fields if name else ():
            if re.search(rf"\b{key}\b", words):
                found[name].setdefault(key, words)
    return found
