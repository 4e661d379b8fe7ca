"""What a plan is: stages, each needed or left out with reason and forecast, and warnings; as text, table and JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

DAY, YEAR = 86_400.0, 31_557_600.0  # seconds
NO_ERROR = 1e-6  # as a share; what lies below has no error worth a number


@dataclass(frozen=True)
class Stage:
    """One step: needed or left out, and why; the library it loads and what it does.

    part : of the run that it belongs to, the first stage of which has the forecast of all:
    seconds : wall-clock;  loading : of them those of libraries;  memory_bytes : of the whole process meanwhile
    error : that the solver will state: of rays the relative standard error, of waves the numerical one
    rough : factors on the error between which it lies where only a range is known, as of rays by chosen facets
    """

    name: str
    needed: bool
    why: str
    library: str = ""
    cost: str = ""
    part: str = ""
    seconds: float | None = None
    memory_bytes: float | None = None
    error: float | None = None
    rough: tuple[float, float] | None = None
    loading: float | None = None


@dataclass(frozen=True)
class Plan:
    """The stages of a scene in order, and warnings about where its numbers should not be trusted.

    machine : whose speeds the seconds are;  chosen : settings taken for `max_seconds` and `tol`, by key of the scene
    alternatives : what other settings would have cost, rows of settings, seconds and error
    refused : why `simulate` will not begin it, "" where it will
    """

    title: str
    stages: tuple[Stage, ...]
    warnings: tuple[str, ...] = ()
    machine: str = ""
    chosen: Mapping[str, Any] = field(default_factory=dict)
    alternatives: tuple[Mapping[str, Any], ...] = ()
    refused: str = ""

    def needs(self, name: str) -> bool:
        """Is the stage of that name done? False as well for a stage that is not in the plan."""
        return any(s.name == name and s.needed for s in self.stages)

    @property
    def seconds(self) -> float:
        """Of all stages, from starting Python, where that is still to be done, to the page."""
        return sum(s.seconds or 0.0 for s in self.stages)

    @property
    def loading(self) -> float:
        """Seconds of them in which Python and libraries are loaded, which further runs in the process do not need."""
        return sum(s.loading or 0.0 for s in self.stages)

    @property
    def memory_bytes(self) -> float:
        """The most that the process holds at a time."""
        return max((s.memory_bytes or 0.0 for s in self.stages), default=0.0)

    @property
    def error(self) -> float | None:
        """The largest of the errors that the solvers will state."""
        return max((s.error for s in self.stages if s.error is not None), default=None)

    @property
    def error_words(self) -> str:
        """The largest error; the range of what it may be, where a rough one may be the largest."""
        rough = [(s.rough[0] * s.error, s.rough[1] * s.error) for s in self.stages if s.error is not None and s.rough]
        known = max((s.error for s in self.stages if s.error is not None and not s.rough), default=0.0)
        least, most = (max((r[i] for r in rough), default=0.0) for i in (0, 1))
        if most > known:
            return between(max(known, least), most)
        return "" if self.error is None else percent(self.error)

    @property
    def refused_in_words(self) -> str:
        """That `simulate` will not begin the scene, and why."""
        return f"REFUSED: simulate will not begin this scene: {self.refused}" if self.refused else ""

    def choices(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Columns and cells of the settings that were chosen and those that were not."""
        rows: list[tuple[str, ...]] = []
        for a in self.alternatives:
            settings = in_words({k.split(".")[1]: v for k, v in a["settings"].items()})
            speckle = "" if a["speckle"] is None else percent(a["speckle"])
            cells = (a["part"], settings, duration(a["seconds"]), percent(a["error"]), speckle)
            rows.append(("yes" if a["chosen"] else "", *cells))
        return ("chosen", "part", "settings", "time", "error", "speckle"), rows

    def parts(self) -> dict[str, dict[str, float | None]]:
        """Part of the run → seconds, memory_bytes and error that are expected of it."""
        return {
            s.part: {"seconds": s.seconds, "memory_bytes": s.memory_bytes, "error": s.error}
            for s in self.stages
            if s.needed and s.part and s.seconds is not None
        }

    def rows(self) -> list[dict[str, Any]]:
        """One dictionary a stage: the fields of `Stage`."""
        return [{**asdict(s), "rough": list(s.rough) if s.rough else None} for s in self.stages]

    def to_dict(self) -> dict[str, Any]:
        return {
            "title": self.title,
            "stages": self.rows(),
            "refused": self.refused,
            "warnings": list(self.warnings),
            "seconds": self.seconds,
            "loading": self.loading,
            "memory_bytes": self.memory_bytes,
            "error": self.error,
            "machine": self.machine,
            "chosen": dict(self.chosen),
            "alternatives": [dict(a) for a in self.alternatives],
        }

    def to_json(self) -> str:
        return json.dumps(self.to_dict(), ensure_ascii=False)

    def table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Columns, and the cells of all stages with the totals as a last row."""
        columns = ("done", "stage", "time", "memory", "error", "what and why", "library")
        rows = [
            (
                "yes" if s.needed else "no",
                s.name,
                *figures(s.seconds, s.memory_bytes, s.error, s.rough),
                "; ".join(t for t in (s.cost, s.why) if t),
                s.library,
            )
            for s in self.stages
        ]
        total = figures(self.seconds, self.memory_bytes, None)[:2]
        once = f"{duration(self.loading)} of it to load Python and libraries, once in a process" if self.loading else ""
        return columns, [*rows, ("", "in all", *total, self.error_words, once, "")]

    def __str__(self) -> str:
        columns, rows = self.table()
        cells = [columns, *rows]
        order = (0, 1, 2, 3, 4, 6, 5)
        widths = [max(len(row[i]) for row in cells) for i in order[:-1]]
        lines = [self.refused_in_words] if self.refused else []
        lines += [f"Plan of {self.title}"]
        lines += ["  ".join([*(row[i].ljust(w) for i, w in zip(order, widths)), row[5]]).rstrip() for row in cells]
        lines += [f"times: {self.machine}"] if self.machine else []
        return "\n".join([*lines, *(f"warning: {w}" for w in self.warnings)])


def figures(
    seconds: float | None, memory_bytes: float | None, error: float | None, rough: tuple[float, float] | None = None
) -> tuple[str, str, str]:
    """Two digits of each, with its unit; empty where there is none; a range for a rough error."""
    return (
        duration(seconds),
        "" if memory_bytes is None else size_in_words(memory_bytes),
        "" if error is None else between(rough[0] * error, rough[1] * error) if rough and error else percent(error),
    )


def between(least: float, most: float) -> str:
    """The range in which an error lies; in words where it has no upper or no lower end that says anything."""
    if most >= 0.995:
        return "100 %" if least >= 0.95 else f"{_one_digit(least)} % or more"
    return f"{_one_digit(least)} … {_one_digit(most)} %" if least >= NO_ERROR else f"up to {_one_digit(most)} %"


def _one_digit(share: float) -> str:
    """In per cent, never in powers of ten."""
    whole = float(f"{100 * share:.1g}")
    return f"{whole:.0f}" if whole >= 1 else f"{whole:.6f}".rstrip("0")


def duration(seconds: float | None) -> str:
    """Two digits in seconds, minutes, hours, days or years; empty for None."""
    if seconds is None:
        return ""
    if seconds < 120:
        return f"{seconds:.1f} s" if seconds < 9.95 else f"{seconds:.0f} s"
    if seconds < 2 * DAY:
        return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
    return f"{seconds / DAY:.0f} days" if seconds < 2 * YEAR else f"{float(f'{seconds / YEAR:.2g}'):,.0f} years"


def rounded_up(value: float) -> float:
    """The next number of two digits, for advice: what is rounded down would be refused again."""
    digit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / digit * (1 - 1e-12)) * digit:.2g}")


def size_in_words(count: float) -> str:
    return f"{count / 1e6:.0f} MB" if count < 0.9995e9 else f"{count / 1e9:.1f} GB"


def in_words(settings: Mapping[str, Any]) -> str:
    """ "key = value, …", large whole numbers in groups of three digits."""
    return ", ".join(f"{k} = {v:,}" if isinstance(v, int) else f"{k} = {v}" for k, v in settings.items())


def percent(share: float) -> str:
    """Two digits and the sign."""
    return f"{100 * share:.2g} %" if share < 0.995 else "100 %"
