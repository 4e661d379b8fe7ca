"""Errors and warnings that a user can act on.

A message says what is wrong, what was got (value, shape, unit), what is allowed and what to do.
The command line prints one line of it and exits with status 2.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

#: How many names a message lists: a line of a hundred materials helps nobody.
MOST_NAMES = 25
# of a message: what is wrong stands at its beginning, what to do at its end
MOST_LETTERS = 1000


class VgonioError(Exception):
    """Base of all errors that the input, not the program, is responsible for. A message is one line, not too long."""

    def __init__(self, message: object = "", *more: object) -> None:
        super().__init__(one_line(message), *more)


class InputError(VgonioError, ValueError):
    """A value, an array or a scene key is outside what is allowed."""


class FileFormatError(VgonioError, ValueError):
    """A file is missing, truncated, of an unknown kind or of another program."""


class MaterialError(VgonioError, ValueError):
    """A material is unknown, or was asked for outside its wavelength table."""


class BackendError(VgonioError, RuntimeError):
    """A method was asked for whose library or device is not there; the message says what to install."""


class ToleranceError(VgonioError, RuntimeError):
    """The tolerance asked cannot be met; the message gives the reason and the achieved figure."""


class VgonioWarning(UserWarning):
    """Something implausible that the program goes on with."""


def one_line(text: object) -> str:
    """A message without line ends and unprintable characters; a long one, which quotes a file, without its middle."""
    line = "".join(c if c.isprintable() else " " if c.isspace() else "?" for c in str(text))
    return line if len(line) <= MOST_LETTERS else f"{line[: MOST_LETTERS * 2 // 3]} … {line[-MOST_LETTERS // 3 :]}"


def nearest(name: object, known: Iterable[str]) -> str:
    """A hint "did you mean 'x'?" for a misspelt name, or the list of known ones."""
    known = sorted(known)
    close = difflib.get_close_matches(str(name), known, n=1, cutoff=0.5)
    more = f" and {len(known) - MOST_NAMES} more" if len(known) > MOST_NAMES else ""
    return f"did you mean {close[0]!r}?" if close else "known: " + ", ".join(known[:MOST_NAMES]) + more


def whole(name: str, value: Any, least: int, most: int | None = None) -> int:
    """`value` as an int from `least` to `most`; InputError otherwise."""
    try:
        n = int(value)
        fits = n == value and least <= n <= (n if most is None else most) and not isinstance(value, bool)
    except (TypeError, ValueError, OverflowError):
        fits = False
    if not fits:
        top = "" if most is None else f" and at most {most:g}"
        raise InputError(f"{name} = {value!r}: a whole number of at least {least}{top} is needed")
    return n


def relative_tolerance(value: Any, name: str = "tol") -> float:
    """`value` as a float between 0 and 1, both excluded; InputError otherwise."""
    try:
        tol = float(value)
    except (TypeError, ValueError):
        tol = -1.0
    if not 0 < tol < 1:
        raise InputError(f"{name} = {value!r}: a relative error between 0 and 1 is needed")
    return tol
