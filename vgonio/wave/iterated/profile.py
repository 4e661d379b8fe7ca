"""Reflections of one window on a profile: the curve and what it sees, fields of each, powers and energies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...materials import Material
from ...surface.heightfield import Heightfield
from ..polarisation import PAULI
from ..quadrature import Complex, Floats
from .beam import Beam
from .curve import Curve, joined, sample_curve
from .diffraction import Diffraction, diffracted
from .far_field import Directions, far_amplitudes
from .propagate import POLARISATIONS, Pairs, pair_operators
from .sight import Sight, look, mean_height

WEIGHTS = {"s": {"TE": 1.0, "TM": 0.0}, "p": {"TE": 0.0, "TM": 1.0}, "unpolarised": {"TE": 0.5, "TM": 0.5}}


@dataclass(frozen=True, eq=False)
class Stretch:
    """The lit part of a profile: its points, what they see, and the light on them.

    Neighbouring parts of a larger profile cast shadows on it, but send no light to it.
    """

    curve: Curve
    sight: Sight
    beam: Beam

    @staticmethod
    def of(surface: Heightfield, beam: Beam, spacing: float) -> Stretch:
        """Points no more than `spacing` µm apart over ± beam.half, shadows from as much again on either side."""
        lo, hi = beam.centre - beam.half, beam.centre + beam.half
        curve = sample_curve(surface, lo, hi, spacing)
        side = surface.size_um[1]
        reach = beam.half if np.ptp(surface.z) > 0 else 0.0
        left = lo - reach if surface.periodic else max(0.0, lo - reach)
        right = hi + reach if surface.periodic else min(side, hi + reach)
        parts = [(left, lo), (lo, hi), (hi, right)]
        found = [
            curve if part == (lo, hi) else sample_curve(surface, *part, 2 * spacing) if part[1] - part[0] > spacing
            else curve.cut(slice(0, 0))
            for part in parts
        ]  # fmt: skip
        first = len(found[0])
        sight = look(joined(found), first, first + len(curve))
        inside = (sight.source >= first) & (sight.source < first + len(curve))
        return Stretch(curve, Sight(sight.row[inside], sight.source[inside] - first, sight.right, sight.left), beam)

    @property
    def steepest(self) -> float:
        """Angle of the steepest piece against the horizontal, radians."""
        return float(np.arccos(np.clip(self.curve.nz.min(), 0, 1)))

    def incident(self, k: float, theta: Floats) -> tuple[Complex, Complex]:
        """u and ∂u/∂n of the light alone, (n, len(theta)) each."""
        return self.beam.field(self.curve, k, theta, self._level(theta), self.again(theta))

    def _level(self, theta: Floats) -> Floats:
        """(len(theta),) mean height at which the light meets the profile, around the middle of the beam."""
        weight = self.beam.window(self.curve.x - self.beam.centre) ** 2
        return np.array([mean_height(self.curve.x, self.curve.z, weight, float(t)) for t in theta])

    def facing(self, theta: Floats) -> Floats:
        """(len(theta), n) cosine between normals and directions."""
        return np.sin(theta)[:, None] * self.curve.nx + np.cos(theta)[:, None] * self.curve.nz

    def footprint(self, theta: Floats) -> Floats:
        """(len(theta),) share of the light's power that meets the lit part were it alone, a continuous line."""
        if self.beam.kind == "tapered":
            return np.ones(len(theta))
        along = self.curve.x - self.beam.centre
        across = along - (self.curve.z - self._level(theta)[:, None]) * np.tan(theta)[:, None]
        return np.array([self.beam.share(float(row.min()), float(row.max())) for row in across])

    def again(self, theta: Floats) -> NDArray[np.bool_]:
        """(len(theta),) bool: where light can meet the profile a second time, |θ| + 3 × the steepest slope ≥ 90°."""
        return np.abs(theta) + 3 * self.steepest >= np.pi / 2


@dataclass(frozen=True)
class Light:
    """One wavelength and polarisation: k in rad/µm, angles of incidence (t,) in radians, "TE" or "TM", the material."""

    k: float
    theta: Floats
    polarisation: str
    material: Material
    wavelength_nm: float

    def first(self, stretch: Stretch, shadowing: bool) -> tuple[Complex, Complex]:
        """u = (1 + r) u_inc and ∂u/∂n = (1 − r) ∂u_inc/∂n where the source is seen, (n, t) each."""
        curve = stretch.curve
        u, v = stretch.incident(self.k, self.theta)
        cosine = stretch.facing(self.theta).T
        r = self.material.amplitudes(np.clip(cosine, 0, 1), self.wavelength_nm)[POLARISATIONS[self.polarisation]]
        lit = stretch.sight.seen(curve, self.theta).T if shadowing else np.ones(cosine.shape, bool)
        return np.where(lit, (1 + r) * u, 0), np.where(lit, (1 - r) * v, 0)

    def pairs(self, stretch: Stretch) -> Pairs:
        return pair_operators(
            stretch.curve, stretch.curve, stretch.sight, self.k, self.material, self.wavelength_nm, self.polarisation
        )


