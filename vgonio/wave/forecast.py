"""What a job of the waves will take, before it is begun: seconds from counts, to warn and to refuse."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ToleranceError, VgonioWarning

if TYPE_CHECKING:
    from .effort import How, Work
    from .job import Job
    from .weighted import Shadows

WARN_SECONDS = 600.0  # longer than one waits for
MOST_SECONDS = 86_400.0  # a day
# on two cores, measured within a factor 3 (benchmarks/waves.py); a guess is all that is wanted
WINDOW_SECONDS = 2e-3  # of any transform, however small
POINT_SECONDS = 6e-8  # of a point in one row of scattering vectors
SHARED_SECONDS = 4e-9  # of a point in one row where windows share the sums over y
VECTOR_SECONDS = 4e-7  # of a scattering vector in one window
TERM_SECONDS = {"opencl": 1.5e-9, "reference": 5e-8}


def seconds(
    windows: int,
    points: float,
    vectors: float,
    rows: float,
    passes: float = 1.0,
    shared: bool = False,
    direct: str = "",
) -> float:
    """Rough seconds of `windows` windows of so many points each, for scattering vectors in rows of equal q_y.

    passes : transforms of each window beyond the one that plain waves need (facets' amplitudes, shadows)
    shared : whether windows share the sums over y;  direct : "opencl" or "reference" for a direct sum
    """
    if direct in TERM_SECONDS:
        return windows * passes * points * vectors * TERM_SECONDS[direct]
    point = SHARED_SECONDS if shared else POINT_SECONDS
    return windows * (passes * (rows * points * point + WINDOW_SECONDS) + vectors * VECTOR_SECONDS)


def remedy(expected: float) -> str:
    """How long, and what would make it less."""
    hours = f"{expected / 3600:.1f} h" if expected < 2 * MOST_SECONDS else f"{expected / MOST_SECONDS:,.0f} days"
    long = hours if expected > 7200 else f"{expected / 60:.0f} min"
    return (
        f"about {long} of work on two cores: take fewer angles or wavelengths, a larger tol, fewer windows (a larger "
        "coherence_um, a part of the surface), or leave out shadowing"
    )


def estimate(work: Work, job: Job, how: How, shadows: Shadows | None) -> float:
    """Rough seconds of all windows of a job."""
    window = work.plan.windows[0]
    sides = np.array(work.surface.size_um) if window is None else 2 * np.array(window.half)
    counts = np.maximum(sides / np.maximum(how.spacing, 1e-12), 1)
    points = float(counts[1] if work.surface.is_profile else counts.prod())
    rows = len(np.unique(np.round(job.q[:, 1], 6))) if how.azimuth is not None else 10
    local = len(job.sources) * len(work.wavelength_nm) * work.model.parts if work.model.local else 1
    passes, vectors = float(local), float(len(job.q))
    if shadows is not None:
        pairs = len(np.unique(job.source * (int(job.view.max()) + 1) + job.view))
        passes *= max(1.0, pairs / (len(job.sources) if work.model.local else 1))
        rows = max(1, rows // 8)  # the rows of one element
    return seconds(len(work.plan.windows), points, vectors, rows, passes, work.shared(job, how, shadows), how.method)


def require_affordable(work: Work, job: Job, how: How, shadows: Shadows | None) -> None:
    """ToleranceError above MOST_SECONDS, a warning above WARN_SECONDS."""
    expected = estimate(work, job, how, shadows)
    if expected > MOST_SECONDS:
        raise ToleranceError(f"waves: {remedy(expected)}; at most {MOST_SECONDS / 3600:.0f} h are begun")
    if expected > WARN_SECONDS:
        warnings.warn(f"waves: {remedy(expected)}", VgonioWarning, stacklevel=4)
