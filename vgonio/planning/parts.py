"""Seconds, memory and error of every part of a run: what is fixed, libraries included, and what grows with the work."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import assembly
from ..accuracy.calibrating import Calibration
from ..accuracy.speeds import Speeds
from ..directions import Detector, Incoming
from ..memory import resident
from ..scene import Scene
from ..surface import Heightfield
from .forecast import LEAST_WAVE_TOL, MB, Forecast
from .loading import costs
from .sizes import FEWEST_FOR_SHIFT, detector_elements, result_groups

if TYPE_CHECKING:
    from ..wave import FullWave, IteratedKirchhoff

# in units of the time that a point of a surface takes for its first phase (`Speeds.phase`), measured beside it
READ, LEVEL, SUMMARY, SAMPLE_BYTES = 0.4, 4.0, 4.0, 60.0
# of the time that the part takes in the smallest scene
PAIR, UNPAIRED = 0.9, 0.8  # more for every further pair of results, less where there is none
FIGURE, MOST_FIGURES, RESULT = 0.16, 13, 0.2
UNCOLOURED = 0.5  # less, of a page without colours and spectra
CELL_BYTES = 100.0  # of a BRDF, its error and what else stands beside it, when it is saved
KEPT, MOST_KEPT = 0.5, 80 * MB  # of a part's memory, that Python does not hand back
SPACING_ERROR = {True: 0.01, False: 0.03}  # of points on profiles and patches: shadows' edges fall between them


def forecasts(
    scene: Scene, source: Heightfield | None, surface: Heightfield | None, on: Calibration, solvers: bool = True,
    first_look: bool = False, new_process: bool = False,
) -> dict[str, Forecast]:  # fmt: skip
    """Part of the run → its forecast; `memory_bytes` is that of the whole process while the part runs.

    solvers : False leaves their own work out, but not their libraries
    first_look : at some rays, where only they tell what their error will be
    new_process : of a run in a process of its own, otherwise of one in this process, which may have libraries already
    """
    speeds = on.speeds
    found = {"start": Forecast(0.0, 0.0)}
    if source is not None and surface is not None:
        found["surface"] = _surface(scene, source, speeds)
        found["surface summary"] = Forecast(SUMMARY * surface.z.size * speeds.phase, SAMPLE_BYTES * surface.z.size)
    elif scene.measured is not None:
        found["surface"] = Forecast(0.0, 0.0)
    known = dict[str, Forecast]()
    if surface is not None and solvers:
        known = {k: f for k, f in _solvers(scene, surface, on, first_look) if f is not None}
    elif surface is not None:
        known = {name: Forecast(0.0, 0.0) for name in result_groups(scene) if name != "measured"}
    return _with_fixed(found | known | _verdict(scene, speeds), scene, surface, speeds, new_process)


def _solvers(
    scene: Scene, surface: Heightfield, on: Calibration, first_look: bool
) -> Iterator[tuple[str, Forecast | None]]:
    """Groups of the result and the forecasts of their solvers, None for a solver of another kind."""
    if scene.geometric is not None:
        yield "rays", _rays(scene, surface, on, first_look)
    for name, theory in assembly.wave_groups(scene).items():
        yield name, wave_part(scene, surface, theory, on.speeds)


def _with_fixed(
    found: dict[str, Forecast], scene: Scene, surface: Heightfield | None, speeds: Speeds, new_process: bool
) -> dict[str, Forecast]:
    """The same with Python and libraries in seconds and memory: what is loaded stays, and is loaded once."""
    once = costs(scene, surface, list(found), speeds, new_process)
    out, base = dict[str, Forecast](), 0.0 if new_process else float(resident())
    for part, of in found.items():
        seconds, size = once[part]
        base += size
        each = speeds.fixed.get("waves" if part.startswith("waves") else part, 0.0)
        memory = base + of.memory_bytes
        out[part] = replace(of, seconds=of.seconds + each + seconds, memory_bytes=memory, loading=seconds)
        base += min(KEPT * of.memory_bytes, MOST_KEPT)
    return out


def _surface(scene: Scene, source: Heightfield, speeds: Speeds) -> Forecast:
    asked, n = scene.surface, source.z.size
    seconds, memory = READ * n * speeds.phase, SAMPLE_BYTES * n
    if asked is not None and asked.file is not None:
        if asked.filter is not None or assembly.levelling(scene, source) != "none":
            seconds += LEVEL * n * speeds.phase
    return Forecast(seconds, memory)


def _rays(scene: Scene, surface: Heightfield, on: Calibration, first_look: bool) -> Forecast | None:
    from ..geometric import RayOptics
    from .ray_forecast import ray_forecast

    gonio, solver = assembly.gonioreflectometer(scene), assembly.rays(scene)
    if not isinstance(solver, RayOptics):
        return None
    return ray_forecast(solver, surface, gonio.incoming, gonio.detector, on.speeds, on.threads, first_look)


def wave_part(scene: Scene, surface: Heightfield, theory: str, speeds: Speeds) -> Forecast | None:
    gonio = assembly.gonioreflectometer(scene)
    return of_waves(assembly.waves(scene, theory), surface, gonio.incoming, gonio.detector, speeds)


def of_waves(
    solver: Any, surface: Heightfield, incoming: Incoming, detector: Detector, speeds: Speeds
) -> Forecast | None:
    """Of `solver.scatter(surface, incoming, detector)`, without libraries; None for a solver that is none of waves."""
    from ..wave import FullWave, IteratedKirchhoff, Kirchhoff

    if isinstance(solver, FullWave):
        return _full_wave(solver, surface, incoming, speeds)
    if isinstance(solver, IteratedKirchhoff):
        return _iterated(solver, surface, incoming, speeds)
    if isinstance(solver, Kirchhoff):
        from .wave_forecast import wave_forecast

        return wave_forecast(solver, surface, incoming, detector, speeds)
    return None


def _full_wave(solver: FullWave, surface: Heightfield, incoming: Incoming, speeds: Speeds) -> Forecast:
    from ..wave.full_wave import forecast

    expected = forecast(solver, surface, incoming)
    # for large systems the factorisation is what counts, and its speed was measured by itself
    flops = FLOPS * expected.price.unknowns**3 * expected.windows * len(solver.wavelength_nm)
    seconds = max(expected.seconds * speeds.kernel, flops * speeds.flop)
    return Forecast(seconds, expected.price.bytes, max(solver.tol, LEAST_WAVE_TOL), 1 / np.sqrt(expected.windows))


def _iterated(solver: IteratedKirchhoff, surface: Heightfield, incoming: Incoming, speeds: Speeds) -> Forecast:
    from ..wave.iterated.forecast import counts

    n = counts(solver, surface, incoming)
    pair = speeds.profile_pair if surface.is_profile else speeds.patch_pair
    seconds = n.pairs * pair + n.far * speeds.far_term
    memory = PROFILE_PAIR_BYTES * n.points**2 if surface.is_profile else PATCH_BYTES * n.points
    return Forecast(seconds, memory, max(solver.tol, SPACING_ERROR[surface.is_profile]), 1 / np.sqrt(n.independent))


FLOPS = 0.67  # of n³: a factorisation of complex numbers, n unknowns, when half of them are eliminated
PROFILE_PAIR_BYTES, PATCH_BYTES = 60.0, 2500.0


def _verdict(scene: Scene, speeds: Speeds) -> dict[str, Forecast]:
    """Comparison, saving, page."""
    results = len(result_groups(scene))
    angles = len(scene.light.theta_i_deg) if scene.light is not None else 5
    wavelengths = len(scene.light.wavelength_nm) if scene.light is not None else 5
    cells = float(results * angles * wavelengths * detector_elements(scene))
    found = {}
    if results:
        of = speeds.fixed.get("comparison", 0.1)
        pairs = results * (results - 1) / 2
        found["comparison"] = Forecast(of * (PAIR * (pairs - 1) if pairs else -UNPAIRED), CELL_BYTES * cells)
    if scene.output.file:
        found["save"] = Forecast(2e-7 * cells, CELL_BYTES * cells)
    if scene.output.report:
        of = speeds.fixed.get("report", 1.0)
        plane = scene.detector is not None and scene.detector.theta_o_deg is not None
        figures = FIGURE * (min(angles, MOST_FIGURES) - 1) * plane + RESULT * (results - 2)
        figures -= UNCOLOURED * (wavelengths < FEWEST_FOR_SHIFT)
        found["report"] = Forecast(max(of * figures, -0.6 * of), CELL_BYTES * cells + 3 * MB * angles)
    return found
