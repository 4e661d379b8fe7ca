"""Running the cases: seconds and memory beside the errors, on a machine that is named."""

from __future__ import annotations

import json
import math
import os
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from ..errors import BackendError
from ..memory import Watch
from .cases import CASES, Case, as_text, require

Row = dict[str, Any]
COLUMNS = ("case", "solver", "answer", "setting", "asked", "stated", "achieved", "seconds", "memory_mb", "note")


def select(names: Sequence[str] = ()) -> list[Case]:
    """The cases of those names, all without any; InputError for a name that there is not."""
    return [require(n) for n in names] if names else list(CASES.values())


def run_cases(
    names: Sequence[str] = (), *, quick: bool = False, progress: Callable[[str, float], None] | None = None
) -> list[Row]:
    """One row a case and setting: errors asked, stated and achieved (None where one cannot ask, or the
    solver states none), seconds, memory above what was there before in MB.

    quick : the cheapest settings alone;  progress : called as progress(case, fraction)
    A backend that is absent gives a row with the reason and no figures. Raises InputError for an unknown name.
    """
    rows: list[Row] = []
    for case in select(names):
        settings = case.quick if quick else case.settings
        for n, setting in enumerate(settings):
            if progress:
                progress(case.name, n / len(settings))
            if n == 0:
                _warm_up(case, settings[0])
            rows.append(_row(case, setting))
        if progress:
            progress(case.name, 1.0)
    return rows


def _warm_up(case: Case, setting: float) -> None:
    """Loading libraries and compiling kernels is done once and is not the solver's time."""
    try:
        case.run(setting)
    except BackendError:
        pass


def _row(case: Case, setting: float) -> Row:
    row: Row = dict.fromkeys(COLUMNS) | {
        "case": case.name,
        "solver": case.solver,
        "answer": case.answer,
        "setting": as_text(setting, case.unit),
    }
    try:
        with Watch() as memory:
            begin = time.perf_counter()
            outcome = case.run(setting)
            seconds = time.perf_counter() - begin
    except BackendError as e:
        return row | {"note": str(e)}
    figures = {k: v if math.isfinite(v) else None for k, v in asdict(outcome).items()}
    return row | figures | {"seconds": seconds, "memory_mb": None if memory.growth is None else memory.growth / 1e6}


def machine(brief: bool = False) -> dict[str, Any]:
    """Processor, its count, system, load and versions that figures belong to; `brief`: the first two."""
    named = {"processor": _processor(), "processors": os.cpu_count()}
    if brief:
        return named
    from ..dataset import versions

    return {
        **named,
        "system": platform.platform(),
        "load": round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None,
        "versions": json.loads(versions()),
    }


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as stream:
            return next(line.split(":")[1].strip() for line in stream if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()
