"""The command on studies: sweep."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import InputError, VgonioWarning
from .common import Json, Quiet, Set, print_json, print_table, progress_bars, save_figure, say


def sweep(
    study: Annotated[
        Path | None, typer.Argument(metavar="STUDY", help="Study file (TOML).", show_default=False)
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FOLDER", help="Where points and result go.", show_default="STUDY.sweep"
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="A Dask scheduler, tcp://…; else workers on this machine."),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", metavar="N", help="Processes on this machine.", show_default="all processors"),
    ] = None,
    retry: Annotated[
        bool, typer.Option("--retry", help="Also points whose input was refused before.", show_default=False)
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Count what is done, and plan what is left; compute nothing.")
    ] = False,
    schema: Annotated[
        bool,
        typer.Option(
            "--schema",
            help="Only write the JSON schema of studies for editors, beside STUDY or here.",
            show_default=False,
        ),
    ] = False,
    overrides: Set = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Simulate a scene for many values of its keys.

    A study names a scene and what varies. Finished points are stored at once and never computed again: after an
    interruption the same command goes on. How long it will take, and with how much memory, --dry-run says before.

    Example: vgonio sweep study.toml --workers 4
    """
    if schema:
        _write_schema(study.parent if study is not None else Path("."))
        return
    if study is None:
        raise InputError("nothing to sweep: give STUDY, a TOML file that names a scene and what varies")
    from ..studies import Store, gather, load_study, plan_study
    from ..studies import sweep as run

    made = load_study(study, overrides or ())
    folder = output if output is not None else study.with_suffix(".sweep")
    planned = None
    if dry_run:
        store = Store(folder.absolute())
        tree, planned = gather(made, store), plan_study(made, store, workers, retry)
    else:
        from ..planning import with_folder

        with_folder(folder / "result.nc")
        with progress_bars() as progress:
            tell = None if progress is None else lambda ended, points: progress("points", ended / points)
            tree = run(made, folder, scheduler=scheduler, workers=workers, retry=retry, progress=tell)
        written = _written(tree, folder)
    summary = _summary(tree) | ({"plan": planned.to_dict()} if planned else {})
    if as_json:
        print_json(summary)
    elif not quiet:
        print_table(made.title, list(summary["counts"]), [list(summary["counts"].values())])
        if planned:
            print_table("What is left will take", *planned.table())
            print(f"times: {planned.machine}")
        for what in [] if dry_run else written:
            say(f"{what[0]}: {what[1]}")
    if not dry_run and summary["counts"]["failed"] == summary["counts"]["points"]:
        raise InputError(f"no point could be computed: {'; '.join(summary['failures'])}")
    _warn(summary["failures"])


def _write_schema(folder: Path) -> None:
    import json

    from ..files import written_whole
    from ..planning import with_folder
    from ..studies.schema import STUDY_SCHEMA_FILE, STUDY_SCHEMA_LINE, study_schema

    path = with_folder(folder / STUDY_SCHEMA_FILE)
    with written_whole(path) as stream:
        stream.write((json.dumps(study_schema(), ensure_ascii=False, indent=1) + "\n").encode())
    say(f"wrote {path}: the first line of a study has to be {STUDY_SCHEMA_LINE}")


def _written(tree: Any, folder: Path) -> list[tuple[str, Path]]:
    from ..measure import save
    from ..report.sweep_figures import overview

    done = [("result", save(tree, folder / "result.nc"))]
    figure = overview(tree)
    if figure is not None:
        save_figure(figure, folder / "overview.png")
        done.append(("overview", folder / "overview.png"))
    return done


def _summary(tree: Any) -> dict[str, Any]:
    """How many points are in which state, and the reasons of those that failed."""
    state, reason = tree["state"].values.ravel(), tree["reason"].values.ravel()
    counts = {name: int((state == i).sum()) for i, name in enumerate(("done", "failed", "not computed"))}
    reasons: dict[str, int] = {}
    for text in reason[state == 1]:
        reasons[str(text)] = reasons.get(str(text), 0) + 1
    return {"counts": {"points": int(state.size), **counts}, "failures": reasons}


def _warn(failures: dict[str, int]) -> None:
    import warnings

    for reason, count in failures.items():
        points = "1 point" if count == 1 else f"{count} points"
        warnings.warn(VgonioWarning(f"{points} failed: {reason}"), stacklevel=2)
