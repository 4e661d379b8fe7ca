"""The spreading kernel of the non-uniform transforms that use the grid of the points, and its band of q_z.

Barnett, Magland and af Klinteberg (2019): an "exponential of semicircle" in place of a sinc, divided out again on the
other side of the Fourier transform.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .quadrature import Floats

OVERSAMPLING = 1.5  # of the grid of q_z (and of q_x, q_y on planes)


@dataclass(frozen=True)
class Kernel:
    """ψ(t) = exp(β (√(1 − t²) − 1)) on |t| < 1, `width` grid cells wide (Barnett 2019, 1.8)."""

    width: int
    beta: float

    @staticmethod
    def of(tol: float, oversampling: float) -> Kernel:
        """Width from the kernel's error bound exp(−π w √(1 − 1/σ)), β just inside the cut-off."""
        width = int(np.ceil(np.log(1 / tol) / (np.pi * np.sqrt(1 - 1 / oversampling)))) + 1
        width = int(np.clip(width, 3, 24))
        return Kernel(width, 0.97 * np.pi * width * (1 - 1 / (2 * oversampling)))

    def __call__(self, t: Floats) -> Floats:
        return np.exp(self.beta * (np.sqrt(np.maximum(1 - t**2, 0.0)) - 1))

    def transform(self, frequency: Floats) -> Floats:
        """∫ ψ(2s/width) exp(−i frequency s) ds over s in grid cells, frequency in rad per cell."""
        t, w = np.polynomial.legendre.leggauss(4 * self.width + 16)
        half = self.width / 2
        flat = np.ravel(frequency)
        return (np.cos(np.outer(flat, half * t)) @ (half * w * self(t))).reshape(np.shape(frequency))

    def taps(self, position: Floats) -> tuple[NDArray[np.int64], Floats]:
        """First grid index and the `width` weights around each position (in cells)."""
        first = np.ceil(position - self.width / 2).astype(np.int64)
        distance = first[:, None] + np.arange(self.width) - position[:, None]
        return first, self(2 * distance / self.width)


@dataclass(frozen=True)
class Band:
    """Uniform q_l = start + l·step, l < count, that cover the q_z asked for with the kernel's margin."""

    start: float
    step: float
    count: int
    kernel: Kernel

    @staticmethod
    def of(qz: Floats, reach: float, tol: float) -> Band:
        """reach : largest |z| from the middle, µm"""
        kernel = Kernel.of(tol, OVERSAMPLING)
        step = np.pi / (OVERSAMPLING * reach)
        margin = kernel.width // 2 + 1
        start = float(qz.min()) - margin * step
        return Band(start, step, int(np.ceil(np.ptp(qz) / step)) + 2 * margin + 1, kernel)

    def values(self, z: Floats) -> Floats:
        """ψ̂ at z (µm): even and smooth, so a table with cubic interpolation does for millions of points."""
        from scipy.interpolate import CubicSpline

        top = max(float(np.abs(z).max()), 1e-12) * 1.0001
        t = np.linspace(0, top, 2048)
        table = CubicSpline(t, self.kernel.transform(t * self.step), bc_type=((1, 0.0), "not-a-knot"))
        return table(np.abs(z))
