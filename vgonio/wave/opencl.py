"""The direct sum as an OpenCL kernel: an honest, independent check of the fast transform, on CPU (PoCL) or GPU."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BackendError
from .pocl_cpu import SYMPTOM, name_processor
from .quadrature import Complex, Floats, Points

COLUMNS = (64, 256)  # points of one row of a work-item, a kernel for each
TERMS = 16384  # points of one work-item, all its rows
TARGETS = 4096  # directions of one launch
BYTES = 4e8  # of points and partial sums held on the device at a time
PRECISION = 1e-5  # what single precision with exact phases keeps
MOST_TURNS = 2.0**22  # beyond that whole turns are not told from their fractions


@dataclass(frozen=True, eq=False)
class Device:
    """The compiled kernels on one device, by the points of one row of a work-item."""

    name: str
    platform: str
    context: Any
    queue: Any
    kernels: dict[int, Any]


def _rank(device) -> tuple:
    """GPUs before CPUs, then the newest platform: with two PoCLs installed their order is arbitrary."""
    import pyopencl as cl

    gpu = bool(device.type & cl.device_type.GPU)
    numbers = tuple(int(p) for p in "".join(c if c.isdigit() else " " for c in device.platform.version).split()[:4])
    return gpu, numbers


@lru_cache(maxsize=4)
def device(name: str = "") -> Device:
    """The best device, or the first whose name or platform contains `name` (also VGONIO_OPENCL_DEVICE).

    Raises BackendError with the reason where there is no OpenCL, no such device, or the kernel does not build.
    """
    name = name or os.environ.get("VGONIO_OPENCL_DEVICE", "")
    _writable_cache()
    try:
        import pyopencl as cl

        found = [d for p in cl.get_platforms() for d in p.get_devices()]
    except Exception as e:  # a broken driver raises all kinds of errors
        raise BackendError(f"no OpenCL here ({type(e).__name__}: {e}); pip install 'pyopencl[pocl]'") from None
    fit = [d for d in found if name.lower() in f"{d.platform.name} {d.platform.version} {d.name}".lower()]
    if not fit:
        have = ", ".join(f"{d.name.strip()} ({d.platform.version})" for d in found) or "none"
        raise BackendError(f"no OpenCL device matches {name!r}; there are: {have}")
    return _build(max(fit, key=_rank))


def _writable_cache() -> None:
    """PoCL and pyopencl keep kernels under ~/.cache and fail, far from the cause, where they cannot write there."""
    if os.environ.get("POCL_CACHE_DIR"):
        return
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    there = next((p for p in (home / "pocl", *(home / "pocl").parents) if p.exists()), Path("/"))
    if not (there.is_dir() and os.access(there, os.W_OK)):
        os.environ.setdefault("PYOPENCL_NO_CACHE", "1")
        os.environ["POCL_CACHE_DIR"] = tempfile.mkdtemp(prefix="vgonio-pocl-")


def _build(best: Any, again: bool = True) -> Device:
    import pyopencl as cl

    width = 16 if best.native_vector_width_float >= 16 else 8
    source = files("vgonio.wave").joinpath("kernels/direct_sum.cl").read_text()
    try:
        context = cl.Context([best])
        built = [cl.Program(context, source).build(options=[f"-DWIDTH={width}", f"-DCOLUMNS={n}"]) for n in COLUMNS]
        kernels = {n: cl.Kernel(program, "direct_sum") for n, program in zip(COLUMNS, built)}
        return Device(best.name.strip(), best.platform.version, context, cl.CommandQueue(context), kernels)
    except Exception as e:
        if again and SYMPTOM in str(e) and name_processor(best):
            return _build(best, again=False)
        line = next((s for s in str(e).splitlines() if "error" in s.lower()), str(e).splitlines()[0])
        raise BackendError(f"the kernel does not build on {best.name.strip()}: {line.strip()}") from None


def split(a: Floats) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """High and low single-precision parts of doubles: 48 bits together."""
    high = a.astype(np.float32)
    return high, (a - high).astype(np.float32)


def transform(points: Points, q: Floats, tol: float = PRECISION, on: Device | None = None) -> Complex:
    """(m,) sums of `points` at q (m, 3). Phases keep their fraction of a cycle up to 10⁵ rad; precision about 1e-5.

    Raises BackendError for phases beyond MOST_TURNS cycles.
    """
    d = on or device()
    rows, columns = points.weight.any(axis=1), points.weight.any(axis=0)
    s = np.zeros(len(q), np.complex128)
    if not (rows.any() and len(q)):
        return s
    x, y = points.x[columns], points.y[rows]
    z, weight = (a[np.ix_(rows, columns)] for a in (points.z, points.weight))
    # phases count from the middle of the patch; what that turns them by comes back in double precision
    middle = np.array([a.min() / 2 + a.max() / 2 for a in (x, y, z)])
    x, y, z = x - middle[0], y - middle[1], z - middle[2]
    turns = q / (2 * np.pi)
    most = float(np.max(np.abs(turns) @ np.array([np.abs(a).max() for a in (x, y, z)])))
    if most > MOST_TURNS:
        raise BackendError(f"phases of {most:.2g} cycles are too much for the OpenCL sum: use method = 'nufft'")
    at_once = max(1, int(BYTES / 12 / (len(x) + COLUMNS[-1])))
    for first in range(0, len(y), at_once):
        part = slice(first, first + at_once)
        s += _strip(d, x, y[part], z[part], weight[part], turns)
    return s * np.exp(-1j * (q @ middle)) * points.factor(q)


def _strip(d: Device, x: Floats, y: Floats, z: Floats, weight: Floats, turns: Floats) -> Complex:
    """The sum over a grid that fits the device, without the factor for its middle."""
    import pyopencl as cl

    n = min(COLUMNS, key=lambda c: (-(-len(x) // c) * c, -c))  # least padding, and of equals the longer
    strips, pad = -(-len(x) // n), -len(x) % n
    rows = max(1, TERMS // n)
    groups = -(-len(y) // rows)
    single = np.pad(weight.astype(np.float32), ((0, 0), (0, pad)))
    read = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR

    def send(a: NDArray) -> Any:
        return cl.Buffer(d.context, read, hostbuf=np.ascontiguousarray(a))

    arrays = (np.pad(x, (0, pad)), y, np.pad(z, ((0, 0), (0, pad))))
    buffers = [send(half) for a in arrays for half in split(a)] + [send(single)]
    whole = float(single.sum(dtype=np.float64))
    sizes = [np.int32(v) for v in (len(y), strips, strips * n, rows)]
    step = max(1, min(TARGETS, int(BYTES / 16 / (groups * strips))))
    s = np.zeros(len(turns), np.complex128)
    for t in range(0, len(turns), step):
        packed = np.concatenate(split(turns[t : t + step]), axis=1)
        partial = np.empty((groups * strips, len(packed), 2))
        out = cl.Buffer(d.context, cl.mem_flags.WRITE_ONLY, partial.nbytes)
        work = (len(packed), groups * strips)
        d.kernels[n](d.queue, work, None, np.int32(len(packed)), *sizes, send(packed), *buffers, out)
        cl.enqueue_copy(d.queue, partial, out)
        total = partial.sum(axis=0)
        # the kernel gives Σ w sin² of half the angle: Σ w cos is the sum of the weights less twice that
        s[t : t + step] = whole - 2 * total[:, 0] + 1j * total[:, 1]
    return s
