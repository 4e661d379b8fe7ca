"""Predictions: the spectral radiance of every patch at every angle, kept on disk as they are made."""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...files import written_whole
from ..appearance import Appearance
from ..spectral import radiance
from .box import Box, Scene

Floats = NDArray[np.float64]
Progress = Callable[[float], None]
DIRECT_DEPTH = 2  # one reflection: light, sample, instrument


@dataclass(frozen=True)
class Job:
    """One set of predictions. light (n points, n_λ) at wavelength_nm (n_λ,);  samples : paths per pixel and group"""

    box: Box
    wall: Appearance
    patches: Mapping[int, Appearance]
    angles_deg: tuple[float, ...]
    wavelength_nm: Floats
    light: Floats
    samples: int
    seed: int = 0
    max_depth: int = -1

    def key(self, variant: str) -> str:
        """A name for all that decides the outcome."""
        told = {
            "box": asdict(self.box),
            "wall": self.wall.bsdf,
            "patches": {n: a.bsdf for n, a in self.patches.items()},
            "angles": self.angles_deg,
            "wavelength": self.wavelength_nm.tolist(),
            "light": self.light.tolist(),
            "numbers": [self.samples, self.seed, self.max_depth, variant],
        }
        return hashlib.sha1(json.dumps(told, default=str, sort_keys=True).encode()).hexdigest()[:16]


def predict(mi: Any, job: Job, parts: Path | None = None, progress: Progress | None = None) -> xr.Dataset:
    """Render a job: `radiance` and `radiance_stderr` (patch, angle, wavelength), W/(m² sr nm) as the light's.

    The mean over the pixels of the field, and its standard error from their spread. The scene is built once; then only
    angle and material change. parts : folder where each finished angle is kept, and found again by a later run.
    """
    scene: Scene | None = None
    integrator = mi.load_dict({"type": "path", "max_depth": job.max_depth, "rr_depth": 5})
    key = job.key(mi.variant())
    means, errors = [], []
    count, done = len(job.angles_deg) * len(job.patches), 0
    for series, angle in enumerate(job.angles_deg):
        part = None if parts is None else parts / f"{key}_{series}.npz"
        kept = _kept(part)
        if kept is None:
            if scene is None:
                first = next(iter(job.patches.values()))
                scene = Scene(mi, job.box, job.wall, first, job.wavelength_nm, job.light)
            scene.set_angle(angle)
            rows = []
            for number, patch in job.patches.items():
                scene.set_sample(patch)
                rows.append(_spectrum(mi, scene, integrator, job, _seed(job.seed, number, series)))
                if progress is not None:
                    progress((done + len(rows)) / count)
            kept = np.array(rows)
            _keep(part, kept)
        done += len(job.patches)
        means.append(kept[:, 0])
        errors.append(kept[:, 1])
        if progress is not None:
            progress(done / count)
    return _dataset(job, np.array(means), np.array(errors))


def _seed(seed: int, number: int, series: int) -> int:
    # by the place of the angle and not by its value: a slightly perturbed angle keeps its random numbers
    return (seed * 100_003 + number * 613 + series) % 2**31


def _spectrum(mi: Any, scene: Scene, integrator: Any, job: Job, seed: int) -> Floats:
    """(2, n_λ): mean over the field and its standard error."""
    pixels = radiance(mi, scene.scene, integrator, job.wavelength_nm, job.samples, seed)
    pixels = pixels.reshape(-1, job.wavelength_nm.size)
    return np.stack([pixels.mean(axis=0), pixels.std(axis=0, ddof=1) / np.sqrt(len(pixels))])


def direct_part(mi: Any, job: Job, parts: Path | None = None, progress: Progress | None = None) -> xr.DataArray:
    """The part of the radiance that comes straight from the light, same dims; a quarter of the paths."""
    from dataclasses import replace

    few = replace(job, max_depth=DIRECT_DEPTH, samples=max(1, job.samples // 4))
    return predict(mi, few, parts, progress)["radiance"]


def _kept(part: Path | None) -> Floats | None:
    if part is None or not part.is_file():
        return None
    try:
        with np.load(part) as found:
            return found["spectra"]
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return None  # damaged: made again


def _keep(part: Path | None, spectra: Floats) -> None:
    if part is None:
        return
    part.parent.mkdir(parents=True, exist_ok=True)
    with written_whole(part) as stream:
        np.savez_compressed(stream, spectra=spectra)


def _dataset(job: Job, means: Floats, errors: Floats) -> xr.Dataset:
    dims = ("patch", "angle", "wavelength")
    coords = {"patch": list(job.patches), "angle": list(job.angles_deg), "wavelength": job.wavelength_nm}
    return label_radiance(
        xr.Dataset({"radiance": (dims, means.swapaxes(0, 1)), "radiance_stderr": (dims, errors.swapaxes(0, 1))}, coords)
    )


def label_radiance(data: xr.Dataset) -> xr.Dataset:
    """Units and names on what predictions hold."""
    names = {
        "radiance": ("W m-2 sr-1 nm-1", "spectral radiance"),
        "radiance_stderr": ("W m-2 sr-1 nm-1", "standard error of the mean of radiance"),
        "patch": ("1", "number of the patch"),
        "angle": ("degree", "angle of the sample, 90° faces the instrument"),
        "wavelength": ("nm", "wavelength"),
    }
    for name, (units, long_name) in names.items():
        if name in data.variables:
            data[name].attrs |= {"units": units, "long_name": long_name}
    return data
