"""The comparison path (thesis 3.3.2): ground truth, fits, predictions, comparison, error model and error path."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...compare.metrics import interpolate_wavelength
from ...compare.model_fit import fit_model
from ...dataset import versions
from ...errors import InputError
from ..appearance import Appearance, of_fit
from ..variants import choose, use
from . import virtual
from .box import Box
from .comparison import compare
from .error_model import Fitted, error_model, regressed
from .error_path import error_path, perturbed_once, sizes
from .inputs import GroundTruth, common_wavelengths, in_plane, read_ground_truth
from .predict import Job, direct_part, label_radiance, predict
from .settings import Settings, fit_choice
from .verdict import group, spectral_correlation, verdict

Floats = NDArray[np.float64]
Progress = Callable[[str, float], None]
WALL = 0  # the wall's number among the patches
VIRTUAL_NOTE = (
    "VIRTUAL ground truth: nothing was measured. Patches and wall have BRDFs of the shift-extended model, measured by "
    "the virtual gonioreflectometer and rendered as reference."
)


@dataclass(frozen=True)
class Fits:
    """What one model made of all BRDFs, by patch number; the wall is number 0."""

    name: str
    measured: Mapping[int, xr.Dataset]
    fitted: Mapping[int, xr.Dataset]

    def appearance(self, number: int) -> Appearance:
        return of_fit(self.fitted[number], f"{self.name}, {'wall' if number == WALL else f'patch {number}'}")

    def pair(self, number: int) -> Fitted:
        return Fitted(self.measured[number], self.fitted[number]["brdf"])


def validate(settings: Settings, parts: Path | None = None, progress: Progress | None = None) -> xr.DataTree:
    """Everything that a validation gives, as a DataTree.

    parts : folder for finished predictions; a run that was interrupted goes on from there
    Groups: `reference` (radiance and direct part), `predicted_<model>` (radiance, errors, colour differences),
    `error_model`, `error_path`; for a virtual ground truth `true` as well, predicted with the true BRDFs. attrs:
    `title`, `note`, `virtual`, `verdict` (JSON, see `verdict`), `seconds` (JSON), `variant`.
    Raises InputError, FileFormatError or BackendError, each one line.
    """
    seconds: dict[str, float] = {}
    start = time.perf_counter()
    sizes(settings.errors)  # a misspelt source is told before any work
    choice = choose(settings.render.variant)
    mi = use(choice)
    numbers = settings.render.patches
    say = progress or (lambda part, share: None)
    truth = read_ground_truth(settings) if settings.files else _virtual_brdfs(settings)
    wavelength = common_wavelengths(truth, settings.render.wavelengths)
    fits = [_fit(settings, truth, name, say) for name in settings.fit.models]
    seconds["fits"] = time.perf_counter() - start
    base = _job(settings, truth, wavelength)
    tree = xr.DataTree()
    if settings.virtual:
        tree["true"] = xr.DataTree(_timed(seconds, "true", lambda p: predict(mi, _true(settings, base), parts, p), say))
        reference = _timed(seconds, "reference", lambda p: _virtual_reference(mi, settings, base, parts, p), say)
    else:
        at_all = interpolate_wavelength(truth.reference.to_dataset(name="radiance"), wavelength)["radiance"]
        reference = label_radiance(at_all.to_dataset(name="radiance"))
    jobs = {f.name: _with(base, f, numbers) for f in fits}
    for name, job in jobs.items():
        made = _timed(seconds, name, partial(predict, mi, job, parts), say)
        tree[group(name)] = xr.DataTree(xr.merge([made, compare(reference["radiance"], made["radiance"])]))
    plain = fits[0]
    direct = _timed(seconds, "direct", lambda p: direct_part(mi, jobs[plain.name], parts, p), say)
    reference["direct"] = direct
    reference["direct"].attrs["long_name"] = "direct part, predicted with the first model"
    tree["reference"] = xr.DataTree(label_radiance(reference))
    tree["error_model"] = xr.DataTree(_model(tree, plain, numbers, settings.box))
    if settings.errors.repeats:
        path = _timed(seconds, "error path", lambda p: _path(mi, settings, truth, fits[-1], p), say)
        tree["error_path"] = xr.DataTree(path)
    tree.attrs = {
        "title": settings.title,
        "method": "validation",
        "virtual": int(settings.virtual is not None),
        "note": truth.note,
        "variant": choice.variant,
        "variant_why": choice.why,
        "models": json.dumps(list(jobs)),
        "box": json.dumps(settings.box.__dict__),
        "seconds": json.dumps(seconds | {"all": time.perf_counter() - start}),
        "versions": versions(),
    }
    tree.attrs["verdict"] = json.dumps(verdict(tree))
    return tree


def _timed(seconds: dict[str, float], part: str, work: Callable[[Any], Any], say: Progress) -> Any:
    start = time.perf_counter()
    done = work(lambda share: say(part, share))
    say(part, 1.0)
    seconds[part] = time.perf_counter() - start
    return done


def _job(settings: Settings, truth: GroundTruth, wavelength: Floats) -> Job:
    light = np.stack([np.interp(wavelength, truth.light_nm, row) for row in truth.light])
    nothing = Appearance("", {}, "formula")
    r = settings.render
    return Job(settings.box, nothing, {}, r.angles_deg, wavelength, light, r.samples, r.seed, r.max_depth)


def _with(job: Job, fits: Fits, numbers: tuple[int, ...]) -> Job:
    return replace(job, wall=fits.appearance(WALL), patches={n: fits.appearance(n) for n in numbers})


def _fit(settings: Settings, truth: GroundTruth, name: str, say: Progress) -> Fits:
    """Fit one model to the wall and to all patches."""
    model, coefficients, offset = fit_choice(name)
    measured = {WALL: truth.wall, **truth.patches}
    fitted = {}
    for k, (number, data) in enumerate(measured.items()):
        free = ["alpha", "eta", *(["h", "w"] if model == "clausen-2022" else []), *(["c"] if offset else [])]
        fitted[number] = fit_model(
            data,
            model,
            material=None,
            free=free,
            coefficients=coefficients,
            exponent=settings.fit.exponent,
            starts=settings.fit.starts,
            errors="none",
        )
        say("fits " + name, (k + 1) / len(measured))
    return Fits(name, measured, fitted)


def _virtual_brdfs(settings: Settings) -> GroundTruth:
    """What the virtual instrument finds, without reference radiances."""
    v = settings.virtual
    assert v is not None
    numbers = settings.render.patches
    outside = [n for n in numbers if not 1 <= n <= 24]
    if outside:
        raise InputError(f"[render] patches: {outside[0]} is none of the ColorChecker's patches 1 … 24")
    measured = {n: in_plane(virtual.measured_patch(n, v.slope, v.gonio_noise, v.seed), "") for n in (WALL, *numbers)}
    light_nm, light = virtual.light_spectra(settings.box.light_count, v.seed)
    dims = ("patch", "angle", "wavelength")
    empty = xr.DataArray(np.zeros((0, 0, light_nm.size)), {"wavelength": light_nm}, dims)
    return GroundTruth(light_nm, light, measured.pop(WALL), measured, empty, VIRTUAL_NOTE)


def _true(settings: Settings, base: Job) -> Job:
    v = settings.virtual
    assert v is not None
    made = {n: virtual.true_appearance(n, base.wavelength_nm, v.slope) for n in (WALL, *settings.render.patches)}
    return replace(base, wall=made.pop(WALL), patches=made)


def _virtual_reference(mi: Any, settings: Settings, base: Job, parts: Path | None, progress: Any) -> xr.Dataset:
    """Rendered with the true BRDFs, more paths and other random numbers; perturbed once where the scene says so."""
    v = settings.virtual
    assert v is not None
    job = replace(_true(settings, base), samples=v.samples, seed=base.seed + 1000 + v.seed)
    factor = 1.0
    if v.perturbed:
        job, factor = perturbed_once(job, settings.errors, v.seed)
    made = predict(mi, job, parts, progress)
    made = made.assign_coords(angle=list(settings.render.angles_deg))  # what the angle was believed to be
    made["radiance"] = made["radiance"] * factor
    return made


def _model(tree: xr.DataTree, plain: Fits, numbers: tuple[int, ...], box: Box) -> xr.Dataset:
    reference, predicted = tree["reference"].to_dataset(), tree[group(plain.name)].to_dataset()
    share = (reference["direct"].mean("wavelength") / predicted["radiance"].mean("wavelength")).clip(0, 1)
    pairs, w = {n: plain.pair(n) for n in numbers}, predicted["wavelength"].values
    made = error_model(share, predicted["mean_radiance"], w, pairs, plain.pair(WALL), box)
    made.attrs["spectral_correlation"] = spectral_correlation(predicted["nse"], made["nse_fit"])
    made.attrs["regressed"] = json.dumps(regressed(predicted["nrmse"], share))
    made.attrs["model"] = plain.name
    return made


def _path(mi: Any, settings: Settings, truth: GroundTruth, fits: Fits, progress: Any) -> xr.Dataset:
    e = settings.errors
    numbers = tuple(n for n in e.patches if n in settings.render.patches) or settings.render.patches[:1]
    base = _job(settings, truth, common_wavelengths(truth, e.wavelengths))
    job = replace(_with(base, fits, numbers), angles_deg=e.angles_deg, samples=e.samples)
    return error_path(mi, job, e, progress)
