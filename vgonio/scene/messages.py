"""From pydantic's list of errors to one line: the table and key, what was got, what is allowed."""

from __future__ import annotations

from typing import Any

from pydantic import ValidationError

from ..errors import nearest
from .tables import TABLES, Scene


def first_error(error: ValidationError) -> str:
    """The first mistake in one line, unknown keys before everything else, and how many more there are."""
    errors = error.errors(include_url=False)
    errors.sort(key=lambda e: e["type"] != "extra_forbidden")
    places = {_place(e["loc"]) for e in errors}
    more = f" (and {len(places) - 1} more)" if len(places) > 1 else ""
    return " ".join(_line(errors[0]).split()) + more


def _place(loc: tuple[int | str, ...]) -> str:
    # the parts of a union and list positions are pydantic's, not the user's
    return ".".join(
        str(p) for p in loc if isinstance(p, str) and not p.startswith(("list[", "float", "constrained-", "function-"))
    )


def _line(e: Any) -> str:
    place, kind = _place(e["loc"]), e["type"]
    if kind == "extra_forbidden":
        return _unknown(e["loc"])
    if kind == "missing":
        return f"{place} is missing"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"[{place}] has to be a table, got {e['input']!r}"
    if kind == "value_error":
        message = str(e["ctx"]["error"])
        key = place.rpartition(".")[2]
        return message if not place or key in message.split(" ")[:1] else f"{place}: {message}"
    return f"{place} = {e['input']!r}: {e['msg'][0].lower()}{e['msg'][1:]}"


def _unknown(loc: tuple[int | str, ...]) -> str:
    *tables, key = (str(p) for p in loc if isinstance(p, str))  # a position in a list is not a name
    model = TABLES[".".join(tables)] if tables else Scene
    where = f"in [{'.'.join(tables)}]" if tables else "at the top of the scene"
    owners = [name for name, table in TABLES.items() if key in table.model_fields and name != ".".join(tables)]
    what = "table or key" if not tables else "key"
    if key not in Scene.model_fields and owners:
        return f"unknown {what} {key!r} {where}: it belongs to [{owners[0]}]"
    if tables and key in Scene.model_fields:
        return f"unknown {what} {key!r} {where}: it is a table or key of its own, at the top of the scene"
    return f"unknown {what} {key!r} {where}: {nearest(key, model.model_fields)}"
