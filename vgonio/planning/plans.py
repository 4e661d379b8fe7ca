"""What a plan is: stages, each needed or left out with its reason, and warnings; as text, table and JSON."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Stage:
    """One step: needed or left out, and why; the library it loads and what it costs, roughly."""

    name: str
    needed: bool
    why: str
    library: str = ""
    cost: str = ""


@dataclass(frozen=True)
class Plan:
    """The stages of a scene in order, and warnings about where its numbers should not be trusted."""

    title: str
    stages: tuple[Stage, ...]
    warnings: tuple[str, ...] = ()

    def needs(self, name: str) -> bool:
        """Is the stage of that name done? False as well for a stage that is not in the plan."""
        return any(s.name == name and s.needed for s in self.stages)

    def rows(self) -> list[dict[str, Any]]:
        """One dictionary a stage: name, needed, why, library, cost."""
        return [asdict(s) for s in self.stages]

    def to_dict(self) -> dict[str, Any]:
        return {"title": self.title, "stages": self.rows(), "warnings": list(self.warnings)}

    def to_json(self) -> str:
        return json.dumps(self.to_dict(), ensure_ascii=False)

    def __str__(self) -> str:
        cells = [("", "stage", "library", "cost", "why")]
        cells += [("+" if s.needed else "-", s.name, s.library, s.cost, s.why) for s in self.stages]
        widths = [max(len(row[i]) for row in cells) for i in range(4)]
        lines = [f"Plan of {self.title}   (+ is done, - is left out)"]
        lines += ["  ".join([*(c.ljust(w) for c, w in zip(row, widths)), row[4]]).rstrip() for row in cells]
        return "\n".join([*lines, *(f"warning: {w}" for w in self.warnings)])
