"""Files are written whole or not at all, and read only where they are what was asked for: a file, not a device.

Writing goes to a temporary name in the same folder, renamed when complete. Reading stops before memory does.
"""

from __future__ import annotations

import json
import os
import signal
import stat
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from .errors import FileFormatError

# what a person or an instrument writes as text is smaller by far; beyond it a file is something else
MOST_TEXT = 500_000_000
# a million lines of settings are not settings, and TOML is parsed at some megabytes a second
MOST_SETTINGS = 10_000_000
MOST_BYTES = 8_000_000_000
# how the names of results and of pages end
RESULT_ENDINGS = (".nc", ".nc4", ".h5")
PAGE_ENDINGS = (".html", ".htm")


@contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """A binary stream that becomes `path` when the block ends well, and leaves nothing behind when it does not.

    Processes that write the same file do not disturb each other: the last one stays. Raises FileFormatError, with the
    system's reason, where the file cannot be written.
    """
    path = Path(path)
    temporary = path.parent / f".{os.urandom(8).hex()}.tmp"
    try:
        with open(temporary, "wb") as stream:
            yield stream
        os.replace(temporary, path)
    except OSError as e:
        raise FileFormatError(f"cannot write {path}: {e.strerror or e}") from None
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def undisturbed(interrupt_after: bool = True) -> Iterator[None]:
    """Ctrl-C and SIGTERM within the block take effect at its end, or not at all: for what must not be broken off.

    HDF5 calls Python back while it writes and loses what is raised there; and a second Ctrl-C must not undo what the
    first one keeps. Outside the main thread, where no signal arrives, nothing changes.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[tuple[Any, ...]] = []
    signals = [s for s in (signal.SIGINT, signal.SIGTERM) if callable(signal.getsignal(s))]
    before: dict[int, Any] = {s: signal.signal(s, lambda *arguments: came.append(arguments)) for s in signals}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if came and interrupt_after:
        before[came[0][0]](*came[0])


# ---- reading
def require_file(path: Path, what: str = "file") -> int:
    """The size in bytes of a regular file; FileFormatError where there is none: a folder, a pipe, a device, a loop.

    A pipe would be waited for and a device read for ever, so neither is opened.
    """
    try:
        found = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        raise FileFormatError(f"no such {what}: {path}") from None
    except (OSError, ValueError) as e:  # ValueError: a zero byte in the name
        raise FileFormatError(f"cannot read {shown(path)}: {getattr(e, 'strerror', None) or e}") from None
    if stat.S_ISDIR(found.st_mode):
        raise FileFormatError(f"{path} is a folder: a {what} is needed")
    if not stat.S_ISREG(found.st_mode):
        raise FileFormatError(f"{path} is a pipe or a device, no {what}: save what it gives to a file first")
    return found.st_size


def is_file(path: Path) -> bool:
    """Is it a regular file? False, and no error, for a name that no file can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def shown(path: str | os.PathLike[str]) -> str:
    """A name as a message can hold it, in one line."""
    return "".join(c if c.isprintable() else "?" for c in str(path))


def bytes_of(path: Path, what: str = "file", most: int = MOST_BYTES) -> bytes:
    """The content of a regular file of at most `most` bytes; FileFormatError otherwise."""
    size = require_file(path, what)
    if size > most:
        raise FileFormatError(f"{path} has {size / 1e6:.0f} MB: no {what} has more than {most / 1e6:.0f} MB")
    try:
        return path.read_bytes()
    except OSError as e:
        raise FileFormatError(f"cannot read {path}: {e.strerror or e}") from None


def text_of(path: Path, what: str = "text file", most: int = MOST_TEXT, errors: str = "strict") -> str:
    """The text of a file in UTF-8, without its byte order mark, lines ended by one character whoever wrote it.

    FileFormatError where there is no such file, or it is no text.
    """
    content = bytes_of(path, what, most)
    try:
        text = content.decode("utf-8-sig", errors)
    except UnicodeDecodeError as e:
        raise FileFormatError(f"{path} is no valid {what}: byte {e.start} is no text in UTF-8") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def settings_of(path: Path, what: str, missing: str = "") -> dict[str, Any]:
    """The content of a TOML file; FileFormatError where it is none, with the hint `missing` where there is no file."""
    import tomllib

    try:
        text = text_of(path, what, MOST_SETTINGS)
    except FileFormatError as e:
        said = str(e).replace(f"no valid {what}", "no valid TOML file")
        raise FileFormatError(said + (missing if said.startswith("no such") else "")) from None
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise FileFormatError(f"{path} is nested too deeply for a {what}") from None
    except ValueError as e:  # TOMLDecodeError, and what Python says to numbers and dates that cannot be
        raise FileFormatError(f"{path} is no valid TOML file: {' '.join(str(e).split())}") from None


def json_of(path: Path, what: str) -> Any:
    """The content of a JSON file; FileFormatError where there is none."""
    text = text_of(path, what)
    try:
        return json.loads(text)
    except RecursionError:
        raise FileFormatError(f"{path} is nested too deeply for a {what}") from None
    except ValueError as e:
        raise FileFormatError(f"{path} is truncated or no JSON: {e}") from None
