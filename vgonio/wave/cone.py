"""Where in a detector element the waves are evaluated: rows across a cone, scattered points in a hemisphere's cell.

Power is ∫ f cos θ_o dω, and cos θ_o dω = ds_x ds_y in direction cosines: a BRDF over an element is the plain mean of f
over the element's area in direction cosines.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..directions import Detector
from ..errors import ToleranceError
from .quadrature import Floats

MOST_NODES = 30_000_000  # scattering vectors of one incidence: 2 GB


@dataclass(frozen=True, eq=False)
class Nodes:
    """Directions at which f is wanted.

    target : (m,) flat index into (element, wavelength)
    direction : (m, 3);  k : (m,) rad/µm;  weight : (m,), adding up to 1 for each target
    """

    direction: Floats
    k: Floats
    weight: Floats
    target: NDArray[np.int64]


def cone_nodes(detector: Detector, k: Floats, step: float, across: float = 0.0) -> Nodes:
    """In-plane cones crossed by rows of common q_v = n·step (rad/µm), nodes no wider apart than `step` along them.

    A cone around θ_o of half-angle a is an ellipse in direction cosines: centre sin θ_o cos a, half-axes cos θ_o sin a
    in the plane and sin a across it.

    across : component of ω_i across the plane, where the source diverges: q_v = k (across + s_v)
    """
    theta, a = np.deg2rad(detector.theta_deg), detector.half_angle
    parts: list[tuple[NDArray, ...]] = []
    ends = k[:, None] * (across + np.array([-1, 1]) * np.sin(a)) / step
    # an ellipse of k sin a / step by k sin a cos θ / step cells for each direction and wavelength
    expected = np.pi * float(np.sum((k * np.sin(a) / step) ** 2)) * float(np.sum(np.cos(theta)))
    if expected > MOST_NODES:
        raise ToleranceError(
            f"the detector cones hold {expected:.2g} scattering vectors at a spacing of {step:.2g} rad/µm, at most "
            f"{MOST_NODES:.0e}: take a smaller coherence_um, aperture_deg or number of directions and wavelengths"
        )
    for n in range(int(np.floor(ends.min() + 0.5)), int(np.ceil(ends.max() - 0.5)) + 1):
        strip = ((n + np.array([-0.5, 0.5])) * step / k[:, None] - across) / np.sin(a)  # (w, 2) of the half-axis
        strip = np.clip(strip, -1, 1)
        area = np.diff(strip * np.sqrt(1 - strip**2) + np.arcsin(strip), axis=1)[:, 0] / np.pi  # share of the ellipse
        height = np.maximum(np.diff(strip, axis=1)[:, 0], 1e-300)
        chord = np.where(area > 0, area * np.pi / (2 * height), 0.0)  # mean half-length, of the half-axis
        for j in np.flatnonzero(area > 1e-12):
            half = np.cos(theta) * np.sin(a) * chord[j]  # (elements,)
            count = np.maximum(1, np.ceil(2 * half * k[j] / step - 1e-9)).astype(int)
            element = np.repeat(np.arange(len(theta)), count)
            position = np.concatenate([(np.arange(c) + 0.5) / c for c in count])
            su = np.sin(theta[element]) * np.cos(a) + half[element] * (2 * position - 1)
            sv = np.full(su.shape, n * step / k[j] - across)
            weight = area[j] / count[element]
            parts.append((su, sv, np.full(su.shape, k[j]), weight, element * len(k) + j))
    su, sv, kk, weight, target = (np.concatenate(p) for p in zip(*parts))
    up = su**2 + sv**2 < 1 - 1e-12  # what is below the horizon sees nothing
    phi = np.deg2rad(detector.phi_deg[0])
    c, s = np.cos(phi), np.sin(phi)
    direction = np.stack([c * su - s * sv, s * su + c * sv, np.sqrt(np.maximum(1 - su**2 - sv**2, 0))], axis=1)
    return _normalised(direction[up], kk[up], weight[up], target[up].astype(int), len(theta) * len(k))


def cell_nodes(detector: Detector, k: Floats, per_cell: int, rng: np.random.Generator) -> Nodes:
    """Hemisphere cells: `per_cell` stratified directions in each, the same for all wavelengths."""
    start, ring = np.repeat(np.arange(len(detector.ring_cells)), detector.ring_cells), detector.ring_edges
    number = np.concatenate([np.arange(n) for n in detector.ring_cells])
    u = (np.arange(per_cell) + rng.random((len(detector), per_cell))) / per_cell
    v = rng.random((len(detector), per_cell))
    s2 = np.sin(ring) ** 2
    radius = np.sqrt(s2[start][:, None] + u * (s2[start + 1] - s2[start])[:, None])
    phi = 2 * np.pi * (number[:, None] + v) / detector.ring_cells[start][:, None]
    up = np.stack([radius * np.cos(phi), radius * np.sin(phi), np.sqrt(np.maximum(1 - radius**2, 1e-12))], axis=-1)
    m = len(detector) * per_cell
    target = (np.repeat(np.arange(len(detector)), per_cell)[:, None] * len(k) + np.arange(len(k))).ravel()
    direction = np.repeat(up.reshape(m, 3), len(k), axis=0)
    ones = np.ones(len(target))
    return _normalised(direction, np.tile(k, m), ones, target, len(detector) * len(k))


def _normalised(direction: Floats, k: Floats, weight: Floats, target: NDArray, targets: int) -> Nodes:
    total = np.bincount(target, weight, targets)
    return Nodes(direction, k, weight / total[target], target)
