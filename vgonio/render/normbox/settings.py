"""The settings of a validation: a checked TOML file that names light, wall, patches and reference, and says how."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ...errors import InputError, nearest, whole
from ...file_kinds import require_kind
from ...files import settings_of
from ..appearance import KNOWN
from .box import ANGLES_DEG, Box, check_angle

PATCHES = tuple(range(1, 25))
# Mitsuba's resolution in the thesis: 200 samples between 360 and 830 nm
WAVELENGTHS = 200
T = TypeVar("T")


@dataclass(frozen=True)
class Files:
    """Names of the files, relative to the scene: `patches` holds {number}, as in "patch_{number:02d}.json"."""

    light: str
    walls: str
    patches: str
    reference: str


@dataclass(frozen=True)
class Fit:
    """Models to fit and predict with; the first is the plain one that the others are held against.

    models : names of `vgonio.models`, "+k_s" and "+c" free the specular albedo and the offset as well:
    "cook-torrance-1982" is thesis 4.7, "cook-torrance-1982+k_s+c" is 2.23 with 3.1, "clausen-2022" is 4.8
    exponent : w of the cost function (thesis 3.2);  starts : of the search
    """

    models: tuple[str, ...] = ("cook-torrance-1982", "clausen-2022")
    exponent: float = 1.0
    starts: int = 2

    def __post_init__(self) -> None:
        if not self.models or len(set(self.models)) < len(self.models):
            raise InputError(f"models = {list(self.models)}: a list without repetition is needed")
        for name in self.models:
            fit_choice(name)
        whole("starts", self.starts, 1, 1000)


def fit_choice(name: str) -> tuple[str, tuple[str, ...], bool]:
    """("cook-torrance-1982", ("k_d", "k_s"), True) of "cook-torrance-1982+k_s+c"; InputError where it means nothing."""
    model, *more = str(name).split("+")
    if model not in KNOWN:
        raise InputError(f"model {model!r} cannot be rendered by formula: {nearest(model, KNOWN)}")
    for word in more:
        if word not in ("k_s", "c") or word not in KNOWN[model]:
            raise InputError(
                f"{name!r}: {word!r} is nothing that {model} can free besides: {nearest(word, ('k_s', 'c'))}"
            )
    return model, ("k_d", "k_s") if "k_s" in more else ("k_d",), "c" in more


@dataclass(frozen=True)
class Render:
    """samples : paths per pixel and group of four wavelengths;  wavelengths : how many, over what all spectra share;
    max_depth : of the paths, −1 for all"""

    patches: tuple[int, ...] = PATCHES
    angles_deg: tuple[float, ...] = ANGLES_DEG
    samples: int = 64
    wavelengths: int = WAVELENGTHS
    variant: str = "auto"
    seed: int = 0
    max_depth: int = -1

    def __post_init__(self) -> None:
        if not self.patches or len(set(self.patches)) < len(self.patches):
            raise InputError(f"[render] patches = {list(self.patches)}: a list without repetition is needed")
        if not self.angles_deg or len(set(self.angles_deg)) < len(self.angles_deg):
            raise InputError(f"[render] angles_deg = {list(self.angles_deg)}: a list without repetition is needed")
        for angle in self.angles_deg:
            check_angle(angle)
        whole("samples", self.samples, 1)
        whole("wavelengths", self.wavelengths, 2, 2000)
        whole("seed", self.seed, 0, 2**20)


@dataclass(frozen=True)
class Virtual:
    """The ground truth where none was measured: see `virtual`. gonio_noise : relative, of each BRDF value
    perturbed : draw each source of the error path once and put it into the reference;  slope : h of the shift, nm⁻¹"""

    gonio_noise: float = 0.007
    perturbed: bool = False
    seed: int = 1
    slope: float = 1.5e-3
    samples: int = 256

    def __post_init__(self) -> None:
        if not (np.isfinite(self.gonio_noise) and self.gonio_noise >= 0):
            raise InputError(f"[virtual] gonio_noise = {self.gonio_noise}: 0 or a positive number is needed")
        whole("samples", self.samples, 1)


@dataclass(frozen=True)
class ErrorPath:
    """Which patches and angles carry the error path, how often each source is drawn (0: it is left out), at how many
    wavelengths; `sizes` overrides sizes by name"""

    patches: tuple[int, ...] = (4, 19, 22)
    angles_deg: tuple[float, ...] = (30.0, 45.0, 60.0, 75.0, 90.0)
    repeats: int = 4
    wavelengths: int = 20
    samples: int = 64
    seed: int = 7
    sizes: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        whole("repeats", self.repeats, 0, 1000)
        whole("samples", self.samples, 2)
        whole("wavelengths", self.wavelengths, 2, 2000)
        for angle in self.angles_deg:
            check_angle(angle)
        if not isinstance(self.sizes, Mapping):
            raise InputError(f"sizes = {self.sizes!r}: a table of names and sizes is needed")


@dataclass(frozen=True)
class Settings:
    """A checked validation scene; exactly one of `files` and `virtual` is there."""

    folder: Path
    title: str = "Normbox"
    box: Box = field(default_factory=Box)
    files: Files | None = None
    virtual: Virtual | None = None
    fit: Fit = field(default_factory=Fit)
    render: Render = field(default_factory=Render)
    errors: ErrorPath = field(default_factory=ErrorPath)


TABLES: dict[str, type] = {
    "box": Box,
    "files": Files,
    "virtual": Virtual,
    "fit": Fit,
    "render": Render,
    "errors": ErrorPath,
}


def load(source: str | os.PathLike[str] | Mapping[str, Any]) -> Settings:
    """The settings of a TOML file or of a dictionary of the same shape.

    Raises FileFormatError for a file that cannot be read, InputError, one line, for what is wrong in it.
    """
    if isinstance(source, Mapping):
        return _settings(source, Path("."), "scene")
    path = Path(source)
    require_kind(path, "normbox")
    data = settings_of(path, "file", f" (`vgonio validate --init {path.name}` writes one)")
    return _settings(data, path.parent, path.name)


def _settings(data: Mapping[str, Any], folder: Path, shown: str) -> Settings:
    for key in data:
        if key not in {**TABLES, "title": str}:
            raise InputError(f"{shown}: unknown table or key {key!r}: {nearest(key, [*TABLES, 'title'])}")
    made: dict[str, Any] = {
        name: _table(cls, data[name], f"{shown}: [{name}]") for name, cls in TABLES.items() if name in data
    }
    if ("files" in made) == ("virtual" in made):
        raise InputError(f"{shown}: either [files], measured data, or [virtual] is needed, and not both")
    settings = Settings(folder=folder, title=str(data.get("title", "Normbox")), **made)
    for number in settings.errors.patches:
        if number not in PATCHES and number not in settings.render.patches:
            raise InputError(
                f"{shown}: [errors] patches has {number!r}, which is no patch: they go from 1 to {PATCHES[-1]}"
            )
    return settings


def _table(cls: type[T], data: Any, where: str) -> T:
    if not isinstance(data, Mapping):
        raise InputError(f"{where} has to be a table, got {data!r}")
    known = {f.name: f for f in fields(cls)}  # type: ignore[arg-type]
    for key in data:
        if key not in known:
            raise InputError(f"{where}: unknown key {key!r}: {nearest(key, known)}")
    try:
        return cls(**{k: tuple(v) if isinstance(v, list) else v for k, v in data.items()})
    except InputError as e:
        raise InputError(f"{where}: {e}") from None
    except (TypeError, ValueError) as e:
        raise InputError(f"{where}: {str(e).removeprefix(cls.__name__ + '.__init__() ')}") from None
