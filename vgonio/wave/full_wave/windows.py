"""Finite profiles: coherence windows along the profile, each a tapered beam over its own piece."""

from __future__ import annotations

import numpy as np

from ...directions import Detector, Incoming
from ...surface.heightfield import Heightfield
from ...units import nm_to_um
from .. import coherence
from . import beam, effort, remarks
from .detection import element_means
from .outcome import Outcome, Task
from .panels import Floats
from .tapered import Fields, Piece

EDGE = 4.0  # a piece ends at 4 ℓ, where the amplitude of the beam is 3e-4
WHOLE = 8.0  # without a coherence length: ℓ is so small a part of the profile


def taper_of(incoming: Incoming, surface: Heightfield) -> float:
    """ℓ in µm."""
    return surface.size_um[1] / WHOLE if incoming.coherence_um is None else incoming.coherence_um


def centres(surface: Heightfield, taper: float, most: int | None) -> tuple[list[float], float]:
    """Middles of the windows along x, µm, and how many of them are independent."""
    one_row = surface.replace(z=surface.z[:1]) if surface.shape[1] > 1 else surface
    tiled = coherence.spread(coherence.tile(one_row, taper), one_row, most)
    return [w.centre[1] for w in tiled], coherence.independent(tiled, one_row)


def piece(surface: Heightfield, centre: float, taper: float, wavelength: float) -> tuple[float, float]:
    """Ends, µm, of the part of the profile that a window lights; propagating waves make no spot far below λ."""
    half = EDGE * float(np.hypot(taper, wavelength / 2))
    return max(0.0, centre - half), min(surface.size_um[1], centre + half)


def scattered(task: Task) -> Outcome:
    """One wavelength: the mean over windows; the panels are converged in the middle window, and serve all others."""
    solver, surface, theta = task.solver, task.surface, task.theta
    wavelength, index = float(nm_to_um(task.wavelength_nm)), solver.index(task.wavelength_nm)
    taper = taper_of(task.incoming, surface)
    middles, independent = centres(surface, taper, solver.windows)

    def price(nodes: int) -> effort.Cost:
        return effort.cost(nodes, index, len(task.polarisations), len(theta), False)

    def window(n: int, round_: int, part: effort.Part) -> list[Fields]:
        how = effort.resolution(surface, wavelength, index, solver.tol, round_)
        span = piece(surface, middles[n], taper, wavelength)
        what = f"a piece of {span[1] - span[0]:.3g} µm at {task.wavelength_nm:g} nm"
        curve = effort.affordable(surface, span, how, price, what)
        with effort.threads(curve.size):
            one = Piece.of(curve, wavelength, index, task.polarisations)
            found: list[Fields] = []
            for p in task.polarisations:
                part((1 + len(found)) / (1 + len(task.polarisations)))
                found.append(one.solve(theta, p, taper, middles[n]))
        return found

    def means(found: list[Fields]) -> tuple[Floats, Floats]:
        pairs = [_detected(f, task.detector, task.sign, taper) for f in found]
        return np.stack([p[0] for p in pairs]), np.stack([p[1] for p in pairs])

    rounds: list[int] = []

    def run(round_: int, part: effort.Part) -> tuple[Floats, list[Fields], float]:
        found = window(len(middles) // 2, round_, part)
        rounds.append(round_)
        brdf = means(found)[0]
        return brdf.reshape(-1, brdf.shape[-1]), found, 0.0

    _, middle, error = effort.converged(run, solver.tol, lambda part: task.tell(part / len(middles)))
    every: list[list[Fields]] = []
    for n in range(len(middles)):
        before = len(every) + (n < len(middles) // 2)  # windows that are done, the middle one included

        def part(share: float, before: int = before) -> None:
            task.tell((before + share) / len(middles))

        every.append(middle if n == len(middles) // 2 else window(n, max(rounds), part))
    task.tell(1.0)
    pairs = [means(found) for found in every]
    stderr, spread = _standard_error(pairs, independent)
    attrs, lit = {"stderr_estimate": spread}, task.incoming.theta_deg
    brdf = np.mean([p[0] for p in pairs], axis=0)
    return _outcome(every, brdf, stderr, error, index, taper, middles, lit, attrs)


def _standard_error(pairs: list[tuple[Floats, Floats]], independent: float) -> tuple[Floats, str]:
    """Of the mean over windows, from the means over detector elements and their errors in each; and what it is from."""
    if len(pairs) == 1:
        return pairs[0][1], "spread over the directions within a detector element: one window only"
    spread = np.std([p[0] for p in pairs], axis=0, ddof=1)
    return spread / np.sqrt(independent), f"spread over {independent:.1f} effective independent windows"


def _detected(found: Fields, detector: Detector, sign: float, taper: float) -> tuple[Floats, Floats]:
    def p(sine: Floats) -> Floats:
        theta = np.arcsin(sine)
        return found.density(theta) / np.cos(theta)

    rate = found.k * (float(np.ptp(found.curve.x)) + float(np.ptp(found.curve.z)))
    return element_means(detector, sign, found.k, taper, p, rate)


def _outcome(
    every: list[list[Fields]], brdf: Floats, stderr: Floats, error: float, index: complex | None, taper: float,
    middles: list[float], theta_deg: Floats, attrs: dict,
) -> Outcome:  # fmt: skip
    def mean(values: list[list[Floats]]) -> Floats:  # over windows: (polarisation, theta_i)
        return np.mean(np.array(values), axis=0)

    reflected = mean([[f.reflected() for f in w] for w in every])
    lost = mean([[f.lost() for f in w] for w in every])
    absorbed = np.zeros_like(reflected) if index is None else mean([[f.absorbed() for f in w] for w in every])
    condition = np.max([[np.full(len(theta_deg), f.condition) for f in w] for w in every], axis=0)
    residual = np.max([[f.residual for f in w] for w in every], axis=0)
    unknowns = max(f.unknowns for w in every for f in w)
    beams = [r for w, c in zip(every, middles) for r in remarks.of_beam(w[0], taper, c, theta_deg)]
    # in TM the field does not vanish at the open ends, so that what is lost there is known roughly only
    defect = 0.0 if beams else float((np.abs(1 - reflected - absorbed - lost) - lost).max())
    worst = remarks.Quality(unknowns, float(condition.max()), float(residual.max()), defect)
    said = worst.remarks() + remarks.of_ends(float(lost.max())) + beams
    attrs |= {
        "coherence_um": taper,
        "windows": len(middles),
        "edges": f"open: each window is cut {EDGE:g} ℓ from its middle (twice λ at least) or where the profile ends; "
        "what leaves past the ends is in energy_lost",
        "spectrum_kept": beam.REACH,
    }
    return Outcome(brdf, stderr, reflected, absorbed, lost, condition, residual, unknowns, error, _unique(said), attrs)


def _unique(lines: list[str]) -> list[str]:
    return list(dict.fromkeys(lines))
