"""One scene or program of `forecast.py`, in a process of its own: what was expected of it beside what it took, as JSON.

    python benchmarks/forecast_run.py '{"scene": …, "overrides": […], "chosen": {…}, "calibrations": {name: path}}'
    python benchmarks/forecast_run.py '{"program": path, "arguments": […], "calibrations": {name: path}}'

In a program every scene that it simulates and every `Gonioreflectometer.measure` is forecast first and timed then; the
points of a sweep, which run in other processes, are simulated here once more. Prints a list of parts: group, part,
calls, expected seconds by calibration, elapsed and processor seconds, memory expected and found, errors.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import os
import re
import runpy
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

REFERENCE = 10.0  # times finer a tolerance, for the error that was achieved
MOST_FOR_REFERENCE = 15.0  # seconds that a part may have taken to be done again that much finer
Row = dict[str, Any]


class Record:
    """The parts of this process: forecasts by calibration, seconds, memory."""

    def __init__(self, calibrations: dict[str, str], references: bool) -> None:
        self.calibrations, self.references = calibrations, references
        self.rows: dict[tuple[str, str], Row] = {}
        self.inside = False  # of a simulation, whose solvers are no calls of the program's own

    def add(self, group: str, part: str, **figures: Any) -> None:
        """Seconds of calls of one kind add up; of memory and errors the largest counts."""
        row = self.rows.setdefault((group, part), {"group": group, "part": part, "calls": 0})
        row["calls"] += 1
        for name, value in figures.items():
            if value is None:
                continue
            if isinstance(value, dict):
                held = row.setdefault(name, dict.fromkeys(value, 0.0))
                row[name] = {k: held[k] + v for k, v in value.items()}
            elif name in ("wall", "cpu"):
                row[name] = row.get(name, 0.0) + value
            else:
                row[name] = max(row.get(name, 0.0), value)

    @contextlib.contextmanager
    def by(self, name: str) -> Iterator[None]:
        """With one of the calibrations."""
        held = os.environ.get("VGONIO_CALIBRATION")
        os.environ["VGONIO_CALIBRATION"] = self.calibrations[name]
        yield
        os.environ["VGONIO_CALIBRATION"] = held or "off"


def status(field: str) -> float:
    """VmRSS or VmHWM of this process in bytes; ru_maxrss would count that of the process it was forked from."""
    return 1024.0 * int(re.search(rf"{field}:\s+(\d+)", Path("/proc/self/status").read_text())[1])  # type: ignore[index]


def forget_peak() -> None:
    """VmHWM begins anew."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


# ---- scenes
def run_scene(record: Record, group: str, scene: Any, overrides: Any = (), **given: Any) -> Any:
    """Plan by every calibration, then simulate: planned first, so that planning is not counted with the first part."""
    import vgonio as vg

    simulate = record.simulate if hasattr(record, "simulate") else vg.simulate
    chosen = {k: given.pop(k) for k in ("max_seconds", "tol") if given.get(k) is not None}
    plans = {}
    for name in record.calibrations:
        with record.by(name):
            plans[name] = vg.plan(scene, overrides, **chosen)
    open_: dict[str, Any] = {}
    took: dict[str, tuple[float, float]] = {}

    def progress(part: str, share: float) -> None:
        if share == 0.0:
            open_[part] = time.perf_counter(), time.process_time()
        elif share == 1.0:
            wall, used = open_[part]
            took[part] = time.perf_counter() - wall, time.process_time() - used

    forget_peak()
    record.inside = True
    with record.by(next(iter(plans))):
        tree = simulate(scene, overrides, progress=progress, **chosen, **given)
    record.inside = False
    peak = status("VmHWM")
    parts = {name: plan.parts() for name, plan in plans.items()}
    first = next(iter(parts.values()))
    for part, (wall, used) in took.items():
        if part in first:
            stated = tree[part].attrs.get("error_achieved") if part in tree.children else None
            record.add(
                group, part, expected={n: p[part]["seconds"] for n, p in parts.items()}, wall=wall, cpu=used,
                error_expected=first[part]["error"] if isinstance(stated, float) else None,
                error_stated=stated if isinstance(stated, float) else None,
                error_achieved=_achieved_in_scene(record, scene, tree, part, wall),
            )  # fmt: skip
    record.add(group, "memory", memory_expected=next(iter(plans.values())).memory_bytes, memory=peak)
    return tree


def _achieved_in_scene(record: Record, given: Any, tree: Any, part: str, wall: float) -> float | None:
    if not record.references or not part.startswith("waves") or wall > MOST_FOR_REFERENCE:
        return None
    from vgonio import assembly
    from vgonio.scene import load_scene

    scene = load_scene(json.loads(tree.attrs["scene"]))  # with what was chosen
    scene._folder = load_scene(given).folder
    solver, surface = assembly.waves(scene, assembly.wave_groups(scene)[part]), assembly.prepared_surface(scene)
    return _achieved(record, tree[part].to_dataset(), assembly.gonioreflectometer(scene), surface, solver)


