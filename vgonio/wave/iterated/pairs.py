"""One more reflection of all points of a patch on each other: the OpenCL kernel and its slow reference.

Both take fields (sides, 12, ny, nx): N × E and N × H, three components each, real and imaginary parts alternating, area
of the surface over that of the ground included; `kernels/pairs.cl` has the formulas.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import BackendError
from ...materials import fresnel
from .. import opencl
from ..quadrature import Floats
from .propagate import near_grazing

WIDTH = 8
FAR_BELOW = -1e6
LAUNCH = 2e9  # pairs of one launch, so that progress shows
AZIMUTHS = 48  # of the horizon map
Singles = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Grid:
    """Points of a patch: heights z and unit normals (3, ny, nx) at pitch µm."""

    z: Floats
    normal: Floats
    pitch: float

    @property
    def shape(self) -> tuple[int, int]:
        return self.z.shape  # type: ignore[return-value]


@lru_cache(maxsize=16)
def _program(sides: int, most: int, perfect: bool) -> Any:
    import pyopencl as cl

    device = opencl.device()
    options = [f"-DWIDTH={WIDTH}", f"-DSIDES={sides}", f"-DMOST={most}"]
    if perfect:
        options.append("-DPERFECT")
    else:
        scale, series = faddeeva_series()
        listed = ",".join(f"{a:.9e}f" for a in series)
        options += [f"-DTERMS={len(series)}", f"-DSCALE={scale:.9e}f", f"-DFADDEEVA={listed}"]
    source = files("vgonio.wave").joinpath("kernels/pairs.cl").read_text()
    try:
        return cl.Program(device.context, source).build(options=options)
    except cl.Error as e:
        line = next((s for s in str(e).splitlines() if "error" in s.lower()), str(e).splitlines()[0])
        raise BackendError(f"the kernel of pairs does not build on {device.name}: {line.strip()}") from None


def faddeeva_series(terms: int = 16) -> tuple[float, Floats]:
    """Scale L and coefficients (terms,), highest power first, of Weideman's (1994) series: in the upper half plane
    W(z) = 2 p(Z)/(L − iz)² + 1/(√π (L − iz)), Z = (L + iz)/(L − iz); 16 terms are right to 1e-6."""
    scale = np.sqrt(terms / np.sqrt(2))
    t = scale * np.tan(np.arange(-2 * terms + 1, 2 * terms) * np.pi / (4 * terms))
    f = np.concatenate([[0.0], np.exp(-(t**2)) * (scale**2 + t**2)])
    a = np.fft.fft(np.fft.fftshift(f)).real / (4 * terms)
    return float(scale), a[1 : terms + 1][::-1]


def _padded(a: Floats, columns: int, value: float) -> Singles:
    """(…, ny, stride): WIDTH columns to the left and enough to the right."""
    right = -(-columns // WIDTH) * WIDTH - columns + 2 * WIDTH
    wide = [(0, 0)] * (a.ndim - 1) + [(WIDTH, right)]
    return np.ascontiguousarray(np.pad(a.astype(np.float32), wide, constant_values=value))


def reflect_opencl(
    grid: Grid, source: Floats, k: float, index: complex | None, progress: Callable[[float], None] | None = None
) -> Floats:
    """(sides, 12, ny, nx) what arrives and is reflected once more, per unit area of the surface.

    k : rad/µm;  index : n + ik, None for a perfect conductor. Raises BackendError without an OpenCL device.
    """
    import pyopencl as cl

    device, (rows, columns) = opencl.device(), grid.shape
    sides = len(source)
    most = 64 * -(-max(rows, columns) // 64) + WIDTH
    kernel = cl.Kernel(_program(sides, most, index is None), "pairs")
    read = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    arrays = [
        _padded(a, columns, v) for a, v in ((grid.z - grid.z.mean(), FAR_BELOW), (grid.normal, 0.0), (source, 0.0))
    ]
    buffers = [cl.Buffer(device.context, read, hostbuf=a) for a in arrays]
    out = np.zeros(arrays[2].shape, np.float32)
    result = cl.Buffer(device.context, cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR, hostbuf=out)
    eps = 1.0 if index is None else complex(index) ** 2
    metal = 1.0 if index is None else abs((index - 1) / (index + 1))
    numbers = [np.float32(v) for v in (grid.pitch, k, np.real(eps), np.imag(eps), metal, float(arrays[0].max()))]
    step = max(1, int(LAUNCH / (columns * grid.z.size)))
    for first in range(0, rows, step):
        size = (-(-columns // WIDTH), min(step, rows - first))
        whole = [np.int32(v) for v in (columns, rows, arrays[0].shape[-1], WIDTH, first)]
        kernel(device.queue, size, (1, 1), *whole, *numbers, *buffers, result)
        device.queue.finish()
        if progress:
            progress(min(1.0, (first + step) / rows))
    cl.enqueue_copy(device.queue, out, result)
    return out[..., WIDTH : WIDTH + columns].astype(np.float64)


def horizon_map(z: Floats, margin: int, pitch: float, azimuth: Floats) -> Singles:
    """(n, ny, nx) slope of the highest line of sight along azimuths (n,) from points of a patch within z, that has
    `margin` more cells on each side (NaN where there is no surface)."""
    import pyopencl as cl

    device, (high, wide) = opencl.device(), z.shape
    rows, columns = high - 2 * margin, wide - 2 * margin
    kernel = cl.Kernel(_program(1, 64, True), "horizons")
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


# ---- the reference
def seen_from(grid: Grid, iy: int, ix: int) -> NDArray[np.bool_]:
    """(ny, nx) what one point sees by the kernel's rule, column by column of four wedges; facing not yet asked for."""
    seen = np.zeros(grid.shape, bool)
    for turned in range(4):
        z = np.rot90(grid.z, turned)
        where = np.zeros(grid.shape, bool)
        where[iy, ix] = True
        y, x = (int(i) for i in np.argwhere(np.rot90(where, turned))[0])
        found = _wedge(z, y, x, grid.pitch, diagonals=turned % 2 == 0)
        seen |= np.rot90(found, -turned)
    return seen


