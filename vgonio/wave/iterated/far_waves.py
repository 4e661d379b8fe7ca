"""Far directions seen from a patch, on an OpenCL device: horizons, and the phases of all points towards a direction."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import opencl
from ..quadrature import Floats
from .pairs import FAR_BELOW, Grid, Singles, built, lanes

AZIMUTHS = 48  # of the horizon map


@lru_cache(maxsize=1)
def _program() -> Any:
    return built("patch_far.cl", [])


def horizon_map(z: Floats, margin: int, pitch: float, azimuth: Floats) -> Singles:
    """(n, ny, nx) slope of the highest line of sight along azimuths (n,) from points of a patch within z, that has
    `margin` more cells on each side (NaN where there is no surface)."""
    import pyopencl as cl

    device, (high, wide) = opencl.device(), z.shape
    rows, columns = high - 2 * margin, wide - 2 * margin
    kernel = cl.Kernel(_program(), "horizons")
    read = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    heights = np.ascontiguousarray(np.nan_to_num(z, nan=FAR_BELOW).astype(np.float32))
    turns = np.ascontiguousarray(np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1).astype(np.float32))
    out = np.empty((len(azimuth), rows, columns), np.float32)
    buffers = [cl.Buffer(device.context, read, hostbuf=a) for a in (heights, turns)]
    result = cl.Buffer(device.context, cl.mem_flags.WRITE_ONLY, out.nbytes)
    whole = [np.int32(v) for v in (columns, rows, wide, high, margin, int(1.5 * max(high, wide)))]
    numbers = [np.float32(v) for v in (pitch, np.nanmax(z))]
    kernel(device.queue, (columns, rows, len(azimuth)), None, *whole, *numbers, *buffers, result)
    cl.enqueue_copy(device.queue, out, result)
    return out


class Waves:
    """cos and sin of k w·r of a patch's points towards far directions w, 0 where a point does not see w.

    grid : points, counted from their middle;  sheets : (n, ny, nx) slopes of the horizon along some azimuths
    stride : columns of what comes back, a multiple of the device's lanes; those beyond the points are 0
    """

    def __init__(self, grid: Grid, sheets: Singles) -> None:
        import pyopencl as cl

        self.grid, self.device = grid, opencl.device()
        self.stride = -(-grid.shape[1] // lanes()) * lanes()
        read = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        singles = [self.padded(a) for a in (grid.z, grid.normal, sheets)]
        self.buffers = [cl.Buffer(self.device.context, read, hostbuf=a) for a in singles]

    def padded(self, a: Floats | Singles) -> Singles:
        """(…, ny, stride) in single precision."""
        out = np.zeros((*a.shape[:-1], self.stride), np.float32)
        out[..., : a.shape[-1]] = a
        return out

    def __call__(self, w: Floats, k: float, sheet: NDArray[np.int32], share: Floats) -> Singles:
        """(2, m, ny, stride) cosines and sines towards w (m, 3).

        sheet : (m, 2) of the horizon below and above the azimuth of w;  share : (m,) of the latter
        """
        import pyopencl as cl

        (rows, columns), m = self.grid.shape, len(w)
        across = np.hypot(w[:, 0], w[:, 1])
        directions = np.column_stack([w, w * (k / (2 * np.pi)), across, share]).astype(np.float32)
        flags = cl.mem_flags
        tables = [
            cl.Buffer(self.device.context, flags.READ_ONLY | flags.COPY_HOST_PTR, hostbuf=np.ascontiguousarray(a))
            for a in (directions, sheet.astype(np.int32))
        ]
        out = np.empty((2, m, rows, self.stride), np.float32)
        result = cl.Buffer(self.device.context, flags.WRITE_ONLY | flags.USE_HOST_PTR, hostbuf=out)
        whole = [np.int32(v) for v in (rows, self.stride, m)]
        numbers = [np.float32(v) for v in ((columns - 1) / 2, (rows - 1) / 2, self.grid.pitch)]
        kernel = cl.Kernel(_program(), "waves")
        size = (self.stride // lanes(), rows, m)
        kernel(self.device.queue, size, None, *whole, *numbers, *self.buffers, *tables, result)
        cl.enqueue_copy(self.device.queue, out, result)
        return out
