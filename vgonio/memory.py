"""Resident memory of this process, and its growth and peak while a block runs."""

from __future__ import annotations

import os
import threading
from typing import Any

STEP_SECONDS = 0.005


def resident() -> int:
    """Bytes of this process in memory now; 0 where the system does not tell."""
    try:
        with open("/proc/self/statm", encoding="ascii") as stream:
            return int(stream.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return 0


class Watch:
    """`with Watch() as memory:` then `memory.peak` and `memory.growth` in bytes, sampled every `step` seconds; None
    where the system does not tell."""

    def __init__(self, step: float = STEP_SECONDS) -> None:
        self.step = step

    def __enter__(self) -> Watch:
        self.begin = self.most = resident()
        self.ended = threading.Event()
        self.sampler = threading.Thread(target=self._sample, daemon=True)
        if self.begin:
            self.sampler.start()
        return self

    def _sample(self) -> None:
        while not self.ended.wait(self.step):
            self.most = max(self.most, resident())

    def __exit__(self, *exception: Any) -> None:
        self.ended.set()
        if self.begin:
            self.sampler.join()
            self.most = max(self.most, resident())

    @property
    def peak(self) -> int | None:
        return self.most or None

    @property
    def growth(self) -> int | None:
        return self.most - self.begin if self.begin else None
