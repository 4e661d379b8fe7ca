"""A scene becomes a result: its plan is followed, and what the plan leaves out is not even loaded."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from . import assembly
from .dataset import versions
from .errors import InputError, ToleranceError
from .files import PAGE_ENDINGS, RESULT_ENDINGS
from .memory import Watch
from .planning import Plan, check_output, check_outputs, plan_of, with_folder
from .planning.outputs import page_asked
from .scene import Scene, load_scene

if TYPE_CHECKING:
    from .surface import Heightfield

# progress(part, fraction done)
Progress = Callable[[str, float], None]


def simulate(
    scene: str | os.PathLike[str] | Mapping[str, Any] | Scene,
    overrides: Iterable[str] = (),
    progress: Progress | None = None,
    output: str | os.PathLike[str] | None = None,
    report: str | os.PathLike[str] | None = None,
    max_seconds: float | None = None,
    tol: float | None = None,
    planned: Callable[[Plan], None] | None = None,
) -> xr.DataTree:
    """Simulate a scene (TOML file, dictionary or Scene) and return its result.

    overrides : "table.key=value", as --set of the command line;  progress : called as progress(part, fraction)
    output, report : where to write, relative to the working directory, instead of the scene's own [output];
        where a scene asks for a page and `output` alone is given, the page goes beside it, as <output>.html
    max_seconds, tol : the cheapest methods and efforts that meet them, instead of the scene's; without tol the most
        accurate in that time. What was chosen is in the plan, and in the scene that the result holds
    planned : called with the plan before the work begins

    The tree has the groups that were made: surface, rays, waves (waves_<theory> for further theories), measured,
    comparison; its attributes hold the scene, the plan with what was expected of each part, the provenance, and what
    each part took, `seconds`, `processor_seconds` and `memory_bytes` (the largest of the process meanwhile), as JSON.
    When interrupted, the groups that are complete are kept in <output>.partial.nc and KeyboardInterrupt goes on.

    Raises InputError, FileFormatError or MaterialError for bad input, ToleranceError where no methods meet
    `max_seconds` and `tol`, before any work is done.
    """
    checked = load_scene(scene, overrides)
    check_outputs(checked)
    result_path = _destination(output, checked.output.file, checked, RESULT_ENDINGS)
    page_path = _destination(page_asked(checked, output, report), checked.output.report, checked, PAGE_ENDINGS)
    run = _Run(progress)
    with run.part("surface"):
        inputs = assembly.gather(checked)
    checked, plan = plan_of(checked, inputs, max_seconds, tol)
    if plan.refused:
        raise ToleranceError(plan.refused)
    if planned is not None:
        planned(plan)
    tree = xr.DataTree()  # without a name: a title may hold what a name must not
    tree.attrs = {
        "title": checked.name,
        "scene": checked.to_json(),
        "plan": plan.to_json(),
        "provenance": provenance(checked),
    }
    try:
        for name, data in _groups(checked, plan, inputs, run):
            tree[name] = xr.DataTree(data)
        run.store(tree)
        _write(tree, result_path, page_path, run)
    except KeyboardInterrupt as interrupt:
        _keep_finished(tree, run, result_path, interrupt)
        raise
    return tree


class _Run:
    """Seconds, memory and progress of the parts of one simulation."""

    def __init__(self, progress: Progress | None) -> None:
        self.seconds: dict[str, float] = {}
        self.processor: dict[str, float] = {}
        self.memory: dict[str, int] = {}
        self.report = progress

    @contextmanager
    def part(self, name: str) -> Iterator[assembly.Progress | None]:
        """Time a part; gives the solver's callback, which takes the fraction done alone."""
        begin, used = time.perf_counter(), time.process_time()
        if self.report is not None:
            self.report(name, 0.0)
        with Watch(step=0.02) as memory:
            yield (lambda fraction: self.report(name, fraction)) if self.report is not None else None  # type: ignore[misc]
        self.seconds[name] = round(time.perf_counter() - begin, 3)
        self.processor[name] = round(time.process_time() - used, 3)
        if memory.peak is not None:
            self.memory[name] = memory.peak
        if self.report is not None:
            self.report(name, 1.0)

    def store(self, tree: xr.DataTree) -> None:
        """Into the result, beside what the plan expected."""
        tree.attrs |= {
            "seconds": json.dumps(self.seconds),
            "processor_seconds": json.dumps(self.processor),
            "memory_bytes": json.dumps(self.memory),
        }


