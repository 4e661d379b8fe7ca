"""Integrals over the hemisphere of a BRDF that is known in plane at θ_i = 0, and how far they can be told.

Between the directions nothing is known, and a lobe narrower than their step makes any integral wrong by factors. So
each is taken by three rules that agree where the directions resolve the lobe and disagree where they do not: f linear
in θ; ln f linear in sin²θ, as of a Gaussian lobe; and the narrowest lobe that the values allow, all light of which the
detector's cone in the mirror direction sees: as much as that cone holds and, outside of it, no more than the next cone
sees that does not overlap. Means over cones keep ∫ f cos θ dω, but smear what lies inside and outside of a specular
cone: outside, the third rule goes by the cones alone that are wholly outside. The value is the median of the three;
its error half their range, and in squares a third of what every second direction changes (steps that halve reduce the
error of the first two rules by four), and half the difference of both sides of the normal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

Floats = NDArray[np.float64]
Figure = Callable[[Floats, Floats], Floats]  # of what lies inside and outside of a cone about the mirror direction
Curve = Callable[[Floats, Floats, Floats], Floats]  # f between its directions
LARGEST_ERROR = 0.2  # of the integral: beyond it no figure is given
SMALLEST_ERROR = 0.01  # of all reflected light: a share that is known so well is told, however small it is
POINTS = 12  # of Gauss–Legendre in each interval between directions
_NODES, _WEIGHTS = (np.asarray(v, np.float64) for v in np.polynomial.legendre.leggauss(POINTS))
_TINY = 1e-12  # of the largest value: what is darker, or negative by noise, counts as that where a logarithm is needed


@dataclass(frozen=True, eq=False)
class Plane:
    """f about the normal at θ_i = 0, both sides apart.

    theta : (n,) signed, rad, ascending;  f : (n, n_λ) sr⁻¹, none missing;  half : half-angle of the detector's cones,
    rad, 0 for directions
    """

    theta: Floats
    f: Floats
    half: float

    def folded(self) -> tuple[Floats, Floats]:
        """(m,) rad ≥ 0 and (m, n_λ) mean f of both sides."""
        angles = np.asarray(np.round(np.abs(self.theta), 9), np.float64)
        theta, place = np.unique(angles, return_inverse=True)
        count = np.bincount(place).astype(np.float64)
        total = np.zeros((theta.size, self.f.shape[1]))
        np.add.at(total, place, self.f)
        return theta, total / count[:, None]

    def side(self, sign: int) -> tuple[Floats, Floats]:
        """The same of one side of the normal alone."""
        kept = self.theta * sign >= -1e-9
        order = np.argsort(np.abs(self.theta[kept]))
        return np.abs(self.theta[kept])[order], self.f[kept][order]


@dataclass(frozen=True, eq=False)
class Integral:
    """value, error : (n_λ,), error numerical, from steps of θ_o and unlike sides

    unresolved : whether the steps are too coarse to give a figure
    """

    value: Floats
    error: Floats
    unresolved: bool


def whole(plane: Plane) -> Integral:
    """∫ f cos θ dω over the hemisphere, without a unit."""
    return _integral(plane, lambda inside, beyond: inside + beyond, plane.half)


def outside(plane: Plane, cone: float, energy: Floats | None = None) -> Integral:
    """Share of the reflected light further than `cone` (rad) from the normal.

    energy : (n_λ,) all light that is reflected, where it is known; else what `whole` finds by the same rule
    Raises InputError for cones of the detector that are wider than the specular cone.
    """
    if plane.half > cone * (1 + 1e-6):
        raise InputError(
            f"detector cones of {np.degrees(2 * plane.half):.3g}° are wider than the specular cone of "
            f"{np.degrees(2 * cone):.3g}°: give a larger specular_deg or simulate with a narrower aperture_deg"
        )

    everything = whole(plane).value if energy is None else energy
    of_known = _integral(plane, lambda inside, beyond: beyond / everything, cone, SMALLEST_ERROR)
    if energy is not None:
        return Integral(np.minimum(of_known.value, 1.0), of_known.error, of_known.unresolved)
    # light that cones smear to the outside is missing inside: the share alone changes less than what it is made of
    found = _integral(plane, lambda inside, beyond: beyond / np.maximum(inside + beyond, 1e-300), cone, SMALLEST_ERROR)
    return Integral(found.value, np.maximum(found.error, of_known.error), found.unresolved or of_known.unresolved)


def mirror_cone(plane: Plane) -> Floats | None:
    """(n_λ,) power in the detector's cone about the mirror direction, exactly; None where there is no such cone."""
    at = int(np.abs(plane.theta).argmin())
    return np.pi * np.sin(plane.half) ** 2 * plane.f[at] if plane.half > 0 and abs(plane.theta[at]) < 1e-4 else None


