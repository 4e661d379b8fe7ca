"""Where the points of a study are kept: one file a point, written whole by whoever computed it, found by its content.

<folder>/points/ab/abcdef….nc    a result as `vgonio simulate` writes it
<folder>/points/ab/abcdef….json  why a point failed
<folder>/journal/<worker>.jsonl  what was begun and ended, and when: one file a process, so nobody waits
"""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import FileFormatError
from ..files import written_whole


@dataclass(frozen=True)
class Store:
    """Results and failures of a study's points in a folder that all workers see."""

    folder: Path

    @classmethod
    def made(cls, folder: str | os.PathLike[str]) -> Store:
        """The store in `folder`, which is made where it is not there; FileFormatError where it cannot be."""
        path = Path(folder).absolute()
        try:
            for part in ("points", "journal"):
                (path / part).mkdir(parents=True, exist_ok=True)
        except OSError as e:
            raise FileFormatError(f"cannot make the folder {path}: {e.strerror or e}") from None
        return cls(path)

    def result(self, key: str) -> Path:
        """Where the result of the point `key` is, or would be."""
        # 256 folders: a million files in one is slow on most file systems
        return self.folder / "points" / key[:2] / f"{key}.nc"

    def failure(self, key: str) -> Path:
        """Where the reason of its failure is, or would be."""
        return self.result(key).with_suffix(".json")

    def has(self, key: str) -> bool:
        """Whether the point is finished."""
        return self.result(key).is_file()

    def why_failed(self, key: str) -> dict[str, Any] | None:
        """{"reason", "kind", "values"} of a point that failed; kind "input" will fail again, "machine" may not."""
        try:
            found = json.loads(self.failure(key).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return found if isinstance(found, dict) and {"reason", "kind"} <= set(found) else None

    def save(self, tree: Any, key: str) -> None:
        """Store a result, whole or not at all; FileFormatError where its folder cannot be made or written."""
        from ..measure.storage import save

        self._folder_of(key)
        save(tree, self.result(key))
        self.failure(key).unlink(missing_ok=True)

    def fail(self, key: str, reason: str, kind: str, values: Mapping[str, Any]) -> None:
        """Store why a point failed; FileFormatError as `save`."""
        self._folder_of(key)
        with written_whole(self.failure(key)) as stream:
            stream.write(json.dumps({"reason": reason, "kind": kind, "values": dict(values)}, default=str).encode())

    def _folder_of(self, key: str) -> None:
        try:
            self.result(key).parent.mkdir(parents=True, exist_ok=True)
        except OSError as e:
            raise FileFormatError(f"cannot make the folder {self.result(key).parent}: {e.strerror or e}") from None

    def note(self, event: str, key: str, **more: Any) -> None:
        """A line in this process' journal; a journal that cannot be written stops nothing."""
        line = json.dumps({"event": event, "point": key, "time": round(time.time(), 3), **more})
        try:
            with open(self.folder / "journal" / f"{socket.gethostname()}-{os.getpid()}.jsonl", "a") as stream:
                stream.write(line + "\n")
        except OSError:
            pass

    def journal(self) -> Iterator[dict[str, Any]]:
        """All events; a line that a killed worker did not finish is passed over."""
        for file in sorted((self.folder / "journal").glob("*.jsonl")):
            for line in file.read_text(encoding="utf-8").splitlines():
                try:
                    yield json.loads(line)
                except ValueError:
                    continue
