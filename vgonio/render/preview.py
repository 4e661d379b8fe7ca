"""Previews of materials: a sphere (or a mesh of yours) under a spot and a directional light, as in thesis figure 4.13.

Spectra are rendered at the wavelengths asked for and become CIE XYZ with both lights white (D65): the lights send one
unit at every wavelength, and D65 stands in the weights of `vgonio.compare.colour`. All materials are rendered with the
same random numbers, so that their difference is not the noise's; each light by itself, so that there is no noise from
the choice between them: what is left comes from light that goes on between object and floor, and from the edges.

Geometry, in radii of the sphere: it lies on a grey floor (reflectance 0.2) at z = −1; the camera looks at its centre
from (0, −5.2, 1.9) with a field of 27°; the directional light falls along (0.55, 0.7, −0.75); the spot is at
(3.2, −1.5, 2.6).
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..compare import colour
from ..directions import wavelength_list
from ..errors import FileFormatError, InputError, whole
from .appearance import Appearance
from .spectral import radiance
from .variants import Choice, choose, use

Floats = NDArray[np.float64]
WAVELENGTHS = tuple(range(400, 721, 20))
MESHES = (".ply", ".obj")
FLOOR_REFLECTANCE = 0.2
# irradiance of the directional light, and of the spot at the centre, both across the beam
DIRECTIONAL, SPOT = 1.0, 1.3
MOST_PASSES = 256
BRIGHT_PERCENTILE = 97.0


@dataclass(frozen=True)
class Preview:
    """What is rendered: size in pixels, paths per pixel and wavelength group in one pass, and when to stop.

    passes : independent passes (at least 2, for the error);  target_error : go on until the error of Y, the RMS of the
    pixels' standard errors over the RMS of the pixels, is below;  max_seconds : or until so much time has passed for
    each material;  mesh : .ply or .obj in place of the sphere, within the unit sphere
    """

    size: int = 256
    samples: int = 4
    passes: int = 4
    wavelength_nm: Any = WAVELENGTHS
    target_error: float | None = None
    max_seconds: float | None = None
    mesh: str | None = None
    seed: int = 0
    max_depth: int = 4

    def __post_init__(self) -> None:
        whole("size", self.size, 8, 4096)
        whole("samples", self.samples, 1)
        whole("passes", self.passes, 2, MOST_PASSES)
        whole("seed", self.seed, 0, 2**31)
        whole("max_depth", self.max_depth, 2)
        for name, value in (("target_error", self.target_error), ("max_seconds", self.max_seconds)):
            if value is not None and not (np.isfinite(value) and value > 0):
                raise InputError(f"{name} = {value}: a positive number is needed")
        if self.mesh is not None and Path(self.mesh).suffix.lower() not in MESHES:
            raise InputError(f"mesh {self.mesh}: {' or '.join(MESHES)} is needed")
        if self.mesh is not None and not os.path.isfile(self.mesh):
            raise FileFormatError(f"no such mesh: {self.mesh}")
        w = np.sort(wavelength_list(self.wavelength_nm))
        colour.weights(w)
        object.__setattr__(self, "wavelength_nm", w)


def scenes_of(mi: Any, options: Preview, bsdf: Any) -> list[Any]:
    """The Mitsuba scenes of one material, one for each light: their pictures add up."""
    at = mi.ScalarTransform4f().look_at
    film = {"type": "hdrfilm", "width": options.size, "height": options.size, "rfilter": {"type": "box"}}
    camera = {
        "type": "perspective",
        "fov": 27.0,
        "to_world": at(origin=[0, -5.2, 1.9], target=[0, 0, -0.02], up=[0, 0, 1]),
        "film": film,
    }
    mesh = {} if options.mesh is None else {"type": Path(options.mesh).suffix[1:].lower(), "filename": options.mesh}
    parts = {
        "type": "scene",
        "camera": camera,
        "floor": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().translate([0, 0, -1.0]).scale([30, 30, 1]),
            "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": FLOOR_REFLECTANCE}},
        },
        "object": {**(mesh or {"type": "sphere"}), "bsdf": dict(bsdf)},
    }
    try:
        return [mi.load_dict({**parts, "light": light}) for light in _lights(at)]
    except RuntimeError as e:
        # a mesh or a table that Mitsuba does not read; the last part of its message says what it met
        what = options.mesh or bsdf.get("filename", "the material")
        raise FileFormatError(f"Mitsuba cannot read {what}: {str(e).rpartition('] ')[2]}") from None


def _lights(at: Any) -> list[dict[str, Any]]:
    place = [3.2, -1.5, 2.6]
    sun = {
        "type": "directional",
        "direction": [0.55, 0.7, -0.75],
        "irradiance": {"type": "uniform", "value": DIRECTIONAL},
    }
    spot = {
        "type": "spot",
        "to_world": at(origin=place, target=[0, 0, 0], up=[0, 0, 1]),
        "cutoff_angle": 35.0,
        "beam_width": 20.0,
        "intensity": {"type": "uniform", "value": SPOT * float(np.dot(place, place))},
    }
    return [sun, spot]


def preview(
    materials: Sequence[Appearance],
    options: Preview | None = None,
    variant: str | Choice = "auto",
    progress: Callable[[str, float], None] | None = None,
) -> xr.Dataset:
    """Render materials one after the other.

    Returns a Dataset over material, y (from the top), x, wavelength and xyz: `radiance` (white lights of one unit),
    `xyz` (Y = 1 is white at `exposure` 1), `xyz_stderr`; per material `seconds`, `error` (of Y) and `samples`.
    attrs: `variant` and `variant_why`, `exposure` (the factor that brings the 97th percentile of Y of all pictures
    to 1). Raises InputError for no material or two of one name, and as `Appearance.check`.
    """
    options = Preview() if options is None else options
    names = [m.name for m in materials]
    if not names or len(set(names)) < len(names):
        raise InputError(f"materials with different names are needed, got {names or 'none'}")
    for m in materials:
        m.check(options.wavelength_nm)
    chosen = choose(variant) if isinstance(variant, str) else variant
    mi = use(chosen)
    matrix, _ = colour.weights(options.wavelength_nm)
    parts = [_one(mi, m, options, matrix, progress) for m in materials]
    data = xr.concat(parts, dim=xr.Variable("material", names)).assign_coords(xyz=["X", "Y", "Z"])
    bright = np.percentile(data["tristimulus"].sel(xyz="Y").values, BRIGHT_PERCENTILE)
    data.attrs = {
        "variant": chosen.variant,
        "variant_why": chosen.why,
        "exposure": float(1.0 / bright) if bright > 0 else 1.0,
        "routes": ", ".join(m.route for m in materials),
    }
    return _labelled(data)


def _one(
    mi: Any, appearance: Appearance, options: Preview, matrix: Floats, progress: Callable[[str, float], None] | None
) -> xr.Dataset:
    """Passes of one material until the target, the time or their number is reached."""
    scenes = scenes_of(mi, options, appearance.bsdf)
    integrator = mi.load_dict({"type": "path", "max_depth": options.max_depth})
    start = time.perf_counter()
    shape = (options.size, options.size)
    mean, square = np.zeros((*shape, 3)), np.zeros((*shape, 3))
    spectra, done, error = np.zeros((*shape, options.wavelength_nm.size)), 0, np.inf
    least = options.passes
    most = MOST_PASSES if options.target_error or options.max_seconds else least
    while done < most:
        share = _share(done, most, error, options, time.perf_counter() - start)
        if progress is not None:
            progress(appearance.name, min(0.99, share))
        # no pass of one seed is one of another's: pictures of two seeds are independent
        numbers = (options.wavelength_nm, options.samples, (options.seed * MOST_PASSES + done) % 2**32)
        one = np.sum([radiance(mi, s, integrator, *numbers, same_paths=True) for s in scenes], axis=0)
        xyz = one @ matrix
        mean, square, spectra, done = mean + xyz, square + xyz**2, spectra + one, done + 1
        if done >= 2:
            error = _relative_error(mean / done, square / done, done)
        if done >= least and _finished(error, options, time.perf_counter() - start):
            break
    if progress is not None:
        progress(appearance.name, 1.0)
    variance = np.maximum(square / done - (mean / done) ** 2, 0.0) / max(done - 1, 1)
    return xr.Dataset(
        {
            "radiance": (("y", "x", "wavelength"), spectra / done),
            "tristimulus": (("y", "x", "xyz"), mean / done),
            "tristimulus_stderr": (("y", "x", "xyz"), np.sqrt(variance)),
            "seconds": time.perf_counter() - start,
            "error": error,
            "samples": done * options.samples,
        },
        coords={"wavelength": options.wavelength_nm},
    )


def _finished(error: float, options: Preview, seconds: float) -> bool:
    if options.max_seconds is not None and seconds >= options.max_seconds:
        return True
    return options.target_error is None or error <= options.target_error


def _share(done: int, most: int, error: float, options: Preview, seconds: float) -> float:
    """Share of the work that is done: by the number of passes, by the time, or by the error, which falls as 1/√n."""
    if options.max_seconds is not None:
        return seconds / options.max_seconds
    if options.target_error is not None and np.isfinite(error):
        return float(min(1.0, (options.target_error / error) ** 2)) if error > 0 else 1.0
    return done / most


def _relative_error(mean: Floats, square: Floats, passes: int) -> float:
    """RMS over the pixels of the standard error of Y, over the RMS of Y."""
    y, y2 = mean[..., 1], square[..., 1]
    variance = np.maximum(y2 - y**2, 0.0) / (passes - 1)
    size = np.sqrt(np.mean(y**2))
    return float(np.sqrt(np.mean(variance)) / size) if size > 0 else 0.0


def delta_e(data: xr.Dataset, reference: str | None = None) -> xr.DataArray:
    """ΔE₀₀ of each picture against that of the material `reference` (the first), (material, y, x), 0 for itself.

    White is Y = 1 at the common exposure: the difference between the pictures as they are shown. Raises InputError for
    a `reference` that is not there.
    """
    names = [str(m) for m in data["material"].values]
    reference = names[0] if reference is None else reference
    if reference not in names:
        raise InputError(f"reference {reference!r} is not among the materials: {', '.join(names)}")
    lab = colour.lab(data["tristimulus"].values * data.attrs["exposure"])
    values = colour.delta_e(lab[names.index(reference)][None], lab)
    return xr.DataArray(
        values,
        dims=("material", "y", "x"),
        coords={"material": data["material"]},
        name="delta_e_2000",
        attrs={"units": "1", "long_name": "colour difference CIE DE2000 under D65", "reference": reference},
    )


def rgb(data: xr.Dataset) -> Floats:
    """(material, y, x, 3) sRGB in 0 … 1 at the common exposure, clipped."""
    return colour.srgb(data["tristimulus"].values * data.attrs["exposure"])


def _labelled(data: xr.Dataset) -> xr.Dataset:
    names = {
        "radiance": ("1", "spectral radiance under white lights of one unit"),
        "tristimulus": ("1", "CIE 1931 XYZ under D65"),
        "tristimulus_stderr": ("1", "standard error of the mean of tristimulus, from independent passes"),
        "seconds": ("s", "time of rendering"),
        "error": ("1", "relative error of Y, from independent passes"),
        "samples": ("1", "paths per pixel and group of four wavelengths"),
        "wavelength": ("nm", "wavelength"),
        "xyz": ("1", "tristimulus value"),
        "material": ("1", "material"),
    }
    for name, (units, long_name) in names.items():
        data[name].attrs |= {"units": units, "long_name": long_name}
    return data
