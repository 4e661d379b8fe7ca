"""Commands on scenes: simulate, plan, init."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from ..files import written_whole
from .common import Json, Quiet, Set, Threads, is_quiet, print_json, print_table, progress_bars, say

if TYPE_CHECKING:
    from ..planning import Plan

MaxSeconds = Annotated[
    float | None, typer.Option("--max-seconds", metavar="S", help="Choose methods that take no longer, in all.")
]
Tol = Annotated[
    float | None,
    typer.Option("--tol", metavar="T", help="Choose methods with no larger error, of rays and waves, as 0.01."),
]
LONG = 60.0  # seconds beyond which a run says first what it is expected to take
PIPED = 118  # characters of the plan where nobody reads it on a terminal
SceneFile = Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (TOML).", show_default=False)]


def simulate(
    scene: SceneFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="RESULT.nc", help="Where the result goes, instead of the scene's output.file."
        ),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            "--report",
            metavar="PAGE.html",
            help="Where the page goes, instead of the scene's output.report; if the scene has that and only -o is "
            "given, RESULT.html; no page if there is neither.",
        ),
    ] = None,
    overrides: Set = None,
    max_seconds: MaxSeconds = None,
    tol: Tol = None,
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Simulate a scene and write its result and page.

    Rays, waves, a measurement to compare with: what the scene asks for is done, and nothing else. The folder of an
    output may be missing and is made, but not several, and none at the root of the file system.

    With --max-seconds or --tol the cheapest numbers of rays, methods and tolerances that meet both are taken, or
    nothing is begun and one line says why; the theories asked for stay.

    Example: vgonio simulate scene.toml -o result.nc --report result.html --set geometric.rays=100000
    """
    from ..planning.outputs import page_asked
    from ..scene import load_scene
    from ..simulation import simulate as run

    checked = load_scene(scene, overrides or ())
    if output is None and checked.output.file is None and report is None and checked.output.report is None:
        raise InputError(
            f"{scene}: nowhere to write to: give -o RESULT.nc, --report PAGE.html or [output] in the scene"
        )
    with progress_bars() as progress:
        where: dict[str, Any] = {"output": output, "report": report}
        tree = run(checked, progress=progress, max_seconds=max_seconds, tol=tol, planned=_say_long, **where)
    if max_seconds is None and tol is None and checked.geometric is not None:
        tol = checked.geometric.tol
    _warn([*json.loads(tree.attrs["plan"])["warnings"], *_missed(tree, tol)])
    if as_json:
        print_json({"title": tree.attrs["title"], "parts": _parts(tree)})
    elif not quiet:
        _tell(tree)
        _say_of_the_forecast(tree)
        for key, value in json.loads(tree.attrs["plan"]).get("chosen", {}).items():
            print(f"chosen: {key} = {value}")
        page = page_asked(checked, output, report)
        for what, asked, named in (("result", output, checked.output.file), ("page", page, checked.output.report)):
            if asked is not None or named is not None:
                print(f"{what}: {asked if asked is not None else checked.resolve(str(named))}")


def _tell(tree: Any) -> None:
    """What was simulated: the surface in a line, error and seconds of each part."""
    columns = ("part", "seconds", "error asked", "error achieved", "backend")
    print(_imported(tree) or tree.attrs["title"])
    for stage in json.loads(tree.attrs["plan"])["stages"]:
        if stage["name"] in ("outliers", "fill") and stage["needed"]:
            print(f"{stage['name']}: {stage['why']}")
    print_table("", columns, [list(r.values()) for r in _parts(tree)])
    _say_which_errors([name for name in json.loads(tree.attrs["seconds"]) if name in tree.children])


def _say_which_errors(parts: list[str]) -> None:
    """What the errors of a table are of, and relative to what."""
    said = [
        "of rays the largest standard error, relative to the BRDF itself where that exceeds 10⁻³ of its peak"
        for name in parts
        if name == "rays"
    ]
    if any(name.startswith("waves") for name in parts):
        said.append("of waves the numerical one, relative to the peak of the BRDF over θₒ; speckle is not in it")
    for start, words in zip(("error: ", "       "), said):
        print(start + words)


def _say_long(made: Plan) -> None:
    """How long a long run is expected to take, before it begins."""
    from ..planning.plans import duration

    if made.seconds > LONG and not is_quiet():
        print(f"expected time: {duration(made.seconds)} ({made.machine})", file=sys.stderr)