def _achieved(record: Record, data: Any, gonio: Any, surface: Any, solver: Any) -> float | None:
    """Largest difference from the same with a tolerance ten times finer, over the largest value of each θ_i and λ."""
    finer = dataclasses.replace(solver, tol=max(solver.tol / REFERENCE, 1e-11))
    held, record.inside = record.inside, True
    try:
        reference = finer.scatter(surface, gonio.incoming, gonio.detector)["brdf"]
    except Exception as e:
        print(f"no reference: {e}", file=sys.stderr)
        return None
    finally:
        record.inside = held
    over = [d for d in reference.dims if d not in ("theta_i", "wavelength")]
    return float((abs(data["brdf"] - reference).max(over) / reference.max(over)).max())


# ---- programs
def run_program(record: Record, path: str, arguments: list[str]) -> None:
    """With `simulate`, `sweep` and `measure` watched."""
    import vgonio as vg
    from vgonio import simulation, studies
    from vgonio.measure import Gonioreflectometer

    record.simulate, measure, sweep = simulation.simulate, Gonioreflectometer.measure, studies.sweep  # type: ignore[attr-defined]

    def simulated(scene: Any, overrides: Any = (), **given: Any) -> Any:
        given.pop("planned", None), given.pop("progress", None)
        return run_scene(record, "scenes", scene, overrides, **given)

    def swept(study: Any, *positional: Any, **given: Any) -> Any:
        loaded = studies.load_study(study)
        for values in loaded.values():
            run_scene(record, "sweep", loaded.point(values))
        return sweep(study, *positional, **given)

    def measured(self: Any, surface: Any, solver: Any) -> Any:
        if record.inside or not hasattr(solver, "scatter"):
            return measure(self, surface, solver)
        return run_call(record, measure, self, surface, solver)

    simulation.simulate, studies.sweep, Gonioreflectometer.measure = simulated, swept, measured  # type: ignore[assignment]
    vg.simulate, vg.sweep = simulated, swept  # type: ignore[assignment]
    sys.argv = [path, *arguments]
    sys.path.insert(0, str(Path(path).parent))
    with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
        runpy.run_path(path, run_name="__main__")


def run_call(record: Record, measure: Any, gonio: Any, surface: Any, solver: Any) -> Any:
    from vgonio.accuracy import calibration
    from vgonio.geometric import RayOptics
    from vgonio.planning import loading
    from vgonio.planning.parts import of_waves
    from vgonio.planning.ray_forecast import ray_forecast

    kind = "rays" if isinstance(solver, RayOptics) else "waves"
    expected, found, known, first = {}, None, None, next(iter(record.calibrations))
    for name in record.calibrations:
        with record.by(name):
            on = calibration()
        place = surface, gonio.incoming, gonio.detector, on.speeds
        if kind == "rays":
            found = ray_forecast(solver, *place, solver.threads or on.threads, first_look=name == first)
        else:
            found = of_waves(solver, *place)
        if found is None:
            return measure(gonio, surface, solver)
        known = found if name == first else known
        theory = {"FullWave": "full-wave", "IteratedKirchhoff": "iterated-kirchhoff"}.get(type(solver).__name__, "")
        libraries = loading.OF_RAYS if kind == "rays" else loading.of_theory(theory, surface.is_profile)
        once, size = loading.cost(libraries - loading.already(), on.speeds)
        expected[name] = found.seconds + on.speeds.fixed[kind] + once
    base = status("VmRSS") + size
    forget_peak()
    wall, used = time.perf_counter(), time.process_time()
    data = measure(gonio, surface, solver)
    wall, used = time.perf_counter() - wall, time.process_time() - used
    peak = status("VmHWM")
    stated = data.attrs.get("error_achieved")
    again = record.references and kind == "waves" and wall < MOST_FOR_REFERENCE
    part = kind if kind == "rays" else f"waves ({type(solver).__name__})"
    record.add(
        "calls", part, expected=expected, wall=wall, cpu=used,
        error_expected=known.error, error_stated=stated if isinstance(stated, float) else None,
        error_achieved=_achieved(record, data, gonio, surface, solver) if again else None,
    )  # fmt: skip
    record.add("calls", "memory", memory_expected=base + known.memory_bytes, memory=peak)
    return data


def main() -> None:
    warnings.simplefilter("ignore")
    asked = json.loads(sys.argv[1])
    record = Record(asked["calibrations"], asked.get("references", False))
    os.environ["MPLBACKEND"] = "Agg"
    if "program" in asked:
        run_program(record, asked["program"], asked["arguments"])
    else:
        with tempfile.TemporaryDirectory() as folder:
            output = {"output": f"{folder}/result.nc", "report": f"{folder}/result.html"}
            run_scene(record, "", asked["scene"], asked.get("overrides", ()), **asked.get("chosen", {}), **output)
    print(json.dumps(list(record.rows.values())))


if __name__ == "__main__":
    main()
