"""From power per direction in the plane of incidence to the BRDF over detector cones and cells.

Across the plane the coherence window spreads the light of a one-dimensional profile as it does that of any surface:
|window|² is Gaussian in direction cosines, exp(−(kℓ s)²). Power is ∫∫ p(s_x) g(s_y) ds_x ds_y over an element.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import erf, erfinv

from ...directions import Detector
from ...units import radians
from .panels import Floats, composite

Density = Callable[[Floats], Floats]  # s_x (m,) -> (r, m) power per unit of s_x over incident power
ACROSS = 24  # directions across the plane, for cells of a hemisphere


def element_means(detector: Detector, sign: float, k: float, taper: float, p: Density, rate: float) -> tuple:
    """(r, elements) BRDF of each detector element, and its standard error as far as the speckles inside it tell.

    sign : 1 or −1, the cosine of the azimuth of the plane of incidence: s_x = sign · sin θ
    rate : phase (rad) that p may turn over a unit of s_x
    """
    if detector.kind == "hemisphere":
        return _cells(detector, sign, k, taper, p, rate)
    sine, weight, element = _cone_nodes(detector, sign, k * taper, rate)
    values = p(sine)
    count = len(detector)
    power = np.array([np.bincount(element, weight * row, count) for row in values])
    square = np.array([np.bincount(element, weight * row**2, count) for row in values])
    total = np.bincount(element, weight, count)
    variance = np.maximum(square / total - (power / total) ** 2, 0)
    width = 2 * np.cos(radians(detector.theta_deg)) * np.sin(detector.half_angle)
    speckles = np.maximum(k * taper * width / np.sqrt(2 * np.pi), 1.0)
    scale = total / detector.projected_solid_angle
    return power / detector.projected_solid_angle, np.sqrt(variance / np.maximum(speckles - 1, 1.0)) * scale


def _cone_nodes(detector: Detector, sign: float, width: float, rate: float) -> tuple[Floats, Floats, np.ndarray]:
    """Nodes s_x over all cones, their weights (what lies across the plane included) and elements.

    A cone is an ellipse of direction cosines, half-axes cos θ sin a along and sin a across the plane."""
    a = detector.half_angle
    sine, weight, element = [], [], []
    for i, t in enumerate(radians(detector.theta_deg)):
        half = np.cos(t) * np.sin(a)
        u, w = composite(24 + rate * half * 1.5)
        position = np.sin(u * np.pi / 2)
        across = erf(width * np.sin(a) * np.sqrt(1 - position**2))
        sine.append(sign * (np.sin(t) * np.cos(a) + half * position))
        weight.append(w * np.pi / 2 * half * np.cos(u * np.pi / 2) * across)
        element.append(np.full(len(u), i))
    s, w, e = np.concatenate(sine), np.concatenate(weight), np.concatenate(element)
    up = np.abs(s) < 1 - 1e-12
    return s[up], w[up], e[up]


def _cells(detector: Detector, sign: float, k: float, taper: float, p: Density, rate: float) -> tuple[Floats, Floats]:
    t, w = composite(64 + 1.5 * rate + 4 * len(detector.ring_cells))
    sine, weight = np.sin(t * np.pi / 2), w * np.pi / 2 * np.cos(t * np.pi / 2)
    across = erfinv(2 * (np.arange(ACROSS) + 0.5) / ACROSS - 1) / (k * taper)
    sx, sy = (a.ravel() for a in np.meshgrid(sine, across, indexing="ij"))
    shrink = np.minimum(1.0, (1 - 1e-12) / np.hypot(sx, sy))
    sx, sy = sx * shrink, sy * shrink
    direction = np.stack([sx, sy, np.sqrt(np.maximum(1 - sx**2 - sy**2, 0))], axis=1)
    ray, cell = detector.catch(direction)
    values = p(sine)[:, ray // ACROSS] * weight[ray // ACROSS] / ACROSS
    power = np.array([np.bincount(cell, row, len(detector)) for row in values])
    return power / detector.projected_solid_angle, np.zeros_like(power)
