"""The command on accuracy: asked and achieved error of every solver beside its seconds and memory."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Annotated, Any

import typer

from .common import Json, Quiet, Threads, print_json, print_table, progress_bars, say


def accuracy(
    cases: Annotated[
        list[str] | None, typer.Argument(metavar="CASE…", help="Cases by name; all without any.", show_default=False)
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FOLDER", help="Where accuracy.csv, .json and .png go."),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="One or two cheap settings of each case: 15 s in all.", show_default=False)
    ] = False,
    calibrate: Annotated[
        bool,
        typer.Option(
            "--calibrate",
            help="Measure this machine instead, so that plans tell its seconds: 20 s.",
            show_default=False,
        ),
    ] = False,
    known: Annotated[bool, typer.Option("--list", help="Name the cases and stop.", show_default=False)] = False,
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Work-precision: every solver on cases whose answer is known.

    Error asked for, stated and achieved, seconds, memory, on this machine, which is named. An empty cell: one
    cannot ask that solver for an error there, or it states none. All cases take two minutes.

    --calibrate measures how fast this machine is, with the --threads given, and keeps that for `vgonio plan`.

    Example: vgonio accuracy sinusoid-nufft v-groove -o accuracy
    """
    if calibrate:
        _calibrate(cases, output, quick, known, as_json)
        return
    from ..accuracy import machine, run_cases, select
    from ..planning import with_folder

    chosen = select(cases or ())
    if known:
        print_table("", ("case", "solver", "known answer"), [(c.name, c.solver, c.answer) for c in chosen])
        return
    if output is not None:  # found out before the work, not after it
        import tempfile

        with tempfile.TemporaryFile(dir=with_folder(output / "accuracy.csv").parent):
            pass
    with progress_bars() as progress:
        rows = run_cases([c.name for c in chosen], quick=quick, progress=progress)
    place = machine()
    found: dict[str, Any] = {"machine": place, "rows": rows}
    if output is not None:
        _write(found, output)
    if as_json:
        print_json(found)
    elif not quiet:
        shown = ("case", "setting", "asked", "stated", "achieved", "seconds", "memory_mb", "note")
        print_table("", shown, [[_rounded(r[c]) for c in shown] for r in rows])
        print(f"on {place['processor']}, {place['processors']} processors, load {place['load']}")
        if output is not None:
            say(f"written: accuracy.csv, accuracy.json and accuracy.png in {output}")


def _calibrate(cases: list[str] | None, output: Path | None, quick: bool, known: bool, as_json: bool) -> None:
    """Measure the machine and keep that."""
    from dataclasses import asdict

    from ..accuracy import calibrate, calibration_path
    from ..errors import InputError

    if cases or output is not None or quick or known:
        raise InputError("--calibrate measures the machine and nothing else: leave cases, -o, --quick and --list out")
    with progress_bars() as progress:
        made = calibrate(progress=progress)
    if as_json:
        print_json({"file": str(calibration_path()), **asdict(made)})
        return
    say(f"{made.machine}, {made.threads} threads: kept in {calibration_path()}")


def _rounded(value: Any) -> Any:
    """Two figures are what errors and shared machines are good for."""
    return f"{value:.2g}" if isinstance(value, float) else value


def _write(found: dict[str, Any], folder: Path) -> None:
    import csv
    import json

    from ..files import written_whole
    from ..planning import with_folder
    from ..report.accuracy_figures import work_precision

    table = io.StringIO()
    writer = csv.DictWriter(table, fieldnames=list(found["rows"][0]))
    writer.writeheader()
    writer.writerows(found["rows"])
    text = json.dumps(found, indent=1)
    for name, content in (("accuracy.csv", table.getvalue()), ("accuracy.json", text)):
        with written_whole(with_folder(folder / name)) as stream:
            stream.write(content.encode())
    with written_whole(folder / "accuracy.png") as stream:
        work_precision(found["rows"]).savefig(stream, format="png", dpi=150)
