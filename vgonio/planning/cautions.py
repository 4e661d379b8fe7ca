"""What to be wary of in a scene's numbers, before they are there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..assembly import Inputs, gonioreflectometer, rays, wave_groups
from ..scene import Light, Scene
from ..validity import wave_warnings
from .forecast import Forecast
from .slips import slips

if TYPE_CHECKING:
    import xarray as xr

    from ..surface import Heightfield

MOST_TRIED = 10**6  # points of a surface that is meshed for a warning, 0.5 s


def warnings_of(scene: Scene, inputs: Inputs, expected: Mapping[str, Forecast]) -> list[str]:
    found = slips(scene, inputs)
    scalar = [t for t in scene.wave.theory if t != "full-wave"] if scene.wave is not None else []
    if inputs.surface is not None and scene.wave is not None and scalar:
        material = scene.material.name if scene.material is not None else None
        largest = _largest_theta_o(scene)
        found += wave_warnings(inputs.surface, scalar, scene.light, largest, scene.wave.shadowing, material)
        found += _cut_window(scene, inputs.surface)
        found += _long(scene, expected)
    if inputs.surface is not None and scene.geometric is not None and scene.light is not None:
        found += _turned_slopes(scene, inputs.surface)
    if inputs.measured is not None and scene.light is not None:
        found += _measured_warnings(inputs.measured, scene.light)
    return found


def _turned_slopes(scene: Scene, surface: Heightfield) -> list[str]:
    """The line of the run where mirror images of a finite sample turn its slopes round; a big mesh tells in the run."""
    from ..surface.symmetry import leaning

    if surface.periodic or surface.z.size > MOST_TRIED or not leaning(surface):
        return []
    from ..geometric.sides import caution, mirrored_at

    incoming = gonioreflectometer(scene).incoming
    told = caution(surface, incoming, mirrored_at(rays(scene), surface, incoming))
    return [told] if told else []


def _cut_window(scene: Scene, surface: Heightfield) -> list[str]:
    """A line where iterated Kirchhoff will not take the coherence length of the light."""
    if scene.wave is None or "iterated-kirchhoff" not in scene.wave.theory:
        return []
    from .iterated_choice import places_of

    cut = places_of(scene, surface, scene.wave.window_um).cut
    return [f"iterated-kirchhoff: {cut}"] if cut else []


def _long(scene: Scene, expected: Mapping[str, Forecast]) -> list[str]:
    """A line where the scalar waves are long work, and whether they would be begun at all."""
    from ..wave import forecast
    from ..wave.theories import THEORIES

    groups = [name for name, theory in wave_groups(scene).items() if theory in THEORIES]
    seconds = sum(expected[name].seconds for name in groups if name in expected)
    if seconds <= forecast.WARN_SECONDS or refusal(scene, expected):
        return []
    return [f"waves: {forecast.remedy(seconds)}"]


def refusal(scene: Scene, expected: Mapping[str, Forecast]) -> str:
    """Why `simulate` will not begin a scene: scalar waves of more than a day; "" where it will."""
    from ..wave import forecast
    from ..wave.theories import THEORIES

    seconds = [expected[n].seconds for n, t in wave_groups(scene).items() if t in THEORIES and n in expected]
    longest = max(seconds, default=0.0)
    if longest <= forecast.MOST_SECONDS:
        return ""
    return f"waves: {forecast.remedy(longest)}; at most {forecast.MOST_SECONDS / 3600:.0f} h are begun"


def _largest_theta_o(scene: Scene) -> float:
    asked = scene.detector
    if asked is None:
        return 0.0
    return 90.0 if asked.theta_o_deg is None else float(np.max(np.abs(asked.theta_o_deg)))


def _measured_warnings(data: xr.Dataset, light: Light) -> list[str]:
    found = []
    for name, asked, unit in (("theta_i", light.theta_i_deg, "°"), ("wavelength", light.wavelength_nm, " nm")):
        have = np.asarray(data[name], float)
        outside = [a for a in asked if not have.min() - 1e-6 <= a <= have.max() + 1e-6]
        if outside:
            found.append(
                f"{name} of the measured file goes from {have.min():g} to {have.max():g}{unit}: "
                f"{len(outside)} of {len(asked)} values of the scene are outside and cannot be compared"
            )
    return found
