"""All coherence windows, rows and directions of an in-plane detector together.

A two-dimensional type-3 transform for each window and each row q_v spreads every point of the surface again and again.
But the points lie on a grid in (x, y), only z is irregular, and windows and rows are products of functions of x and y:

1. at uniform q_l over the band of q_z, sum over y: G(row, l, x) = Σ_y w_y(y) exp(−i q_v y) exp(−i q_l z) / ψ̂(z), a
   matrix product of (rows × y) with (y × x), exp(−i q_l z) going on from l to l + 1 by one multiplication;
2. for every window along x: weigh with w_x, fast Fourier transform along x;
3. interpolate from the grid (q_l, q_u) to the scattering vectors with the kernel whose transform was divided out.

Steps 2 and 3 are the standard type-2 non-uniform transform with the "exponential of semicircle" kernel of Barnett,
Magland and af Klinteberg (2019). The product costs no more for many windows along x than for one.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import scipy.fft
import scipy.sparse as sp
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ..surface.heightfield import Heightfield
from .coherence import Window
from .quadrature import Complex, Floats, require_affordable
from .spreading import Band, Kernel

OVERSAMPLING_X = 2.0
COLUMNS = 256  # of one matrix product: (y × columns) stays in the cache
MEMORY = 4e8  # bytes of the sums over y that are held: rows beyond go over the points again
MIN_ROWS = 4  # with fewer rows of q_v the separate transforms are quicker


def sums(
    surface: Heightfield, windows: list[Window], spacing: tuple[float, float], q: Floats, tol: float
) -> Iterator[tuple[Complex, float]]:
    """S (m,) and A_w for every window in turn; q (m, 3) in rows of equal q_y, positions count from the window's centre.

    The windows of equal y_c have to follow each other, as `coherence.tile` makes them.
    """
    lx = surface.size_um[1]
    n = int(np.ceil(lx / spacing[1]))
    x = (np.arange(n) + 0.5) * lx / n
    middle = (surface.z.min() + surface.z.max()) / 2
    turn = np.exp(-1j * q[:, 2] * middle)
    for y_c in dict.fromkeys(w.centre[0] for w in windows):
        group = [w for w in windows if w.centre[0] == y_c]
        half = group[0].half[0]
        rows = max(2, int(np.ceil(2 * half / spacing[0])))
        require_affordable(rows, n)
        y = (np.arange(rows) + 0.5) * 2 * half / rows - half
        z = surface.interpolant.grid(y + y_c, x) - middle
        slices = [_columns(w, x, lx, surface.periodic) for w in group]
        profiles = [w.profile(t, w.half[1]) for w, (_, t) in zip(group, slices)]
        g = group[0].profile(y, half)
        area_y = float(np.sum(g**2)) * 2 * half / rows
        S = _group(z, y, g * (2 * half / rows), slices, profiles, lx / n, q, tol)
        for s, gx in zip(S, profiles):
            yield s * turn, area_y * float(np.sum(gx**2)) * lx / n


def _group(
    z: Floats, y: Floats, g: Floats, slices: list[tuple[NDArray, Floats]], profiles: list[Floats], dx: float,
    q: Floats, tol: float,
) -> Complex:  # fmt: skip
    """S (windows, m) of windows of one y_c, heights z (y, x) from the middle; g (y,) weights along y.

    slices : of each window its columns of z and their positions from its centre;  profiles : weights along x
    """
    levels, row = np.unique(np.round(q[:, 1] / np.abs(q).max() * 1e12), return_inverse=True)
    levels = levels * np.abs(q).max() * 1e-12
    targets = [np.flatnonzero(row == r) for r in range(len(levels))]
    x_kernel = Kernel.of(tol, OVERSAMPLING_X)
    along = (np.exp(-1j * np.outer(levels, y)) * g).astype(np.complex128)
    band = Band.of(q[:, 2], float(np.abs(z).max()) * 1.001 + 1e-9, tol)
    lines = [_lines(band, q[t, 2]) for t in targets]
    size = scipy.fft.next_fast_len(int(OVERSAMPLING_X * max(len(c) for c, _ in slices)) + 1)
    # positions in cells of the frequency grid; dividing out the kernel's transform
    weights = [gx * dx / x_kernel.transform(2 * np.pi * t / dx / size) for gx, (_, t) in zip(profiles, slices)]
    first_x = [t[0] for _, t in slices]
    S = np.zeros((len(slices), len(q)), np.complex128)
    at_once = max(1, int(MEMORY / (16 * band.count * z.shape[1])))
    for first in range(0, len(levels), at_once):
        held = range(first, min(first + at_once, len(levels)))
        spectrum = _sum_over_y(z, along[first : first + at_once], [lines[r] for r in held], band)
        for r in held:
            own = spectrum[r - first, lines[r]]
            spectra = [
                scipy.fft.fft(own[:, column] * weight, size, axis=1, workers=-1)
                for weight, (column, _) in zip(weights, slices)
            ]
            S[:, targets[r]] = _interpolate(spectra, q[targets[r]], first_x, dx, size, x_kernel, band, lines[r].start)
    return S


def _lines(band: Band, qz: Floats) -> slice:
    """The q_l that the q_z of one row need."""
    at, _ = band.kernel.taps((np.array([qz.min(), qz.max()]) - band.start) / band.step)
    return slice(int(at[0]), int(at[1]) + band.kernel.width)


def _sum_over_y(z: Floats, along: Complex, lines: list[slice], band: Band) -> Complex:
    """(rows, count, x) Σ_y along(row, y) exp(−i q_l z) / ψ̂(z), z (y, x) from the middle, at the `lines` of each row."""
    out = np.empty((len(along), band.count, z.shape[1]), np.complex128)
    wanted = [np.array([s.start <= l < s.stop for s in lines]) for l in range(band.count)]

    def block(a: int) -> None:
        part = z[:, a : a + COLUMNS]
        wave = np.exp(-1j * band.start * part) / band.values(part)
        turn = np.exp(-1j * band.step * part)
        for l, rows in enumerate(wanted):
            if rows.all():
                out[:, l, a : a + COLUMNS] = along @ wave
            elif rows.any():
                out[rows, l, a : a + COLUMNS] = along[rows] @ wave
            wave *= turn

    # blocks side by side: the threads of BLAS wait for each other in products as small as these (3 to 40 times slower)
    with threadpool_limits(1, user_api="blas"), ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(block, range(0, z.shape[1], COLUMNS)))
    return out


def _columns(w: Window, x: Floats, length: float, periodic: bool) -> tuple[NDArray[np.int64], Floats]:
    """Indices of the columns under a window, and their positions from its centre."""
    h = length / len(x)
    first = int(np.ceil((w.centre[1] - w.half[1]) / h - 0.5))
    last = int(np.floor((w.centre[1] + w.half[1]) / h - 0.5))
    if not periodic:
        first, last = max(first, 0), min(last, len(x) - 1)
    index = np.arange(first, last + 1)
    return np.asarray(index % len(x), np.int64), np.asarray((index + 0.5) * h - w.centre[1], np.float64)


def _interpolate(
    spectra: list[Complex],
    q: Floats,
    first_x: list[float],
    h: float,
    size: int,
    x_kernel: Kernel,
    band: Band,
    first_line: int,
) -> Complex:
    """(windows, m) from the grids (q_l, q_u) of the windows of one row, whose first line is given, to its vectors."""
    u = q[:, 0] * h * size / (2 * np.pi)
    at_u, weight_u = x_kernel.taps(u)
    at_l, weight_l = band.kernel.taps((q[:, 2] - band.start) / band.step)
    column = (at_u[:, None] + np.arange(x_kernel.width)) % size
    # the same arithmetic as in `_lines`: a q_z on the very edge of a kernel must not fall beside the lines by rounding
    line = at_l[:, None] - first_line + np.arange(band.kernel.width)
    index = (line[:, :, None] * size + column[:, None, :]).reshape(len(q), -1)
    weight = (weight_l[:, :, None] * weight_u[:, None, :]).ravel()
    pointer = np.arange(len(q) + 1) * index.shape[1]
    out = np.empty((len(spectra), len(q)), np.complex128)
    # the FFT counts columns from the first of the window, the kernel was divided out about the centre:
    # exp(−i q_u (x_0 + j h)) with the grid's own frequency in place of q_u under the kernel's sum
    for i, (grid, x0) in enumerate(zip(spectra, first_x)):
        shift = np.exp(-2j * np.pi * np.fft.fftfreq(size) * x0 / h)
        values = grid * shift
        matrix = sp.csr_array((weight, index.ravel(), pointer), shape=(len(q), values.size))
        out[i] = (matrix @ values.ravel().view(np.float64).reshape(-1, 2)).view(np.complex128)[:, 0]
    return out
