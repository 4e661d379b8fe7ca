"""One more reflection on a profile: fields of mutually visible points at each other, and the tangent-plane rule again.

With the normal n into the air the field that leaves the surface is u(r) = ∫ [u ∂G/∂n' − G ∂u/∂n'] ds' with
G = (i/4) H₀(k|r − r'|) under exp(−iωt). Each pair of points carries a wave of its own direction, so that its reflection
coefficient r is that of its own angle: u = (1 + r) u_pair, ∂u/∂n = (1 − r) ∂u_pair/∂n. u is E_y (TE, r_s) or H_y (TM,
r_p).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ...materials import Material
from ..quadrature import Complex, Floats
from .curve import Curve
from .sight import Sight

POLARISATIONS = {"TE": 0, "TM": 1}
ASYMPTOTIC = 60.0  # k·distance beyond which Hankel's series is exact to 1e-8 with the terms below


@dataclass(frozen=True, eq=False)
class Pairs:
    """Sparse operators from fields (u, v = ∂u/∂n) on the curve to those of the next reflection.

    Blocks that vanish (a perfect conductor has u or v alone) are None.
    """

    uu: sp.csr_array | None
    uv: sp.csr_array | None
    vu: sp.csr_array | None
    vv: sp.csr_array | None

    def next(self, u: Complex, v: Complex) -> tuple[Complex, Complex]:
        """(u, v) of the next reflection, (rows, …)."""
        return _sum(self.uu, u, self.uv, v), _sum(self.vu, u, self.vv, v)


def _sum(a: sp.csr_array | None, u: Complex, b: sp.csr_array | None, v: Complex) -> Complex:
    parts = [m @ f for m, f in ((a, u), (b, v)) if m is not None]
    return np.sum(parts, axis=0) if parts else np.zeros_like(u)


def hankel(t: Floats, zeroth: bool = True) -> tuple[Complex, Complex]:
    """H₀⁽¹⁾ (empty unless `zeroth`) and H₁⁽¹⁾ of t > 0, (n,)."""
    from scipy.special import j0, j1, y0, y1

    near = t < ASYMPTOTIC
    h0, h1 = (np.empty(t.shape if wanted else 0, np.complex128) for wanted in (zeroth, True))
    a, b = t[near], t[~near]
    front = np.sqrt(2 / (np.pi * b)) * np.exp(1j * (b - np.pi / 4))
    e = 1j / b  # Σ i^n a_n(ν)/t^n, DLMF 10.17.5
    if zeroth:
        h0[near] = j0(a) + 1j * y0(a)
        h0[~near] = front * (1 + e * (-1 / 8 + e * (9 / 128 + e * (-75 / 1024 + e * 3675 / 32768))))
    h1[near] = j1(a) + 1j * y1(a)
    h1[~near] = -1j * front * (1 + e * (3 / 8 + e * (-15 / 128 + e * (105 / 1024 - e * 4725 / 32768))))
    return h0, h1


def pair_operators(
    curve: Curve, rows: Curve, sight: Sight, k: float, material: Material, wavelength_nm: float, polarisation: str
) -> Pairs:
    """Operators of one more reflection, from all points of `curve` to `rows`, for "TE" or "TM".

    The pair's field and its slope are exact where one of them alone is left (perfect conductors). For penetrable media
    the slope of the pair's double layer is taken as that of the plane wave along the pair, −ik cos θ times the field:
    near-field terms of a plane-wave reflection coefficient would mean nothing. In TM the double layer, which vanishes
    in the tangent plane itself, is received with `near_grazing`; the single layer, whose part in the tangent plane the
    rule of the first reflection holds already, with r.
    """
    i, j = sight.row, sight.source
    dx, dz = rows.x[i] - curve.x[j], rows.z[i] - curve.z[j]
    distance = np.hypot(dx, dz)
    dx, dz = dx / distance, dz / distance
    leaving = dx * curve.nx[j] + dz * curve.nz[j]
    arriving = -(dx * rows.nx[i] + dz * rows.nz[i])
    h0, h1 = hankel(k * distance)
    double = 0.25j * k * h1 * leaving * curve.ds[j]  # ∂G/∂n'
    slope = 0.25j * k * h1 * arriving * curve.ds[j]  # ∂G/∂n
    shape = (len(rows), len(curve))

    def sparse(values: Complex) -> sp.csr_array:
        pointer = np.searchsorted(i, np.arange(len(rows) + 1))
        return sp.csr_array((values, j, pointer), shape=shape)

    if material.perfect:
        if polarisation == "TE":
            return Pairs(None, None, None, sparse(-2 * slope))
        return Pairs(sparse(2 * double), None, None, None)
    r = material.amplitudes(arriving, wavelength_nm)[POLARISATIONS[polarisation]]
    single = 0.25j * h0 * curve.ds[j]
    if polarisation == "TM":
        admittance = arriving * (1 - r) / (1 + r)  # ∂u/∂n = −ik·admittance·u, whatever the angle nearly
        head_on = np.abs(material.amplitudes(1.0, wavelength_nm)[1])
        q = 1 + near_grazing(r, arriving, admittance, k * distance, head_on)
        return Pairs(
            sparse(q * double),
            sparse(-(1 + r) * single),
            sparse(-1j * k * admittance * q * double),
            sparse(1j * k * admittance * (1 + r) * single),
        )
    return Pairs(
        sparse((1 + r) * double),
        sparse(-(1 + r) * single),
        sparse(-(1 - r) * 1j * k * arriving * double),
        sparse(-(1 - r) * slope),
    )


def near_grazing(r: Complex, cosine: Floats, admittance: Complex, kd: Floats, metal: Floats | float) -> Complex:
    """r with what a source at a distance kd adds to a plane wave near grazing: r + (1 − r) F(w)·metal, (p,).

    F(w) = 1 + i√π w exp(−w²) erfc(−iw), w = √(ikd/2) (cos θ + admittance) (Sommerfeld 1909; Chien and Soroka 1975): a
    good conductor takes H along its surface as a perfect one does up to distances of some |n|² wavelengths, where plane
    waves at grazing incidence would be extinguished, r = −1. The formula is for surfaces that respond locally; `metal`,
    |r| at normal incidence, lets the correction fade for media that reflect little.
    """
    from scipy.special import wofz

    w = np.sqrt(0.5j * kd) * (cosine + admittance)
    return r + (1 - r) * (1 + 1j * np.sqrt(np.pi) * w * wofz(w)) * metal