def _say_of_the_forecast(tree: Any) -> None:
    """A line where the run took more than twice or less than half of what was expected."""
    from ..planning.record import disagreement

    said = disagreement(*(json.loads(tree.attrs.get(k, "{}")) for k in ("plan", "seconds", "processor_seconds")))
    if said:
        print(f"time: {said}")


def _missed(tree: Any, asked: float | None) -> list[str]:
    """A line where the rays, a cap, did not suffice for the tolerance that the user asked for; the wave solver warns
    by itself."""
    achieved = tree["rays"].attrs.get("error_achieved") if "rays" in tree.children else None
    if asked is None or not isinstance(achieved, float) or achieved <= asked:
        return []
    if math.isinf(achieved):
        return [
            "rays: at some angle of incidence none came into a detector, so that their error is not known: it is dark "
            "there, or geometric.rays are too few"
        ]
    return [f"rays: error {achieved:.2g} instead of the {asked:g} asked for: raise geometric.rays"]


def _imported(tree: Any) -> str:
    """Points, pitch, size and Sq of the surface, or nothing."""
    stages = json.loads(tree.attrs["plan"])["stages"]
    return next((s["cost"] for s in stages if s["needed"] and s["name"].endswith(" surface")), "")


def _parts(tree: Any) -> list[dict[str, Any]]:
    """One row a part: name, seconds, tolerance asked, error achieved, backend."""
    rows = []
    for name, seconds in json.loads(tree.attrs["seconds"]).items():
        attrs = tree[name].attrs if name in tree.children else {}
        keys = ("tolerance_asked", "error_achieved", "backend")
        rows.append({"part": name, "seconds": seconds, **{k: attrs.get(k) for k in keys}})
    return rows


def _warn(lines: list[str]) -> None:
    import warnings

    from ..errors import VgonioWarning

    for line in lines:
        warnings.warn(VgonioWarning(line), stacklevel=2)


def plan(
    scene: SceneFile,
    overrides: Set = None,
    max_seconds: MaxSeconds = None,
    tol: Tol = None,
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Show what a scene will do, without doing it.

    Every stage with its time, memory and error, what is left out and why, and where the numbers should not be
    trusted. Times are those of this machine once it is calibrated: vgonio accuracy --calibrate.

    Example: vgonio plan scene.toml --json
    """
    from ..planning import plan as make_plan

    made = make_plan(scene, overrides or (), max_seconds, tol, new_process=True)
    if as_json:
        print_json(made.to_dict())
        return
    if made.refused:
        print(made.refused_in_words)
    print_table(f"Plan of {made.title}", *made.table(), width=PIPED)
    if made.alternatives:
        print()
        print_table("What was chosen, and what else would have cost", *made.choices(), width=PIPED)
    _say_which_errors([s.part for s in made.stages if s.error is not None])
    print(f"times: {made.machine}")
    _warn(list(made.warnings))


def init(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="File to write.")] = Path("scene.toml"),
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file that is there.", show_default=False)] = False,
    schema: Annotated[
        bool,
        typer.Option(
            "--schema",
            help="Also the JSON schema for editors, beside the scene; a scene that is there is kept.",
            show_default=False,
        ),
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Write a commented scene to start from.

    It runs as it is, on a generated surface. With its schema an editor completes keys, explains them, marks mistakes.

    Example: vgonio init scene.toml && vgonio simulate scene.toml
    """
    from importlib.resources import files

    from ..planning import check_output, with_folder

    check_output(scene, (scene.suffix.lower(),))
    with_folder(scene)
    first = _write_schema(scene.parent) if schema else ""
    if schema and scene.exists() and not force:
        say(f"kept {scene}: for editors its first line has to be {first.strip()}")
        return
    if scene.exists() and not force:
        raise InputError(f"{scene} is there already: choose another name, or --force to overwrite it")
    text = (files("vgonio") / "template.toml").read_text(encoding="utf-8").replace("NAME", scene.stem)
    text = first + text
    with written_whole(scene) as stream:
        stream.write(text.encode())
    import shlex

    typed = shlex.quote(str(scene))
    say(f"wrote {scene}: edit it, then `vgonio plan {typed}` and `vgonio simulate {typed}`")


def _write_schema(folder: Path) -> str:
    """Write the schema into a folder; the line with which a scene names it."""
    from ..scene.schema import SCHEMA_FILE, SCHEMA_LINE, scene_schema

    path = folder / SCHEMA_FILE
    with written_whole(path) as stream:
        stream.write((json.dumps(scene_schema(), ensure_ascii=False, indent=1) + "\n").encode())
    say(f"wrote {path}")
    return f"{SCHEMA_LINE}\n"
