"""The slow, obviously right sum: every point, every direction, double precision."""

from __future__ import annotations

import numpy as np

from .quadrature import Complex, Floats, Points


def transform(points: Points, q: Floats, tol: float = 0.0) -> Complex:
    """(m,) Σ weight exp(−i (q_x x + q_y y + q_z z)) for q (m, 3) rad/µm; `tol` is not needed."""
    s = np.empty(len(q), np.complex128)
    for m, (qx, qy, qz) in enumerate(q):
        rows = np.exp(-1j * qz * points.z) * points.weight
        s[m] = np.exp(-1j * qy * points.y) @ rows @ np.exp(-1j * qx * points.x)
    return s * points.factor(q)