@dataclass(frozen=True, eq=False)
class Reflections:
    """What one window sends out, relative to its incident power: BRDF and energy, of each and of their sum.

    brdf : (bounces + 2, t, elements), the last but one the coherent sum, the last that with diffraction
    energy : (bounces + 2, t);  used : bounces done;  mueller : (16, t, elements) of the last of brdf, row by row
    caught : (t,) power that the lit points receive, over that of the same window on a flat surface
    sight_error : of a patch, share of pairs that face each other whose sight is judged otherwise by a march along the
        line between them; 0 on profiles, whose sight is exact between the points
    pairs_error : of a patch, largest error of the fields of a reflection by taking blocks of points together
    """

    brdf: Floats
    energy: Floats
    used: int
    mueller: Floats
    caught: Floats
    sight_error: float = 0.0
    diffraction: Diffraction = Diffraction()
    pairs_error: float = 0.0


def fields(stretch: Stretch, light: Light, bounces: int, tol: float, shadowing: bool) -> tuple[Complex, Complex]:
    """Fields u, v (n, t, reflections), up to `bounces` or until the mean square of the next on the
    surface is no more than `tol` of the first."""
    u, v = light.first(stretch, shadowing)
    found = [(u, v)]
    on = np.flatnonzero(stretch.again(light.theta)) if stretch.sight.row.size else np.zeros(0, int)
    pairs = light.pairs(stretch) if bounces > 1 and on.size else None
    u, v = u[:, on], v[:, on]
    first = _strength(stretch, light, u, v)
    while pairs is not None and len(found) < bounces:
        u, v = pairs.next(u, v)
        if np.all(_strength(stretch, light, u, v) <= tol * first):
            break
        wide = [np.zeros_like(found[0][0]) for _ in range(2)]
        wide[0][:, on], wide[1][:, on] = u, v
        found.append((wide[0], wide[1]))
    return np.stack([f[0] for f in found], axis=-1), np.stack([f[1] for f in found], axis=-1)


def _strength(stretch: Stretch, light: Light, u: Complex, v: Complex) -> Floats:
    return stretch.curve.ds @ (np.abs(u) ** 2 + np.abs(v / light.k) ** 2)


def reflect(
    stretch: Stretch, lights: dict[str, Light], polarisation: str, to: Directions, bounces: int, tol: float,
    shadowing: bool = True, sweeps: int = 0,
) -> Reflections:  # fmt: skip
    """All reflections of light of some polarisation, from those of `lights`: "TE", "TM" or both.

    sweeps : at most so many for diffraction (`sweeps.sweep`), none where `bounces` is 1
    """
    some = next(iter(lights.values()))
    k, theta = some.k, some.theta
    share = np.array([WEIGHTS[polarisation][name] for name in lights])
    seen = stretch.sight.seen(stretch.curve, to.theta) if shadowing else None
    incident = stretch.beam.power(k, theta)[:, None]
    series = [fields(stretch, light, bounces, tol, shadowing) for light in lights.values()]
    most = max(u.shape[-1] for u, _ in series)
    u, v = (np.stack([_padded(s[i], most) for s in series], axis=1) for i in (0, 1))
    far = far_amplitudes(stretch.curve, u, v, k, to.theta, seen)  # (m, lights, t, reflections)
    total = far.sum(axis=-1)
    caught = _caught(stretch, theta, k) if shadowing else np.ones(len(theta))
    whole, done = total, Diffraction()
    if sweeps and bounces > 1 and shadowing:
        start = u.sum(axis=-1), v.sum(axis=-1)
        whole, done = diffracted(stretch, list(lights.values()), start, total, to.theta, sweeps, tol)
        on = np.array(done.swept, bool)
        whole[..., on] *= np.sqrt(caught / np.maximum(stretch.footprint(theta), 1e-300))[
            on
        ]  # neighbours cast no shadows in the sweeps
    power = np.zeros((bounces + 2, len(theta), len(to.theta)))
    power[:most] = np.einsum("mltb,l->btm", np.abs(far) ** 2, share) / incident
    for row, amplitude in ((-2, total), (-1, whole)):
        power[row] = np.einsum("mlt,l->tm", np.abs(amplitude) ** 2, share) / incident
    return Reflections(
        to.means(power), to.total(power), most, to.means(_mueller(whole) / incident), caught, diffraction=done
    )


def _caught(stretch: Stretch, theta: Floats, k: float) -> Floats:
    """Power that the lit points receive over that of the window. A tapered beam meets the surface with all it has."""
    if stretch.beam.kind == "tapered":
        return np.ones(len(theta))
    curve = stretch.curve
    received = np.abs(stretch.incident(k, theta)[0].T) ** 2 * stretch.facing(theta) * stretch.sight.seen(curve, theta)
    return received @ curve.ds / stretch.beam.power(k, theta)


def _mueller(far: Complex) -> Floats:
    """(16, t, m) Mueller matrices from amplitudes (m, lights, t) of TE and TM; zeros where one of them is missing.

    E_y is the s component of both beams, H_y minus the p component of the reflected one (p = ω × s), so the Jones
    matrix is diag(TE, −TM).
    """
    if far.shape[1] < 2:
        return np.zeros((16, far.shape[2], far.shape[0]))
    jones = np.zeros((2, 2, *far[:, 0].T.shape), np.complex128)
    jones[0, 0], jones[1, 1] = far[:, 0].T, -far[:, 1].T
    found = np.einsum("iab,bctm,jcd,adtm->ijtm", PAULI, jones, PAULI, jones.conj()).real / 2
    return found.reshape(16, *found.shape[2:])


def _padded(a: Complex, count: int) -> Complex:
    return np.concatenate([a, np.zeros((*a.shape[:-1], count - a.shape[-1]), a.dtype)], axis=-1)
