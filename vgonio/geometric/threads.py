"""Threads of the tracing: numpy and the tracers release the interpreter's lock while they work."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

from threadpoolctl import threadpool_limits

T = TypeVar("T")
AHEAD = 4  # results that may wait to be taken, beside one a processor


@contextmanager
def workers(threads: int | None) -> Iterator[Executor]:
    """A pool of `threads` threads, None: all processors; BLAS gets one each, its own only wait for each other."""
    with threadpool_limits(1, user_api="blas"), ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        yield pool


def in_order(pool: Executor, work: Callable[..., T], jobs: Iterable[tuple]) -> Iterator[T]:
    """Results of work(*job) in the order of the jobs; few of them are started before they are wanted."""
    waiting: deque[Future[T]] = deque()
    for job in jobs:
        if len(waiting) >= AHEAD + (os.cpu_count() or 1):
            yield waiting.popleft().result()
        waiting.append(pool.submit(work, *job))
    while waiting:
        yield waiting.popleft().result()
