"""Rough seconds of the wave theories."""

from __future__ import annotations

import numpy as np

from ..scene import Scene
from ..surface import Heightfield
from .sizes import detector_elements, refinement


def wave_seconds(scene: Scene, surface: Heightfield) -> float:
    """Rough seconds of the wave theories of a scene, all together: right within a factor of a few."""
    from ..wave import cost
    from ..wave.coherence import REACH, tile
    from ..wave.theories import THEORIES

    asked, light, detector = scene.wave, scene.light, scene.detector
    if asked is None or light is None or detector is None:
        return 0.0
    spacing = np.array(surface.pitch_um) / refinement(surface, light.wavelength_nm)
    counts = np.maximum(np.minimum(2 * REACH * light.coherence_um, surface.size_um) / spacing, 16)
    k = 2e3 * np.pi / np.asarray(light.wavelength_nm)
    in_plane = detector.theta_o_deg is not None
    radius = k * light.coherence_um * (np.sin(np.deg2rad(detector.aperture_deg / 2)) if in_plane else 0.0)
    angles, elements = len(light.theta_i_deg), detector_elements(scene)
    local = (2 if light.polarisation == "unpolarised" else 1) if asked.fresnel == "local" else 12 * asked.polarised
    passes = float(angles * (elements if asked.shadowing else 1) * max(1, local * len(k)))
    plain = not local and not asked.shadowing
    one = cost.seconds(
        len(tile(surface, light.coherence_um)),
        float(counts[1] if surface.is_profile else counts.prod()) * (4 if asked.shadowing else 1),
        angles * elements * float(np.sum(np.maximum(0.7 * np.pi * radius**2, 1) if in_plane else 4 + 0 * k)),
        float(2 * radius.max() + 1) if in_plane else 10.0,
        1.0 if plain else passes,
        plain and in_plane and not surface.is_profile and asked.method in ("auto", "nufft"),
        asked.method,
    )
    return one * sum(t in THEORIES for t in asked.theory)
