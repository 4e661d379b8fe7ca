"""The error path (thesis 3.3.3): named sources with their sizes, propagated by repeated runs with perturbed inputs.

Every run has the random numbers of the unperturbed one, so what differs is the source's doing; "rendering" itself is
run with other numbers. Limits ("± 1 mm") are drawn evenly between them, accuracies ("2 %") from a normal distribution.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...errors import InputError, nearest
from ..appearance import Appearance
from .predict import Job, direct_part, predict
from .settings import ErrorPath

Floats = NDArray[np.float64]
Random = np.random.Generator
FACTOR_DRAWS = 400


@dataclass(frozen=True)
class Source:
    """A row of the table. `perturb(job, size, rng)` gives the perturbed job and a factor on the radiance.

    runs : whether the job changes; a factor alone needs no rendering and is drawn `FACTOR_DRAWS` times
    """

    size: float
    unit: str
    spread: str  # "limits" or "standard deviation"
    what: str
    perturb: Callable[[Job, float, Random], tuple[Job, float]]
    runs: bool = True


def _geometry(job: Job, size: float, rng: Random) -> tuple[Job, float]:
    """Every length of the box, the light, the sample's place and the instrument's."""
    box = job.box

    def off(count: int) -> Any:
        return rng.uniform(-size, size, count)

    changed = box.moved(
        size_mm=tuple(np.add(box.size_mm, off(3))),
        light_mm=tuple(np.add(box.light_mm, off(2))),
        light_offset_mm=tuple(np.add(box.light_offset_mm, off(2))),
        sample_at_mm=tuple(np.add(box.sample_at_mm, off(3))),
        distance_mm=float(box.distance_mm + off(1)[0]),
        instrument_offset_mm=tuple(np.add(box.instrument_offset_mm, off(2))),
    )
    return replace(job, box=changed), 1.0


def _angle(job: Job, size: float, rng: Random) -> tuple[Job, float]:
    """One offset for each series of patches, as the thesis sets the angle once for all."""
    return replace(job, angles_deg=tuple(min(90.0, a + rng.uniform(-size, size)) for a in job.angles_deg)), 1.0


def _brdf(job: Job, size: float, rng: Random) -> tuple[Job, float]:
    """A factor on each sample's BRDF and on the wall's."""
    patches = {n: scaled(a, 1 + size * rng.standard_normal()) for n, a in job.patches.items()}
    return replace(job, wall=scaled(job.wall, 1 + size * rng.standard_normal()), patches=patches), 1.0


def scaled(appearance: Appearance, factor: float) -> Appearance:
    """The same material with its BRDF times a factor: k_d, k_s and c are what it is linear in."""
    made = dict(appearance.bsdf)
    for name in ("k_d", "k_s"):
        if name in made:
            values = [repr(float(v) * factor) for v in made[name]["values"].split(",")]
            made[name] = {**made[name], "values": ", ".join(values)}
    made.setdefault("k_s", {"type": "uniform", "value": float(factor)})
    if "c" in made:
        made["c"] = made["c"] * factor
    return replace(appearance, bsdf=made)


def _emission(job: Job, size: float, rng: Random) -> tuple[Job, float]:
    return replace(job, light=job.light * (1 + size * rng.standard_normal())), 1.0


def _homogeneity(job: Job, size: float, rng: Random) -> tuple[Job, float]:
    return replace(job, light=job.light * (1 + rng.uniform(-size, size, (len(job.light), 1)))), 1.0


def _factor(job: Job, size: float, rng: Random) -> tuple[Job, float]:
    return job, 1 + size * rng.standard_normal()


def _interpolation(job: Job, size: float, rng: Random) -> tuple[Job, float]:
    """Of every `size` values of the light's spectra only one is kept, and what is between interpolated."""
    w, step = job.wavelength_nm, max(1, int(size))
    kept = np.unique(np.append(np.arange(int(rng.integers(0, step)), w.size, step), [0, w.size - 1]))
    return replace(job, light=np.stack([np.interp(w, w[kept], row[kept]) for row in job.light])), 1.0


def _numbers(job: Job, size: float, rng: Random) -> tuple[Job, float]:
    return replace(job, seed=int(rng.integers(1, 2**20))), 1.0


