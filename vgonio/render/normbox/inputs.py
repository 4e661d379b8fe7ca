"""The measured files of a validation, and the ground truth that they, or a virtual one, make.

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
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...errors import FileFormatError, InputError
from ...files import text_of, written_whole
from .settings import Render, Settings

Floats = NDArray[np.float64]
# not str.format: a file could ask it for a name of gigabytes
PLACE = re.compile(r"\{number(?::0(\d)d)?\}")


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
