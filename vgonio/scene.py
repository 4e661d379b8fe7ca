"""The scene file: one TOML file says what is wanted, and is checked as a whole before any work starts.

A table that is absent is work that is not done. Every mistake is one line: the table and key, what was got, what is
allowed. Values are checked by the very functions that use them later, so that no rule stands in two places.
"""

from __future__ import annotations

import json
import math
import os
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationError,
    field_validator,
    model_validator,
)

from . import __version__
from .directions import Detector as DetectorCheck
from .directions import Incoming, angle_list, wavelength_list
from .errors import FileFormatError, InputError, nearest
from .surface.filter import FILLS, LEVELS
from .surface.heightfield import pitch_pair
from .surface.interpolant import KINDS
from .units import to_um

THEORIES = ("kirchhoff", "generalized-harvey-shack", "harvey-shack")
LATER_THEORIES = ("iterated-kirchhoff", "full-wave")
METHODS = ("auto", "nufft", "opencl", "reference")
GENERATORS = ("flat", "sinusoid", "lamellar", "blazed", "gaussian", "power_law", "sandblasted")
MAX_LIST = 100_000


# ---- kinds of values
def expand(value: Any) -> Any:
    """A list of numbers from a number, a list or {start, stop, step}, the stop included."""
    if isinstance(value, Mapping):
        return _range(dict(value))
    return (
        [value]
        if isinstance(value, (int, float)) and not isinstance(value, bool)
        else list(value)
        if _listlike(value)
        else value
    )


def _listlike(value: Any) -> bool:
    return isinstance(value, (tuple, range)) or hasattr(value, "tolist")


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
    if step == 0 or not all(map(math.isfinite, (start, stop, step))) or (stop - start) * step < 0:
        raise InputError(
            f"the range from {start:g} to {stop:g} by {step:g} is empty: step has to lead from start to stop"
        )
    count = math.floor((stop - start) / step * (1 + 1e-12) + 1e-9) + 1
    if count > MAX_LIST:
        raise InputError(f"the range from {start:g} to {stop:g} by {step:g} has {count} values: allowed are {MAX_LIST}")
    return [round(start + i * step, 9) for i in range(count)]


def _whole(value: Any) -> Any:
    """TOML's 1e6 is a float: take it as a count where it is whole."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def one_of(allowed: Iterable[str], later: Iterable[str] = ()) -> AfterValidator:
    """A word out of `allowed`; a word of `later` is refused as not offered yet."""
    allowed = tuple(allowed)

    def check(value: str) -> str:
        if value in later:
            raise InputError(f"{not_offered(repr(value))}; offered: {', '.join(map(repr, allowed))}")
        if value not in allowed:
            raise InputError(f"{value!r} is unknown: {nearest(value, allowed)}")
        return value

    return AfterValidator(check)


def not_offered(what: str) -> str:
    return f"{what} is not offered by this version of vgonio ({__version__})"


def _checked(function: Any) -> AfterValidator:
    """A value that `function` accepts, kept as it is."""

    def check(value: Any) -> Any:
        if value is not None:
            function(value)
        return value

    return AfterValidator(check)


Numbers = Annotated[list[float], BeforeValidator(expand)]
Count = Annotated[int, BeforeValidator(_whole), Field(ge=1)]
Share = Annotated[float, Field(gt=0, lt=1)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Pitch = Annotated[float | list[float], _checked(pitch_pair)]
# settings that later versions offer: false and absent mean the same
Later = Any


class Table(BaseModel):
    """Strict: no unknown keys, no strings for numbers; unchangeable once read."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    @classmethod
    def refuse(cls, value: Any, name: str) -> None:
        if value is not None and value is not False:
            raise InputError(not_offered(f"{name} = {json.dumps(value, default=str)}"))


# ---- the tables
class Filter(Table):
    s_um: Positive | None = None
    l_um: Positive | None = None


class Surface(Table):
    file: str | None = None
    generate: dict[str, Any] | None = None
    pitch_um: Pitch | None = None
    height_unit: Annotated[str, _checked(to_um)] | None = None
    interpolation: Annotated[str, one_of(KINDS)] | None = None
    periodic: bool | None = None
    crop_um: Positive | list[Positive] | None = None
    level: Annotated[str, one_of(LEVELS)] | None = None
    filter: Filter | None = None
    outliers: Annotated[float, Field(ge=3, allow_inf_nan=False)] | None = None
    fill: Annotated[str, one_of(("error", *FILLS))] = "error"

    @model_validator(mode="after")
    def _one_source(self) -> Surface:
        if (self.file is None) == (self.generate is None):
            got = "both" if self.file is not None else "neither"
            raise InputError(f"give either file or generate, got {got}")
        if self.generate is not None:
            check_generator(self.generate)
            for key in ("pitch_um", "height_unit"):
                if getattr(self, key) is not None:
                    raise InputError(f"{key} overrides a file's: for a generated surface give generate.{key}")
        return self


