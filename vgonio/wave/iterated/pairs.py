"""One more reflection of all points of a patch on each other, in OpenCL; `pair_reference.py` is the same, slowly.

Fields are (sides, 12, ny, nx): N × E and N × H, three components each, real and imaginary parts alternating, area of
the surface over that of the ground included; `kernels/pairs.cl` has the formulas.
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
from .. import opencl
from ..quadrature import Floats
from .blocks import BLOCK, Rules

FAR_BELOW = -1e6
LAUNCH = 2e9  # pairs of one launch, so that progress shows
SCRATCH = 2.5e8  # bytes of lists of sources, and of marks of blocks, that are held at a time
CHECKED = (0.23, 0.31, 0.39, 0.47, 0.55, 0.63, 0.71, 0.79)  # where, of the side, rows compare blocks with all pairs
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


def built(name: str, options: list[str]) -> Any:
    """The program of kernels/`name`, for vectors of `lanes()`. Raises BackendError where it does not build."""
    import pyopencl as cl

    device = opencl.device()
    kernels = files("vgonio.wave").joinpath("kernels")
    source = kernels.joinpath("vectors.cl").read_text() + kernels.joinpath(name).read_text()
    try:
        return cl.Program(device.context, source).build(options=[f"-DWIDTH={lanes()}", *options])
    except cl.Error as e:
        line = next((s for s in str(e).splitlines() if "error" in s.lower()), str(e).splitlines()[0])
        raise BackendError(f"kernels/{name} does not build on {device.name}: {line.strip()}") from None


@lru_cache(maxsize=16)
def _program(sides: int, most: int, perfect: bool) -> Any:
    options = [f"-DBLOCK={BLOCK}", f"-DSIDES={sides}", f"-DMOST={most}"]
    if perfect:
        return built("pairs.cl", [*options, "-DPERFECT"])
    scale, series = faddeeva_series()
    listed = ",".join(f"{a:.9e}f" for a in series)
    return built("pairs.cl", [*options, f"-DTERMS={len(series)}", f"-DSCALE={scale:.9e}f", f"-DFADDEEVA={listed}"])


def faddeeva_series(terms: int = 16) -> tuple[float, Floats]:
    """Scale L and coefficients (terms,), highest power first, of Weideman's (1994) series: in the upper half plane
    W(z) = 2 p(Z)/(L − iz)² + 1/(√π (L − iz)), Z = (L + iz)/(L − iz); 16 terms are right to 1e-6."""
    scale = np.sqrt(terms / np.sqrt(2))
    t = scale * np.tan(np.arange(-2 * terms + 1, 2 * terms) * np.pi / (4 * terms))
    f = np.concatenate([[0.0], np.exp(-(t**2)) * (scale**2 + t**2)])
    a = np.fft.fft(np.fft.fftshift(f)).real / (4 * terms)
    return float(scale), a[1 : terms + 1][::-1]


def lanes() -> int:
    """Observers that one work-item looks after side by side: 16 where the device has vectors so wide, otherwise 8."""
    import pyopencl as cl

    widest = min(d.native_vector_width_float for d in opencl.device().context.get_info(cl.context_info.DEVICES))
    return 16 if widest >= 16 else 8


def _padded(a: Floats, columns: int, value: float) -> Singles:
    """(…, ny, stride): a vector's columns to the left and enough to the right."""
    width = lanes()
    right = -(-columns // width) * width - columns + 2 * width
    wide = [(0, 0)] * (a.ndim - 1) + [(width, right)]
    return np.ascontiguousarray(np.pad(a.astype(np.float32), wide, constant_values=value))


def reflect_opencl(
    grid: Grid, source: Floats, k: float, index: complex | None, progress: Callable[[float], None] | None = None
) -> Floats:
    """(sides, 12, ny, nx) what arrives and is reflected once more, per unit area of the surface: every visible pair.

    k : rad/µm;  index : n + ik, None for a perfect conductor (which has no N × E). Raises BackendError without an
    OpenCL device.
    """
    work = _Work.of(grid, source, k, index)
    work.rows(None, progress)
    return work.result()


def reflect_blocks(
    grid: Grid, source: Floats, k: float, index: complex | None, rules: Rules,
    progress: Callable[[float], None] | None = None,
) -> tuple[Floats, float]:  # fmt: skip
    """The same with blocks of sources taken together by `rules`, and its error.

    error : 2-norm of what differs from all pairs on some rows over the norm of what arrives there. Those rows are
    those of all pairs in the result. Raises BackendError without an OpenCL device.
    """
    work = _Work.of(grid, source, k, index)
    work.rows(rules, progress)
    taken, some = work.result(), sorted({int(c * grid.shape[0]) for c in CHECKED})
    for row in some:
        work.reflect(row, 1, None)
    exact = work.result()
    size = float(np.linalg.norm(exact[:, :, some]))
    return exact, float(np.linalg.norm((exact - taken)[:, :, some])) / max(size, 1e-300)


@dataclass(frozen=True, eq=False)
class _Work:
    """What the kernels of one reflection share: buffers on the device, sizes, constants."""

    program: Any
    device: Any
    shape: tuple[int, int]
    stride: int
    numbers: list[Any]
    buffers: list[Any]
    out: Any
    parts: tuple[int, int]
    width: int

    @staticmethod
    def of(grid: Grid, source: Floats, k: float, index: complex | None) -> _Work:
        import pyopencl as cl

        device, (rows, columns), sides, width = opencl.device(), grid.shape, len(source), lanes()
        parts = 6 if index is None else 12  # N × E vanishes on perfect conductors
        most = 64 * -(-max(rows, columns) // 64) + width
        heights = _padded(grid.z - grid.z.mean(), columns, FAR_BELOW)
        arrays = [heights, _padded(grid.normal, columns, 0.0), _padded(source[:, -parts:], columns, 0.0)]
        read = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        buffers = [cl.Buffer(device.context, read, hostbuf=a) for a in arrays]
        out = cl.Buffer(device.context, cl.mem_flags.READ_WRITE, arrays[2].nbytes)
        eps = 1.0 if index is None else complex(index) ** 2
        metal = 1.0 if index is None else abs((index - 1) / (index + 1))
        numbers = [np.float32(v) for v in (grid.pitch, k, np.real(eps), np.imag(eps), metal, float(heights.max()))]
        program = _program(sides, most, index is None)
        return _Work(program, device, (rows, columns), heights.shape[-1], numbers, buffers, out, (sides, parts), width)

    @property
    def blocks(self) -> tuple[int, int]:
        return self.stride // BLOCK, -(-self.shape[0] // BLOCK)

    @property
    def vectors(self) -> int:
        return -(-self.shape[1] // self.width)

    @property
    def marks(self) -> int:
        """Bytes of the blocks that one row of observers sees as a whole."""
        return int(self.vectors * np.prod(self.blocks) * self.width)

    def rows(self, rules: Rules | None, progress: Callable[[float], None] | None) -> None:
        """What arrives at all rows, some at a time."""
        rows, columns = self.shape
        step = max(1, int(LAUNCH / (columns**2 * rows)))
        if rules is not None:
            step = min(-(-step // BLOCK), max(1, int(SCRATCH / (BLOCK * self.marks)))) * BLOCK
        for first in range(0, rows, step):
            self.reflect(first, min(step, rows - first), rules)
            if progress:
                progress(min(1.0, (first + step) / rows))

    def reflect(self, first: int, count: int, rules: Rules | None) -> None:
        """What arrives at `count` rows from `first` on."""
        import pyopencl as cl

        flags, queue = cl.mem_flags, self.device.queue
        whole = [np.int32(v) for v in (*self.shape[::-1], self.stride, self.width, first, *self.blocks)]
        marks = self.out
        if rules is not None:
            marks = cl.Buffer(self.device.context, flags.READ_WRITE, self.marks * count)
        nearest = np.float32(0 if rules is None else rules.distances[-1])
        kernel, items = cl.Kernel(self.program, "pairs"), self.vectors * count
        at_once = min(items, self.items)
        lists = cl.Buffer(self.device.context, flags.READ_WRITE, at_once * self.listed)
        for begin in range(0, items, at_once):
            kernel(
                queue, (min(at_once, items - begin),), (1,), *whole, *self.numbers, *self.buffers, marks,
                np.int32(rules is not None), nearest, np.int32(first * self.vectors + begin), lists, self.out,
            )  # fmt: skip
        if rules is not None:
            tables = [
                cl.Buffer(self.device.context, flags.READ_ONLY | flags.COPY_HOST_PTR, hostbuf=a)
                for a in (rules.distances, rules.nodes, rules.polynomials)
            ]
            kernel = cl.Kernel(self.program, "thinned")
            kernel(
                queue, (self.vectors, -(-count // BLOCK)), (1, 1), *whole, *self.numbers[:-1], *self.buffers, marks,
                np.int32(len(rules.distances)), *tables, self.out,
            )  # fmt: skip
        queue.finish()

    @property
    def listed(self) -> int:
        """Bytes of the longest list of sources of one vector of observers."""
        return int((self.shape[1] + self.width) * self.shape[0] * 8)

    @property
    def items(self) -> int:
        """Vectors of observers whose lists fit the scratch memory."""
        return max(1, int(SCRATCH / self.listed))

    def result(self) -> Floats:
        import pyopencl as cl

        (rows, columns), (sides, parts) = self.shape, self.parts
        found = np.empty((sides, parts, rows, self.stride), np.float32)
        cl.enqueue_copy(self.device.queue, found, self.out)
        out = np.zeros((sides, 12, rows, columns))
        out[:, -parts:] = found[..., self.width : self.width + columns]
        return out
