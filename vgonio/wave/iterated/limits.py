"""Where iterated Kirchhoff should not be trusted: said with every result, and by the plan."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...surface.heightfield import Heightfield
from ..quadrature import Floats

NEAR_GRAZING = 0.03  # an order whose cos θ is below this passes off: a Wood anomaly
RESONANT_PERIOD = 3.0  # wavelengths: below, grooves are not many wavelengths wide and guide or resonate
GRATING_PERIOD = 30.0  # wavelengths: what repeats after more is a rough surface, its orders a continuum
SHALLOW = 0.05  # depth in wavelengths below which a short period does no harm
NARROW = 2.0  # wavelengths: walls closer than this do not reflect as planes
CURVATURE = 10.0  # 4π r cos θ over λ that counts as large (Beckmann and Spizzichino 1963)
GRAZING_DEG = 80.0


def limits(surface: Heightfield, theta_i_deg: ArrayLike, wavelength_nm: ArrayLike) -> list[str]:
    """One line for each reason to distrust the tangent plane on this surface, an empty list where there is none."""
    theta = np.atleast_1d(np.asarray(theta_i_deg, float))
    wavelength = np.atleast_1d(np.asarray(wavelength_nm, float)) * 1e-3
    found = [*_grating(surface, theta, wavelength), *_walls(surface, wavelength)]
    radius = _curvature_radius(surface)
    reach = 4 * np.pi * radius * np.cos(np.deg2rad(np.abs(theta).max()))
    if surface.interpolation == "cubic" and reach < CURVATURE * wavelength.max():
        found.append(
            f"RMS radius of curvature {radius:.2g} µm against λ = {wavelength.max():.3g} µm: the tangent plane is out "
            f"of its range (4π r cos θ_i ≥ {CURVATURE:g} λ, Beckmann and Spizzichino 1963)"
        )
    if np.abs(theta).max() > GRAZING_DEG and np.ptp(surface.z) > 0:
        found.append(
            f"θ_i = {np.abs(theta).max():g}°: beyond {GRAZING_DEG:g}° the light creeps along the surface, and edges of "
            "shadows, which are taken as sharp, decide"
        )
    return found


def _grating(surface: Heightfield, theta: Floats, wavelength: Floats) -> list[str]:
    if not (surface.periodic and surface.is_profile) or np.ptp(surface.z) == 0:
        return []
    period, found = surface.period_um or surface.size_um[1], []
    if period > GRATING_PERIOD * wavelength.max():
        return []
    deep = np.ptp(surface.z) > SHALLOW * wavelength.min()
    if deep and period < RESONANT_PERIOD * wavelength.max():
        found.append(
            f"period {period:.3g} µm is {period / wavelength.max():.2g} wavelengths: grooves in the resonance domain "
            "are out of range of any Kirchhoff theory, take the full-wave solver"
        )
    m = np.arange(-int(2 * period / wavelength.min()) - 1, int(2 * period / wavelength.min()) + 2)
    sine = np.sin(np.deg2rad(theta))[:, None, None] + m * wavelength[:, None] / period
    off = np.abs(1 - np.abs(sine)) < NEAR_GRAZING**2 / 2
    for i, w, j in np.argwhere(off)[:3]:
        found.append(
            f"Wood anomaly: order {m[j]} passes off at grazing at θ_i = {theta[i]:g}°, λ = {wavelength[w] * 1e3:g} nm; "
            "the light that it gives to the other orders and to surface waves is not in this theory"
        )
    return found


def _walls(surface: Heightfield, wavelength: Floats) -> list[str]:
    """Narrow grooves with vertical walls."""
    if surface.interpolation != "nearest" or np.ptp(surface.z) == 0:
        return []
    deep = SHALLOW * wavelength.min()
    narrow = _narrowest(surface.z[:1] if surface.is_profile else surface.z, surface.dx, deep)
    if not surface.is_profile:
        narrow = min(narrow, _narrowest(surface.z.T, surface.dy, deep))
    if narrow >= NARROW * wavelength.max():
        return []
    return [
        f"walls {narrow:.3g} µm apart, {narrow / wavelength.max():.2g} wavelengths: between them light is guided, not "
        "reflected as by planes; take the full-wave solver"
    ]


def _narrowest(z: Floats, pitch: float, deep: float) -> float:
    """Least distance in µm between steps of more than `deep` along any row of z; ∞ where no row has two."""
    row, at = np.nonzero(np.abs(np.diff(z, axis=1)) > deep)
    gaps = np.diff(at)[np.diff(row) == 0]
    return float(gaps.min()) * pitch if gaps.size else np.inf


def _curvature_radius(surface: Heightfield) -> float:
    second = [np.diff(surface.z, 2, axis=a) / p**2 for a, p in enumerate(surface.pitch_um) if surface.shape[a] > 2]
    rms = max((float(np.sqrt(np.mean(c**2))) for c in second), default=0.0)
    return 1 / rms if rms > 0 else np.inf
