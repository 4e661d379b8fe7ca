"""Which of the cone's rules a surface needs: is there light in a lobe as narrow as that of a coherence window?

Where the surface is rough and all light diffuse, what a cut lattice adds is speckle, and in the standard error. Where a
mirror direction or orders of a grating stay coherent, every window has the same narrow lobe, and the quadrature has to
be right by itself.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..directions import Detector
from ..surface.heightfield import Heightfield
from .cone import CUT, RULES, Choice, Rule
from .job import Job
from .quadrature import Floats

POINTLIKE = 0.01  # k ℓ sin a of a cone over which a window's lobe is constant to 5e-5, and √tol does for tol / 2
WIDE = 4.0  # a diffuse lobe is wide where its width in q is so many 1/ℓ
LINE = 0.25  # share of the variance in one frequency that makes a grating
WINGS = 6.0  # in 1/ℓ: beyond, a window's lobe is below 1e-6 of its top
LARGE = 30.0  # radius of a cone in 1/ℓ from which a Gauss rule is out of proportion
LITTLE = 50_000  # scattering vectors that are not worth sparing
FEW = 2  # wavelengths up to which rows of their own are cheaper than shared ones


def cone_rules(
    surface: Heightfield, sources: Floats, theory: str, k: Floats, step: float, detector: Detector, tol: float
) -> list[Choice]:
    """A rule for each source (n, 3); wavenumbers k and the lattice's `step` in rad/µm.

    Where it costs little, all light is treated as if it came in narrow lobes. Where diffuse light has a coherent rest
    in the mirror direction, only elements that its lobe reaches have the fine rule.
    """
    a = detector.half_angle_rad
    if k.max() * np.sin(a) / step < max(POINTLIKE, np.sqrt(tol)):
        return [Choice(CUT)] * len(sources)
    sigma, slope = float(np.std(surface.z)), float(np.max(rms_slopes(surface)))
    lines = largest_line(surface) > LINE
    fine = _fine(tol, len(k), float(k.max() * np.sin(a) / step))
    pairs = len(sources) * len(detector)
    little = pairs * float(np.sum((3 * k * np.sin(a) / step + 4) ** 2)) < LITTLE
    found = []
    for wi in sources:
        q_z = 2 * k.min() * (1.0 if theory == "harvey-shack" else wi[2])
        # share of the diffuse light that a cone catches at its brightest, for normally distributed slopes
        diffuse = min(1.0, a**2 / max(8 * slope**2, 1e-300))
        if little or lines or q_z * slope < WIDE * step:
            found.append(Choice(fine))
        elif CUT.error * np.exp(-((q_z * sigma) ** 2)) > tol * diffuse:
            away = np.linalg.norm(detector.directions[:, :2] + wi[:2], axis=1) - np.sin(a)
            found.append(Choice(fine, away * k.min() / step < WINGS if tol >= 1e-4 else None))
        else:
            found.append(Choice(CUT))
    return found


def _fine(tol: float, wavelengths: int, radius: float) -> Rule:
    """radius : of the cone, in 1/ℓ"""
    if radius < LARGE and (wavelengths <= FEW or tol < RULES[2].error):
        return replace(RULES[-1], error=max(tol / 30, RULES[-1].error))
    return RULES[1] if tol >= RULES[1].error else RULES[2]


def cone_attributes(choices: list[Choice]) -> dict[str, float | str]:
    """`cone_rule` in words, and `cone_error`, what the quadrature over a cone is off by relative to the peak."""
    fine = [c for c in choices if c.rule is not CUT]
    if not fine:
        what = "lattice of 1/ℓ cut at the edge: its error is speckle, in brdf_stderr, or the cone is a point"
        return {"cone_rule": what, "cone_error": 0.0}
    some = "" if len(fine) == len(choices) else f" for {len(fine)} of {len(choices)} sources"
    some += "" if any(c.elements is None for c in fine) else " around the mirror direction"
    what = "Gauss over the disc" if fine[0].rule.narrow == np.inf else "lattice with a soft edge"
    return {"cone_rule": f"{what}{some}, for lobes as narrow as a window's", "cone_error": fine[0].rule.error}


def cell_attributes(surface: Heightfield, job: Job, theory: str, step: float, detector: Detector) -> dict[str, float]:
    """`cell_error`: what the few directions in the cells of a hemisphere make of a lobe as narrow as a window's.

    The lobe exp(−q²/step²) of the light that stays in the mirror direction has ∫ ds = π step²/k²; the directions add it
    up to something else. That is weighed with the coherent share of the light in the brightest cell.
    """
    narrow = job.weight * np.exp(-np.sum((job.q[:, :2] / step) ** 2, axis=1)) * job.k**2 / (np.pi * step**2)
    caught = np.einsum("iew,e->iw", job.gather(narrow), detector.projected_solid_angle)
    sigma, slope = float(np.std(surface.z)), float(np.max(rms_slopes(surface)))
    angles, _, wavelengths = job.shape
    largest, k = np.zeros((angles, wavelengths)), np.zeros((angles, wavelengths))
    at = (job.target // (wavelengths * len(detector)), job.wavelength)
    np.maximum.at(largest, at, job.wi[:, 2])
    np.maximum.at(k, at, job.k)
    q_z = 2 * k * (1.0 if theory == "harvey-shack" else largest)
    coherent = np.exp(-((q_z * sigma) ** 2))
    if largest_line(surface) > LINE:
        coherent[:] = 1.0
    coherent = np.where(q_z * slope < WIDE * step, 1.0, coherent)
    # share of the diffuse light in the brightest cell, for normally distributed slopes
    diffuse = min(1.0, float(detector.projected_solid_angle.max()) / max(8 * np.pi * slope**2, 1e-300))
    weighed = coherent / np.maximum(coherent + (1 - coherent) * diffuse, 1e-300)
    return {"cell_error": float(np.max(np.abs(caught - 1) * weighed))}


def rms_slopes(surface: Heightfield) -> Floats:
    """(2,) along x and y; 0 for walls, whose steps have no slope."""
    if surface.interpolation == "nearest":
        return np.zeros(2)
    ip = surface.interpolant
    g = [ip.grid(surface.y, surface.x, dx=1), ip.grid(surface.y, surface.x, dy=1)]
    return np.array([np.sqrt(np.mean(a**2)) for a in g])


def largest_line(surface: Heightfield) -> float:
    """Share of the variance of heights in the strongest single frequency."""
    z = surface.z[:1] if surface.is_profile else surface.z
    power = np.abs(np.fft.fft2(z - z.mean())) ** 2
    total = float(power.sum())
    return float(2 * power.max() / total) if total > 0 else 1.0  # a frequency and its negative are one
