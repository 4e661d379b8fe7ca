"""The boundary integral equations of a curve between air and a material, and their dense solution.

ψ is E_y (TE) or H_y (TM), φ = ∂ψ/∂n on the air side. With S, D, D' the layer potentials of air (1) and material (2):

perfect, TE:  (½ + D' − ikS) φ = ∂ψ_i/∂n − ik ψ_i  (combined field: Brakhage and Werner 1965, no spurious resonances)
perfect, TM:  (½ − D) ψ = ψ_i
material:     (½ − D₁) ψ + S₁ φ = ψ_i,  (½ + D₂) ψ − β S₂ φ = 0,  β = 1 (TE), n² (TM)

(Maystre 1978; Colton and Kress 1983.) Rows and columns carry the square roots of the quadrature weights (Bremer
2012), φ on panels shorter than 1/k their length: so the condition number is that of the operator, not of the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from .kernels import Complex
from .panels import Floats, Panels

RESIDUAL_ROWS = 64

Operators = dict[str, Complex]


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

    scale : factors of rows and columns;  condition : estimate of the condition number in the 1-norm
    rows : of the matrix, those `kept` for residuals
    """

    lu: tuple[Complex, np.ndarray]
    scale: tuple[Floats, Floats]
    condition: float
    kept: np.ndarray
    rows: Complex
    panels: Panels
    k: float
    perfect: bool
    polarisation: str

    @property
    def unknowns(self) -> int:
        return len(self.scale[0])

    def solve(self, field: Complex, slope: Complex) -> tuple[Complex, Complex, Floats]:
        """ψ, φ (N, r) on the surface for incident ψ_i, ∂ψ_i/∂n (N, r), and relative residuals (r,)."""
        n = self.panels.size
        if not self.perfect:
            right = np.concatenate([field, np.zeros_like(field)])
        elif self.polarisation == "TE":
            right = slope - 1j * self.k * field
        else:
            right = field
        scaled = right * self.scale[0][:, None]
        u = scipy.linalg.lu_solve(self.lu, scaled, check_finite=False)
        residual = np.linalg.norm(self.rows @ u - scaled[self.kept], axis=0)
        size = np.linalg.norm(scaled, axis=0) * np.sqrt(len(self.kept) / len(scaled))
        u /= self.scale[1][:, None]
        zero = np.zeros_like(field)
        if not self.perfect:
            return u[:n], u[n:] * self.k, residual / size
        return (zero, u, residual / size) if self.polarisation == "TE" else (u, zero, residual / size)


def factored(
    panels: Panels, k: float, index: complex | None, polarisation: str, air: Operators, inside: Operators | None
) -> Factored:
    """Factorise the system of one polarisation; `inside` are the material's "single" and "double", None for perfect."""
    n = panels.size
    half = np.arange(n)
    if index is None or inside is None:
        if polarisation == "TE":
            a = air["adjoint"] - 1j * k * air["single"]
        else:
            a = -air["double"]
        a[half, half] += 0.5
    else:
        a = np.empty((2 * n, 2 * n), np.complex128)
        a[:n, :n], a[:n, n:] = -air["double"], k * air["single"]
        a[n:, :n], a[n:, n:] = inside["double"], -contrast(index, polarisation) * k * inside["single"]
        a[np.arange(2 * n), np.tile(half, 2)] += 0.5
    root = np.sqrt(np.tile(panels.weight, len(a) // n))
    columns = root.copy()
    columns[n:] *= np.minimum(1.0, k * np.repeat(panels.length, panels.order))[: len(a) - n]
    a *= root[:, None]
    a /= columns
    return _factorise(a, (root, columns), panels, k, index is None, polarisation)


def _factorise(
    a: Complex, scale: tuple[Floats, Floats], panels: Panels, k: float, perfect: bool, polarisation: str
) -> Factored:
    kept = np.unique(np.linspace(0, len(a) - 1, RESIDUAL_ROWS).astype(int))
    rows, norm = a[kept].copy(), float(np.abs(a).sum(axis=0).max())
    lu = scipy.linalg.lu_factor(a, overwrite_a=True, check_finite=False)
    reciprocal, _ = scipy.linalg.lapack.zgecon(lu[0], norm)
    condition = 1 / reciprocal if reciprocal > 0 else np.inf
    return Factored(lu, scale, float(condition), kept, rows, panels, k, perfect, polarisation)
