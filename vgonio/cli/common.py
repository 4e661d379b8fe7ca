"""Options that all commands share, tables, progress bars."""

from __future__ import annotations

import io
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import InputError
from ..files import written_whole

# read by the numerical libraries when they are loaded, so set before that
THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "POCL_MAX_PTHREAD_COUNT",
    "POCL_CPU_MAX_CU_COUNT",
)
_state = {"quiet": False}


def _set_threads(count: int | None) -> int | None:
    if count is not None:
        if count < 1:
            raise InputError(f"--threads {count}: at least one thread is needed")
        for name in THREAD_VARIABLES:
            os.environ[name] = str(count)
    return count


def _set_quiet(quiet: bool) -> bool:
    _state["quiet"] = quiet
    return quiet


def is_quiet() -> bool:
    return _state["quiet"]


Quiet = Annotated[
    bool,
    typer.Option("--quiet", "-q", callback=_set_quiet, help="Say nothing but results and errors.", show_default=False),
]
Threads = Annotated[
    int | None,
    typer.Option("--threads", callback=_set_threads, help="Processor threads to use.", metavar="N", show_default="all"),
]
Json = Annotated[bool, typer.Option("--json", help="Print the table as JSON.", show_default=False)]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override a key, as in --set light.coherence_um=20. Repeatable."),
]


def say(text: str) -> None:
    """A line for people on standard output, unless --quiet."""
    if not is_quiet():
        print(text)


def save_figure(figure: Any, path: Path) -> None:
    """A matplotlib figure as PNG, written whole or not at all."""
    with written_whole(path) as stream:
        figure.savefig(stream, format="png", dpi=150)


def print_json(value: Any) -> None:
    """JSON on standard output as its standard has it: what is not finite, an error not known, is null."""
    print(json.dumps(_plain(value), ensure_ascii=False, indent=2, allow_nan=False))


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    value = value.item() if hasattr(value, "item") else value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[Any]], width: int = 200) -> None:
    """A table on standard output: as wide as it needs to be, up to `width`, where nobody reads it on a terminal."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title or None, title_justify="left", header_style="bold", box=SIMPLE_HEAD)
    for i, column in enumerate(columns):
        table.add_column(column, overflow="fold", justify="left" if i == 0 else "default")
    for row in rows:
        table.add_row(*(_cell(v) for v in row))
    if sys.stdout.isatty():
        Console(markup=False, highlight=False).print(table)
        return
    console = Console(width=width, markup=False, highlight=False, file=io.StringIO())
    console.print(table)
    print("\n".join(line.rstrip() for line in console.file.getvalue().splitlines()).strip("\n"))  # type: ignore[attr-defined]


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


@contextmanager
def progress_bars() -> Iterator[Callable[[str, float], None] | None]:
    """progress(part, fraction) that draws bars on standard error; None unless that is a terminal."""
    if is_quiet() or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description:16}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as bars:
        tasks: dict[str, Any] = {}

        def progress(part: str, fraction: float) -> None:
            if part not in tasks:
                tasks[part] = bars.add_task(part, total=1.0)
            bars.update(tasks[part], completed=min(1.0, fraction))

        yield progress


@contextmanager
def busy(what: str) -> Iterator[None]:
    """A moving sign on standard error while work goes on whose length nobody knows; nothing unless on a terminal."""
    if is_quiet() or not sys.stderr.isatty():
        yield
        return
    from rich.console import Console

    with Console(stderr=True).status(f"{what} …"):
        yield