LIMITS, DEVIATION = "limits", "standard deviation"
# sizes: thesis 3.3.3 and 3.3.1
SOURCES = {
    "geometry": Source(1.0, "mm", LIMITS, "every length of the box, light, sample and instrument", _geometry),
    "angle": Source(1.0, "degree", LIMITS, "the sample's angle", _angle),
    "brdf": Source(0.007, "1", DEVIATION, "in-plane BRDFs of patches and wall, a factor on each", _brdf),
    "emission": Source(0.02, "1", DEVIATION, "spectroradiometer, when the light is measured", _emission),
    "reference": Source(0.02, "1", DEVIATION, "spectroradiometer, when the reference is measured", _factor, False),
    "repeatability": Source(0.01, "1", DEVIATION, "the light's intensity from one series to the next", _factor, False),
    "homogeneity": Source(0.03, "1", LIMITS, "each point of the light", _homogeneity),
    "diffusivity": Source(0.026, "1", DEVIATION, "the light's deviation from Lambert: its direct part", _factor, False),
    "interpolation": Source(2.0, "1", LIMITS, "every second value of the light's spectra left out", _interpolation),
    "rendering": Source(1.0, "1", DEVIATION, "other random numbers", _numbers),
}


def sizes(options: ErrorPath) -> dict[str, float]:
    """Sizes of all sources, those of the scene in place of the thesis'."""
    for name, value in options.sizes.items():
        if name not in SOURCES:
            raise InputError(f"unknown source of error {name!r}: {nearest(name, SOURCES)}")
        if not (isinstance(value, (int, float)) and np.isfinite(value) and value >= 0):
            raise InputError(f"size of the source {name!r} = {value!r}: a number that is not negative is needed")
    return {name: float(options.sizes.get(name, s.size)) for name, s in SOURCES.items()}


def error_path(mi: Any, job: Job, options: ErrorPath, progress: Callable[[float], None] | None = None) -> xr.Dataset:
    """Propagate all sources.

    `deviation` (source, patch, angle) : relative RMS difference over the spectrum, RMS over the repeats;
    `combined` (patch, angle) : the root of the sum of their squares; `size`, `unit`, `spread`, `what` of each source
    job : predictions with all fitted materials; its patches and angles are those of `options`
    """
    chosen, rng = sizes(options), np.random.default_rng(options.seed)
    base = predict(mi, job)["radiance"]
    direct = direct_part(mi, job)
    found = np.zeros((len(SOURCES), *base.shape[:2]))
    for i, (name, source) in enumerate(SOURCES.items()):
        squares = np.zeros(base.shape[:2])
        rounds = options.repeats if source.runs else FACTOR_DRAWS
        for k in range(rounds):
            changed, factor = source.perturb(job, chosen[name], rng)
            if name == "diffusivity":
                other = base.values + (factor - 1) * direct.values
            else:
                run = base.values if changed is job else predict(mi, changed)["radiance"].values
                other = run * factor
            squares += relative_rms(base.values, other) ** 2
            if progress is not None:
                progress((i + (k + 1) / rounds) / len(SOURCES))
        found[i] = np.sqrt(squares / rounds)
    coords: Mapping[str, Any] = {"source": list(SOURCES), "patch": base["patch"], "angle": base["angle"]}
    data = xr.Dataset({"deviation": (("source", "patch", "angle"), found)}, coords)
    data["combined"] = np.sqrt((data["deviation"] ** 2).sum("source"))
    data["size"] = ("source", [chosen[n] for n in SOURCES])
    data["unit"] = ("source", [s.unit for s in SOURCES.values()])
    data["spread"] = ("source", [s.spread for s in SOURCES.values()])
    data["what"] = ("source", [s.what for s in SOURCES.values()])
    for name in ("deviation", "combined"):
        data[name].attrs |= {"units": "1", "long_name": f"{name} of the radiance, relative, RMS over the spectrum"}
    data.attrs["repeats"] = options.repeats
    return data


def relative_rms(base: Floats, other: Floats) -> Floats:
    """RMS over the spectrum of the difference, over the mean of `base`: (…, n_λ) to (…)."""
    return np.sqrt(np.mean((other - base) ** 2, axis=-1)) / base.mean(axis=-1)


def perturbed_once(job: Job, options: ErrorPath, seed: int) -> tuple[Job, float]:
    """A job with every source but rendering and interpolation drawn once, for a reference as a measurement has it."""
    chosen, rng, factor = sizes(options), np.random.default_rng(seed), 1.0
    for name, source in SOURCES.items():
        # the diffusivity would need the direct part; its size is in the table
        if name not in ("rendering", "interpolation", "diffusivity"):
            job, more = source.perturb(job, chosen[name], rng)
            factor *= more
    return job, factor
