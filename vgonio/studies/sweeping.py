"""A sweep on Dask: points go to workers, each stores its own result at once, the scheduler carries names only."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import __version__
from ..errors import BackendError, InputError, VgonioError, whole
from ..files import undisturbed
from .gathering import gather
from .store import Store
from .study import Study, content_key, load_study
from .worker import compute

if TYPE_CHECKING:
    import xarray as xr

    from ..scene import Scene

# (points that have ended, points in all)
Progress = Callable[[int, int], None]
IN_FLIGHT = 4  # points a thread: enough to keep it busy, few enough for the scheduler to hold in memory
# after so many workers died under a point it is the point that kills them
DEATHS = 3
SETTINGS = {"distributed.scheduler.allowed-failures": DEATHS}
# Of a cluster on this machine: processes are waited for however busy it is, and one is lost when it has ended, not when
# it has long been silent, as it is while the machine sleeps or a job is stopped. One that was killed begins anew: Dask
# gives it up after 15 s, and without a last one a sweep would wait for ever.
OF_OUR_OWN = {
    "distributed.scheduler.worker-ttl": None,
    "distributed.scheduler.no-workers-timeout": "10 minutes",
    "distributed.deploy.lost-worker-timeout": "1 hour",
    "distributed.comm.timeouts.connect": "120s",
}
ANSWER_SECONDS = 30


def sweep(
    study: str | os.PathLike[str] | Mapping[str, Any] | Study,
    folder: str | os.PathLike[str] | None = None,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    retry: bool = False,
    progress: Progress | None = None,
) -> xr.DataTree:
    """Compute the points of a study that are not stored yet, and return all of them as one tree over the swept dims.

    folder : where points are stored, by default <study>.sweep beside the file; all workers have to see it
    scheduler : address of a Dask scheduler ("tcp://…"); without it a LocalCluster of `workers` processes of one thread
    retry : also points whose input was refused before (those that the machine failed are always tried again)
    progress : called as progress(points that have ended, points in all)

    A point that fails is recorded with its reason and stops nothing. Killed workers or a killed run lose what was in
    flight; running again goes on. Raises InputError and FileFormatError for a bad study, BackendError without Dask or
    where the scheduler does not answer.
    """
    made = study if isinstance(study, Study) else load_study(study)
    store = Store.made(folder if folder is not None else default_folder(study))
    tell = progress or (lambda ended, points: None)
    ended = 0

    def one_more() -> None:
        nonlocal ended
        ended += 1
        tell(ended, len(made))

    left = todo(made, store, retry, one_more)
    first = next(left, None)
    if first is not None:
        try:
            with _client(scheduler, workers, len(made)) as client:
                _compute_all(client, store, first, left, one_more)
        except KeyboardInterrupt as interrupt:
            interrupt.add_note(f"finished points are kept in {store.folder}; the same command goes on from there")
            raise
    return gather(made, store)


def default_folder(study: Any) -> Path:
    if not isinstance(study, (str, os.PathLike)):
        raise InputError("a study that is no file needs a folder for its points")
    return Path(study).with_suffix(".sweep")


Point = tuple[str, "Scene", dict[str, Any]]


def todo(study: Study, store: Store, retry: bool, ended: Callable[[], None]) -> Iterator[Point]:
    """Points that have to be computed; the others, and those whose scene is refused, have ended already."""
    for values in study.values():
        key, scene = "", None
        try:
            scene = study.point(values)
            key = content_key(scene)
        except VgonioError:
            ended()  # refused: the reason is found again when the results are gathered
            continue
        failed = store.why_failed(key)
        if store.has(key) or (failed is not None and failed["kind"] == "input" and not retry):
            ended()
        else:
            yield key, scene, values


def workers_for(asked: int | None, points: int) -> int:
    """Processes on this machine: as many as asked for, or as it has processors, and no more than points."""
    return min(points, whole("workers", asked if asked is not None else os.cpu_count() or 1, 1))


@contextmanager
def _client(scheduler: str | None, workers: int | None, points: int) -> Iterator[Any]:
    """A client of the scheduler at an address, or of a cluster of our own that ends with the block."""
    try:
        import dask
        import distributed
    except ModuleNotFoundError:
        raise BackendError("a sweep needs Dask: pip install 'vgonio[sweep]'") from None
    count = workers_for(workers, points)
    with dask.config.set(SETTINGS if scheduler is not None else {**SETTINGS, **OF_OUR_OWN}), ExitStack() as begun:
        if scheduler is not None:
            client = begun.enter_context(_answering(scheduler))
        else:
            with undisturbed():  # a cluster that is broken off half made, or half ended, leaves processes behind
                begun.enter_context(_without_the_callers_script())
                cluster = begun.enter_context(_cluster(count))
                client = begun.enter_context(distributed.Client(cluster, set_as_default=False))
        try:
            yield client
        finally:
            # What is computed is stored: a worker that does not end in Dask's time, as on a busy machine, loses none.
            with undisturbed(), suppress(Exception):
                begun.close()


def _answering(scheduler: str) -> Any:
    import distributed
    from distributed.comm import resolve_address

    # Never the default client of the process: one that found no scheduler would stay it, and files would be saved
    # under its locks (xarray asks Dask for them).
    try:
        resolve_address(scheduler)  # a client that meets a bad address itself hangs for 20 s when it is dropped
        return distributed.Client(scheduler, timeout=ANSWER_SECONDS, set_as_default=False)
    except (OSError, ValueError) as e:
        raise BackendError(f"no Dask scheduler answers at {scheduler!r}: {e or type(e).__name__}") from None


def _cluster(count: int) -> Any:
    import distributed

    try:
        return distributed.LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            dashboard_address=":0",  # any free port, where None would take 8787 and warn of a second cluster
            scheduler_kwargs={"dashboard": False},
            silence_logs=50,
            preload=["vgonio.studies.worker"],
        )
    except Exception as e:  # whatever the machine refused: memory, processes, ports
        why = " ".join(f"{type(e).__name__}: {e}".split())
        raise BackendError(f"{count} worker processes could not be started ({why}): take fewer of them") from None


@contextmanager
def _without_the_callers_script() -> Iterator[None]:
    """Workers need nothing of the program that sweeps; multiprocessing would run it again in each of them.

    A script without `if __name__ == "__main__":` would then start clusters in its own workers.
    """
    main = sys.modules["__main__"]
    kept: dict[str, Any] = {name: vars(main)[name] for name in ("__file__", "__spec__") if name in vars(main)}
    vars(main).pop("__file__", None)
    main.__spec__ = None
    try:
        yield
    finally:
        vars(main).update(kept)


def _compute_all(client: Any, store: Store, first: Point, todo: Iterator[Point], ended: Callable[[], None]) -> None:
    """A window of points slides over the study, so that neither memory nor scheduler ever holds all of them."""
    from distributed import as_completed

    points: dict[str, Point] = {}

    def submit(point: Point) -> Any:
        key, scene, values = point
        points[key] = point
        return client.submit(compute, scene, key, values, store, __version__, key=f"point-{key}", pure=False)

    running = as_completed([submit(first)], loop=client.loop)
    try:
        for point in todo:
            if point[0] in points:  # two values that mean the same
                ended()
                continue
            running.add(submit(point))
            while running.count() >= _window(client):
                _one_ended(running, store, points)
                ended()
        while running.count():
            _one_ended(running, store, points)
            ended()
    except KeyboardInterrupt:
        with undisturbed(interrupt_after=False):
            client.cancel(list(running.futures))
        raise


def _window(client: Any) -> int:
    threads = sum(client.nthreads().values())
    return IN_FLIGHT * max(1, threads)


def _one_ended(running: Any, store: Store, points: dict[str, Point]) -> None:
    future = next(running)
    key, _, values = points.pop(future.key.removeprefix("point-"))
    if future.status != "finished":
        reason = future.exception() if future.status == "error" else future.status
        store.fail(key, f"the worker was lost: {type(reason).__name__}: {reason}", "machine", values)
