"""Free-space kernels of the two-dimensional Helmholtz equation, time dependence exp(−iωt).

G = (i/4) H₀⁽¹⁾(kr) and its derivatives along the normals at the source and at the target (Colton and Kress 1983).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from .panels import Floats

Complex = NDArray[np.complex128]

NEGLIGIBLE = 40.0  # nepers: exp(−40) = 4·10⁻¹⁸


def hankel(kind: int, k: complex, r: Floats) -> Complex:
    """H_kind⁽¹⁾(k r), kind 0 or 1; Im k ≥ 0; zero where absorption leaves nothing."""
    if complex(k).imag == 0:
        u = complex(k).real * r
        real, imaginary = ((special.j0, special.y0), (special.j1, special.y1))[kind]
        out = np.empty(u.shape, np.complex128)
        out.real, out.imag = real(u), imaginary(u)
        return out
    out = np.zeros(r.shape, np.complex128)
    near = complex(k).imag * r < NEGLIGIBLE
    out[near] = special.hankel1(kind, k * r[near])
    return out


def single(k: complex, r: Floats) -> Complex:
    """G."""
    return 0.25j * hankel(0, k, r)


def slope(k: complex, r: Floats) -> Complex:
    """−(1/r) dG/dr: ∂G/∂n' = slope · n'·(r − r'), ∂G/∂n = −slope · n·(r − r')."""
    return 0.25j * k * hankel(1, k, r) / r
