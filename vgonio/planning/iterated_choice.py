"""Reflections and patches of iterated Kirchhoff that a choice may vary, with the error that each leaves.

What is left out has a share p of the light, which rays tell before anything is simulated: reflections beyond the last
one (`bounces`), second hits outside the patch (`window_um`). In a coherent sum a share p changes the brdf by up to p
and, by interference, by about 2 √(p/n), n independent windows over which that averages. Windows are never made smaller:
below six coherence lengths the window is the coherence length, which is a question and no effort.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import assembly
from ..errors import InputError
from ..scene import Scene
from ..surface import Heightfield
from .plans import in_words

BOUNCES = (1, 2, 3, 4, 6, 8)
WIDER = (1.0, 1.5, 2.0, 3.0)  # of the patch that is taken where none is named
RAYS = 20_000  # of the look at reflections, to an angle
WORTH = 1e-4  # share of the light below which nothing more is tried


@dataclass(frozen=True)
class Variant:
    """Settings by key of the scene, the error that they leave, and where that is from"""

    settings: dict[str, Any]
    error: float = 0.0
    why: str = ""

    @property
    def words(self) -> str:
        return in_words(self.settings)


def variants(scene: Scene, surface: Heightfield) -> list[Variant]:
    """All that are worth trying; what the scene names stays. A single one without settings where nothing can vary."""
    if scene.wave is None or "iterated-kirchhoff" not in scene.wave.theory:
        return [Variant({})]
    bounces = _bounces(scene, surface)
    return [_worse(b, w) for w in _windows(scene, surface) for b in bounces]


def _worse(a: Variant, b: Variant) -> Variant:
    """Both together: the larger error counts, as tolerances do."""
    worst = a if a.error >= b.error else b
    return Variant(a.settings | b.settings, worst.error, worst.why)


def changed_by(share: float, independent: float) -> float:
    """Of the brdf, relative to its largest values, where so large a share of the light is left out."""
    return float(share + 2 * np.sqrt(share / max(independent, 1.0)))


def _bounces(scene: Scene, surface: Heightfield) -> list[Variant]:
    assert scene.wave is not None
    gonio = assembly.gonioreflectometer(scene)
    independent = places_of(scene, surface, scene.wave.window_um).independent
    asked = scene.wave.bounces
    left = _left_after(scene, surface, gonio.incoming)
    found = []
    for b in BOUNCES if asked is None else (asked,):
        share = left[min(b, len(left)) - 1]
        words = f"{share:.2g} of the light that is reflected more than {b} time{'s' if b > 1 else ''}"
        found.append(Variant({} if asked else {"wave.bounces": b}, changed_by(share, independent), words))
        if share < WORTH:
            break
    return found


def _left_after(scene: Scene, surface: Heightfield, incoming: Any) -> list[float]:
    """Shares of the reflected light that leave after more than 1, 2, … reflections, by rays: the largest of all θ_i."""
    import warnings

    from ..directions import Detector
    from ..geometric import RayOptics

    light, most = scene.light, BOUNCES[-1]
    assert light is not None
    ends = sorted({min(light.wavelength_nm), max(light.wavelength_nm)})
    solver = RayOptics(assembly.scene_material(scene), ends, rays=RAYS, bounces=most + 1, estimator="binning")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        by = solver.scatter(surface, incoming, Detector.in_plane([0.0], aperture_deg=2.0))["energy_by_bounce"]
    total = np.maximum(by.sum("bounce"), 1e-300)
    return [float((by.isel(bounce=slice(b, None)).sum("bounce") / total).max()) for b in range(1, most + 1)]


def _windows(scene: Scene, surface: Heightfield) -> Iterator[Variant]:
    from ..wave.iterated.second_hits import second_hits

    assert scene.wave is not None
    incoming, asked = assembly.gonioreflectometer(scene).incoming, scene.wave.window_um
    usual = places_of(scene, surface, asked).window_um
    for wider in WIDER if asked is None else (1.0,):
        try:
            places = places_of(scene, surface, asked or (float(f"{usual * wider:.3g}") if wider > 1 else usual))
        except InputError:  # larger than the surface
            return
        hits = [second_hits(surface, places.windows, places.length_um, wi, 0) for wi in incoming.vectors]
        share = max(again * outside for again, outside in hits)
        words = f"{share:.2g} of the light that meets the surface again outside the patch of {places.window_um:g} µm"
        settings = {"wave.window_um": places.window_um} if wider > 1 else {}
        yield Variant(settings, changed_by(share, places.independent), words)
        if share < WORTH:
            return


def places_of(scene: Scene, surface: Heightfield, window_um: float | None) -> Any:
    """The windows of iterated Kirchhoff on the scene's surface."""
    from ..wave.iterated.place import Places

    assert scene.wave is not None
    coherence = assembly.gonioreflectometer(scene).incoming.coherence_um
    return Places.of(surface, window_um, coherence, scene.wave.windows)
