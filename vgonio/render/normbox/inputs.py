"""What a validation takes in: a TOML file that names light, wall, patches and reference, and the files that it names.

Light: CSV, one line for each wavelength: wavelength_nm and the spectral radiance at each measured point in
W/(m² sr nm), the point's number in the header, x fastest from x < 0, y < 0 on. Reference: CSV, one line for each
spectrum: patch, angle_deg and the spectral radiances, their wavelengths in nm in the header. BRDFs: any in-plane format
of `vgonio.measure.read`. Lines that begin with # are comments.
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...errors import FileFormatError, InputError, nearest, whole
from ...files import settings_of, text_of, written_whole
from ..appearance import KNOWN
from .box import ANGLES_DEG, Box, check_angle

Floats = NDArray[np.float64]
PATCHES = tuple(range(1, 25))
# not str.format: a file could ask it for a name of gigabytes
PLACE = re.compile(r"\{number(?::0(\d)d)?\}")
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


@dataclass(frozen=True)
class GroundTruth:
    """light (25, n_λ) at light_nm, W/(m² sr nm);  wall and patches : in-plane BRDFs;  reference : spectral radiances,
    dims patch, angle, wavelength;  note : where all this comes from"""

    light_nm: Floats
    light: Floats
    wall: xr.Dataset
    patches: Mapping[int, xr.Dataset]
    reference: xr.DataArray
    note: str


def load(source: str | os.PathLike[str] | Mapping[str, Any]) -> Settings:
    """The settings of a TOML file or of a dictionary of the same shape.

    Raises FileFormatError for a file that cannot be read, InputError, one line, for what is wrong in it.
    """
    if isinstance(source, Mapping):
        return _settings(source, Path("."), "scene")
    path = Path(source)
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


# ---- files
def read_ground_truth(settings: Settings) -> GroundTruth:
    """Read and check all files of a measured ground truth, before any work is done."""
    from ...measure import read

    files = settings.files
    assert files is not None
    patch_files = {n: settings.folder / _numbered(files.patches, n) for n in settings.render.patches}
    _require_files([settings.folder / f for f in (files.light, files.reference, files.walls)] + [*patch_files.values()])
    light_nm, light = read_light(settings.folder / files.light, settings.box.light_count)
    reference = read_reference(settings.folder / files.reference, settings.render)
    wall = in_plane(read(settings.folder / files.walls), files.walls)
    patches = {}
    for number, path in patch_files.items():
        patches[number] = in_plane(read(path), path.name)
    return GroundTruth(light_nm, light, wall, patches, reference, "measured files")


def _require_files(paths: list[Path]) -> None:
    """FileFormatError that names all files that are not there, not one a run."""
    missing = [str(path) for path in paths if not path.is_file()]
    if missing:
        told = ", ".join(missing[:5]) + (f" and {len(missing) - 5} more" if len(missing) > 5 else "")
        raise FileFormatError(f"{len(missing)} of {len(paths)} files of [files] are missing: {told}")


def _numbered(pattern: str, number: int) -> str:
    name = PLACE.sub(lambda found: f"{number:0{found[1] or 1}d}", pattern)
    if name == pattern:
        raise InputError(f'[files] patches = {pattern!r}: {{number}} is needed, as in "patch_{{number:02d}}.json"')
    return name


def in_plane(data: xr.Dataset, name: str) -> xr.Dataset:
    """The dataset again; InputError unless it holds a BRDF in the plane of incidence, over spectra."""
    if "theta_o" not in data["brdf"].dims:
        raise InputError(f"{name} holds no in-plane BRDF: its directions are cells of a hemisphere")
    known = np.isfinite(data["brdf"].values).all(axis=-1)
    if known.sum() < 6 or data.sizes["theta_i"] < 2:
        raise InputError(
            f"{name} holds {int(known.sum())} in-plane spectra at {data.sizes['theta_i']} angles of incidence: "
            "two angles and six spectra are the least that a fit needs"
        )
    return data


def _rows(path: Path) -> list[list[str]]:
    lines = text_of(path, "file").splitlines()
    try:
        rows = [r for r in csv.reader(lines) if r and not r[0].lstrip().startswith("#")]
    except csv.Error as e:
        raise FileFormatError(f"cannot read {path}: {e}") from None
    if len(rows) < 2:
        raise FileFormatError(f"{path} holds no table: a header and at least one line are needed")
    for number, row in enumerate(rows):
        if len(row) != len(rows[0]):
            raise FileFormatError(f"{path}: line {number + 1} has {len(row)} values, the header {len(rows[0])}")
    return rows


def _numbers(path: Path, cells: list[list[str]]) -> Floats:
    try:
        values = np.array(cells, dtype=np.float64)
    except ValueError as e:
        raise FileFormatError(f"{path}: {e}") from None
    if not np.isfinite(values).all():
        raise FileFormatError(f"{path} holds a value that is no finite number")
    return values


def _radiances(path: Path, values: Floats, where: str) -> Floats:
    if np.any(values < 0):
        raise InputError(f"{path}: a radiance is negative ({values.min():.3g} W/(m² sr nm), {where})")
    return values


def read_light(path: Path, points: int) -> tuple[Floats, Floats]:
    """(n_λ,) nm ascending and (points, n_λ) W/(m² sr nm) of the light's points; one column serves all of them."""
    rows = _rows(path)
    if rows[0][0].strip() != "wavelength_nm":
        raise FileFormatError(f"{path}: the header has to begin with wavelength_nm, got {rows[0][0]!r}")
    table = _numbers(path, rows[1:])
    if table.shape[1] - 1 not in (1, points):
        raise FileFormatError(f"{path} has {table.shape[1] - 1} spectra: {points} are needed, or one for all points")
    order = _ascending(path, table[:, 0])
    light = _radiances(path, table[order, 1:].T, "light")
    return table[order, 0], np.repeat(light, points, axis=0) if len(light) == 1 else light


