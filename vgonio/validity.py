"""Where the scalar wave theories should not be trusted: figures of the surface against criteria from the literature."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .surface.statistics import parameters, slopes
from .wave.trust import NOTABLE, PHASE, SMITH_LIMIT, STEEP_DEG, STEEP_SHARE

if TYPE_CHECKING:
    from .surface import Heightfield
    from .wave.trust import Expectation

CURVATURE_FACTOR = 10.0  # "much larger" of Beckmann and Spizzichino 1963: 4π r cos θ ≫ λ
FEW_WINDOWS = 10  # speckle of ten windows is a third of the BRDF


def steep_share(surface: Heightfield) -> float:
    """Share of the projected area that is steeper than STEEP_DEG."""
    zx, zy = slopes(surface)
    return float(np.mean(np.hypot(zx, zy) > np.tan(np.deg2rad(STEEP_DEG))))


def curvature_radius_um(surface: Heightfield) -> float:
    """One over the RMS curvature along the axes, µm; infinite for planes."""
    second = [np.diff(surface.z, 2, axis=a) / p**2 for a, p in enumerate(surface.pitch_um) if surface.shape[a] > 2]
    rms = max((float(np.sqrt(np.mean(c**2))) for c in second), default=0.0)
    return 1 / rms if rms > 0 else np.inf


def wave_warnings(
    surface: Heightfield, theories: list[str], light: Any, largest_theta_o: float, shadowing: bool = False
) -> list[str]:
    """One line for every criterion that the surface, the angles or the coherence length fail."""
    angles = max(float(np.max(np.abs(light.theta_i_deg))), largest_theta_o)
    once = not set(theories) <= {"iterated-kirchhoff", "full-wave"}
    found = [
        *rigorous_warnings(surface, theories, light),
        *(_steep(surface) if once else ()),
        *(_grazing(surface, angles) if once and not shadowing else ()),
        *(_curved(surface, float(np.max(np.abs(light.theta_i_deg))), max(light.wavelength_nm)) if once else ()),
        *_unresolved(surface, light, largest_theta_o),
        *_coherence(surface, light.coherence_um),
    ]
    if "iterated-kirchhoff" in theories:
        from .wave.iterated.limits import limits

        found += limits(surface, light.theta_i_deg, light.wavelength_nm)
    if "harvey-shack" in theories:
        factor = 2 / (2 * np.cos(np.deg2rad(min(angles, 89.0))))
        if factor > PHASE:
            found.append(
                f"harvey-shack takes q_z = 2k at every angle, up to {factor:.1f} times the phase of the other theories "
                f"at {angles:g}°: trust it near the normal only"
            )
    return found


def expectations(surface: Heightfield, theories: list[str], light: Any) -> list[Expectation]:
    """The worst error to expect of each theory over the scene's angles and its shortest and longest wavelength."""
    return [max(cases, key=lambda e: e.error[1]) for cases in _expected(surface, theories, light)]


def _expected(surface: Heightfield, theories: list[str], light: Any) -> list[list[Expectation]]:
    """For each theory of the table one for every angle and the shortest and longest wavelength; none for a plane."""
    from .wave import trust

    grating = trust.equivalent_grating(surface)
    if grating[1] == 0:
        return []
    ends = sorted({min(light.wavelength_nm), max(light.wavelength_nm)})
    cases = [(float(t), float(w)) for t in sorted({abs(t) for t in light.theta_i_deg}) for w in ends]
    return [[trust.expected(t, *grating, *c) for c in cases] for t in theories if t in trust.THEORIES]


def rigorous_warnings(surface: Heightfield, theories: list[str], light: Any) -> list[str]:
    """Theories that are off by more than NOTABLE on rigorous gratings like this surface; none where none is like it."""
    from .wave.trust import equivalent_grating

    inside = [[e for e in cases if not e.outside] for cases in _expected(surface, theories, light)]
    found = [max(cases, key=lambda e: e.error[1]) for cases in inside if cases]
    shape, depth, period = equivalent_grating(surface)
    return [
        f"{e}; a {shape} grating of depth {depth:.3g} µm and period {period:.3g} µm was taken for it"
        for e in found
        if e.error[1] > NOTABLE
    ]


