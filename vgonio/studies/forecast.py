"""What a sweep will take before it begins: plans of some points, and what each worker does once."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from .. import assembly
from ..errors import VgonioError
from .store import Store
from .study import Study
from .sweeping import todo, workers_for

SPREAD = 9  # points that are planned, from the first to the last; the dearest of all may be one more
# seconds, as docs/sweeps.md has them: to start and stop workers, of a point's share of gathering; bytes of Dask
START, GATHERED, DASK = 3.0, 0.012, 25e6


@dataclass(frozen=True)
class PointPlan:
    """One of the points that were planned: its values, its seconds without libraries, the bytes of a process for it"""

    values: Mapping[str, Any]
    seconds: float
    memory_bytes: float


@dataclass(frozen=True)
class StudyPlan:
    """What is left of a study, in seconds and bytes.

    left : points to be computed, by so many workers of one thread;  planned : some of them, from the first to the last
    dearest : of all combinations the one whose keys each have the value that takes longest;  loading : seconds of the
    libraries, once for each worker;  machine : whose seconds these are
    """

    left: int
    workers: int
    planned: tuple[PointPlan, ...]
    dearest: PointPlan
    loading: float
    machine: str

    @property
    def point_seconds(self) -> float:
        """The mean of the points that were planned."""
        return float(np.mean([p.seconds for p in self.planned]))

    @property
    def seconds(self) -> float:
        """From starting the workers to the result: of the worker that has the most to do, and of gathering."""
        each = max(self.left * self.point_seconds / self.workers, self.dearest.seconds)
        return START + self.loading + each + GATHERED * self.left

    @property
    def memory_bytes(self) -> float:
        """Of a worker, at most."""
        return DASK + max(p.memory_bytes for p in (*self.planned, self.dearest))

    def to_dict(self) -> dict[str, Any]:
        """What JSON can hold of it: seconds, bytes and counts, by the names of the attributes."""
        totals = {k: getattr(self, k) for k in ("seconds", "point_seconds", "memory_bytes")}
        return {**totals, **asdict(self)}

    def table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Columns and the one row of what is left."""
        from ..planning.plans import duration, size_in_words

        columns = ("left", "a point", "first", "dearest", "workers", "libraries", "in all", "memory of a worker")
        seconds = (self.point_seconds, self.planned[0].seconds, self.dearest.seconds)
        cells = (str(self.left), *map(duration, seconds), str(self.workers), duration(self.loading))
        return columns, [(*cells, duration(self.seconds), size_in_words(self.memory_bytes))]


def plan_study(study: Study, store: Store, workers: int | None = None, retry: bool = False) -> StudyPlan | None:
    """What the points that are not stored yet will take on so many workers (all processors); None where none is left.

    A few points are planned as `vg.plan` does, with one thread: their surfaces are made or read, nothing is simulated.
    Libraries, which a worker loads once, are counted apart. Raises what plans raise, where no point can be planned.
    """
    from ..accuracy.calibrating import calibration

    left = sum(1 for _ in todo(study, store, retry, lambda: None))
    if not left:
        return None
    on = calibration(1)
    some = set(np.unique(np.linspace(0, left - 1, min(left, SPREAD)).round()).astype(int).tolist())
    chosen = [v for i, (_, _, v) in enumerate(todo(study, store, retry, lambda: None)) if i in some]
    planned, loading, why = [], 0.0, None
    for values in chosen:
        try:
            point, once = _plan(study, values, on)
        except VgonioError as e:  # the point's own failure, as in the sweep
            why = why or e
            continue
        planned.append(point)
        loading = max(loading, once)
    if why is not None and not planned:
        raise why
    ends = [planned[0], *_ends(study, planned[0], on)]
    dearest = max([*planned, *ends, *_combined(study, ends, on)], key=lambda p: p.seconds)
    return StudyPlan(left, workers_for(workers, left), tuple(planned), dearest, loading, str(on))


def _plan(study: Study, values: Mapping[str, Any], on: Any) -> tuple[PointPlan, float]:
    """A point's plan and the seconds of its libraries. What planning takes, as each point is, is measured."""
    from ..planning import plan_of

    point = study.point(values)
    stored = point.output.model_copy(update={"file": "point.nc", "report": None})
    scene = point.model_copy(update={"output": stored})
    inputs = assembly.gather(scene)
    begin = time.process_time()
    made = plan_of(scene, inputs, new_process=True, on=on)[1]
    planning = time.process_time() - begin
    return PointPlan(dict(values), made.seconds - made.loading + planning, made.memory_bytes), made.loading


def _ends(study: Study, first: PointPlan, on: Any) -> Iterator[PointPlan]:
    """The first point with the value at the other end of each key, one at a time."""
    for key, values in () if study.zipped else study.vary.items():
        other = values[-1] if first.values[key] != values[-1] else values[0]
        if other != first.values[key]:
            yield from _planned(study, {**first.values, key: other}, on)


def _combined(study: Study, ends: list[PointPlan], on: Any) -> Iterator[PointPlan]:
    """All keys at the end that takes longer."""
    first, changed = ends[0], {}
    for end in ends[1:]:
        key = next(k for k in study.vary if end.values[k] != first.values[k])
        if end.seconds > first.seconds:
            changed[key] = end.values[key]
    if len(changed) > 1:
        yield from _planned(study, {**first.values, **changed}, on)


def _planned(study: Study, values: Mapping[str, Any], on: Any) -> Iterator[PointPlan]:
    """Its plan, or nothing where the point is refused."""
    try:
        yield _plan(study, values, on)[0]
    except VgonioError:
        return
