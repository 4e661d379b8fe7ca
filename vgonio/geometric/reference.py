"""Closest hits by trying every facet in double precision: slow, and right for all to see."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..surface.mesh import Mesh

Floats = NDArray[np.float64]
PAIRS = 1 << 20  # rays times facets that are tried at a time
EDGE = 1e-12  # barycentric coordinates reach over the edge by so much, so that no ray slips between two facets


class Reference:
    """Ray against triangle after Möller and Trumbore 1997, all pairs."""

    name = "reference, all facets in double precision"
    device = "CPU"

    def __init__(self, mesh: Mesh) -> None:
        self.first, second, third = mesh.corners(slice(None))
        self.edges = second - self.first, third - self.first

    def facet(self, position: Floats, direction: Floats) -> NDArray[np.int32]:
        """(n,) index of the first facet hit, −1 for none."""
        step = max(1, PAIRS // len(self.first))
        parts = [self._facet(position[i : i + step], direction[i : i + step]) for i in range(0, len(position), step)]
        return np.concatenate(parts) if parts else np.zeros(0, np.int32)

    def _facet(self, position: Floats, direction: Floats) -> NDArray[np.int32]:
        e1, e2 = self.edges
        d = np.asarray(direction)[:, None, :]
        across = np.cross(d, e2)
        determinant = np.einsum("nfj,fj->nf", across, e1)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1 / determinant
            away = position[:, None, :] - self.first
            u = np.einsum("nfj,nfj->nf", away, across) * inverse
            other = np.cross(away, e1)
            v = np.einsum("nfj,nfj->nf", d, other) * inverse
            t = np.einsum("nfj,fj->nf", other, e2) * inverse
            inside = (determinant != 0) & (u >= -EDGE) & (v >= -EDGE) & (u + v <= 1 + EDGE) & (t > 0)
        t = np.where(inside, t, np.inf)
        nearest = np.argmin(t, axis=1)
        return np.where(np.isfinite(t[np.arange(len(t)), nearest]), nearest, -1).astype(np.int32)