def _ascending(path: Path, wavelength: Floats) -> Any:
    if np.any(wavelength <= 0) or np.unique(wavelength).size < wavelength.size:
        raise FileFormatError(f"{path}: wavelengths have to be positive, and none twice")
    return np.argsort(wavelength)


def read_reference(path: Path, wanted: Render) -> xr.DataArray:
    """Reference radiances (patch, angle, wavelength) of the patches and angles that are wanted."""
    rows = _rows(path)
    if [c.strip() for c in rows[0][:2]] != ["patch", "angle_deg"]:
        raise FileFormatError(f"{path}: the header has to begin with patch,angle_deg, got {','.join(rows[0][:2])}")
    wavelength = _numbers(path, [rows[0][2:]])[0]
    order = _ascending(path, wavelength)
    table = _numbers(path, rows[1:])
    known = {(int(r[0]), float(r[1])): k for k, r in enumerate(table)}
    found = np.empty((len(wanted.patches), len(wanted.angles_deg), wavelength.size))
    for i, patch in enumerate(wanted.patches):
        if not any(p == patch for p, _ in known):
            have = ", ".join(map(str, sorted({p for p, _ in known})))
            raise InputError(f"{path}: patch {patch} is missing; it has {have}")
        for j, angle in enumerate(wanted.angles_deg):
            row = next((k for (p, a), k in known.items() if p == patch and abs(a - angle) < 1e-6), None)
            if row is None:
                have = ", ".join(f"{a:g}" for a in sorted({a for p, a in known if p == patch}))
                raise InputError(f"{path}: patch {patch} was not measured at {angle:g}°; its angles are {have}")
            found[i, j] = _radiances(path, table[row, 2:], f"patch {patch}, {angle:g}°")[order]
    coords = {"patch": list(wanted.patches), "angle": list(wanted.angles_deg), "wavelength": wavelength[order]}
    return xr.DataArray(found, coords, ("patch", "angle", "wavelength"))


def write_light(path: str | os.PathLike[str], wavelength_nm: Floats, light: Floats, note: str = "") -> None:
    """The light as `read_light` reads it."""
    header = ["wavelength_nm", *(str(k + 1) for k in range(len(light)))]
    _write(path, note, header, np.column_stack([wavelength_nm, light.T]))


def write_reference(path: str | os.PathLike[str], reference: xr.DataArray, note: str = "") -> None:
    """Reference radiances as `read_reference` reads them."""
    header = ["patch", "angle_deg", *(f"{w:.10g}" for w in reference["wavelength"].values)]
    rows = [
        np.concatenate([[float(p), float(a)], reference.sel(patch=p, angle=a).values])
        for p in reference["patch"].values
        for a in reference["angle"].values
    ]
    _write(path, note, header, np.array(rows))


def _write(path: str | os.PathLike[str], note: str, header: list[str], table: Floats) -> None:
    lines = [f"# {note}"] if note else []
    lines += [",".join(header), *(",".join(f"{v:.10g}" for v in row) for row in table)]
    with written_whole(path) as stream:
        stream.write(("\n".join(lines) + "\n").encode())


def common_wavelengths(truth: GroundTruth, count: int) -> Floats:
    """`count` wavelengths, evenly over the range that light, reference and all BRDFs share.

    Raises InputError, naming the ranges, where they do not overlap.
    """
    ranges = {
        "light": truth.light_nm,
        "reference": truth.reference["wavelength"].values,
        "walls": truth.wall["wavelength"].values,
        **{f"patch {n}": d["wavelength"].values for n, d in truth.patches.items()},
    }
    low_name = max(ranges, key=lambda k: ranges[k].min())
    high_name = min(ranges, key=lambda k: ranges[k].max())
    low, high = float(ranges[low_name].min()), float(ranges[high_name].max())
    if high <= low:
        raise InputError(
            f"the spectra do not overlap: {low_name} begins at {low:g} nm, {high_name} ends at {high:g} nm"
        )
    return np.linspace(low, high, count)
