"""Ways to make the parts of a scene: numbers of rays, estimators, methods, tolerances, patches, and what each costs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from .. import assembly
from ..accuracy.calibrating import Calibration
from ..scene import Scene
from ..surface import Heightfield
from .forecast import LEAST_WAVE_TOL
from .iterated_choice import variants
from .parts import SPACING_ERROR, wave_part
from .plans import rounded_up

RAY_TOLERANCES = (0.3, 0.1, 0.05, 0.03, 0.02, 0.01, 0.005, 0.003, 0.002, 0.001)
WAVE_TOLERANCES = (0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6)
SOME = (0.1, 0.01, 1e-3, 1e-4)  # of them for direct sums, which are seldom the quickest
MOST_TRACED = 10**11  # rays at all angles together: hours to days
ITERATED_TOLERANCES = (0.1, 0.03, 0.01)  # its spacing of points is good to 1 … 3 %
OPENCL_TOL = 5e-5  # what single precision is good for
FEWER = (2, 4, 8, 16, 64)  # of the windows only every so many are taken, where time is short


@dataclass(frozen=True)
class Candidate:
    """One way to make a part: settings by key of the scene, and what they cost

    part : "rays" or "waves";  why : where the error is from, where that is not the tolerance
    added : speckle that it has more than the scene's own windows and patches, as a relative standard error
    """

    part: str
    settings: dict[str, Any]
    seconds: float
    error: float
    speckle: float | None = None
    why: str = ""
    added: float = 0.0

    def row(self, chosen: bool) -> dict[str, Any]:
        return {
            "part": self.part,
            "settings": dict(self.settings),
            "seconds": self.seconds,
            "error": self.error,
            "speckle": self.speckle,
            "chosen": chosen,
        }


def groups_of(scene: Scene, surface: Heightfield, on: Calibration, tol: float | None) -> list[list[Candidate]]:
    groups = []
    if scene.geometric is not None:
        groups.append(list(_ray_candidates(scene, surface, on, tol)))
    if scene.wave is not None:
        groups.append(list(wave_candidates(scene, surface, on, tol)))
    return groups


def _ray_candidates(scene: Scene, surface: Heightfield, on: Calibration, tol: float | None) -> Iterator[Candidate]:
    from .ray_forecast import forecasts_of_tolerances

    assert scene.geometric is not None
    gonio, asked = assembly.gonioreflectometer(scene), scene.geometric
    narrow = gonio.detector.kind == "in-plane" and not gonio.incoming.divergence_deg
    estimators = ("facets", "binning") if asked.estimator == "auto" and narrow else (asked.estimator,)
    tolerances = sorted({*RAY_TOLERANCES, *([tol] if tol else [])}, reverse=True)
    most = MOST_TRACED // len(gonio.incoming.theta_deg)
    for estimator in estimators:
        solver = replace(assembly.rays(scene), estimator=estimator)
        found = forecasts_of_tolerances(
            solver, surface, gonio.incoming, gonio.detector, on.speeds, on.threads, tolerances, most
        )
        for tolerance, (wanted, f) in zip(tolerances, found):
            # where so many rays cannot be had, the error is what the most give
            short = wanted.rays == most and (f.error or 0.0) > tolerance
            error = rounded_up(f.error or 0.0) if short else tolerance
            settings = {"geometric.tol": error, "geometric.rays": wanted.rays, "geometric.estimator": estimator}
            yield Candidate("rays", settings, f.seconds, error)


def wave_candidates(scene: Scene, surface: Heightfield, on: Calibration, tol: float | None) -> Iterator[Candidate]:
    assert scene.wave is not None
    scalar = set(scene.wave.theory) - {"full-wave", "iterated-kirchhoff"}
    methods = ("nufft", "opencl", "reference") if scene.wave.method == "auto" and scalar else (scene.wave.method,)
    asked = [max(tol, LEAST_WAVE_TOL)] if tol else []
    iterated = "iterated-kirchhoff" in scene.wave.theory
    tolerances = sorted({*(ITERATED_TOLERANCES if iterated else WAVE_TOLERANCES), *asked}, reverse=True)
    tried, known, usual = variants(scene, surface), dict[str, Candidate](), 1.0
    for method in methods:
        few = method != "nufft" and len(methods) > 1
        for tolerance in [t for t in tolerances if not few or t in SOME or t == tol]:
            if method == "opencl" and tolerance < OPENCL_TOL:
                continue
            for variant in tried:
                settings = {"wave.tol": tolerance, "wave.method": method, **variant.settings}
                if scene.wave.theory == ["iterated-kirchhoff"] and variant.words in known:  # tol costs it nothing
                    error = max(tolerance, SPACING_ERROR[surface.is_profile])
                    whole = replace(known[variant.words], settings=settings, error=error)
                else:
                    whole = known[variant.words] = _wave_candidate(scene, surface, on, settings)
                if "wave.window_um" not in variant.settings:
                    usual = whole.speckle or 0.0
                else:
                    whole = replace(whole, added=max((whole.speckle or 0.0) ** 2 - usual**2, 0.0) ** 0.5)
                if variant.error > whole.error:
                    whole = replace(whole, error=min(variant.error, 1.0), why=variant.why)
                yield whole
                yield from _with_fewer_windows(scene, surface, whole)


def _wave_candidate(scene: Scene, surface: Heightfield, on: Calibration, settings: dict[str, Any]) -> Candidate:
    changed = with_settings(scene, settings)
    found = [wave_part(changed, surface, theory, on.speeds) for theory in assembly.wave_groups(scene).values()]
    known = [f for f in found if f is not None]
    seconds = sum(f.seconds for f in known)
    error = max((f.error for f in known if f.error is not None), default=1.0)
    return Candidate("waves", settings, seconds, error, max((f.speckle or 0.0 for f in known), default=None))


def _with_fewer_windows(scene: Scene, surface: Heightfield, whole: Candidate) -> Iterator[Candidate]:
    """The same with fewer windows: time falls as their number, but for a window's worth of finding the spacing; the
    speckle rises as one over its root."""
    from ..wave.coherence import WindowPlan

    assert scene.wave is not None
    incoming = assembly.gonioreflectometer(scene).incoming
    there = WindowPlan.of(surface, incoming.coherence_um, scene.wave.windows)
    for fewer in FEWER:
        count = len(there.windows) // fewer
        if count >= 1:
            independent = min(float(count), there.independent)
            yield Candidate(
                "waves",
                {**whole.settings, "wave.windows": count},
                whole.seconds * (count + 0.5) / (len(there.windows) + 0.5),
                whole.error,
                min(1.0, (whole.speckle or 0.0) * (there.independent / independent) ** 0.5),
            )


def with_settings(scene: Scene, settings: dict[str, Any]) -> Scene:
    """The scene with other values of some keys "table.key" of tables that it has."""
    tables: dict[str, dict[str, Any]] = {}
    for key, value in settings.items():
        table, name = key.split(".")
        if getattr(scene, table) is not None:
            tables.setdefault(table, {})[name] = value
    return scene.model_copy(update={t: getattr(scene, t).model_copy(update=v) for t, v in tables.items()})
