"""The tables of a scene and their keys, as models that check themselves.

Values are checked by the very functions that use them later, so that no rule stands in two places.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    field_validator,
    model_validator,
)

from ..directions import Detector as DetectorCheck
from ..directions import Incoming, angle_list, wavelength_list
from ..errors import InputError
from ..surface.checks import pitch_pair
from ..surface.filter import FILLS, LEVELS
from ..surface.interpolant import KINDS
from ..units import to_um
from .values import check_generator, checked, expand, not_offered, one_of, whole

THEORIES = ("kirchhoff", "generalized-harvey-shack", "harvey-shack", "iterated-kirchhoff", "full-wave")
METHODS = ("auto", "nufft", "opencl", "reference")
TRACERS = ("embree", "reference", "warp")
ESTIMATORS = ("auto", "binning", "facets")

Numbers = Annotated[list[float], BeforeValidator(expand)]
Count = Annotated[int, BeforeValidator(whole), Field(ge=1)]
Share = Annotated[float, Field(gt=0, lt=1)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Pitch = Annotated[float | list[float], checked(pitch_pair)]


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
    height_unit: Annotated[str, checked(to_um)] | None = None
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
            remedy = ": take one of the two out" if got == "both" else ""
            raise InputError(f"give either file or generate, got {got}{remedy}")
        if self.generate is not None:
            check_generator(self.generate)
            for key in ("pitch_um", "height_unit"):
                if getattr(self, key) is not None:
                    raise InputError(f"{key} overrides a file's: for a generated surface give generate.{key}")
        return self


class Film(Table):
    """A layer on the material."""

    name: str | None = None
    file: str | None = None
    thickness_nm: Annotated[float, Field(ge=0, allow_inf_nan=False)]

    @model_validator(mode="after")
    def _one_source(self) -> Film:
        one_material(self.name, self.file)
        return self


class Material(Table):
    name: str | None = None
    file: str | None = None
    film: list[Film] = []  # from the outside in; a single one may stand without the brackets

    @field_validator("film", mode="before")
    @classmethod
    def _list(cls, value: Any) -> Any:
        return [value] if isinstance(value, Mapping) else value

    @model_validator(mode="after")
    def _one_source(self) -> Material:
        one_material(self.name, self.file)
        return self


def one_material(name: str | None, file: str | None) -> None:
    if (name is None) == (file is None):
        raise InputError('give either name (for example "Al") or file (a refractiveindex.info YAML or CSV)')


class Light(Table):
    wavelength_nm: Annotated[Numbers, checked(wavelength_list)]
    theta_i_deg: Annotated[Numbers, checked(lambda a: angle_list(a, "theta_i_deg"))]
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
    tracer: Annotated[str, one_of(TRACERS)] = "embree"
    estimator: Annotated[str, one_of(ESTIMATORS)] = "auto"
    seed: Annotated[int, Field(ge=0)] = 0
    polarised: bool = False
    statistics: bool = False
    refinement_check: bool = False


class Wave(Table):
    theory: list[Annotated[str, one_of(THEORIES)]] = ["kirchhoff"]
    method: Annotated[str, one_of(METHODS)] = "auto"
    tol: Share = 1e-3
    shadowing: bool = False
    fresnel: Annotated[str, one_of(("half", "local"))] = "half"
    energy: bool = False
    renormalise: bool = False
    bounces: Count | None = None
    window_um: Positive | None = None
    windows: Count | None = None
    polarised: bool = False

    @field_validator("theory", mode="before")
    @classmethod
    def _list(cls, value: Any) -> Any:
        return [value] if isinstance(value, str) else value

    @model_validator(mode="after")
    def _offered(self) -> Wave:
        known = {"kirchhoff", "iterated-kirchhoff"}
        if self.polarised and (not set(self.theory) <= known or self.fresnel != "half"):
            raise InputError('polarised = true is for "kirchhoff" and "iterated-kirchhoff" alone, without fresnel')
        for key in ("window_um", "bounces"):
            value = getattr(self, key)
            if "iterated-kirchhoff" not in self.theory and value is not None and (key, value) != ("bounces", 1):
                raise InputError(f'{key} = {value:g} is for theory = "iterated-kirchhoff", got {self.theory}')
        scalar = self.shadowing or self.energy or self.renormalise or self.fresnel != "half"
        if set(self.theory) <= {"full-wave", "iterated-kirchhoff"} and scalar:
            raise InputError(
                "shadowing, fresnel, energy and renormalise are for the theories of one reflection: "
                f"{' and '.join(self.theory)} holds shadows, local reflection and all energies as it is"
            )
        if not self.theory or len(set(self.theory)) < len(self.theory):
            raise InputError(f"theory lists nothing or a theory twice: {self.theory}")
        return self


class Measured(Table):
    """A measured BRDF; everything but `file` and `format` goes to its reader, where it is checked."""

    file: str
    format: str | None = None
    unit: str | None = None
    wavelength_unit: str | None = None
    negative: str | None = None
    duplicates: str | None = None
    # of formats that hold functions of two directions; by default the angles of [light] and [detector]
    theta_i_deg: Numbers | None = None
    theta_o_deg: Numbers | None = None
    resolution_deg: float | None = None
    wavelength_nm: float | None = None


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
    _shown: str = PrivateAttr(default="scene")  # in messages: the file with its ending

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
        tables = [self.surface, self.material, *(self.material.film if self.material else []), self.measured]
        named = [t.file for t in tables if t is not None and t.file is not None]
        return [self.resolve(f) for f in named]

    def to_dict(self) -> dict[str, Any]:
        """All settings, defaults included, as plain values; `load_scene` accepts it again."""
        return self.model_dump(mode="json", exclude_none=True)

    def to_json(self) -> str:
        return self.model_dump_json(exclude_none=True)


TABLES: dict[str, type[Table]] = {
    "surface": Surface,
    "surface.filter": Filter,
    "material": Material,
    "material.film": Film,
    "light": Light,
    "detector": Detector,
    "geometric": Geometric,
    "wave": Wave,
    "measured": Measured,
    "output": Output,
}