class Material(Table):
    name: str | None = None
    file: str | None = None

    @model_validator(mode="after")
    def _one_source(self) -> Material:
        if (self.name is None) == (self.file is None):
            raise InputError('give either name (for example "Al") or file (a refractiveindex.info YAML or CSV)')
        return self


class Light(Table):
    wavelength_nm: Annotated[Numbers, _checked(wavelength_list)]
    theta_i_deg: Annotated[Numbers, _checked(lambda a: angle_list(a, "theta_i_deg"))]
    phi_i_deg: float = 0.0
    divergence_deg: float = 0.0
    polarisation: str = "unpolarised"
    coherence_um: float = 30.0

    @model_validator(mode="after")
    def _physical(self) -> Light:
        Incoming(
            self.theta_i_deg,  # type: ignore[arg-type]
            self.phi_i_deg,
            self.coherence_um,
            self.divergence_deg,
            self.polarisation,
        )
        return self


class Detector(Table):
    kind: Annotated[str, one_of(("in-plane", "hemisphere"))] = "in-plane"
    theta_o_deg: Numbers | None = None
    aperture_deg: float = 2.0
    resolution_deg: float | None = None

    @model_validator(mode="after")
    def _physical(self) -> Detector:
        if self.kind == "hemisphere":
            if self.theta_o_deg is not None:
                raise InputError('theta_o_deg is for kind = "in-plane": a hemisphere takes resolution_deg')
            DetectorCheck.hemisphere(5.0 if self.resolution_deg is None else self.resolution_deg)
            return self
        if self.resolution_deg is not None:
            raise InputError('resolution_deg is for kind = "hemisphere": in plane give theta_o_deg')
        if self.theta_o_deg is None:
            raise InputError('theta_o_deg is missing (or kind = "hemisphere")')
        DetectorCheck.in_plane(self.theta_o_deg, self.aperture_deg)
        return self


class Geometric(Table):
    rays: Count = 1_000_000
    tol: Share | None = None
    max_bounces: Count | None = None
    tracer: str = "embree"
    seed: Annotated[int, Field(ge=0)] = 0
    polarised: Later = False

    @model_validator(mode="after")
    def _offered(self) -> Geometric:
        self.refuse(self.polarised, "polarised")
        if self.tracer != "embree":
            raise InputError(f"{not_offered(f'tracer {self.tracer!r}')}; offered: 'embree'")
        return self


class Wave(Table):
    theory: list[Annotated[str, one_of(THEORIES, LATER_THEORIES)]] = ["kirchhoff"]
    method: Annotated[str, one_of(METHODS)] = "auto"
    tol: Share = 1e-3
    shadowing: Later = False
    bounces: Later = None
    window_um: Later = None
    polarised: Later = False

    @field_validator("theory", mode="before")
    @classmethod
    def _list(cls, value: Any) -> Any:
        return [value] if isinstance(value, str) else value

    @model_validator(mode="after")
    def _offered(self) -> Wave:
        for key in ("shadowing", "window_um", "polarised"):
            self.refuse(getattr(self, key), key)
        self.refuse(None if self.bounces == 1 else self.bounces, "bounces")
        if not self.theory or len(set(self.theory)) < len(self.theory):
            raise InputError(f"theory lists nothing or a theory twice: {self.theory}")
        return self


class Measured(Table):
    file: str
    format: str | None = None


class Output(Table):
    file: str | None = None
    report: str | None = None


class Scene(Table):
    """A checked scene. Relative paths in it are relative to `folder`."""

    title: str = ""
    surface: Surface | None = None
    material: Material | None = None
    light: Light | None = None
    detector: Detector | None = None
    geometric: Geometric | None = None
    wave: Wave | None = None
    measured: Measured | None = None
    output: Output = Output()

    _folder: Path = PrivateAttr(default=Path("."))
    _name: str = PrivateAttr(default="scene")

    @model_validator(mode="after")
    def _complete(self) -> Scene:
        simulated = [name for name in ("geometric", "wave") if getattr(self, name) is not None]
        for table in ("surface", "material", "light", "detector") if simulated else ():
            if getattr(self, table) is None:
                raise InputError(f"[{simulated[0]}] needs the table [{table}], which is missing")
        if not simulated and self.measured is None and self.surface is None:
            raise InputError("nothing to do: give [surface] with [geometric] or [wave], or [measured]")
        return self

    @property
    def name(self) -> str:
        """The title, or the name of the scene file."""
        return self.title or self._name

    @property
    def folder(self) -> Path:
        return self._folder

    def resolve(self, name: str) -> Path:
        """Path of a file that the scene names."""
        return Path(os.path.normpath(self._folder / Path(name).expanduser()))

    @property
    def inputs(self) -> list[Path]:
        """Files that the scene reads."""
        named = [t.file for t in (self.surface, self.material, self.measured) if t is not None and t.file is not None]
        return [self.resolve(f) for f in named]

    def to_dict(self) -> dict[str, Any]:
        """All settings, defaults included, as plain values; `load_scene` accepts it again."""
        return self.model_dump(mode="json", exclude_none=True)

    def to_json(self) -> str:
        return self.model_dump_json(exclude_none=True)


