"""From vector fields on a patch to its far field, in the frames and units of vector Kirchhoff (`polarisation.py`)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...directions import Detector, Incoming
from ...materials import Material
from ...surface.heightfield import Heightfield
from ..coherence import Window
from ..job import Job, detector_job
from ..polarisation import VectorKirchhoff
from ..quadrature import Complex, Floats
from .patch import Patch, all_reflections
from .profile import Reflections

BLOCK, BYTES = 96, 2.5e8  # directions whose phases are held together, at most, and their bytes
PER_SPECKLE = 5.0  # direction cosines of the energies are λ/(5ℓ) apart: alias of the window's correlation exp(−25/4)


def far_sums(
    patch: Patch, fields: list[Floats], wo: Floats, k: float, progress: Callable[[float], None] | None = None
) -> Complex:
    """(reflections, 12, m) sums of N × E and N × H over the points that see each of wo (m, 3); 12 = 2 incident × 6."""
    waves, sheet, share = patch.far(wo)
    flat = np.concatenate([waves.padded(f).reshape(24, -1) for f in fields]) * np.float32(patch.grid.pitch**2)
    n = flat.shape[1]
    out = np.empty((len(wo), len(flat) // 2), np.complex128)
    block = int(np.clip(BYTES / (8 * n), 1, BLOCK))
    for a in range(0, len(wo), block):
        part = slice(a, a + block)
        both = waves(wo[part], k, sheet[part], share[part]).reshape(-1, n) @ flat.T  # cosines, then sines
        c, s = np.split(both, 2)
        out[part].real = c[:, 0::2] + s[:, 1::2]
        out[part].imag = c[:, 1::2] - s[:, 0::2]
        if progress:
            progress(min(1.0, (a + block) / len(wo)))
    # phases counted from the middle of the patch: what that leaves out has magnitude one and is the same for all
    return np.moveaxis(out.reshape(len(wo), len(fields), 12), 0, -1)


def hemisphere(wavelength: float, length: float) -> tuple[Floats, float]:
    """Directions (m, 3) on a square grid of direction cosines, and the area of one of its cells."""
    step = wavelength / (PER_SPECKLE * length)
    count = 2 * int(np.ceil(1 / step))
    s = (np.arange(count) + 0.5) / count * 2 - 1
    sx, sy = (a.ravel() for a in np.meshgrid(s, s))
    up = sx**2 + sy**2 < 1 - 1e-9
    w = np.stack([sx[up], sy[up], np.sqrt(1 - sx[up] ** 2 - sy[up] ** 2)], axis=1)
    return w, (2 / count) ** 2


def energy_job(wi: Floats, wo: Floats, cell: float, k: float) -> Job:
    """A job of one source whose single element is the whole hemisphere: weight cos θ_o dω."""
    m = len(wo)
    return Job(
        k * (wi + wo), np.full(m, k), wo, np.zeros(m, np.int64), wi[None], np.arange(m), wo, np.full(m, cell),
        np.zeros(m, np.int64), (1, 1, 1), sums=True,
    )  # fmt: skip


def brdf_of(sums: Complex, job: Job, model: VectorKirchhoff, area: float) -> Floats:
    """(reflections + 1, 17, *job.shape) BRDF and Mueller matrix of each reflection, then of their coherent sum.

    sums : (reflections, 12, m) of one source
    """
    both = np.concatenate([sums, sums.sum(axis=0)[None]])
    values = np.stack([model.intensity(one, job) for one in both]) * (job.prefactor / area)
    return job.gather(job.weight * values)


def patch_reflections(
    surface: Heightfield, window: Window, incoming: Incoming, detector: Detector, material: Material,
    wavelength_nm: float, spacing: float, bounces: int, tol: float, seed: int,
    progress: Callable[[float], None] | None = None, energies: bool = True, blocks: bool = False,
) -> tuple[Reflections, Patch]:  # fmt: skip
    """All reflections of one window and wavelength, and the patch they were found on. Without `energies`, those are 0;
    with `blocks`, points far from each other are taken together."""
    phi = float(np.deg2rad(incoming.phi_deg))
    patch = Patch.of(surface, window, spacing, phi)
    k = 2 * np.pi / (wavelength_nm * 1e-3)
    job = detector_job(incoming, detector, np.array([k]), 1 / window.length, "kirchhoff", seed)
    model = VectorKirchhoff(material, incoming.polarisation, incoming.phi_deg)
    angles = len(incoming.theta_deg)
    found = np.zeros((bounces + 1, 17, angles, len(detector)))
    energy, used, worst = np.zeros((bounces + 1, angles)), 0, 0.0
    sphere, cell = hemisphere(wavelength_nm * 1e-3, window.length)
    for i, wi in enumerate(incoming.vectors):

        def part(share: float, start: float = 0.0, i: int = i) -> None:
            if progress:
                progress((i + start + share) / angles)

        fields, error = all_reflections(
            patch, wi, k, material, wavelength_nm, incoming.phi_deg, bounces, tol, blocks, lambda f: part(f / 2)
        )
        worst = max(worst, error)
        one = job.some(np.flatnonzero(job.source == i))
        values = brdf_of(far_sums(patch, fields, one.wo, k), one, model, patch.area)
        n = len(fields)
        found[:n, :, i], found[-1, :, i] = values[:n, :, i, :, 0], values[n, :, i, :, 0]
        used = max(used, n)
        if detector.kind == "hemisphere":
            energy[:, i] = found[:, 0, i] @ detector.projected_solid_angle
        elif energies:
            whole = energy_job(wi, sphere, cell, k)
            sums = far_sums(patch, fields, sphere, k, lambda f: part(f / 2, 0.5))
            powers = brdf_of(sums, whole, model, patch.area)[:, 0, 0, 0, 0]
            energy[:n, i], energy[-1, i] = powers[:n], powers[n]
    caught = np.array([patch.caught(wi) for wi in incoming.vectors])
    return Reflections(found[:, 0], energy, used, found[-1, 1:], caught, pairs_error=worst), patch
