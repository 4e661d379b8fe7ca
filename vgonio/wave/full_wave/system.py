"""The boundary integral equations of a curve between air and a material, and their dense solution.

ψ is E_y (TE) or H_y (TM), φ = ∂ψ/∂n on the air side. With S, D, D' the layer potentials of air (1) and material (2):

perfect, TE:  (½ + D' − ikS) φ = ∂ψ_i/∂n − ik ψ_i  (combined field: Brakhage and Werner 1965, no spurious resonances)
perfect, TM:  (½ − D) ψ = ψ_i
material:     (½ − D₁) ψ + S₁ φ = ψ_i,  (½ + D₂) ψ − β S₂ φ = 0,  β = 1 (TE), n² (TM)

In an absorbing material S₂ and D₂ reach a few skin depths only: they are sparse, and so is the admittance
Y = (β S₂)⁻¹ (½ + D₂), φ = Yψ. Then (½ − D₁ + S₁ Y) ψ = ψ_i is left, half as large and seven times cheaper.

(Maystre 1978; Colton and Kress 1983.) Rows and columns carry the square roots of the quadrature weights (Bremer
2012), φ on panels shorter than 1/k their length: so the condition number is that of the operator, not of the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg

from .kernels import Complex
from .panels import Floats, Panels

RESIDUAL_ROWS = 64
SPARSE = 0.12  # share of entries other than zero up to which the material's operators count as sparse
DROPPED = 1e-14  # of the largest entry of the admittance

Operators = dict[str, Any]  # matrices by name, and the admittance once it is known


def operators_needed(perfect: bool, polarisation: str) -> tuple[str, ...]:
    """Layer potentials of air that the equation of a polarisation, "TE" or "TM", takes."""
    if not perfect:
        return ("single", "double")
    return ("single", "adjoint") if polarisation == "TE" else ("double",)


def contrast(index: complex | None, polarisation: str) -> complex:
    """β: ∂ψ/∂n in the material over that in air."""
    return 1.0 if polarisation == "TE" or index is None else complex(index) ** 2


@dataclass(frozen=True, eq=False)
class Factored:
    """A factorised system.

    unknown : "psi", "phi" or "both" (φ/k below ψ);  admittance : Y where φ was eliminated
    scale : factors of rows and columns;  condition : estimate of the condition number in the 1-norm
    rows : of the matrix, those `kept` for residuals
    """

    unknown: str
    lu: tuple[Complex, np.ndarray]
    scale: tuple[Floats, Floats]
    condition: float
    kept: np.ndarray
    rows: Complex
    k: float
    admittance: sp.csr_array | None = None

    @property
    def unknowns(self) -> int:
        """Fields at the nodes, those eliminated included."""
        return len(self.scale[0]) * (1 if self.admittance is None else 2)

    def solve(self, field: Complex, slope: Complex) -> tuple[Complex, Complex, Floats]:
        """ψ, φ (N, r) on the surface for incident ψ_i, ∂ψ_i/∂n (N, r), and relative residuals (r,)."""
        zero = np.zeros_like(field)
        if self.unknown == "phi":
            right = slope - 1j * self.k * field
        else:
            right = np.concatenate([field, zero]) if self.unknown == "both" else field
        u, residual = self._solve(right)
        if self.unknown == "phi":
            return zero, u, residual
        if self.unknown == "both":
            return u[: len(field)], u[len(field) :] * self.k, residual
        return u, zero if self.admittance is None else self.admittance @ u, residual

    def _solve(self, right: Complex) -> tuple[Complex, Floats]:
        scaled = right * self.scale[0][:, None]
        u = scipy.linalg.lu_solve(self.lu, scaled, check_finite=False)
        residual = np.linalg.norm(self.rows @ u - scaled[self.kept], axis=0)
        size = np.linalg.norm(scaled, axis=0) * np.sqrt(len(self.kept) / len(scaled))
        return u / self.scale[1][:, None], residual / size


def factored(
    panels: Panels, k: float, index: complex | None, polarisation: str, air: Operators, inside: Operators | None
) -> Factored:
    """Factorise the system of one polarisation; `inside` are the material's "single" and "double", None for perfect."""
    n, half = panels.size, np.arange(panels.size)
    admittance, unknown = None, "psi"
    if index is None or inside is None:
        if polarisation == "TE":
            a, unknown = air["adjoint"] - 1j * k * air["single"], "phi"
        else:
            a = -air["double"]
    elif np.count_nonzero(inside["single"]) < SPARSE * n**2:
        if "admittance" not in inside:  # the same for both polarisations but for β
            inside["admittance"] = _admittance(panels, inside)
        admittance = inside["admittance"] / contrast(index, polarisation)
        a = (admittance.T @ air["single"].T).T - air["double"]
    else:
        unknown = "both"
        a = np.empty((2 * n, 2 * n), np.complex128)
        a[:n, :n], a[:n, n:] = -air["double"], k * air["single"]
        a[n:, :n], a[n:, n:] = inside["double"], -contrast(index, polarisation) * k * inside["single"]
        a[n + half, half] += 0.5
    a[half, half] += 0.5
    root = np.sqrt(np.tile(panels.weight, len(a) // n))
    columns = root.copy()
    columns[n:] *= _shortness(panels, k)[: len(a) - n]
    a *= root[:, None]
    a /= columns
    return _factorise(a, (root, columns), k, unknown, admittance)


def _shortness(panels: Panels, k: float) -> Floats:
    """(N,) length of the node's panel in units of 1/k, at most 1."""
    return np.minimum(1.0, k * np.repeat(panels.length, panels.order))


def _admittance(panels: Panels, inside: Operators) -> sp.csr_array:
    """βY = S₂⁻¹ (½ + D₂), sparse."""
    n = panels.size
    right = inside["double"].copy()
    right[np.arange(n), np.arange(n)] += 0.5
    found = scipy.sparse.linalg.splu(sp.csc_array(inside["single"])).solve(right)
    found[np.abs(found) < DROPPED * np.abs(found).max()] = 0.0
    return sp.csr_array(found)


def _factorise(
    a: Complex, scale: tuple[Floats, Floats], k: float, unknown: str, admittance: sp.csr_array | None
) -> Factored:
    kept = np.unique(np.linspace(0, len(a) - 1, RESIDUAL_ROWS).astype(int))
    rows, norm = a[kept].copy(), float(np.abs(a).sum(axis=0).max())
    lu = scipy.linalg.lu_factor(a, overwrite_a=True, check_finite=False)
    reciprocal, _ = scipy.linalg.lapack.zgecon(lu[0], norm)
    condition = 1 / reciprocal if reciprocal > 0 else np.inf
    return Factored(unknown, lu, scale, float(condition), kept, rows, k, admittance)
