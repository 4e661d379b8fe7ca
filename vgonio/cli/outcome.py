"""How a command ends: one line on standard error, and the exit status that belongs to it."""

from __future__ import annotations

import io
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import typer

from ..errors import VgonioError, VgonioWarning

# the base of typer's usage errors, wherever its copy of click lives
USAGE_ERROR: Any = next(c for c in typer.BadParameter.__mro__ if c.__name__ == "ClickException")
DONE, OWN_FAULT, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def run(arguments: list[str]) -> int:
    """Run one command line; see `vgonio.cli.main`."""
    kept = _Warnings()
    _stand_in_for_closed_streams()
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # where a terminal knows no θ, a question mark has to do
    try:
        with _interruptions() as came:
            status = _command(arguments, kept, came)
    except KeyboardInterrupt as e:
        kept.show()
        notes = "; ".join(getattr(e, "__notes__", []))
        return _say(f"interrupted{': ' if notes else ''}{notes}", INTERRUPTED)
    except BrokenPipeError:
        # the reader of our output has gone: nothing more to say to anybody
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OWN_FAULT
    kept.show()
    return status


def _stand_in_for_closed_streams() -> None:
    """Where the caller closed standard output or error (`>&-`), Python has None there: what is said goes nowhere."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))


@contextmanager
def _interruptions() -> Iterator[list[int]]:
    """The signals that came: SIGTERM, as batch systems send it, ends a command as Ctrl-C does: finished parts are kept,
    nothing half-written. None is lost where Python can raise nothing, as while an object is deleted: it is sent again.
    """
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield came
        return

    def interrupt(number: int, frame: Any) -> None:
        came.append(number)
        raise KeyboardInterrupt

    def lost(what: Any) -> None:
        if issubclass(what.exc_type, KeyboardInterrupt) and came:
            threading.Timer(0.05, again, [came[-1]]).start()  # not here: it would be lost again
        else:
            told(what)

    def again(number: int) -> None:
        if signal.getsignal(number) is interrupt:
            os.kill(os.getpid(), number)

    wanted = [s for s in (signal.SIGINT, signal.SIGTERM) if s == signal.SIGTERM or callable(signal.getsignal(s))]
    before: dict[int, Any] = {s: signal.signal(s, interrupt) for s in wanted}
    told, sys.unraisablehook = sys.unraisablehook, lost
    try:
        yield came
    finally:
        sys.unraisablehook = told
        for number, handler in before.items():
            signal.signal(number, handler)


def _invoke(arguments: list[str], came: list[int]) -> None:
    """Run the command; what a library made of an interruption, such as an error of a file it had open, is one again."""
    from .app import app

    # not app(): that would end an interruption before its notes are read
    command = typer.main.get_command(app)
    try:
        with command.make_context("vgonio", list(arguments)) as context:
            command.invoke(context)
    except Exception:
        if came:
            raise KeyboardInterrupt from None
        raise


def _command(arguments: list[str], kept: _Warnings, came: list[int]) -> int:
    try:
        with kept:
            _invoke(arguments, came)
        return DONE
    except typer.Exit as e:
        return e.exit_code
    except USAGE_ERROR as e:
        kept.drop()
        return _say(f"error: {_usage(e)}", BAD_INPUT)
    except typer.Abort:
        raise KeyboardInterrupt from None
    except VgonioError as e:
        # what was wrong is one line; what else looked odd on the way there would only hide it
        kept.drop()
        return _say(f"error: {e}", BAD_INPUT)
    except BrokenPipeError:
        raise
    except (OSError, MemoryError) as e:
        # the machine refused: a full disk, a name that is too long, an array that does not fit
        kept.drop()
        return _say(f"error: {_refusal(e)}", BAD_INPUT)
    except Exception as e:
        if isinstance(e, ModuleNotFoundError) and e.name and not e.name.startswith("vgonio"):
            kept.drop()
            return _say(f"error: the Python package {e.name} is missing: pip install {e.name}", BAD_INPUT)
        if os.environ.get("VGONIO_DEBUG"):
            raise
        return _say(f"internal error: {type(e).__name__}: {e} (VGONIO_DEBUG=1 shows where)", OWN_FAULT)


def _refusal(error: OSError | MemoryError) -> str:
    if isinstance(error, MemoryError):
        return f"not enough memory for this scene ({error or 'no more is to be had'})"
    place = "" if error.filename is None else f"{error.filename}: "
    return f"{place}{error.strerror or error}"


def _usage(error: Any) -> str:
    path = getattr(getattr(error, "ctx", None), "command_path", "vgonio")
    message = error.format_message().rstrip(".")
    return f"{message[:1].lower()}{message[1:]} (`{path} --help` shows what is allowed)"


def _say(text: str, status: int) -> int:
    print("vgonio: " + " ".join(text.split()), file=sys.stderr, flush=True)
    return status


class _Warnings:
    """Collects our own warnings while a command runs; each is shown once, in one line, when it has ended."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.catcher = warnings.catch_warnings()

    def __enter__(self) -> _Warnings:
        self.catcher.__enter__()
        if not sys.warnoptions:
            warnings.simplefilter("ignore")
        warnings.simplefilter("always", VgonioWarning)
        self.other = warnings.showwarning
        warnings.showwarning = self.collect
        return self

    def __exit__(self, *exception: Any) -> None:
        self.catcher.__exit__(*exception)

    def collect(self, message: Any, category: Any, *place: Any, **more: Any) -> None:
        if not issubclass(category, VgonioWarning):
            self.other(message, category, *place, **more)
        elif str(message) not in self.lines:
            self.lines.append(str(message))

    def drop(self) -> None:
        self.lines.clear()

    def show(self) -> None:
        from .common import is_quiet

        for line in [] if is_quiet() else self.lines:
            _say(f"warning: {line}", DONE)
