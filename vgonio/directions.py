"""Directions of light: signed in-plane angles, full directions, the source (`Incoming`) and the detector (`Detector`).

Both ω_i and ω_o point away from the surface. In the plane of incidence ω = (sin θ cos φ, sin θ sin φ, cos θ) with a
signed θ and the azimuth φ of the plane: the mirror direction is θ_o = −θ_i, back-scattering is θ_o = θ_i.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InputError, nearest
from .units import degrees, radians

Floats = NDArray[np.float64]
#: Least full angle of a detector cone: below, the solid angle 2π(1 − cos a) is lost in rounding.
MIN_APERTURE_DEG = 1e-4
#: Angles between these are probably in radians: up to π/2, and not so small that they are next to the normal.
RADIANS = (0.1, 1.6)
#: Longest coherence length in µm; its square is still a number that divides others.
MOST_COHERENCE_UM = 1e12
#: What `polarisation` of the light may be; s and p as CONVENTIONS.md has them.
POLARISATIONS = ("unpolarised", "s", "p")


def angle_list(values: ArrayLike, name: str) -> Floats:
    """Angles in degrees as a (n,) array: not empty, finite, |θ| < 90°, none twice; InputError otherwise."""
    a = _numbers(values, name, "degrees", "angle")
    bad = a[~(np.abs(a) < 90.0)]
    if bad.size:
        raise InputError(f"{name} = {bad[0]:g}° is not allowed: angles lie within −90° < θ < 90° (exclusive)")
    return _distinct(a, name, "an angle")


def wavelength_list(values: ArrayLike, name: str = "wavelength_nm") -> Floats:
    """Wavelengths in nm as a (n,) array: not empty, positive, none twice; InputError otherwise."""
    a = _numbers(values, name, "nm", "wavelength")
    if not np.all(np.isfinite(a) & (a > 0)):
        raise InputError(f"{name} holds {a[~(np.isfinite(a) & (a > 0))][0]:g} nm: wavelengths are positive")
    return _distinct(a, name, "a wavelength")


def _numbers(values: ArrayLike, name: str, unit: str, one: str) -> Floats:
    try:
        a = np.atleast_1d(np.asarray(list(values) if isinstance(values, range) else values, dtype=np.float64)).ravel()
    except (TypeError, ValueError):
        raise InputError(f"{name} has to be a number or a list of numbers in {unit}, got {values!r}") from None
    if a.size == 0:
        raise InputError(f"{name} is empty: give at least one {one}")
    return a


def like_radians(values: ArrayLike, name: str) -> str:
    """A line where angles in degrees were probably given in radians, as [0, 0.5236, 1.047]; "" where not.

    theta_i_deg : none beyond π/2, and some that are no whole numbers. Of detectors, "theta_o_deg", that is a narrow
    scan as well: there half of them or more have to be whole degrees in radians and one above 1.
    """
    size = np.abs(np.asarray(values, float))
    size = size[size > 0]
    if size.size == 0 or not RADIANS[0] <= size.max() <= RADIANS[1] or np.all(size == np.round(size)):
        return ""
    whole = np.abs(np.rad2deg(size) - np.round(np.rad2deg(size))) < 0.03
    if name != "theta_i_deg" and (size.max() < 1 or np.mean(whole) < 0.5):
        return ""
    meant = f"{np.rad2deg(size.max()):.3g}°"
    return f"{name} goes up to {size.max():.4g}°: are these radians ({meant})? degrees are expected"


def _distinct(a: Floats, name: str, one: str) -> Floats:
    if np.unique(a).size != a.size:
        raise InputError(f"{name} lists {one} twice: {a.tolist()}")
    return a


def scalar(value: float, name: str) -> float:
    """`value` as one real number, NaN and infinity included; InputError for anything else."""
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {value!r}: one number is needed") from None


def unit_vectors(theta: ArrayLike, phi: ArrayLike = 0.0) -> Floats:
    """(…, 3) unit vectors of polar angle θ (signed in plane) and azimuth φ, both in radians."""
    theta, phi = np.broadcast_arrays(np.asarray(theta, float), np.asarray(phi, float))
    s = np.sin(theta)
    return np.stack([s * np.cos(phi), s * np.sin(phi), np.cos(theta)], axis=-1)


def half_vectors(wi: Floats, wo: Floats) -> Floats:
    """(…, 3) unit half vectors between wi and wo, (…, 3) each, broadcast."""
    h = wi + wo
    return h / np.linalg.norm(h, axis=-1, keepdims=True)


@dataclass(frozen=True)
class Incoming:
    """Incident light: directions of the source and how coherent, divergent and polarised it is.

    theta_deg : (n,) signed polar angles, degrees;  phi_deg : azimuth of the plane of incidence, degrees
    coherence_um : ℓ, standard deviation of the Gaussian amplitude window exp(−r²/2ℓ²), or None for the whole sample
    divergence_deg : full angle of the cone that the source fills;  polarisation : "unpolarised", "s" or "p"
    """

    theta_deg: Floats
    phi_deg: float = 0.0
    coherence_um: float | None = 30.0
    divergence_deg: float = 0.0
    polarisation: str = "unpolarised"

    def __post_init__(self) -> None:
        object.__setattr__(self, "theta_deg", angle_list(self.theta_deg, "theta_i_deg"))
        for key, name in (("phi_deg", "phi_i_deg"), ("divergence_deg", "divergence_deg")):
            object.__setattr__(self, key, scalar(getattr(self, key), name))
        if self.coherence_um is not None:
            object.__setattr__(self, "coherence_um", scalar(self.coherence_um, "coherence_um"))
        if not np.isfinite(self.phi_deg):
            raise InputError(f"phi_i_deg = {self.phi_deg} is not a finite angle in degrees")
        if self.coherence_um is not None and not (np.isfinite(self.coherence_um) and self.coherence_um > 0):
            raise InputError(f"coherence_um = {self.coherence_um} µm: the coherence length has to be positive")
        if self.coherence_um is not None and self.coherence_um > MOST_COHERENCE_UM:
            raise InputError(
                f"coherence_um = {self.coherence_um:g} µm: at most {MOST_COHERENCE_UM:g} µm; None takes the whole "
                "sample as one window"
            )
        if not 0 <= self.divergence_deg < 90:
            raise InputError(f"divergence_deg = {self.divergence_deg}°: allowed is 0 ≤ divergence < 90°")
        if self.polarisation not in POLARISATIONS:
            raise InputError(f"polarisation {self.polarisation!r}: {nearest(self.polarisation, POLARISATIONS)}")

    @cached_property
    def vectors(self) -> Floats:
        """(n, 3) unit vectors towards the source."""
        return unit_vectors(radians(self.theta_deg), radians(self.phi_deg))

    def spread(self, rings: int = 2) -> tuple[Floats, Floats]:
        """Quadrature over the source's cone: (n, m, 3) directions and (m,) weights that sum to 1; m = 1 when parallel.

        Rings of equal solid angle with six directions each; directions below the horizon are left out by the caller.
        """
        if self.divergence_deg == 0:
            return self.vectors[:, None, :], np.ones(1)
        half = radians(self.divergence_deg / 2)
        r = np.arccos(1 - (np.arange(rings) + 0.5) / rings * (1 - np.cos(half)))
        psi = (np.arange(6) + 0.5 * np.arange(rings)[:, None]) * np.pi / 3
        local = unit_vectors(r[:, None], psi).reshape(-1, 3)
        return np.einsum("nij,mj->nmi", frames(self.vectors), local), np.full(len(local), 1.0 / len(local))


def s_axes(w: Floats, phi_deg: float = 0.0) -> Floats:
    """(n, 3) s axes n × ω / |n × ω| of directions ω (n, 3); at the pole ŷ, turned by the azimuth of incidence."""
    s = np.cross([0.0, 0.0, 1.0], w)
    length = np.linalg.norm(s, axis=1, keepdims=True)
    phi = radians(phi_deg)
    across = np.array([-np.sin(phi), np.cos(phi), 0.0])
    return np.where(length > 1e-9, s / np.maximum(length, 1e-300), across)


def frames(w: Floats) -> Floats:
    """(n, 3, 3) rotation matrices whose third column is w (n, 3): local cone coordinates to the world's."""
    a = np.where(np.abs(w[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    t = np.cross(a, w)
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    return np.stack([np.cross(t, w), t, w], axis=-1)


def cone_projected_solid_angle(theta: ArrayLike, half: float) -> Floats:
    """∫ cos θ dω over a circular cone of half-angle `half` around polar angle θ (radians), the part above the horizon.

    π sin²a cos θ where the whole cone is above; otherwise the clipped ellipse sx ≤ … of the direction cosines is
    integrated: in direction cosines cos θ dω = dsx dsy.
    """
    polar = np.abs(np.atleast_1d(np.asarray(theta, float)))
    full = np.pi * np.sin(half) ** 2 * np.cos(polar)
    clipped = polar + half > np.pi / 2
    for i in np.flatnonzero(clipped):
        # rings of the cone: azimuths ψ for which cos θ cos r + sin θ sin r cos ψ > 0
        r = (np.arange(2000) + 0.5) / 2000 * half
        c = np.clip(-1 / (np.tan(polar[i]) * np.tan(r)), -1, 1)
        psi = np.arccos(c)  # half-width of the visible azimuths
        ring = 2 * (psi * np.cos(polar[i]) * np.cos(r) + np.sin(polar[i]) * np.sin(r) * np.sin(psi))
        full[i] = np.sum(ring * np.sin(r)) * half / 2000
    return full


@dataclass(frozen=True)
class Detector:
    """What catches the light: in-plane cones (`kind="in-plane"`) or the cells of a hemisphere (`kind="hemisphere"`).

    directions : (m, 3) unit vectors to the centres;  dims : names of the result's detector dimension
    half_angle_rad : of the cone (in-plane);  rings : edges in θ and cells per ring (hemisphere)
    """

    kind: str
    theta_deg: Floats  # (m,) signed in plane, ≥ 0 on the hemisphere
    phi_deg: Floats  # (m,) azimuths
    dims: tuple[str, ...]
    half_angle_rad: float = 0.0
    ring_edges_rad: Floats = field(default_factory=lambda: np.zeros(0))
    ring_cells: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))

    @staticmethod
    def in_plane(theta_o_deg: ArrayLike, aperture_deg: float, phi_deg: float = 0.0) -> Detector:
        """Cones of full angle `aperture_deg` at the signed angles θ_o of the plane with azimuth φ.

        Raises InputError for an aperture outside MIN_APERTURE_DEG … 90° and for angles that are none.
        """
        theta = angle_list(theta_o_deg, "theta_o_deg")
        aperture_deg = scalar(aperture_deg, "aperture_deg")
        if not MIN_APERTURE_DEG <= aperture_deg <= 90:
            raise InputError(f"aperture_deg = {aperture_deg}°: allowed is {MIN_APERTURE_DEG}° … 90° (the full angle)")
        return Detector(
            "in-plane", theta, np.full(theta.shape, float(phi_deg)), ("theta_o",), float(radians(aperture_deg / 2))
        )

    @staticmethod
    def hemisphere(resolution_deg: float = 5.0) -> Detector:
        """Cells of nearly equal solid angle: a cap around the pole, then rings of height `resolution_deg`.

        Raises InputError outside 0.25 … 45°.
        """
        resolution_deg = scalar(resolution_deg, "resolution_deg")
        if not 0.25 <= resolution_deg <= 45:
            raise InputError(f"resolution_deg = {resolution_deg}°: allowed is 0.25° … 45°")
        rings = max(2, round((90 - resolution_deg / 2) / resolution_deg) + 1)
        edges = np.concatenate([[0.0], resolution_deg / 2 + (90 - resolution_deg / 2) * np.arange(rings) / (rings - 1)])
        edges[-1] = 90.0
        area = np.cos(radians(edges[:-1])) - np.cos(radians(edges[1:]))
        cells = np.maximum(1, np.rint(area / area[0] / 1.0)).astype(np.int64)
        cells = np.where(np.arange(rings) == 0, 1, np.maximum(4, cells))
        theta = np.repeat(degrees(np.arccos((np.cos(radians(edges[:-1])) + np.cos(radians(edges[1:]))) / 2)), cells)
        theta[0] = 0.0
        phi = np.concatenate([(np.arange(n) + 0.5) * 360.0 / n if n > 1 else np.zeros(1) for n in cells])
        return Detector("hemisphere", theta, phi, ("cell",), 0.0, radians(edges), cells)

    @cached_property
    def directions(self) -> Floats:
        """(n, 3) unit vectors of the middles of cones or cells."""
        return unit_vectors(radians(self.theta_deg), radians(self.phi_deg))

    def __len__(self) -> int:
        return self.theta_deg.size

    @cached_property
    def _ring_start(self) -> NDArray[np.int64]:
        return np.concatenate([[0], np.cumsum(self.ring_cells)])

    @cached_property
    def solid_angle(self) -> Floats:
        """(m,) solid angles in sr (of the whole cone in plane)."""
        if self.kind == "in-plane":
            return np.full(len(self), 2 * np.pi * (1 - np.cos(self.half_angle_rad)))
        ring = 2 * np.pi * -np.diff(np.cos(self.ring_edges_rad)) / self.ring_cells
        return np.repeat(ring, self.ring_cells)

    @cached_property
    def projected_solid_angle(self) -> Floats:
        """(m,) ∫ cos θ dω over each element, in sr."""
        if self.kind == "in-plane":
            return cone_projected_solid_angle(radians(self.theta_deg), self.half_angle_rad)
        ring = np.pi * np.diff(np.sin(self.ring_edges_rad) ** 2) / self.ring_cells
        return np.repeat(ring, self.ring_cells)

    def catch(self, d: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Which element catches which direction: pairs (index into d, element) for d (n, 3) unit vectors, d_z > 0.

        Cones may overlap, so a direction can appear more than once; cells of a hemisphere do not.
        """
        if self.kind == "hemisphere":
            theta = np.arccos(np.clip(d[:, 2], -1, 1))
            ring = np.clip(np.searchsorted(self.ring_edges_rad, theta, side="right") - 1, 0, len(self.ring_cells) - 1)
            n = self.ring_cells[ring]
            turn = np.arctan2(d[:, 1], d[:, 0]) / (2 * np.pi) % 1.0
            cell = np.minimum((turn * n).astype(np.int64), n - 1)
            return np.arange(len(d)), self._ring_start[ring] + cell
        p = radians(self.phi_deg[0])
        near = np.flatnonzero(np.abs(d[:, 1] * np.cos(p) - d[:, 0] * np.sin(p)) <= np.sin(self.half_angle_rad))
        ray, element = np.nonzero(d[near] @ self.directions.T >= np.cos(self.half_angle_rad))
        return near[ray], element
