"""How finely, at what cost: panels from the tolerance, the price before it is paid, the error by a coarser solution."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from ...errors import ToleranceError
from ...surface.heightfield import Heightfield
from .panels import Floats, Panels
from .profile import Resolution, cut, fewest_nodes

MOST_UNKNOWNS = 8000
SMALL = 700  # nodes below which a second thread gains nothing worth having
ORDER, FEW = 10, 5  # nodes of a panel; of one among corners in the first solution, for tol ≥ LAX
LAX = 3e-4
NOTHING = 1e-9
MISSED = 1e-2  # of tol·λ: what panels may miss of the surface in the first solution
COARSE, FINER = 1.6, 1.5  # longest panel of the first solution in wavelengths; each further one is so much finer
ROUNDS = 4  # solutions at most
# seconds of one core, rather too many than too few: a kernel value, an entry of a grating's far images, an operation
PER_KERNEL, PER_IMAGE, PER_FLOP = 35e-9, 1.1e-6, 1 / 1.5e10
NEARBY = 1000  # kernel values, for each node, of the panels close to it
CLEAR = 0.3  # k of a material through which panels further away see each other

DONE = (0.0, 0.3, 0.8, 0.95, 1.0)  # of the work, before each solution: two are enough as a rule

T = TypeVar("T")
Part = Callable[[float], None]  # is told the share of some work that is done


@dataclass(frozen=True)
class Cost:
    """Unknowns, memory and time of one wavelength, before anything is solved."""

    unknowns: int
    bytes: float
    seconds: float

    def __str__(self) -> str:
        return f"{self.unknowns:,} unknowns, {self.bytes / 1e9:.2g} GB, about {self.seconds:.2g} s a wavelength"


def resolution(surface: Heightfield, wavelength: float, index: complex | None, tol: float, round_: int) -> Resolution:
    """Panels of the `round_`-th solution: shorter inside a material where the wavelength is.

    Smooth profiles are solved on shorter and shorter panels. Among corners it is the number of nodes that grows: panels
    that shrink towards a corner are as many as they are, and fields on them converge exponentially in that number. On
    a perfect conductor, whose current is infinite at an edge, it starts higher.
    """
    inside = 1.0 if index is None else max(1.0, complex(index).real)
    order = ORDER
    if surface.interpolation != "cubic":
        order = max(4, (FEW if tol >= LAX and index is not None else ORDER - 2) + 2 * round_)
    longest = COARSE * order / ORDER * wavelength / inside / FINER**round_
    return Resolution(longest, MISSED * tol * wavelength / 4**round_, order, round_ + (tol < LAX))


def cost(nodes: int, index: complex | None, polarisations: int, incidences: int, periodic: bool) -> Cost:
    """Of `nodes` points on the profile; a grating has three images and a factorisation for every angle. The field in an
    absorbing material is eliminated, that in a transparent one doubles the system."""
    clear = index is not None and complex(index).imag < CLEAR
    images = 3 if periodic else 1
    kept = images * nodes**2 * (3 if index is None else 4)
    kernels = nodes * (images * nodes + NEARBY) * (4 if index is None else 8)
    far = incidences * nodes**2 if periodic else 0
    solved = polarisations * (incidences if periodic else 1)
    flops = solved * float(nodes) ** 3 * (64 / 3 if clear else 8 / 3 if index is None else 16 / 3)
    held = 16.0 * (kept + 2 * float(nodes) ** 2 * (4 if clear else 1))
    return Cost(nodes if index is None else 2 * nodes, held, kernels * PER_KERNEL + far * PER_IMAGE + flops * PER_FLOP)


def require_affordable(price: Cost, what: str) -> None:
    """Raise ToleranceError, before memory is asked for, where the system is too large for a direct solution."""
    if price.unknowns > MOST_UNKNOWNS:
        raise ToleranceError(
            f"full wave: {what} needs {price}; at most {MOST_UNKNOWNS:,} unknowns are solved. Take a smaller "
            "coherence_um (a finite profile is cut to 4 of them on each side), a shorter profile or period, a longer "
            "wavelength or a larger tol; 'perfect' needs half the unknowns of a material"
        )


def affordable(
    surface: Heightfield, span: tuple[float, float], how: Resolution, price: Callable[[int], Cost], what: str
) -> Panels:
    """Panels of the profile over `span` (µm). price : nodes → their cost

    Raises ToleranceError where they are too many, before they are made where the length of the profile tells.
    """
    require_affordable(price(fewest_nodes(surface, *span, how)), what)
    curve = cut(surface, *span, how)
    require_affordable(price(curve.size), what)
    return curve


def threads(nodes: int) -> Any:
    """Context in which small systems have one thread of BLAS: more of them wait for each other, up to a hundred times
    longer than the work takes where other programs run beside them."""
    from threadpoolctl import threadpool_limits

    return threadpool_limits(1 if nodes < SMALL else None, user_api="blas")


def converged(
    run: Callable[[int, Part], tuple[Floats, T, float]], tol: float, progress: Part
) -> tuple[Floats, T, float]:
    """Solutions on finer and finer panels until two agree: values of the last, what comes with them, their error.

    run : round, and whom to tell how much of it is done → values (r, m), anything else, and what else is known of their
        error (the energy balance of a grating)
    The error is the difference of the last two solutions relative to the largest value of each row, which is the error
    of the coarser one, or that other figure where it is larger. Where a second solution cannot be afforded, a coarser
    one is compared with the first.
    """

    def inside(round_: int) -> Part:
        return lambda part: progress(DONE[round_] + part * (DONE[round_ + 1] - DONE[round_]))

    last, found, defect = run(0, inside(0))
    error = np.inf
    for round_ in range(1, ROUNDS):
        try:
            fine, better, defect = run(round_, inside(round_))
        except ToleranceError:
            if not np.isfinite(error):
                error = max(difference(run(-1, lambda part: None)[0], last), defect)
            break
        error = max(difference(last, fine), defect)
        last, found = fine, better
        if error <= tol:
            break
    return last, found, error


def difference(a: Floats, b: Floats) -> float:
    """Largest |a − b| relative to the largest value in its row, or to NOTHING where nothing is reflected."""
    top = np.maximum(np.abs(b).max(axis=1), NOTHING)
    return float((np.abs(a - b).max(axis=1) / top).max())