def unresolved_words(plane: Plane, of_cones: bool) -> str:
    """Why an integral is refused, and what helps."""
    theta = plane.folded()[0]
    step = np.degrees(np.diff(theta[:3]).max()) if theta.size > 2 else 90.0
    half = np.degrees(plane.half)
    finer = half if 0 < half < 0.99 * step else step / 2
    energies = ", or let the simulation sum it up (rays; waves with energy = true)" if of_cones else ""
    return (
        f"the lobe is narrower than the step of θ_o about the mirror direction, {step:.3g}°, tells: take a step of "
        f"{finer:.2g}° or less there{energies}, or the hemisphere as detector"
    )


def _integral(plane: Plane, figure: Figure, cone: float, least: float = 0.0) -> Integral:
    theta, f = plane.folded()
    found = _by_rules(theta, f, plane.half, cone, figure)
    value, half_range = np.median(found, axis=0), np.ptp(found, axis=0) / 2
    thinned = _by_rules(theta[::2], f[::2], plane.half, cone, figure) if theta.size > 5 else np.zeros_like(found)
    coarse = np.median(thinned, axis=0)
    numerical = np.hypot(half_range, (coarse - value) / 3)
    covered = theta[0] <= max(plane.half, 1e-4) or plane.half == 0
    fails = (np.sum(numerical) > LARGEST_ERROR * abs(np.sum(value)) and np.mean(numerical) > least) or not covered
    both = [figure(*_linear(*plane.side(sign), cone)) for sign in (-1, 1) if _reaches(plane, sign, theta[-1])]
    unlike = np.abs(both[0] - both[1]) / 2 if len(both) == 2 else np.zeros_like(value)
    return Integral(value, np.hypot(numerical, unlike), bool(fails))


def _reaches(plane: Plane, sign: int, last: float) -> bool:
    side = plane.side(sign)[0]
    return side.size > 2 and bool(side[-1] > 0.98 * last) and bool(side[0] <= max(plane.half, 1e-4))


def _by_rules(theta: Floats, f: Floats, half: float, cone: float, figure: Figure) -> Floats:
    """(3, n_λ) of figure(inside, outside) of the cone, by the three rules."""
    return np.stack([figure(*rule(theta, f, half, cone)) for rule in (_first, _gaussian, _narrowest)])


def _first(theta: Floats, f: Floats, half: float, cone: float) -> tuple[Floats, Floats]:
    return _linear(theta, f, cone)


def _linear(theta: Floats, f: Floats, cone: float) -> tuple[Floats, Floats]:
    return _over(theta, f, 0.0, cone, _line), _over(theta, f, cone, np.pi / 2, _line)


def _gaussian(theta: Floats, f: Floats, half: float, cone: float) -> tuple[Floats, Floats]:
    return _over(theta, f, 0.0, cone, _bell), _over(theta, f, cone, np.pi / 2, _bell)


def _narrowest(theta: Floats, f: Floats, half: float, cone: float) -> tuple[Floats, Floats]:
    """Nothing beyond the last direction, and as little about the mirror direction as the values allow."""
    clear = (theta >= 2 * half - 1e-9) & (theta > 0)
    beyond = clear & (theta >= cone + half - 1e-9)
    if not beyond.any():
        return np.pi * np.sin(half) ** 2 * f[0], np.zeros(f.shape[1])
    in_cone = np.pi * np.sin(half) ** 2 * f[0]
    inside = in_cone + _over(theta[clear], np.minimum(f[clear], f[0]), half, cone, _line)
    return inside, _over(theta[beyond], f[beyond], cone, theta[-1], _line)


def _over(theta: Floats, f: Floats, low: float, high: float, between: Curve) -> Floats:
    """(n_λ,) ∫ f cos θ dω from low to high, rad; beyond the directions f is that of the last one."""
    if high <= low:
        return np.zeros(f.shape[1])
    edges = np.unique(np.concatenate([[low, high], theta[(theta > low) & (theta < high)]]))
    width = np.diff(edges)[:, None] / 2
    x = (edges[:-1, None] + width + width * _NODES).ravel()
    weight = (width * _WEIGHTS).ravel() * np.pi * np.sin(2 * x)
    return weight @ between(x, theta, f)


def _line(x: Floats, theta: Floats, f: Floats) -> Floats:
    """(m, n_λ) f linear in θ."""
    if theta.size == 1:
        return np.broadcast_to(f, (x.size, f.shape[1]))
    right = np.clip(np.searchsorted(theta, x), 1, theta.size - 1)
    t = np.clip((x - theta[right - 1]) / (theta[right] - theta[right - 1]), 0.0, 1.0)[:, None]
    return (1 - t) * f[right - 1] + t * f[right]


def _bell(x: Floats, theta: Floats, f: Floats) -> Floats:
    """(m, n_λ) f whose logarithm is linear in sin²θ."""
    known = np.maximum(f, _TINY * np.maximum(f.max(axis=0), 1e-300))
    return np.exp(_line(np.sin(x) ** 2, np.sin(theta) ** 2, np.log(known)))