def check_generator(generate: Mapping[str, Any]) -> None:
    """Raise InputError unless `generate` names a kind of surface and only parameters that it takes."""
    import inspect

    from . import surface

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


# ---- reading
def load_scene(source: str | os.PathLike[str] | Mapping[str, Any] | Scene, overrides: Iterable[str] = ()) -> Scene:
    """The scene of a TOML file, of a dictionary of the same shape, or a scene again, with overrides "table.key=value".

    An override's value is TOML; a bare word is taken as a string. Raises FileFormatError for a file that cannot be
    read and InputError, one line, for what is wrong in it.
    """
    overrides = list(overrides)
    if isinstance(source, Scene):
        if not overrides:
            return source
        return _build(_overridden(source.to_dict(), overrides), source.folder, source._name, "scene")
    if isinstance(source, Mapping):
        return _build(_overridden(dict(source), overrides), Path("."), "scene", "scene")
    path = Path(source)
    return _build(_overridden(_read(path), overrides), path.parent, path.stem, path.name)


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise FileFormatError(
            f"no such scene file: {path} (`vgonio init {path.name}` writes one to start from)"
        ) from None
    except OSError as e:
        raise FileFormatError(f"cannot read scene {path}: {e.strerror or e}") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as e:
        raise FileFormatError(f"{path} is no valid TOML file: {' '.join(str(e).split())}") from None


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
    except tomllib.TOMLDecodeError:
        pass
    if not value or value[0] in "[{\"'+-0123456789" and not _looks_like_path(value):
        raise InputError(f"--set {text!r}: {value!r} is no TOML value (quote strings, write lists as [1, 2])")
    return keys, value


def _looks_like_path(value: str) -> bool:
    return value[0] not in "[{\"'" and any(c.isalpha() for c in value)


def _overridden(data: dict[str, Any], overrides: Iterable[str]) -> dict[str, Any]:
    for text in overrides:
        keys, value = parse_override(text)
        data = _with(data, keys, value, text)
    return data


def _with(data: Mapping[str, Any], keys: list[str], value: Any, text: str) -> dict[str, Any]:
    """`data` with one nested key replaced; nothing is changed in place."""
    if len(keys) == 1:
        return {**data, keys[0]: value}
    inner = data.get(keys[0], {})
    if not isinstance(inner, Mapping):
        raise InputError(f"--set {text!r}: {keys[0]} is {inner!r}, not a table")
    return {**data, keys[0]: _with(inner, keys[1:], value, text)}


def _build(data: Mapping[str, Any], folder: Path, name: str, shown: str) -> Scene:
    try:
        scene = Scene.model_validate(dict(data))
    except ValidationError as e:
        raise InputError(f"{shown}: {first_error(e)}") from None
    scene._folder, scene._name = folder, name
    return scene


# ---- from pydantic's list of errors to one line
def first_error(error: ValidationError) -> str:
    """The first mistake in one line, unknown keys before everything else, and how many more there are."""
    errors = error.errors(include_url=False)
    errors.sort(key=lambda e: e["type"] != "extra_forbidden")
    places = {_place(e["loc"]) for e in errors}
    more = f" (and {len(places) - 1} more)" if len(places) > 1 else ""
    return " ".join(_line(errors[0]).split()) + more


def _place(loc: tuple[int | str, ...]) -> str:
    # the parts of a union and list positions are pydantic's, not the user's
    return ".".join(str(p) for p in loc if isinstance(p, str) and not p.startswith(("list[", "float", "function-")))


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
    *tables, key = (str(p) for p in loc)
    model = TABLES[".".join(tables)] if tables else Scene
    where = f"in [{'.'.join(tables)}]" if tables else "at the top of the scene"
    owners = [name for name, table in TABLES.items() if key in table.model_fields and name != ".".join(tables)]
    what = "table or key" if not tables else "key"
    if key not in Scene.model_fields and owners:
        return f"unknown {what} {key!r} {where}: it belongs to [{owners[0]}]"
    if tables and key in Scene.model_fields:
        return f"unknown {what} {key!r} {where}: it is a table or key of its own, at the top of the scene"
    return f"unknown {what} {key!r} {where}: {nearest(key, model.model_fields)}"


TABLES: dict[str, type[Table]] = {
    "surface": Surface,
    "surface.filter": Filter,
    "material": Material,
    "light": Light,
    "detector": Detector,
    "geometric": Geometric,
    "wave": Wave,
    "measured": Measured,
    "output": Output,
}
