"""Fresnel reflection of Stokes vectors for all wavelengths at once, from a table over the angle of incidence."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from ..materials import Material

Floats = NDArray[np.float64]


class FresnelTable:
    """Mueller elements of a mirror facet at `wavelength_nm` (w,), tabulated over √cos so that grazing is resolved.

    With R_s, R_p and r_s r_p*:  I' = a I + b Q,  Q' = b I + a Q,  U' = c U + d V,  V' = −d U + c V
    (a = (R_s + R_p)/2, b = (R_s − R_p)/2, c + id = r_s r_p*). Linear interpolation, error below 1e-6 (tested).
    """

    def __init__(self, material: Material, wavelength_nm: ArrayLike, nodes: int = 4096) -> None:
        self.nodes = nodes
        cos = (np.arange(nodes + 1) / nodes) ** 2
        rs, rp = material.amplitudes(cos, np.asarray(wavelength_nm, float))
        s, p, cross = np.abs(rs) ** 2, np.abs(rp) ** 2, rs * rp.conj()
        self.table = np.stack([(s + p) / 2, (s - p) / 2, cross.real, cross.imag], axis=1)  # (nodes + 1, 4, w)
        self.first_two = np.ascontiguousarray(self.table[:, :2])
        a, b = self.table[:, 0], self.table[:, 1]
        self.powers, self.squares = (a, b), (a**2, 2 * a * b, b**2)

    def position(self, cos_i: Floats) -> tuple[NDArray[np.int64], Floats]:
        """Node below and fraction towards the next."""
        u = np.sqrt(cos_i) * self.nodes
        i = np.minimum(u.astype(np.int64), self.nodes - 1)
        return i, u - i

    def elements(self, cos_i: Floats, count: int = 4) -> Floats:
        """(n, count, w): the first `count` of a, b, c, d at cos_i (n,)."""
        i, t = self.position(cos_i)
        table = self.table if count > 2 else self.first_two
        # whole rows: numpy gathers those fastest
        below, above = np.take(table, i, axis=0), np.take(table, i + 1, axis=0)
        above -= below
        above *= t[:, None, None]
        below += above
        return below[:, :count]

    def histogram(self, cos_i: Floats, weight: Floats, row: NDArray, rows: int) -> sp.coo_array:
        """(rows, nodes + 1) joint histogram of the rows that rays (n,) belong to and of their angles of incidence.

        Its product with a column of the table is what `elements` gives, weighted and added up by row: the work does
        not grow with rays × wavelengths any more.
        """
        i, t = self.position(cos_i)
        entries = np.concatenate([weight * (1 - t), weight * t])
        return sp.coo_array(
            (entries, (np.concatenate([row, row]), np.concatenate([i, i + 1]))), shape=(rows, self.nodes + 1)
        )

    def summed(self, cos_i: Floats, weight: Floats | None, element: int) -> Floats:
        """(w,) Σ weight · element(cos_i): the rays are gathered on the table's nodes first, wavelengths come after."""
        i, t = self.position(cos_i)
        w = 1.0 if weight is None else weight
        gathered = np.bincount(i, w * (1 - t), self.nodes + 1) + np.bincount(i + 1, w * t, self.nodes + 1)
        return gathered @ self.table[:, element]
