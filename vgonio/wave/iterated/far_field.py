"""From fields on a profile to its far field: power per radian, means over detector elements, energies.

u(r) → √(2/(πkr)) exp(i(kr − π/4)) (i/4) N(θ_o),  N = ∫ [−ik (n·ω_o) u − ∂u/∂n] exp(−ik ω_o·r) ds, so that the power per
radian is |N|²/(8πk).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...directions import Detector, unit_vectors
from ..quadrature import Complex, Floats
from .curve import Curve

BLOCK = 4_000_000  # terms of the sum held together
PER_SPECKLE = 1.0  # directions for each λ/(length of the lit part)
IN_CELL = 6  # least number of directions in a detector element


@dataclass(frozen=True, eq=False)
class Directions:
    """Directions in the plane at which the far field is wanted, and what each adds to detector elements.

    theta : (m,) signed, radians;  width : (m,) radians that each stands for in the half circle, 0 for those of a cone
    node, element : (p,) pairs of direction and detector element;  share : (p,) factor on power per radian, 1/sr
    """

    theta: Floats
    width: Floats
    node: NDArray[np.integer]
    element: NDArray[np.integer]
    share: Floats
    elements: int

    def means(self, power: Floats) -> Floats:
        """(…, elements) BRDF from relative power per radian (…, m)."""
        flat = power.reshape(-1, power.shape[-1])
        rows = [np.bincount(self.element, row[self.node] * self.share, self.elements) for row in flat]
        return np.array(rows, np.float64).reshape(*power.shape[:-1], self.elements)

    def total(self, power: Floats) -> Floats:
        """(…,) power over the half circle."""
        return power @ self.width


def directions(detector: Detector, sign: float, wavelength: float, length: float) -> Directions:
    """Directions for a detector whose plane is that of the profile, and a half circle of them for the energies.

    A BRDF of a cone (or cell) is the power that it catches over incident power and ∫ cos θ dω: all light of a profile
    is in the plane. sign : −1 where the plane's azimuth is 180°;  wavelength, length (of the lit part) : µm
    """
    step = min(wavelength / (length * PER_SPECKLE), np.pi / 180)
    count = int(np.ceil(np.pi / step)) * (IN_CELL if detector.kind == "hemisphere" else 1)
    circle = (np.arange(count) + 0.5) / count * np.pi - np.pi / 2
    width = np.full(count, np.pi / count)
    if detector.kind == "hemisphere":
        node, cell = detector.catch(unit_vectors(circle))
        share = np.pi / count / detector.projected_solid_angle[cell]
        return Directions(circle, width, node, cell, share, len(detector))
    return _cones(detector, sign, circle, width, step)


def _cones(detector: Detector, sign: float, circle: Floats, width: Floats, step: float) -> Directions:
    a = detector.half_angle_rad
    nodes = max(IN_CELL, int(np.ceil(4 * a / step)) + 1)
    part = ((np.arange(nodes) + 0.5) / nodes * 2 - 1) * a
    theta = (sign * np.deg2rad(detector.theta_deg)[:, None] + part).ravel()
    element = np.repeat(np.arange(len(detector)), nodes)
    share = 2 * a / nodes / detector.projected_solid_angle[element]
    up = np.abs(theta) < np.pi / 2 - 1e-9
    node = len(circle) + np.arange(int(up.sum()))
    everything = np.concatenate([circle, theta[up]])
    widths = np.concatenate([width, np.zeros(int(up.sum()))])
    return Directions(everything, widths, node, element[up], share[up], len(detector))


def far_amplitudes(
    curve: Curve, u: Complex, v: Complex, k: float, theta: Floats, seen: NDArray[np.bool_] | None
) -> Complex:
    """N/√(8πk) (m, …) at directions θ (m,) for fields u, v (n, …); `seen` (m, n): what each direction sees."""
    out = np.empty((len(theta), *u.shape[1:]), np.complex128)
    flat_u, flat_v = (a.reshape(len(curve), -1) for a in (u, v))
    for a in range(0, len(theta), max(1, BLOCK // len(curve))):
        part = slice(a, a + max(1, BLOCK // len(curve)))
        s, c = np.sin(theta[part])[:, None], np.cos(theta[part])[:, None]
        wave = np.exp(-1j * k * (s * curve.x + c * curve.z)) * curve.ds
        if seen is not None:
            wave *= seen[part]
        double = wave * (-1j * k * (s * curve.nx + c * curve.nz))
        out[part] = (double @ flat_u - wave @ flat_v).reshape(-1, *u.shape[1:])
    return out / np.sqrt(8 * np.pi * k)