def _wedge(z: Floats, y: int, x: int, pitch: float, diagonals: bool) -> NDArray[np.bool_]:
    """Sight towards larger x within 45°."""
    seen = np.zeros(z.shape, bool)
    rows = np.arange(len(z)) - y
    horizon = np.full(len(z), -np.inf)
    for a in range(1, z.shape[1] - x):
        b = rows[np.abs(rows) <= a]
        share, at = np.abs(b) / a, b + y
        inner = horizon[at - np.sign(b)]
        with np.errstate(invalid="ignore"):
            line = np.where(share > 0, inner * share, 0) + np.where(share < 1, horizon[at] * (1 - share), 0)
        rise = (z[at, x + a] - z[y, x]) / (pitch * np.hypot(a, b))
        seen[at, x + a] = (rise >= line) & (diagonals | (np.abs(b) < a))
        horizon = horizon.copy()
        horizon[at] = np.maximum(line, rise)
    return seen


def reflect_reference(grid: Grid, source: Floats, k: float, index: complex | None, observers: Any) -> Floats:
    """(sides, 12, len(observers)) what `reflect_opencl` gives at a few observers (iy, ix), in double precision."""
    ny, nx = grid.shape
    x, y = np.meshgrid(np.arange(nx) * grid.pitch, np.arange(ny) * grid.pitch)
    fields = (source[:, 0::2] + 1j * source[:, 1::2]).reshape(len(source), 2, 3, ny, nx)
    out = np.zeros((len(source), 12, len(observers)))
    for n, (iy, ix) in enumerate(observers):
        r = np.stack([x[iy, ix] - x, y[iy, ix] - y, grid.z[iy, ix] - grid.z])
        d = np.linalg.norm(r, axis=0)
        u = r / np.where(d > 0, d, 1)
        own = grid.normal[:, iy, ix]
        c = -np.einsum("iyx,i->yx", u, own)
        pair = seen_from(grid, iy, ix) & (np.sum(u * grid.normal, axis=0) > 1e-6) & (c > 1e-6)
        u, c, d = u[:, pair], c[pair], d[pair]
        front = (1j * k - 1 / d) * np.exp(1j * k * d) / (4 * np.pi * d) * grid.pitch**2
        a, b = fields[:, 0][..., pair], fields[:, 1][..., pair]
        parts = front * _cross(u, a), -front * _cross(u, _cross(u, b))
        found = _tangent_plane(u, c, own, *parts, k * d, index)
        out[:, 0::2, n], out[:, 1::2, n] = found.real, found.imag
    return out


def _cross(u: Floats, a: NDArray) -> NDArray:
    """u (3, n) × a (sides, 3, n)."""
    return np.cross(np.broadcast_to(u, a.shape), a, axis=1)


def _tangent_plane(
    u: Floats, c: Floats, own: Floats, from_a: NDArray, from_b: NDArray, kd: Floats, index: complex | None
) -> NDArray:
    """(sides, 6) sums of n × E and n × H of waves along u (3, n), whose fields (sides, 3, n) come from A and from B."""
    one = np.ones(c.shape, np.complex128)
    rs, rp = (-one, one) if index is None else fresnel(c, index)
    s = np.cross(u, own, axisb=0, axisa=0).T
    s /= np.sqrt(np.sum(s**2, axis=0) + 1e-14)
    p, t = np.cross(u, s, axis=0), np.cross(own[:, None], s, axis=0)
    admittance = c * (1 - rp) / (1 + rp)
    metal = 1.0 if index is None else abs((index - 1) / (index + 1))
    q = near_grazing(rp, c, admittance, kd, metal)
    on_s = np.sum((from_a + from_b) * s, axis=1)
    along = (1 + rp) * np.sum(from_a * p, axis=1) + (1 + q) * np.sum(from_b * p, axis=1)
    electric = (admittance * along)[:, None] * s + ((1 + rs) * on_s)[:, None] * t
    magnetic = ((1 - rs) * c * on_s)[:, None] * s - along[:, None] * t
    return np.concatenate([electric.sum(axis=-1), magnetic.sum(axis=-1)], axis=1)