def outside_of_the_table(surface: Heightfield, theories: list[str], light: Any) -> str:
    """Why rigorous gratings say little about this surface, in words; "" where they do say something."""
    from .wave.trust import equivalent_grating

    outside = {line for cases in _expected(surface, theories, light) for e in cases for line in e.outside}
    if not outside:
        return ""
    shape, depth, period = equivalent_grating(surface)
    return (
        f"no rigorous grating is like this surface (as a {shape} one, depth {depth:.3g} µm, period {period:.3g} µm): "
        f"{', '.join(sorted(outside))}"
    )


def _steep(surface: Heightfield) -> list[str]:
    share = steep_share(surface)
    if share <= STEEP_SHARE or surface.interpolation == "nearest":
        return []
    return [
        f"{share:.1%} of the surface is steeper than {STEEP_DEG:g}° and reflects light onto its neighbours: "
        "the wave theories hold single reflections only, compare with the rays' higher bounces"
    ]


def _grazing(surface: Heightfield, largest: float) -> list[str]:
    a = parameters(surface)["alpha"]
    limit = float(np.rad2deg(np.arctan(1 / (SMITH_LIMIT * a)))) if a > 0 else 90.0
    if largest <= limit or surface.interpolation == "nearest":
        return []
    return [
        f"shadowing matters beyond {limit:.0f}° (slope α = {a:.3g}; Smith 1967) and is not asked for: expect "
        f"too much light at angles up to {largest:g}°, or set wave.shadowing = true"
    ]


def _curved(surface: Heightfield, largest_theta_i: float, wavelength_nm: float) -> list[str]:
    radius = curvature_radius_um(surface)
    reach = 4 * np.pi * radius * np.cos(np.deg2rad(largest_theta_i))
    if reach >= CURVATURE_FACTOR * wavelength_nm * 1e-3 or surface.interpolation == "nearest":
        return []
    return [
        f"RMS radius of curvature {radius:.2g} µm is small for the tangent plane at θ_i = {largest_theta_i:g}° and "
        f"{wavelength_nm:g} nm: 4π r cos θ should be well above λ (Beckmann and Spizzichino 1963)"
    ]


def _unresolved(surface: Heightfield, light: Any, largest_theta_o: float) -> list[str]:
    """A smooth surface scatters by its spectral density at q; beyond the samples' it is the interpolant's."""
    shortest = min(light.wavelength_nm) * 1e-3
    smooth = 4 * np.pi * float(np.std(surface.z)) < shortest
    reach = np.sin(np.deg2rad(largest_theta_o)) + np.max(np.abs(np.sin(np.deg2rad(light.theta_i_deg))))
    resolved = shortest / (2 * max(surface.pitch_um))
    grating = surface.periodic and surface.is_profile
    if not smooth or reach <= resolved or grating or np.ptp(surface.z) == 0:
        return []
    return [
        f"roughness finer than {2 * max(surface.pitch_um):g} µm is not in the samples: beyond "
        f"|sin θ_i + sin θ_o| = {resolved:.2g} (at {shortest * 1e3:g} nm) the scatter is the interpolant's"
    ]


def _coherence(surface: Heightfield, coherence_um: float) -> list[str]:
    from .wave.coherence import REACH, independent, tile

    side = surface.size_um[1] if surface.shape[0] == 1 else min(surface.size_um)
    if not surface.periodic and 2 * REACH * coherence_um > side:
        return [
            f"the coherence window (ℓ = {coherence_um:g} µm, {REACH:g} ℓ to each side) is larger than the sample's "
            f"{side:g} µm: it is cut, choose a smaller coherence_um or a larger sample"
        ]
    count = independent(tile(surface, coherence_um), surface)
    if count < FEW_WINDOWS and not (surface.periodic and surface.is_profile):
        return [
            f"the coherence windows that fit on the sample overlap and are worth about {count:.0f} independent "
            "coherence windows: expect speckle"
        ]
    return []
