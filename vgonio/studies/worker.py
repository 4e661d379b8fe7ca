"""What a worker of a sweep does: one point at a time, simulated and stored where it is."""

from __future__ import annotations

import json
import signal
import time
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from .. import __version__
from ..errors import VgonioError
from .store import Store

if TYPE_CHECKING:
    import xarray as xr

    from ..scene import Scene


def dask_setup(worker: Any) -> None:
    """Called by Dask when a worker of ours starts: Ctrl-C reaches all processes of a terminal, one decides."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def compute(scene: Scene, key: str, values: dict[str, Any], store: Store, version: str) -> None:
    """One point, on a worker: simulated and stored, or its failure recorded. Returns nothing: results do not travel."""
    if store.has(key):
        return
    import dask

    store.note("begun", key)
    begin = time.perf_counter()
    try:
        if version != __version__:
            raise RuntimeError(f"the worker has vgonio {__version__}, the sweep was begun by {version}")
        # on a worker xarray would ask the cluster for a lock on the bytes it writes to
        with dask.config.set(scheduler="synchronous"):
            store.save(_simulated(scene, values), key)
        store.note("done", key, seconds=round(time.perf_counter() - begin, 3))
    except Exception as e:
        kind = "input" if isinstance(e, VgonioError) else "machine"
        store.fail(key, str(e) if kind == "input" else f"{type(e).__name__}: {e}", kind, values)
        store.note("failed", key, reason=str(e))


def _simulated(scene: Scene, values: Mapping[str, Any]) -> xr.DataTree:
    from ..scene import without_output
    from ..simulation import simulate

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the plan's warnings are in the result
        tree = simulate(without_output(scene))
    tree.attrs["point"] = json.dumps(dict(values), default=str)
    return tree
