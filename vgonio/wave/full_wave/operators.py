"""Matrices of the layer potentials on a curve: panels' own weights far away, local corrections nearby."""

from __future__ import annotations

import numpy as np

from . import nearby
from .kernels import Complex, single, slope
from .panels import Panels

ENTRIES = 2_000_000  # of a matrix at a time: bounds what is held besides the matrices


def assemble(k: complex, targets: Panels, sources: Panels, wanted: tuple[str, ...], same: bool) -> dict[str, Complex]:
    """(N, N') matrices that take densities at the nodes of `sources` to potentials at those of `targets`.

    wanted : "single" ∫ G φ ds', "double" ∫ ∂G/∂n' ψ ds', "adjoint" ∫ ∂G/∂n φ ds'
    same : both are the same panels; then double and adjoint are principal values
    """
    tx, tz = targets.point
    x, z = sources.point
    out = {name: np.empty((targets.size, sources.size), np.complex128) for name in wanted}
    rows = max(1, ENTRIES // sources.size)
    for start in range(0, targets.size, rows):
        part = slice(start, start + rows)
        rx, rz = tx[part, None] - x, tz[part, None] - z
        r = np.hypot(rx, rz)
        r[r == 0] = 1.0
        if "single" in wanted:
            out["single"][part] = single(k, r) * sources.weight
        if "double" in wanted or "adjoint" in wanted:
            g = slope(k, r) * sources.weight
            if "double" in wanted:
                out["double"][part] = g * (sources.normal[0] * rx + sources.normal[1] * rz)
            if "adjoint" in wanted:
                nx, nz = (n[part, None] for n in targets.normal)
                out["adjoint"][part] = -g * (nx * rx + nz * rz)
    _nearby(k, targets, sources, out, same)
    return out


def _nearby(k: complex, targets: Panels, sources: Panels, out: dict[str, Complex], same: bool) -> None:
    near = nearby.find(targets, sources, same)
    if not len(near.target):
        return
    columns = near.panel[:, None] * sources.order + np.arange(sources.order)
    for name, values in nearby.correct(k, targets, sources, near, tuple(out)).items():
        out[name][near.target[:, None], columns] = values
