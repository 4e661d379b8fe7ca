"""Kinds of values in a scene: ranges, words out of a list, parameters of generators."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import AfterValidator

from .. import __version__
from ..errors import InputError, nearest

GENERATORS = ("flat", "sinusoid", "lamellar", "blazed", "gaussian", "power_law", "sandblasted")
MAX_LIST = 100_000


def expand(value: Any) -> Any:
    """A list of numbers from a number, a list or {start, stop, step}, the stop included."""
    if isinstance(value, Mapping):
        return _range(dict(value))
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return [value]
    listlike = isinstance(value, (tuple, range)) or hasattr(value, "tolist")
    return list(value) if listlike else value


def _range(value: dict[str, Any]) -> list[float]:
    for key in value:
        if key not in ("start", "stop", "step"):
            raise InputError(f"unknown key {key!r} in a range: {nearest(key, ('start', 'stop', 'step'))}")
    try:
        start, stop, step = (float(value[k]) for k in ("start", "stop", "step"))
    except KeyError as e:
        raise InputError(f"a range needs start, stop and step: {e.args[0]} is missing") from None
    except (TypeError, ValueError):
        raise InputError(f"a range needs numbers for start, stop and step, got {value}") from None
    if not all(map(math.isfinite, (start, stop, step))):
        raise InputError(f"a range needs finite numbers for start, stop and step, got {value}")
    if step == 0 or (stop - start) * step < 0:
        raise InputError(
            f"the range from {start:g} to {stop:g} by {step:g} is empty: step has to lead from start to stop"
        )
    steps = (stop - start) / step * (1 + 1e-12) + 1e-9
    if steps >= MAX_LIST:
        raise InputError(
            f"the range from {start:g} to {stop:g} by {step:g} has {steps + 1:.6g} values: allowed are {MAX_LIST}"
        )
    count = math.floor(steps) + 1
    return [round(start + i * step, 9) for i in range(count)]


def whole(value: Any) -> Any:
    """TOML's 1e6 is a float: take it as a count where it is whole."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


@dataclass(frozen=True, slots=True)
class Words(AfterValidator):
    """A check of a word that tells a JSON schema which words there are."""

    allowed: tuple[str, ...] = ()

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        return {**handler(core), "enum": list(self.allowed)}


def one_of(allowed: Iterable[str], later: Iterable[str] = ()) -> AfterValidator:
    """A word out of `allowed`; a word of `later` is refused as not offered yet."""
    allowed = tuple(allowed)

    def check(value: str) -> str:
        if value in later:
            raise InputError(f"{not_offered(repr(value))}; offered: {', '.join(map(repr, allowed))}")
        if value not in allowed:
            raise InputError(f"{value!r} is unknown: {nearest(value, allowed)}")
        return value

    return Words(check, allowed)


def not_offered(what: str) -> str:
    return f"{what} is not offered by this version of vgonio ({__version__})"


def checked(function: Any) -> AfterValidator:
    """A value that `function` accepts, kept as it is."""

    def check(value: Any) -> Any:
        if value is not None:
            function(value)
        return value

    return AfterValidator(check)


def check_generator(generate: Mapping[str, Any]) -> None:
    """Raise InputError unless `generate` names a kind of surface and only parameters that it takes."""
    from .. import surface

    kind = generate.get("kind")
    if kind not in GENERATORS:
        raise InputError(f"generate.kind = {kind!r} is unknown: {nearest(str(kind), GENERATORS)}")
    allowed = inspect.signature(getattr(surface, kind)).parameters
    for key in generate:
        if key != "kind" and key not in allowed:
            raise InputError(f"unknown key {key!r} in surface.generate of kind {kind!r}: {nearest(key, allowed)}")
    missing = [
        k for k, p in allowed.items() if p.default is p.empty and p.kind is not p.VAR_KEYWORD and k not in generate
    ]
    if missing:
        raise InputError(f"surface.generate of kind {kind!r} needs {', '.join(missing)}")
