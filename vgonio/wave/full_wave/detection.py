"""From power per direction in the plane of incidence to the BRDF over detector cones and cells.

All light of a one-dimensional profile is in the plane: an element catches ∫ p(s_x) ds_x over what it covers of it, as
for iterated Kirchhoff. (A window of finite width across the plane would let a narrow cone lose light at long
wavelengths that a rough surface gives back from beside the plane: a shift of the spectrum that is none.)
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...directions import Detector
from ...units import radians
from .panels import Floats, composite

Density = Callable[[Floats], Floats]  # s_x (m,) -> (r, m) power per unit of s_x over incident power


def element_means(detector: Detector, sign: float, k: float, taper: float, p: Density, rate: float) -> tuple:
    """(r, elements) BRDF of each detector element, and its standard error as far as the speckles inside it tell.

    sign : 1 or −1, the cosine of the azimuth of the plane of incidence: s_x = sign · sin θ
    rate : phase (rad) that p may turn over a unit of s_x
    """
    if detector.kind == "hemisphere":
        return _cells(detector, p, rate)
    sine, weight, element = _cone_nodes(detector, sign, rate)
    values = p(sine)
    count = len(detector)
    power = np.array([np.bincount(element, weight * row, count) for row in values])
    square = np.array([np.bincount(element, weight * row**2, count) for row in values])
    total = np.bincount(element, weight, count)
    variance = np.maximum(square / total - (power / total) ** 2, 0)
    width = 2 * np.cos(radians(detector.theta_deg)) * np.sin(detector.half_angle_rad)
    speckles = np.maximum(k * taper * width / np.sqrt(2 * np.pi), 1.0)
    scale = total / detector.projected_solid_angle
    return power / detector.projected_solid_angle, np.sqrt(variance / np.maximum(speckles - 1, 1.0)) * scale


def _cone_nodes(detector: Detector, sign: float, rate: float) -> tuple[Floats, Floats, np.ndarray]:
    """Nodes s_x from sin(θ − a) to sin(θ + a) of all cones, their weights and elements."""
    a = detector.half_angle_rad
    sine, weight, element = [], [], []
    for i, t in enumerate(radians(detector.theta_deg)):
        half = np.cos(t) * np.sin(a)
        u, w = composite(24 + rate * half * 1.5)
        position = np.sin(u * np.pi / 2)
        sine.append(sign * (np.sin(t) * np.cos(a) + half * position))
        weight.append(w * np.pi / 2 * half * np.cos(u * np.pi / 2))
        element.append(np.full(len(u), i))
    s, w, e = np.concatenate(sine), np.concatenate(weight), np.concatenate(element)
    up = np.abs(s) < 1 - 1e-12
    return s[up], w[up], e[up]


def _cells(detector: Detector, p: Density, rate: float) -> tuple[Floats, Floats]:
    t, w = composite(64 + 1.5 * rate + 4 * len(detector.ring_cells))
    sine, weight = np.sin(t * np.pi / 2), w * np.pi / 2 * np.cos(t * np.pi / 2)
    direction = np.stack([sine, np.zeros_like(sine), np.sqrt(np.maximum(1 - sine**2, 0))], axis=1)
    ray, cell = detector.catch(direction)
    values = p(sine)[:, ray] * weight[ray]
    power = np.array([np.bincount(cell, row, len(detector)) for row in values])
    return power / detector.projected_solid_angle, np.zeros_like(power)