def _groups(scene: Scene, plan: Plan, inputs: assembly.Inputs, run: _Run) -> Iterator[tuple[str, xr.Dataset]]:
    """The groups of the result, each as soon as it is complete."""
    if inputs.surface is not None:
        from .measure.surface_summary import surface_dataset

        with run.part("surface summary"):
            summary = surface_dataset(inputs.surface)
        yield "surface", summary
    results: dict[str, xr.Dataset] = {}
    for name, data in _results(scene, plan, inputs, run):
        results[name] = data
        yield name, data
    if plan.needs("compare") or plan.needs("shift"):
        from .compare import compare

        with run.part("comparison"):
            # what instruments would read takes the library of colours: of one result alone, nothing asks for it
            comparison = compare(results, material=inputs.material, instruments=plan.needs("compare"))
        yield "comparison", comparison


def _results(scene: Scene, plan: Plan, inputs: assembly.Inputs, run: _Run) -> Iterator[tuple[str, xr.Dataset]]:
    """The groups that hold a BRDF."""
    if inputs.surface is not None:
        yield from _simulated(scene, plan, inputs.surface, run)
    if inputs.measured is not None:
        yield "measured", inputs.measured


def _simulated(scene: Scene, plan: Plan, surface: Heightfield, run: _Run) -> Iterator[tuple[str, xr.Dataset]]:
    if plan.needs("trace"):
        with run.part("rays") as callback:
            data = assembly.gonioreflectometer(scene).measure(surface, assembly.rays(scene, callback))
        yield "rays", data
    for name, theory in assembly.wave_groups(scene).items():
        with run.part(name) as callback:
            data = assembly.gonioreflectometer(scene).measure(surface, assembly.waves(scene, theory, callback))
        yield name, data


# ---- writing
def _destination(
    asked: str | os.PathLike[str] | None, named: str | None, scene: Scene, endings: tuple[str, ...]
) -> Path | None:
    if asked is not None:
        check_output(Path(asked), endings, scene.inputs)
        return Path(asked)
    return scene.resolve(named) if named is not None else None


def _write(tree: xr.DataTree, result_path: Path | None, page_path: Path | None, run: _Run) -> None:
    if result_path is not None:
        from .measure.storage import save

        with run.part("save"):
            save(tree, with_folder(result_path))
    if page_path is not None:
        from .report import page

        with run.part("report"):
            page(tree, with_folder(page_path))
    run.store(tree)


def _keep_finished(tree: xr.DataTree, run: _Run, path: Path | None, interrupt: KeyboardInterrupt) -> None:
    """Save the complete groups under another name: a result of the full name is always complete."""
    finished = [name for name in tree.children if name != "surface"]
    if "save" in run.seconds:
        interrupt.add_note(f"the result is complete in {path}, its page is not written")
        return
    if path is None or not finished:
        interrupt.add_note("nothing was finished, nothing is kept")
        return
    from .files import undisturbed
    from .measure.storage import save

    partial = path.with_name(f"{path.stem}.partial{path.suffix}")
    run.store(tree)
    tree.attrs |= {"interrupted": "yes: groups that were not finished are absent"}
    with undisturbed(interrupt_after=False):
        save(tree, with_folder(partial))
    interrupt.add_note(f"finished parts ({', '.join(finished)}) are kept in {partial}")


# ---- provenance
def provenance(scene: Scene) -> str:
    """Who made the numbers: versions, platform, processors, date, and the inputs' SHA-256, as JSON."""
    return json.dumps(
        {
            "versions": json.loads(versions()),
            "platform": platform.platform(),
            "processor": platform.machine(),
            "cpu_count": os.cpu_count(),
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
            "inputs": {p.name: _digest(p) for p in scene.inputs},
        }
    )


def _digest(path: Path) -> str:
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def simulated(tree: xr.DataTree) -> dict[str, xr.Dataset]:
    """The groups of a result that hold a BRDF, by name; InputError if there is none."""
    found = {str(name): node.to_dataset() for name, node in tree.children.items() if "brdf" in node.data_vars}
    if not found:
        raise InputError("the result has no group with a BRDF (rays, waves, measured)")
    return found
