"""Total reflected power of the wave theories, by quasi-random directions of its own over the hemisphere.

In direction cosines s the share of the incident power that is reflected is E = ∫ f ds over the unit disc. Three sets
of directions share the work, each dense where another part of f is large, and are weighed by the sum of their densities
(Veach and Guibas 1995, balance heuristic): the disc evenly; a normal distribution around the mirror direction, as wide
as a coherence window diffracts; mirror directions of facets whose slopes are normally distributed as the surface's.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..directions import Detector, Incoming
from ..surface.heightfield import Heightfield
from .coherence import WindowPlan
from .job import Job, parallel
from .lobes import rms_slopes
from .quadrature import Floats
from .theories import scattering_vector

REPLICATES = 8  # independently shifted sets of directions; their spread is the error of the quadrature
NODES = (48, 48, 96)  # directions of one replicate: even, mirror, facets
WIDER = 1.25  # the sampled distributions are so much wider than what they follow: their tails must not be thinner
VIEW_DEG = 15.0  # cells of the hemisphere whose centre's shadows hold for all directions in them
R2 = np.array([0.7548776662466927, 0.5698402909980532])  # plastic number's inverse powers (Roberts 2018)


def energy_job(surface: Heightfield, plan: WindowPlan, incoming: Incoming, k: Floats, theory: str, seed: int) -> Job:
    """Directions whose weighted sum of f, for each (theta_i, replicate, wavelength), is the reflected share."""
    sources, angle, share = parallel(incoming)
    rng = np.random.default_rng([seed, 1])
    lobe = plan.step / np.sqrt(2) * WIDER  # rad/µm; exp(−ℓ² q²) of a Gaussian window
    slopes = np.maximum(rms_slopes(surface) * WIDER, 1e-4)
    cells = Detector.hemisphere(VIEW_DEG)
    parts: list[tuple[Any, ...]] = []
    for i, wi in enumerate(sources):
        for replicate in range(REPLICATES):
            u = [_points(n, rng) for n in NODES]
            for j, kj in enumerate(k):
                s = np.concatenate([_disc(u[0]), _mirror(u[1], wi, lobe / kj), _facets(u[2], wi, slopes)])
                up = s[:, 0] ** 2 + s[:, 1] ** 2 < 1 - 1e-9
                wo = np.column_stack([s[up], np.sqrt(1 - np.sum(s[up] ** 2, axis=1))])
                target = (angle[i] * REPLICATES + replicate) * len(k) + j
                n = len(wo)
                weight = share[i] / _density(wo, wi, lobe / kj, slopes)
                parts.append((wo, np.full(n, kj), np.full(n, i), weight, np.full(n, target)))
    wo, kk, source, weight, target = (np.concatenate(p) for p in zip(*parts))
    view = cells.catch(wo)[1]
    shape = (len(incoming.theta_deg), REPLICATES, len(k))
    q = scattering_vector(theory, kk, sources[source], wo)
    return Job(q, kk, wo, source, sources, view, cells.directions, weight, target, shape, sums=True)


def total(windows: Floats, independent: float) -> tuple[Floats, Floats]:
    """E and its standard error (theta_i, wavelength) from windows (n, theta_i, replicate, wavelength): the spread over
    replicates, that of the quadrature, and that over windows, of which `independent` are, together."""
    mean = windows.mean(axis=(0, 2))
    quadrature = windows.mean(axis=0).var(axis=1, ddof=1) / windows.shape[2]
    if len(windows) < 2:
        return mean, np.sqrt(quadrature)
    sample = windows.mean(axis=2).var(axis=0, ddof=1) / max(independent, 1.0)
    return mean, np.sqrt(quadrature + sample)


# ---- directions, as direction cosines (n, 2), and the density of all of them together
def _points(n: int, rng: np.random.Generator) -> Floats:
    return (np.arange(1, n + 1)[:, None] * R2 + rng.random(2)) % 1.0


def _disc(u: Floats) -> Floats:
    return _polar(np.sqrt(u[:, 0]), u[:, 1])


def _polar(radius: Floats, turn: Floats) -> Floats:
    return radius[:, None] * np.stack([np.cos(2 * np.pi * turn), np.sin(2 * np.pi * turn)], axis=1)


def _normal(u: Floats) -> Floats:
    return _polar(np.sqrt(-2 * np.log1p(-u[:, 0])), u[:, 1])


def _mirror(u: Floats, wi: Floats, width: float) -> Floats:
    return -wi[:2] + width * _normal(u)


def _facets(u: Floats, wi: Floats, slopes: Floats) -> Floats:
    """Mirror directions of ω_i about facets; those that would go down are put outside of the disc."""
    t = slopes * _normal(u)
    n = np.column_stack([-t, np.ones(len(t))]) / np.sqrt(1 + np.sum(t**2, axis=1))[:, None]
    dot = n @ wi
    wo = 2 * dot[:, None] * n - wi
    return np.where(((wo[:, 2] > 0) & (dot > 0))[:, None], wo[:, :2], 2.0)


def _density(wo: Floats, wi: Floats, width: float, slopes: Floats) -> Floats:
    """Expected number of directions per unit of ds, (m,), all sets together."""
    away = np.sum((wo[:, :2] + wi[:2]) ** 2, axis=1)
    mirror = np.exp(-away / (2 * width**2)) / (2 * np.pi * width**2)
    h = wi + wo
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    t = -h[:, :2] / h[:, 2:]
    normal = np.exp(-np.sum((t / slopes) ** 2, axis=1) / 2) / (2 * np.pi * np.prod(slopes))
    # dt = dω_h/h_z³, dω_h = dω_o/(4 ω_o·h), ds = cos θ_o dω_o
    facets = normal / (4 * np.sum(wo * h, axis=1) * h[:, 2] ** 3 * wo[:, 2])
    return NODES[0] / np.pi + NODES[1] * mirror + NODES[2] * facets
