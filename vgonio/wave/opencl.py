"""The direct sum as an OpenCL kernel: an honest, independent check of the fast transform, on CPU (PoCL) or GPU."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BackendError
from .pocl_cpu import SYMPTOM, name_processor
from .quadrature import Complex, Floats, Points

BLOCK = 4096  # points of one work-item
TARGETS = 4096  # directions of one launch
BYTES = 4e8  # of points and partial sums held on the device at a time
PRECISION = 1e-5  # what single precision with exact phases keeps


@dataclass(frozen=True, eq=False)
class Device:
    """A compiled kernel on one device."""

    name: str
    platform: str
    context: Any
    queue: Any
    kernel: Any


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


def _build(best: Any, again: bool = True) -> Device:
    import pyopencl as cl

    width = 16 if best.native_vector_width_float >= 16 else 8
    source = files("vgonio.wave").joinpath("kernels/direct_sum.cl").read_text()
    try:
        context = cl.Context([best])
        program = cl.Program(context, source).build(options=[f"-DWIDTH={width}", f"-DBLOCK={BLOCK}"])
        queue, kernel = cl.CommandQueue(context), cl.Kernel(program, "direct_sum")
        return Device(best.name.strip(), best.platform.version, context, queue, kernel)
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
    """(m,) sums of `points` at q (m, 3). Phases keep their fraction of a cycle up to 10⁵ rad; precision about 1e-5."""
    d = on or device()
    import pyopencl as cl

    used = np.flatnonzero(points.weight.ravel())
    x, y = (a.ravel()[used] for a in np.broadcast_arrays(points.x[None, :], points.y[:, None]))
    z, weight = points.z.ravel()[used], points.weight.ravel()[used]
    # phases count from the middle of the patch; what that turns them by comes back in double precision
    middle = np.array([a.mean() if len(a) else 0.0 for a in (x, y, z)])
    turns = q / (2 * np.pi)
    s = np.zeros(len(q), np.complex128)
    read = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    for start in range(0, len(used), int(BYTES / 28) // BLOCK * BLOCK):
        part = slice(start, start + int(BYTES / 28) // BLOCK * BLOCK)
        count = len(used[part])
        padded = -(-count // BLOCK) * BLOCK
        arrays: list[NDArray[np.float32]] = []
        for a, m in zip((x, y, z), middle):
            arrays += [np.pad(v, (0, padded - count)) for v in split(a[part] - m)]
        arrays.append(np.pad(weight[part].astype(np.float32), (0, padded - count)))
        buffers = [cl.Buffer(d.context, read, hostbuf=np.ascontiguousarray(a)) for a in arrays]
        blocks = padded // BLOCK
        step = max(1, min(TARGETS, int(BYTES / 16 / blocks)))
        for t in range(0, len(q), step):
            high, low = split(turns[t : t + step])
            n = len(high)
            packed = np.ascontiguousarray(np.concatenate([high, low], axis=1))
            partial = np.empty((blocks, n, 2))
            out = cl.Buffer(d.context, cl.mem_flags.WRITE_ONLY, partial.nbytes)
            packed_buffer = cl.Buffer(d.context, read, hostbuf=packed)
            d.kernel(d.queue, (n, blocks), None, np.int32(n), np.int32(blocks), packed_buffer, *buffers, out)
            cl.enqueue_copy(d.queue, partial, out)
            total = partial.sum(axis=0)
            s[t : t + step] += total[:, 0] + 1j * total[:, 1]
    return s * np.exp(-1j * (q @ middle)) * points.factor(q)
