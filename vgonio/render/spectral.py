"""Spectral radiance of a Mitsuba scene at exactly the wavelengths that are asked for.

Mitsuba carries four wavelengths along a path. Here they are not drawn at random: every pixel gets the same number of
paths for each group of four, so a spectrum of n values costs ⌈n/4⌉ renderings and has no noise from the choice of
wavelengths. The light is followed by one of Mitsuba's own integrators ("path" unless another is given).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..directions import wavelength_list

Floats = NDArray[np.float64]
GROUP = 4  # wavelengths of a path in Mitsuba's spectral variants
MOST_LANES = 2**21  # paths of one launch: about 1 GB


def groups(wavelength_nm: Floats) -> Floats:
    """(g, 4) wavelengths in nm, each group spread over the whole spectrum; the last one fills up."""
    n = -(-wavelength_nm.size // GROUP)
    padded = np.append(wavelength_nm, np.full(n * GROUP - wavelength_nm.size, wavelength_nm[-1]))
    return padded.reshape(GROUP, n).T


def radiance(
    mi: Any,
    scene: Any,
    integrator: Any,
    wavelength_nm: Any,
    samples: int,
    seed: int = 0,
    *,
    sensor: int = 0,
    same_paths: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Floats:
    """Mean spectral radiance (height, width, n_λ) of the pixels of a sensor, box filter, in the unit of the emitters.

    wavelength_nm (n_λ,);  samples : paths per pixel and group of wavelengths;  seed : 0 … 2³² − 1
    same_paths : every group follows the same paths, so that noise has no colour; otherwise they are independent, and
        noise averages out over the spectrum
    progress : called with the share that is done
    """
    eye = scene.sensors()[sensor]
    width, height = (int(x) for x in eye.film().crop_size())
    wanted = wavelength_list(wavelength_nm)
    sets = groups(wanted)
    lanes = height * width * samples
    at_once = 1 if same_paths else max(1, min(len(sets), MOST_LANES // lanes))
    trace = _trace_scalar if mi.variant().startswith("scalar") else _trace
    found = []
    for first in range(0, len(sets), at_once):
        block = sets[first : first + at_once]
        start = seed if same_paths else (seed * 1009 + first) % 2**32
        values = trace(mi, scene, integrator, eye, block, (height, width), samples, start)
        found.append(values)
        if progress is not None:
            progress(min(1.0, (first + at_once) / len(sets)))
    spectra = np.concatenate(found)  # (g, height, width, 4)
    return np.moveaxis(spectra, (0, 3), (3, 2)).reshape(height, width, -1)[..., : wanted.size]


def _trace(
    mi: Any, scene: Any, integrator: Any, eye: Any, sets: Floats, shape: tuple[int, int], samples: int, seed: int
) -> Floats:
    """(g, height, width, 4) in one launch: lanes are ordered by group, pixel, sample."""
    import drjit as dr

    height, width = shape
    count = len(sets) * height * width * samples
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, count)
    lane = dr.arange(mi.UInt32, count)
    # opaque numbers: the compiled kernel then serves every size, seed and set of wavelengths
    per_pixel, across, down = (dr.opaque(mi.UInt32, x) for x in (samples, width, height))
    pixel = lane // per_pixel
    row, column = (pixel // across) % down, pixel % across
    place = mi.Point2f(column, row) + sampler.next_2d()
    place = mi.Point2f(place.x / mi.Float(across), place.y / mi.Float(down))
    ray, _ = eye.sample_ray_differential(0.0, 0.5, place, mi.Point2f(0.5), True)
    group = pixel // (across * down)
    table = [mi.Float(sets[:, j].astype(np.float32)) for j in range(GROUP)]
    ray.wavelengths = mi.Spectrum(*(dr.gather(mi.Float, t, group) for t in table))
    value, hit, _ = integrator.sample(scene, sampler, ray)
    value = dr.select(hit, value, 0.0)
    found = np.array(value, dtype=np.float64)  # (4, lanes)
    return found.reshape(GROUP, len(sets), height, width, samples).mean(axis=-1).transpose(1, 2, 3, 0)


def _trace_scalar(
    mi: Any, scene: Any, integrator: Any, eye: Any, sets: Floats, shape: tuple[int, int], samples: int, seed: int
) -> Floats:
    """The same path by path."""
    height, width = shape
    result = np.zeros((len(sets), height, width, GROUP))
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, 1)
    for g, wavelengths in enumerate(sets):
        spectrum = mi.Spectrum(*(float(w) for w in wavelengths))
        for pixel in range(height * width):
            row, column = divmod(pixel, width)
            total = np.zeros(GROUP)
            for _ in range(samples):
                shift = sampler.next_2d()
                place = mi.Point2f((column + shift.x) / width, (row + shift.y) / height)
                ray, _ = eye.sample_ray_differential(0.0, 0.5, place, mi.Point2f(0.5), True)
                ray.wavelengths = spectrum
                value, hit, _ = integrator.sample(scene, sampler, ray)
                if hit:
                    total += np.array(value, dtype=np.float64).ravel()
            result[g, row, column] = total / samples
    return result


def in_passes(render: Callable[[int, int], Floats], samples: int, passes: int, seed: int = 0) -> tuple[Floats, Floats]:
    """Mean and standard error of the mean over independent passes; `render(samples, seed)` makes one of them."""
    each = max(1, samples // passes)
    found = np.stack([render(each, seed * 7919 + i) for i in range(passes)])
    return found.mean(axis=0), found.std(axis=0, ddof=1) / np.sqrt(passes)
