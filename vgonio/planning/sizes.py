"""How much a scene asks for: results, detector elements, points between samples."""

from __future__ import annotations

import numpy as np

from .. import assembly
from ..scene import Scene
from ..surface import Heightfield

FEWEST_FOR_SHIFT = 3  # wavelengths: a line through two points fits whatever they are


def result_groups(scene: Scene) -> list[str]:
    """Names of the groups that hold a BRDF, in order: rays, waves …, measured."""
    rays = ["rays"] if scene.geometric is not None else []
    return rays + list(assembly.wave_groups(scene)) + (["measured"] if scene.measured is not None else [])


def detector_elements(scene: Scene) -> int:
    """Number of detector cones or cells."""
    from ..directions import Detector

    asked = scene.detector
    if asked is None:
        return 0
    if asked.theta_o_deg is not None:
        return len(asked.theta_o_deg)
    return len(Detector.hemisphere(5.0 if asked.resolution_deg is None else asked.resolution_deg))


def refinement(surface: Heightfield, wavelength_nm: list[float]) -> int:
    """Points per sample and axis for at most half a cycle of phase between points on the steepest RMS slope."""
    from ..surface.plausible import rms_step_slope

    k = 2 * np.pi / (min(wavelength_nm) * 1e-3)
    return max(1, int(np.ceil(2 * k * max(surface.pitch_um) * (1 + rms_step_slope(surface)) / np.pi)))
