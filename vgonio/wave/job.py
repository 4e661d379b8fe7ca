"""What is wanted of every coherence window: scattering vectors, and where the intensity at each of them goes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..directions import Detector, Incoming
from .cone import CUT, Choice, Nodes, Rule, cell_nodes, cone_nodes
from .quadrature import Floats
from .theories import scattering_vector

NODES_PER_CELL = 4  # directions evaluated in each cell of a hemisphere, per window
SUMMED = 256  # directions that are computed again where only sums matter

Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Job:
    """Scattering vectors and their share in the means over detector elements.

    q : (m, 3) rad/µm;  k : (m,) rad/µm;  wo : (m, 3) directions towards the detector
    source : (m,) index into `sources` (n, 3);  view : (m,) index into `views` (v, 3), whose shadows hold for the node
    weight : (m,) in the mean over the detector element
    target : (m,) flat index (theta_i, element, wavelength) into `shape`
    sums : whether only sums over many elements matter, and so errors relative to them, not to the largest value
    room : (element, wavelength) or one number, speckles of a window that an element has room for
    """

    q: Floats
    k: Floats
    wo: Floats
    source: Ints
    sources: Floats
    view: Ints
    views: Floats
    weight: Floats
    target: Ints
    shape: tuple[int, int, int]
    sums: bool = False
    room: Floats | float = np.inf

    @property
    def wavelength(self) -> Ints:
        """(m,) index of the wavelength."""
        return self.target % self.shape[2]

    @property
    def wi(self) -> Floats:
        """(m, 3) directions towards the source."""
        return self.sources[self.source]

    @property
    def prefactor(self) -> Floats:
        """(m,) k²/(4π²) / (cos θ_i cos θ_o)."""
        return self.k**2 / (4 * np.pi**2) / (self.wi[:, 2] * self.wo[:, 2])

    def some(self, which: Ints) -> Job:
        """The same job with some of its scattering vectors alone."""
        names = ("q", "k", "wo", "source", "view", "weight", "target")
        return replace(self, **{n: getattr(self, n)[which] for n in names})

    def gather(self, values: Floats) -> Floats:
        """(…, theta_i, element, wavelength) sums of values (…, m)."""
        rows = values.reshape(-1, values.shape[-1])
        size = int(np.prod(self.shape))
        summed = np.stack([np.bincount(self.target, row, size) for row in rows])
        return np.asarray(summed, np.float64).reshape(*values.shape[:-1], *self.shape)

    def checked(self) -> Ints:
        """Scattering vectors that are computed again: every detector element at two angles and two wavelengths.

        In each element the vector closest to mirror reflection, so that the peak of a narrow lobe is among them.
        """
        if self.sums:
            return np.linspace(0, len(self.q) - 1, min(len(self.q), SUMMED)).astype(np.int64)
        angles, elements, wavelengths = self.shape
        tilt = np.hypot(self.q[:, 0], self.q[:, 1]) / self.q[:, 2]
        order = np.lexsort((tilt, self.target))
        first = np.searchsorted(self.target[order], np.arange(np.prod(self.shape) + 1))
        wanted = [
            (i * elements + e) * wavelengths + w
            for i in sorted({0, angles - 1})
            for w in sorted({0, wavelengths // 2})
            for e in range(0, elements, max(1, elements // 64))
        ]
        return np.array([order[first[t]] for t in wanted if first[t + 1] > first[t]], np.int64)

    def difference(self, f: Floats, g: Floats) -> float:
        """Largest |f − g| (m,) relative to the largest of the same angle of incidence and wavelength."""
        if self.sums:
            return float(np.sum(self.weight * np.abs(f - g)) / max(float(np.sum(self.weight * f)), 1e-300))
        angles, elements, wavelengths = self.shape
        group = self.target // (elements * wavelengths) * wavelengths + self.wavelength
        peak = np.zeros(angles * wavelengths)
        np.maximum.at(peak, group, np.maximum(f, g))
        return float(np.max(np.abs(f - g) / np.maximum(peak[group], 1e-300), initial=0.0))


def parallel(incoming: Incoming) -> tuple[Floats, Ints, Floats]:
    """Directions of the source above the horizon: (n, 3), the angle of incidence of each, its share of the power."""
    directions, share = incoming.spread()
    found = []
    for i, cone in enumerate(directions):
        up = cone[:, 2] > 0
        found += [(wi, i, s) for wi, s in zip(cone[up], share[up] / share[up].sum())]
    sources, angle, shares = zip(*found)
    return np.array(sources), np.array(angle, np.int64), np.array(shares)


def detector_job(
    incoming: Incoming,
    detector: Detector,
    k: Floats,
    step: float,
    theory: str,
    seed: int,
    choose: Callable[[Floats], list[Choice]] | None = None,
) -> Job:
    """The job of a detector; `step` is that of scattering vectors across a cone, rad/µm.

    choose : the cone's rule for each of the sources (n, 3); without it the lattice is cut at the edge
    """
    sources, angle, share = parallel(incoming)
    rng = np.random.default_rng(seed)
    phi = np.deg2rad(incoming.phi_deg)
    across = sources @ np.array([-np.sin(phi), np.cos(phi), 0.0])
    nodes: list[Nodes] = []
    cut = [Choice(CUT)] * len(sources)
    choices = cut if choose is None or detector.kind == "hemisphere" else choose(sources)
    made: dict[tuple[Rule, float], Nodes] = {}

    def cones(rule: Rule, beside: float) -> Nodes:
        if (rule, beside) not in made:
            made[rule, beside] = cone_nodes(detector, k, step, beside, rule)
        return made[rule, beside]

    for n, choice in enumerate(choices):
        if detector.kind == "hemisphere":
            nodes.append(cell_nodes(detector, k, NODES_PER_CELL, rng))
            continue
        beside = float(across[n]) if incoming.divergence_deg else 0.0
        one = cones(choice.rule, beside)
        some = choice.elements
        nodes.append(one if some is None else one.where(some, len(k), cones(CUT, beside)))
    counts = [len(one.k) for one in nodes]
    local = np.concatenate([one.target for one in nodes])
    source = np.repeat(np.arange(len(sources)), counts)
    shape = (len(incoming.theta_deg), len(detector), len(k))
    kk, wo = np.concatenate([one.k for one in nodes]), np.concatenate([one.direction for one in nodes])
    return Job(
        scattering_vector(theory, kk, sources[source], wo),
        kk,
        wo,
        source,
        sources,
        local // shape[2],
        detector.directions,
        np.concatenate([one.weight for one in nodes]) * share[source],
        local + angle[source] * shape[1] * shape[2],
        shape,
        # the intensity of a window is correlated as exp(−ℓ²q²/2): 2π/ℓ² to a speckle
        room=detector.projected_solid_angle[:, None] * (k / step) ** 2 / (2 * np.pi),
    )
