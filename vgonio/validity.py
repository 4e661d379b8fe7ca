"""Where the scalar wave theories should not be trusted: figures of the surface against criteria from the literature."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from .surface.statistics import parameters, slopes
from .wave.trust import NOTABLE, PHASE, SMITH_LIMIT, STEEP_DEG, STEEP_SHARE

if TYPE_CHECKING:
    from .surface import Heightfield
    from .wave.trust import Expectation

CURVATURE_FACTOR = 10.0  # "much larger" of Beckmann and Spizzichino 1963: 4π r cos θ ≫ λ
S_FILTER = re.compile(r"S-filter ([\d.eE+-]+) µm")  # as surface.filter writes it into the history
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
    surface: Heightfield,
    theories: list[str],
    light: Any,
    largest_theta_o: float,
    shadowing: bool = False,
    material: str | None = None,
) -> list[str]:
    """One line for every criterion that the surface, the angles or the coherence length fail."""
    angles = max(float(np.max(np.abs(light.theta_i_deg))), largest_theta_o)
    once = not set(theories) <= {"iterated-kirchhoff", "full-wave"}
    found = [
        *rigorous_warnings(surface, theories, light, material),
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


def expectations(
    surface: Heightfield, theories: list[str], light: Any, material: str | None = None
) -> list[Expectation]:
    """What is worst for each theory over the scene's angles and its shortest and longest wavelength.

    A case that no test is like is worse than any error.
    """
    found = _expected(surface, theories, light, material)
    return [max(cases, key=lambda e: (e.basis == "none", e.error[1])) for cases in found]


def _expected(surface: Heightfield, theories: list[str], light: Any, material: str | None) -> list[list[Expectation]]:
    """For each scalar theory one for every angle and the shortest and longest wavelength; none for a plane."""
    from .wave import trust

    grating = trust.equivalent_grating(surface)
    if grating[1] == 0:
        return []
    ends = {w: trust.is_metal(material, w) for w in sorted({min(light.wavelength_nm), max(light.wavelength_nm)})}
    cases = [
        (float(t), float(w), metal) for t in sorted({abs(t) for t in light.theta_i_deg}) for w, metal in ends.items()
    ]
    return [[trust.expected(t, *grating, *c) for c in cases] for t in theories if t in trust.THEORIES]


def rigorous_warnings(surface: Heightfield, theories: list[str], light: Any, material: str | None = None) -> list[str]:
    """Theories that are off by more than NOTABLE on tested surfaces like this one, or that no test speaks for."""
    found = []
    for cases in _expected(surface, theories, light, material):
        known = [e for e in cases if e.basis != "none"]
        found += [max(known, key=lambda e: e.off)] if known else []
        untested = [e for e in cases if e.basis == "none"]
        found += [max(untested, key=lambda e: (e.theta_i_deg, -e.wavelength_nm))] if untested else []
    return [str(e) for e in found if not e.off <= NOTABLE]


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
    """What roughness between the samples may do, if light sees it: periods from λ over the largest |sin θ_i + sin θ_o|.

    A smooth surface scatters there by its interpolant alone; on a rough one that was measured, what the instrument did
    not resolve adds to it. A generated surface has no more than it was given.
    """
    shortest = min(light.wavelength_nm) * 1e-3
    reach = float(np.sin(np.deg2rad(largest_theta_o)) + np.max(np.abs(np.sin(np.deg2rad(light.theta_i_deg)))))
    finest = resolved_um(surface)
    generated = any(line.startswith("generated") for line in surface.history)
    if generated or reach <= shortest / finest or (surface.periodic and surface.is_profile) or np.ptp(surface.z) == 0:
        return []
    if 4 * np.pi * float(np.std(surface.z)) < shortest:
        return [
            f"roughness finer than {finest:g} µm is not in the samples: beyond "
            f"|sin θ_i + sin θ_o| = {shortest / finest:.2g} (at {shortest * 1e3:g} nm) the scatter is the interpolant's"
        ]
    if not any(line.startswith("read ") for line in surface.history):
        return []
    return [
        f"roughness finer than {finest:g} µm is not in this measured surface (pitch, filter), and light of "
        f"{shortest * 1e3:g} nm sees it down to {shortest / reach:.2g} µm: on blasted metal 10 nm RMS of it decided "
        "back-scattering and its colour, and made forward scattering reddish (docs/wavelength_shift.md)"
    ]


def resolved_um(surface: Heightfield) -> float:
    """The shortest period that a surface holds, µm: two samples, or the cut-off of an S-filter where that is more."""
    cut = [float(c) for line in surface.history for c in S_FILTER.findall(line)]
    return max([2 * max(surface.pitch_um), *cut])


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
