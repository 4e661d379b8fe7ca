"""Scattering vectors all over the hemisphere: one fast Fourier transform of the grid for each of a few q_l.

Points on a uniform grid in (x, y) with irregular z: at each uniform q_l over the band of q_z the two-dimensional
transform of weight·exp(−i q_l z)/ψ̂(z) is a plain FFT; the scattering vectors near q_l take their share of it, with
the kernel of `spreading` in all three directions. Memory is that of one padded grid, whatever the band; a grid that is
too large is cut into blocks, since the sum over points is a sum over blocks.
"""

from __future__ import annotations

import numpy as np
import scipy.fft
import scipy.sparse as sp
from numpy.typing import NDArray

from .quadrature import Complex, Floats, Points
from .spreading import OVERSAMPLING, Band, Kernel

BLOCK = 2048  # points along one side of a block: 3072² padded, 150 MB
TARGETS = 200_000  # scattering vectors at a time: bounds the interpolation weights


def applies(points: Points) -> bool:
    """Is this a uniform grid of more than one row and column?"""
    return all(len(a) > 2 and np.ptp(np.diff(a)) < 1e-9 * np.ptp(a) for a in (points.x, points.y))


def seconds(points: Points, q: Floats, tol: float) -> float:
    """Rough time on two cores: FFTs of the padded grid at 3·10⁷ points/s, interpolation at 5·10⁷ weights/s."""
    kernel = Kernel.of(tol, OVERSAMPLING)
    planes = np.ptp(q[:, 2]) * np.ptp(points.z) * OVERSAMPLING / (2 * np.pi) + kernel.width + 3
    return float(planes * points.size * OVERSAMPLING**2 / 3e7 + len(q) * kernel.width**3 / 5e7)


def transform(points: Points, q: Floats, tol: float) -> Complex:
    """(m,) sums of `points`, a uniform grid, at q (m, 3), relative error about `tol` in the 2-norm."""
    out = np.zeros(len(q), np.complex128)
    for j in range(0, len(points.y), BLOCK):
        for i in range(0, len(points.x), BLOCK):
            rows, columns = slice(j, j + BLOCK), slice(i, i + BLOCK)
            if not points.weight[rows, columns].any():
                continue
            out += _block(
                points.x[columns], points.y[rows], points.z[rows, columns], points.weight[rows, columns], q, tol
            )
    return out


def _block(x: Floats, y: Floats, z: Floats, weight: Floats, q: Floats, tol: float) -> Complex:
    kernel = Kernel.of(tol, OVERSAMPLING)
    middle = (float(z.min()) + float(z.max())) / 2
    band = Band.of(q[:, 2], float(np.ptp(z)) / 2 * 1.001 + 1e-9, tol)
    sides, places, centres = [], [], []
    for a, component in ((y, 1), (x, 0)):
        step = (a[-1] - a[0]) / (len(a) - 1) if len(a) > 1 else 1.0
        size = scipy.fft.next_fast_len(int(np.ceil(OVERSAMPLING * len(a))) + 2 * kernel.width)
        c = len(a) // 2
        # positions in cells of the frequency grid
        t = np.arange(len(a)) - c
        weight = weight / np.expand_dims(kernel.transform(2 * np.pi * t / size), 1 if component == 1 else 0)
        places.append(kernel.taps(q[:, component] * step * size / (2 * np.pi)))
        sides.append((size, c))
        centres.append(a[c])
    wave = weight * np.exp(-1j * band.start * (z - middle)) / band.values(z - middle)
    turn = np.exp(-1j * band.step * (z - middle))
    first, share = band.kernel.taps((q[:, 2] - band.start) / band.step)
    order = np.argsort(first, kind="stable")
    out = np.zeros(len(q), np.complex128)
    for l in range(band.count):
        near = order[
            np.searchsorted(first[order], l - band.kernel.width, "right") : np.searchsorted(first[order], l, "right")
        ]
        if len(near):
            spectrum = _padded_fft(wave, sides)
            for part in np.array_split(near, len(near) // TARGETS + 1):
                values = _gather(spectrum, part, places, kernel)
                out[part] += share[part, l - first[part]] * values
        if l + 1 < band.count:
            wave *= turn
    return out * np.exp(-1j * (q[:, 0] * centres[1] + q[:, 1] * centres[0] + q[:, 2] * middle))


def _padded_fft(wave: Complex, sides: list[tuple[int, int]]) -> Complex:
    """FFT of the grid in a larger one of zeros, the centre (c_y, c_x) at index 0 so that no phase is left over."""
    (sy, cy), (sx, cx) = sides
    buffer = np.zeros((sy, sx), np.complex128)
    for rows, to_rows in ((slice(cy, None), slice(0, len(wave) - cy)), (slice(0, cy), slice(sy - cy, sy))):
        for cols, to_cols in ((slice(cx, None), slice(0, wave.shape[1] - cx)), (slice(0, cx), slice(sx - cx, sx))):
            buffer[to_rows, to_cols] = wave[rows, cols]
    return scipy.fft.fft2(buffer, workers=-1, overwrite_x=True)


def _gather(spectrum: Complex, part: NDArray[np.int64], places: list, kernel: Kernel) -> Complex:
    """(len(part),) kernel-weighted values of the spectrum around each place; the grid repeats."""
    sy, sx = spectrum.shape
    (at_y, weight_y), (at_x, weight_x) = places
    rows = (at_y[part, None] + np.arange(kernel.width)) % sy
    columns = (at_x[part, None] + np.arange(kernel.width)) % sx
    index = (rows[:, :, None] * sx + columns[:, None, :]).reshape(len(part), -1)
    weight = (weight_y[part, :, None] * weight_x[part, None, :]).ravel()
    matrix = sp.csr_array((weight, index.ravel(), np.arange(len(part) + 1) * kernel.width**2), (len(part), sy * sx))
    return (matrix @ spectrum.ravel().view(np.float64).reshape(-1, 2)).view(np.complex128)[:, 0]
