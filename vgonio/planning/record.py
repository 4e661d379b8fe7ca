"""After a run: did it take what was expected, and if not, what is to be done about that."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..accuracy.calibrating import COMMAND
from .plans import duration

FACTOR = 2.0  # that forecasts are good to
LEAST_SECONDS = 2.0  # of a run that is worth a line


def disagreement(plan: Mapping[str, Any], seconds: Mapping[str, float], processor: Mapping[str, float]) -> str:
    """A line where the parts of a run took more than twice or less than half of what was expected, or nothing.

    plan : as `Plan.to_dict` has it;  seconds, processor : part → elapsed, and of the processor, all threads together
    """
    stages = plan.get("stages", [])
    expected = {s["part"]: s["seconds"] for s in stages if s["needed"] and s["part"] and s["seconds"] is not None}
    parts = [p for p in seconds if p in expected]
    wanted, took = sum(expected[p] for p in parts), sum(seconds[p] for p in parts)
    if max(wanted, took) < LEAST_SECONDS or took <= FACTOR * wanted <= FACTOR**2 * took:
        return ""
    worked = sum(processor.get(p, 0.0) for p in parts)
    said = f"expected were {duration(wanted)}, it took {duration(took)}"
    if took > FACTOR * wanted and worked <= FACTOR * wanted:
        return f"{said}, {duration(worked)} of them the processor's: other programs, files or a device were in the way"
    return f"{said} ({plan.get('machine') or 'not calibrated'}): `{COMMAND}` measures this machine"
