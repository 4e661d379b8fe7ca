"""The calibration of this machine: a small file of elementary speeds, from which plans forecast seconds and memory.

It lies at $VGONIO_CALIBRATION, or else in the user's cache: $XDG_CACHE_HOME or ~/.cache, vgonio/calibration.json;
VGONIO_CALIBRATION=off uses none. One file holds one machine and version, an entry for each number of threads.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ..errors import FileFormatError, InputError, whole
from ..files import json_of, written_whole
from .built_in import BUILT_IN, MACHINE
from .libraries import changes, libraries
from .measuring import machine
from .speeds import Speeds

FORMAT = "vgonio calibration"
COMMAND = "vgonio accuracy --calibrate"
OFF = "off"


@dataclass(frozen=True)
class Calibration:
    """Speeds of a machine at a number of threads

    why_not : the reason why they are not quite those of this run, or empty;  libraries : by name, their versions
    """

    machine: str
    threads: int
    date: str
    speeds: Speeds
    why_not: str = ""
    libraries: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        count = "1 thread" if self.threads == 1 else f"{self.threads} threads"
        if not self.date:
            return f"figures of another machine ({self.machine}, {count}): {self.why_not}; `{COMMAND}` takes 20 s"
        made = f"calibrated on this machine, {self.date[:10]}, {count}"
        return f"{made}, but {self.why_not}: `{COMMAND}` takes 20 s" if self.why_not else made


def threads_used() -> int:
    """Threads that a run takes: OMP_NUM_THREADS, which --threads sets, or all processors."""
    asked = os.environ.get("OMP_NUM_THREADS", "")
    return int(asked) if asked.isdigit() and int(asked) > 0 else os.cpu_count() or 1


def calibration_path() -> Path | None:
    """Where the calibration of this machine lies; None where it is turned off."""
    named = os.environ.get("VGONIO_CALIBRATION", "")
    if named:
        return None if named == OFF else Path(named).expanduser()
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "vgonio" / "calibration.json"


def calibrate(
    save: bool = True,
    processor_time: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> Calibration:
    """Measure this machine with as many threads as a run takes (`threads_used`), about 15 s, and keep the result.

    save : write `calibration_path()`, beside the entries of other numbers of threads
    processor_time : seconds of the processor instead of the clock, of all threads together
    progress : called as progress("calibration", fraction)

    Raises InputError where there is nowhere to write to, FileFormatError where that cannot be written.
    """
    from .trials import TRIALS, measured

    path = _writable() if save else None
    threads, found = threads_used(), dict[str, Any]()
    for n, some in enumerate(measured(processor_time, threads)):
        found |= some
        if progress:
            progress("calibration", (n + 1) / TRIALS)
    made = Calibration(_name(), threads, _now(), Speeds(**found), libraries=libraries())
    if path is not None:
        _write(made, path)
    return made


def calibration(threads: int | None = None) -> Calibration:
    """The calibration of this machine for so many threads (None: `threads_used`).

    With the reason in `why_not` one made before a numerical library changed, that of another number of threads, or the
    built-in figures of a named machine.
    """
    threads = threads_used() if threads is None else threads
    path = calibration_path()
    try:
        entries = _entries(path) if path is not None else {}
        why = "" if entries else "VGONIO_CALIBRATION is off"
    except FileFormatError as e:
        entries, why = {}, str(e)
    nearest = min(entries or BUILT_IN, key=lambda n: abs(math.log(n / threads)))
    if not entries:
        return Calibration(MACHINE, nearest, "", BUILT_IN[nearest], why)
    kept = entries[nearest]
    reasons = [changes(kept.libraries, libraries())]
    reasons += [f"not for {threads} thread{'s' if threads > 1 else ''}"] if nearest != threads else []
    return replace(kept, why_not="; ".join(r for r in reasons if r))


def _entries(path: Path) -> dict[int, Calibration]:
    """Threads → calibration of this machine and version; FileFormatError with the reason where there is none."""
    from .. import __version__

    if not path.exists():
        raise FileFormatError("this one is not calibrated")
    kept = json_of(path, "calibration")
    try:
        if kept["format"] != FORMAT:
            raise FileFormatError(f"{path} is no calibration")
        if kept["version"] != __version__:
            raise FileFormatError(f"the calibration is of version {kept['version']}")
        if kept["machine"] != _name():
            raise FileFormatError(f"the calibration is of another machine ({kept['machine']})")
        return {
            whole("threads", int(n), 1): Calibration(
                kept["machine"],
                int(n),
                str(entry["date"]),
                speeds_of(entry["speeds"]),
                libraries={str(k): str(v) for k, v in entry.get("libraries", {}).items()},
            )
            for n, entry in kept["threads"].items()
        }
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as e:
        if isinstance(e, FileFormatError):
            raise
        raise FileFormatError(f"the calibration {path} is damaged") from None


def speeds_of(kept: Mapping[str, Any]) -> Speeds:
    """Speeds from plain values; ValueError, TypeError or KeyError unless all are there, positive and finite."""
    plain = {f.name: float(kept[f.name]) for f in fields(Speeds) if f.name not in ("fixed", "loading")}
    fixed = {str(part): float(seconds) for part, seconds in kept["fixed"].items()}
    loading = {str(part): (float(seconds), float(size)) for part, (seconds, size) in kept["loading"].items()}
    least = [*fixed.values(), *(figure for pair in loading.values() for figure in pair)]
    sound = all(math.isfinite(v) and v > 0 for v in plain.values()) and all(math.isfinite(v) and v >= 0 for v in least)
    if not sound or set(kept) != {*plain, "fixed", "loading"}:
        raise ValueError("speeds have to be positive")
    return Speeds(**plain, fixed=fixed, loading=loading)


def _write(made: Calibration, path: Path) -> None:
    from .. import __version__

    try:
        entries = _entries(path)
    except FileFormatError:
        entries = {}  # of another machine, damaged or absent
    entries[made.threads] = made
    kept = {
        "format": FORMAT,
        "version": __version__,
        "machine": made.machine,
        "threads": {
            str(n): {"date": e.date, "libraries": dict(e.libraries), "speeds": asdict(e.speeds)}
            for n, e in sorted(entries.items())
        },
    }
    with written_whole(path) as stream:
        stream.write((json.dumps(kept, indent=1) + "\n").encode())


def _writable() -> Path:
    """Found out before the work, not after it."""
    path = calibration_path()
    if path is None:
        raise InputError("VGONIO_CALIBRATION is off: unset it, or name a file in it, to keep a calibration")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise FileFormatError(f"cannot make the folder {path.parent}: {e.strerror or e}") from None
    if not os.access(path.parent, os.W_OK):
        raise FileFormatError(f"cannot write {path}: {path.parent} is not writable")
    return path


def _name() -> str:
    """What tells machines apart: processor and how many of it."""
    found = machine(brief=True)
    return f"{found['processor']}, {found['processors']} processors"


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
