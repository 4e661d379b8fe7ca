"""Where in a detector element the waves are evaluated: rows across a cone, scattered points in a hemisphere's cell.

Power is ∫ f cos θ_o dω, and cos θ_o dω = ds_x ds_y in direction cosines: a BRDF over an element is the plain mean of f
over the element's area in direction cosines.

Through a window f is band-limited in q, as |S|² is, but the edge of a cone is sharp: a lattice of directions that is
cut there is off by up to a tenth of a narrow lobe that lies on the edge. `RULES` are that lattice, for diffuse light,
where this is speckle and averages out; lattices that go on beyond the edge with the weights of the disc convolved with
an interpolation kernel (a Gaussian times a sinc), right to all orders for what is band-limited; and a Gauss rule of
the disc, right to all orders as well, whose rows of scattering vectors no two wavelengths share.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..directions import Detector
from ..errors import ToleranceError
from .quadrature import Floats

MOST_NODES = 30_000_000  # scattering vectors of one incidence: 2 GB


@dataclass(frozen=True)
class Rule:
    """spacing : of the lattice, in 1/ℓ;  soft : width of the kernel's Gaussian in lattice steps, 0 for a cut edge;
    least : weights below this share of the largest are left out;  error : on a window's lobe, of its peak
    narrow : cones of k ℓ sin a below this have a Gauss rule of their own, whose rows no other wavelength shares"""

    spacing: float
    soft: float
    least: float
    error: float
    narrow: float


CUT = Rule(1.0, 0.0, 0.0, 0.1, 0.0)
RULES = (CUT, Rule(0.5, 1.5, 1e-4, 1e-3, 1.0), Rule(0.5, 3.0, 1e-6, 3e-5, 1.0), Rule(1.0, 1.0, 1.0, 1e-13, np.inf))


@dataclass(frozen=True, eq=False)
class Choice:
    """A rule for one source;  elements : (detector elements,) bool that it is for, the others are cut; None for all"""

    rule: Rule
    elements: NDArray[np.bool_] | None = None


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

    def where(self, elements: NDArray[np.bool_], wavelengths: int, other: Nodes) -> Nodes:
        """These nodes for the detector elements (e,) bool, those of `other` for the rest."""
        mine, theirs = elements[self.target // wavelengths], ~elements[other.target // wavelengths]
        names = ("direction", "k", "weight", "target")
        return Nodes(*(np.concatenate([getattr(self, n)[mine], getattr(other, n)[theirs]]) for n in names))


def cone_nodes(detector: Detector, k: Floats, step: float, across: float = 0.0, rule: Rule = CUT) -> Nodes:
    """The nodes of in-plane cones by a rule; `step` is 1/ℓ in rad/µm, `across` as for `_cut`."""
    if rule.soft == 0:
        return _cut(detector, k, step, across)
    theta, a = np.deg2rad(detector.theta_deg), detector.half_angle_rad
    reach = np.sin(theta) * np.cos(a)
    # f does not go on below the horizon: cones that come close to it have a Gauss rule, those that cross it a cut edge
    pad = rule.soft * np.sqrt(-2 * np.log(rule.least)) * rule.spacing * step / k.min()
    gauss = k * np.sin(a) / step < rule.narrow
    pad = 0.0 if gauss.all() else pad
    high = np.hypot(np.abs(reach) + np.cos(theta) * np.sin(a) + pad, np.sin(a) + pad) < 1
    whole = np.abs(theta) + a < np.pi / 2
    radius = k * np.sin(a) / (rule.spacing * step)
    expected = float(np.sum((3 * radius + 4 * rule.soft) ** 2)) * len(theta)
    _require_affordable(expected, step)
    parts = [
        (_soft if high[e] and not gauss[j] else _gauss)(reach[e], np.cos(theta[e]), a, k[j], step, across, rule)
        for e in np.flatnonzero(whole)
        for j in range(len(k))
    ]
    target = [e * len(k) + j for e in np.flatnonzero(whole) for j in range(len(k))]
    low = np.flatnonzero(~whole)
    cut = _cut(detector, k, step, across)
    kept = np.isin(cut.target // len(k), low)
    su, sv, weight = (np.concatenate([p[i] for p in parts]) if parts else np.zeros(0) for i in range(3))
    to = np.repeat(np.array(target, np.int64), [len(p[0]) for p in parts])
    direction = _turned(su, sv, detector)
    return _normalised(
        np.concatenate([direction, cut.direction[kept]]),
        np.concatenate([k[to % len(k)], cut.k[kept]]),
        np.concatenate([weight, cut.weight[kept]]),
        np.concatenate([to, cut.target[kept]]),
        len(theta) * len(k),
    )


def _gauss(
    reach: float, cosine: float, a: float, k: float, step: float, across: float, rule: Rule
) -> tuple[Floats, Floats, Floats]:
    """Gauss–Legendre along chords at the nodes of Gauss–Chebyshev of the second kind: exact for polynomials."""
    n = int(np.ceil(3 * k * np.sin(a) / step)) + int(np.ceil(-np.log10(rule.error) - 0.5))
    angle = np.arange(1, n + 1) * np.pi / (n + 1)
    t, w = np.polynomial.legendre.leggauss(n)
    su = reach + cosine * np.sin(a) * np.sin(angle)[:, None] * t
    sv = np.sin(a) * np.cos(angle)[:, None] + 0 * su
    return su.ravel(), sv.ravel(), (np.sin(angle)[:, None] ** 2 * w).ravel()


def _soft(
    reach: float, cosine: float, a: float, k: float, step: float, across: float, rule: Rule
) -> tuple[Floats, Floats, Floats]:
    """A lattice of rows q_v = n·spacing·step, weighed with the disc convolved with the kernel in both directions."""
    h = rule.spacing * step / k
    ry, rx, pad = np.sin(a) / h, cosine * np.sin(a) / h, rule.soft * np.sqrt(-2 * np.log(rule.least))
    first, last = np.floor(across / h - ry - pad), np.ceil(across / h + ry + pad)
    y = np.arange(first, last + 1) - across / h
    x = np.arange(-np.ceil(rx + pad), np.ceil(rx + pad) + 1)
    n = int(6 * ry + 24)  # chords: the kernel has up to π a node
    angle = np.arange(1, n + 1) * np.pi / (n + 1)
    chord, end = rx * np.sin(angle)[:, None], 9 * rule.soft
    integral = _integral(rule.soft)
    along_y = _kernel(y[:, None] - ry * np.cos(angle), rule.soft) * np.sin(angle)
    along_x = integral(np.clip(x + chord, -end, end)) - integral(np.clip(x - chord, -end, end))
    weight = along_y @ along_x
    j, i = np.nonzero(np.abs(weight) > rule.least * weight.max())
    return reach + x[i] * h, y[j] * h, weight[j, i]


def _kernel(t: Floats, soft: float) -> Floats:
    """sinc(t) exp(−t²/2·soft²), t in lattice steps; exactly one in its sum over a lattice, to exp(−(π soft)²/2)."""
    return np.sinc(t) * np.exp(-(t**2) / (2 * soft**2))


@lru_cache(maxsize=8)
def _integral(soft: float) -> Any:
    """∫ of the kernel from −∞ to t, for |t| ≤ 9 soft."""
    from scipy.interpolate import CubicSpline

    t = np.linspace(-9 * soft, 9 * soft, int(3600 * soft) + 1)
    return CubicSpline(t, _kernel(t, soft)).antiderivative()


def _cut(detector: Detector, k: Floats, step: float, across: float) -> Nodes:
    """In-plane cones crossed by rows of common q_v = n·step (rad/µm), nodes no wider apart than `step` along them.

    A cone around θ_o of half-angle a is an ellipse in direction cosines: centre sin θ_o cos a, half-axes cos θ_o sin a
    in the plane and sin a across it.

    across : component of ω_i across the plane, where the source diverges: q_v = k (across + s_v)
    """
    theta, a = np.deg2rad(detector.theta_deg), detector.half_angle_rad
    parts: list[tuple[NDArray, ...]] = []
    ends = k[:, None] * (across + np.array([-1, 1]) * np.sin(a)) / step
    # an ellipse of k sin a / step by k sin a cos θ / step cells for each direction and wavelength
    expected = np.pi * float(np.sum((k * np.sin(a) / step) ** 2)) * float(np.sum(np.cos(theta)))
    _require_affordable(expected, step)
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
    direction = _turned(su, sv, detector)
    return _normalised(direction[up], kk[up], weight[up], target[up].astype(int), len(theta) * len(k))


def _turned(su: Floats, sv: Floats, detector: Detector) -> Floats:
    """(m, 3) directions of cosines in and across the detector's plane."""
    phi = np.deg2rad(detector.phi_deg[0])
    c, s = np.cos(phi), np.sin(phi)
    return np.stack([c * su - s * sv, s * su + c * sv, np.sqrt(np.maximum(1 - su**2 - sv**2, 0))], axis=1)


def _require_affordable(expected: float, step: float) -> None:
    if expected > MOST_NODES:
        raise ToleranceError(
            f"the detector cones hold {expected:.2g} scattering vectors at a spacing of {step:.2g} rad/µm, at most "
            f"{MOST_NODES:.0e}: take a smaller coherence_um, aperture_deg or number of directions and wavelengths"
        )


def cell_nodes(detector: Detector, k: Floats, per_cell: int, rng: np.random.Generator) -> Nodes:
    """Hemisphere cells: `per_cell` stratified directions in each, the same for all wavelengths."""
    start, ring = np.repeat(np.arange(len(detector.ring_cells)), detector.ring_cells), detector.ring_edges_rad
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
