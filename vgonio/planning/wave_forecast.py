"""What a scalar wave theory will take: counts of its windows, rows and scattering vectors, times a machine's speeds.

The windows, the cone's rules and the scattering vectors are those of the solver itself; only the spacing of the points,
which it finds by trial, is taken as its first guess half a step finer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..accuracy.speeds import Speeds
from ..directions import Detector, Incoming
from ..surface import Heightfield
from ..units import wavenumber
from ..wave import Kirchhoff, effort, fourier, planes, windowed
from ..wave.coherence import WindowPlan
from ..wave.cone import Choice
from ..wave.energy import NODES, REPLICATES
from ..wave.job import Job, detector_job, parallel
from ..wave.lobes import cone_rules
from ..wave.quadrature import choose_rule, rates
from ..wave.spreading import OVERSAMPLING, Band, Kernel
from .forecast import LEAST_WAVE_TOL, Forecast

Floats = NDArray[np.float64]
STEP = 1.14  # points are that much closer in the end: one step of 1.3 in half of the cases
ROUNDS, FURTHER = 1.5, 1.5  # trials of the spacing; more of them where transforms have to be tighter as well
ANGLES, WAVELENGTHS = 3, 6  # of which the scattering vectors are counted; the others are like them
CHECKED = 512  # scattering vectors of a trial at most
SHADOW_TRIALS = 5.0  # windows that are summed to find how sharp shadows have to be
SHARPENED = 1.7  # points are so much closer for that, beyond `effort.SHARPER`
KINDS = 1.0  # kinds of points, those that the same directions see, to a pair of source and detector element
ONCE = 25  # times as long as in a window takes what is done once for each scattering vector
VECTOR_BYTES, POINT_BYTES, TRIAL_BYTES = 330.0, 40.0, 140.0


@dataclass(frozen=True)
class Counts:
    """What all windows together are asked for.

    windows, groups : coherence windows, and rows of them across;  independent : their effective number
    points : (along y, along x) of one window;  columns : points along the whole of x
    vectors : scattering vectors;  rows : levels of q_y, and those of one wavelength;  checked : vectors of a trial,
    and their rows
    q : some of the scattering vectors (m, 3);  room : median of speckles of a window that an element has room for
    """

    windows: int
    groups: int
    independent: float
    points: tuple[float, float]
    columns: float
    vectors: float
    rows: float
    rows_each: float
    checked: tuple[float, float]
    q: Floats
    room: float

    @property
    def size(self) -> float:
        return self.points[0] * self.points[1]


def wave_forecast(
    solver: Kirchhoff, surface: Heightfield, incoming: Incoming, detector: Detector, speeds: Speeds
) -> Forecast:
    """Of `solver.scatter(surface, incoming, detector)`; raises what it would raise for too many windows."""
    plan = WindowPlan.of(surface, incoming.coherence_um, solver.windows)
    rule = choose_rule(surface, incoming.coherence_um is not None, False, solver.tol / 20)
    job, scale, spread = _job(solver, surface, incoming, detector, plan)
    counts = _counts(solver, surface, plan, rule, job, scale, spread)
    in_plane = detector.kind == "in-plane"
    seconds, memory = _sums(solver, surface, incoming, detector, counts, speeds, rule, in_plane)
    seconds += _trials(solver, surface, incoming, counts, speeds, in_plane)
    memory = max(memory, TRIAL_BYTES * counts.size + counts.vectors * VECTOR_BYTES)
    if solver.energy or solver.renormalise:
        seconds += _energy_seconds(solver, surface, incoming, counts, speeds)
    least = fourier.OPENCL_TOL if solver.method == "opencl" else LEAST_WAVE_TOL
    speckle = 1 / np.sqrt(counts.independent * max(counts.room, 1.0))
    return Forecast(seconds, memory, max(solver.tol, least), float(min(speckle, 1.0)))


def _job(
    solver: Kirchhoff, surface: Heightfield, incoming: Incoming, detector: Detector, plan: WindowPlan
) -> tuple[Job, float, float]:
    """A job of some angles and wavelengths, how many times as many vectors there are in all, and wavelengths."""
    from dataclasses import replace

    k = np.asarray(wavenumber(solver.wavelength_nm), float)
    sources = parallel(incoming)[0]
    choices = cone_rules(surface, sources, solver.theory, k, plan.step, detector, solver.tol)
    angles = _some(len(incoming.theta_deg), ANGLES)
    some_k = k[_some(len(k), WAVELENGTHS)]
    few = replace(incoming, theta_deg=np.asarray(incoming.theta_deg)[angles])
    each = len(sources) // len(incoming.theta_deg) or 1

    def chosen(of: Floats) -> list[Choice]:
        return [choices[min(int(a) * each + j, len(choices) - 1)] for a in angles for j in range(each)][: len(of)]

    job = detector_job(few, detector, some_k, plan.step, solver.theory, solver.seed, chosen)
    return job, len(sources) / len(parallel(few)[0]) * len(k) / len(some_k), len(k) / len(some_k)


def _some(n: int, most: int) -> NDArray[np.int64]:
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(np.int64))


def _levels(q: Floats) -> int:
    return len(np.unique(np.round(q[:, 1], 6)))


def _counts(
    solver: Kirchhoff, surface: Heightfield, plan: WindowPlan, rule: str, job: Job, scale: float, wavelengths: float
) -> Counts:
    per_cycle = {"uniform": 1.0, "gauss": 2.2, "cells": 1.0}[rule] + 0.15 * -np.log10(solver.tol)
    spacing = 2 * np.pi / np.maximum(rates(surface, job.q), 1e-9) / per_cycle
    window = plan.windows[len(plan.windows) // 2]
    if window is not None:
        spacing = np.minimum(spacing, np.array(window.half) / 12)
    spacing = np.array(surface.pitch_um) if rule == "cells" else spacing / STEP
    if solver.shadowing:
        spacing = spacing / effort.SHARPER / SHARPENED
    sides = np.array(surface.size_um) if window is None else 2 * np.array(window.half)
    points = np.maximum(sides / spacing, 2.0)
    if surface.is_profile:
        points[0] = 1.0
    checked = job.q[job.checked()]
    rows = _levels(job.q)
    one = max(_levels(job.q[job.wavelength == w]) for w in np.unique(job.wavelength))
    # rows that no two wavelengths share are as many times more as there are wavelengths
    alone = rows > 1.5 * one
    room = min(float(np.median(job.room)), len(job.q) / np.prod(job.shape))
    centres = {w.centre[0] for w in plan.gaussian}
    return Counts(
        len(plan.windows),
        max(len(centres), 1),
        plan.independent,
        (float(points[0]), float(points[1])),
        float(max(surface.size_um[1] / spacing[1], 2.0)),
        len(job.q) * scale,
        rows * (wavelengths if alone else 1.0),
        float(one),
        (float(len(checked)), float(_levels(checked))),
        job.q,
        float(np.sqrt(room)) if surface.is_profile else room,
    )


def _sums(
    solver: Kirchhoff, surface: Heightfield, incoming: Incoming, detector: Detector, n: Counts, speeds: Speeds,
    rule: str, in_plane: bool,
) -> tuple[float, float]:  # fmt: skip
    """Seconds and bytes of all windows."""
    method = "nufft" if solver.method == "auto" else solver.method
    parts, transforms = _transforms(solver, incoming, len(incoming.theta_deg))
    outcomes = 17 if solver.polarised else 1
    each = n.vectors * speeds.vector * (4 if solver.polarised else 1)
    once = ONCE * n.vectors * speeds.vector
    memory = n.vectors * (VECTOR_BYTES + 16 * parts + 8 * outcomes)
    shared = (
        transforms == 1 and not solver.shadowing and not surface.is_profile and method == "nufft"
        and rule == "uniform" and in_plane and n.rows >= windowed.MIN_ROWS and np.sin(np.deg2rad(incoming.phi_deg)) == 0
    )  # fmt: skip
    if shared:
        seconds, more = _shared(surface, n, solver.tol, speeds)
        return once + seconds + n.windows * each, memory + more
    memory += n.size * (POINT_BYTES * (1 if parts == 1 and transforms == 1 else 1 + parts) + 60)
    heights = n.size * speeds.height * (3 if transforms > 1 else 1)
    if method != "nufft":
        term = speeds.term if method == "opencl" else speeds.plain_term
        one = n.size * n.vectors * term * parts
    elif in_plane:
        rows = n.rows if transforms == 1 else n.rows_each * transforms
        spread = speeds.spread * _width(solver.tol)
        one = rows * (n.size * spread + speeds.row) + n.vectors * parts * spread
        if solver.shadowing:
            one += KINDS * len(incoming.theta_deg) * len(detector) * speeds.row * n.rows
    else:
        one = transforms * _space(n.q, surface, n.points, n.vectors / transforms, solver.tol, speeds)
        memory += _space_bytes(n, solver.tol)
    if solver.shadowing:
        one += (len(detector) + len(incoming.theta_deg)) * n.size * speeds.shadow * 0.2
    return once + n.windows * (one + heights + each), memory


def _transforms(solver: Kirchhoff, incoming: Incoming, angles: int) -> tuple[int, int]:
    """Sums that the model needs, and how many times over the points all of them go."""
    if solver.polarised:
        return 12, 12 * angles * len(solver.wavelength_nm)  # type: ignore[arg-type]
    if solver.fresnel == "local":
        parts = 2 if incoming.polarisation == "unpolarised" else 1
        return parts, parts * angles * len(solver.wavelength_nm)  # type: ignore[arg-type]
    return 1, 1


def _width(tol: float) -> float:
    """Time of a point of a transform of that tolerance over that of the trial's, as the square of the kernel's width
    (FINUFFT's, at an oversampling of 1.25)."""
    return float(((-np.log(tol / 30) / 1.405 + 1) / 7.56) ** 2)


def _shared(surface: Heightfield, n: Counts, tol: float, speeds: Speeds) -> tuple[float, float]:
    """Windows that share the sums over y (`wave.windowed`): seconds and bytes."""
    eps = tol / 30 / 3  # one more digit in half of the cases
    reach = float(np.ptp(surface.z)) / 2 * 1.001 + 1e-9
    band = Band.of(n.q[:, 2], reach, eps)
    kernel = Kernel.of(eps, windowed.OVERSAMPLING_X)
    # a row at the edge of a cone needs as many lines as its own q_z
    lines = 0.8 * band.count
    size = windowed.OVERSAMPLING_X * min(n.points[1], n.columns) + 1
    sums = n.points[0] * n.columns * band.count * (speeds.line + 0.8 * n.rows * speeds.product)
    passes = max(1.0, 16 * band.count * n.columns * n.rows / windowed.MEMORY)
    sums += (np.ceil(passes) - 1) * n.points[0] * n.columns * band.count * speeds.line
    transform = n.rows * lines * size * np.log2(size) * speeds.fft
    taps = n.vectors * kernel.width * band.kernel.width * speeds.tap
    heights = n.points[0] * n.columns * (speeds.height + speeds.phase)
    per_window = n.windows / n.groups
    held = min(windowed.MEMORY, 16 * band.count * n.columns * n.rows)
    grids = 2 * per_window * lines * size * 16 + n.vectors / max(n.rows, 1) * kernel.width * band.kernel.width * 24
    memory = held + grids + n.points[0] * n.columns * 16 + n.vectors * 16 * per_window
    return n.groups * (heights + sums) + n.windows * (transform + taps), float(memory)


def _space(
    q: Floats, surface: Heightfield, points: tuple[float, float], vectors: float, tol: float, speeds: Speeds
) -> float:
    """Seconds of one transform of scattering vectors all over the hemisphere."""
    eps = tol / 30
    size = points[0] * points[1]
    relief = float(np.ptp(surface.z))
    kernel = Kernel.of(eps, OVERSAMPLING)
    sheets = np.ptp(q[:, 2]) * relief * OVERSAMPLING / (2 * np.pi) + kernel.width + 3
    # as planes.seconds, whose figures are those of two cores
    return float(speeds.space * (sheets * size * OVERSAMPLING**2 / 3e7 + vectors * kernel.width**3 / 5e7))


def _space_bytes(n: Counts, tol: float) -> float:
    kernel = Kernel.of(tol / 30, OVERSAMPLING)
    side = min(planes.BLOCK, max(n.points)) * OVERSAMPLING + 2 * kernel.width
    return 3 * 16 * side**2 + min(n.vectors, planes.TARGETS) * kernel.width**2 * 24 * 1.5


def _trials(
    solver: Kirchhoff, surface: Heightfield, incoming: Incoming, n: Counts, speeds: Speeds, in_plane: bool
) -> float:
    """Seconds of finding the spacing: one window on two grids, for the vectors that are checked."""
    parts, transforms = _transforms(solver, incoming, 2)
    vectors, rows = n.checked
    size = n.size / (effort.SHARPER * SHARPENED) ** 2 if solver.shadowing else n.size
    size *= min(1.0, 1e8 / size)
    spread = speeds.spread * _width(solver.tol)
    coarse = rows * transforms * (size * spread + speeds.row)
    if not in_plane:
        coarse = transforms * _space(n.q, surface, n.points, vectors, solver.tol, speeds)
    fine, direct = 2.25 * size, solver.tol >= 5 * fourier.OPENCL_TOL
    terms = fine * vectors / max(transforms, 1) * transforms
    rate = fourier.OPENCL_RATE if direct else fourier.REFERENCE_RATE
    if terms / rate < fourier.CHECK_SECONDS:
        check = terms * (speeds.term if direct else speeds.plain_term)
    else:
        check = 2.25 * coarse
    heights = (size + fine) * (speeds.height + speeds.phase) * (3 if transforms > 1 else 1)
    total = (ROUNDS + FURTHER * (solver.tol < 1e-4)) * (coarse + check + heights)
    if solver.shadowing:
        total += SHADOW_TRIALS * transforms * effort.EDGES_CHECKED / max(vectors, 1) * rows * n.size * spread
        total += SHADOW_TRIALS * effort.EDGES_CHECKED * n.size * speeds.shadow
    return float(total)


def _energy_seconds(solver: Kirchhoff, surface: Heightfield, incoming: Incoming, n: Counts, speeds: Speeds) -> float:
    """Seconds of the total reflected power, by directions of its own."""
    per = REPLICATES * sum(NODES)
    wavelengths = len(solver.wavelength_nm)  # type: ignore[arg-type]
    vectors = float(per * len(incoming.theta_deg) * wavelengths)
    _, transforms = _transforms(solver, incoming, len(incoming.theta_deg))
    one = transforms * _space(n.q, surface, n.points, vectors / transforms, solver.tol, speeds)
    return (n.windows + 2 * ROUNDS) * (one + vectors * speeds.vector)
