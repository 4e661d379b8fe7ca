"""What a user should know of a full-wave result: ill-conditioned systems, anomalies, cut beams. One line for each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .periodic import NEAR_WOOD, Diffraction
from .tapered import Fields

ILL_CONDITIONED = 1e8  # half the digits of a double are lost
RESIDUAL = 1e-8  # relative, of a system that LU solves to 1e-13 where it is well conditioned
CUT = 0.02  # amplitude of a beam at the end of its piece that is worth a word
LEFT_OUT = 1e-3  # share of a beam's power that its spectrum of propagating waves lacks
UNBALANCED = 1e-3  # of the incident power: reflected, absorbed and lost are computed apart
LOST = 1e-2  # share of the power past the ends of a piece


@dataclass(frozen=True)
class Quality:
    """Worst figures of a result. balance : largest |1 − reflected − absorbed|, where that is known"""

    unknowns: int
    condition: float
    residual: float
    balance: float

    @staticmethod
    def worst(found: list[Quality]) -> Quality:
        return Quality(*(max(getattr(q, n) for q in found) for n in ("unknowns", "condition", "residual", "balance")))

    def remarks(self) -> list[str]:
        out = []
        if self.condition > ILL_CONDITIONED:
            out.append(
                f"ill-conditioned: condition number {self.condition:.1e}, residual {self.residual:.1e} (a resonance of "
                "the profile, walls that nearly touch, or a grating at an anomaly): digits are lost in proportion"
            )
        if self.residual > RESIDUAL:
            out.append(f"the system was solved to a residual of {self.residual:.1e} only")
        if self.balance > UNBALANCED:
            out.append(f"energy balance off by {self.balance:.2%}: panels are too coarse (see error_achieved)")
        return out


def of_ends(lost: float) -> list[str]:
    """Remarks on the share of the light that a finite profile loses past its ends."""
    if lost < LOST:
        return []
    return [
        f"{lost:.1%} of the light leaves past the ends of a finite profile (energy_lost): take a longer profile, or a "
        "smaller coherence_um"
    ]


def of_grating(found: list[Diffraction], wavelength: float, theta_i_deg: float) -> list[str]:
    """Remarks on one incidence of a grating, its polarisations in a list."""
    if found[0].grazing > NEAR_WOOD:
        return []
    return [
        f"Wood's anomaly: at {theta_i_deg:g}° and {wavelength * 1e3:g} nm an order leaves within "
        f"{np.degrees(found[0].grazing):.2g}° of grazing; efficiencies change fast there (condition number "
        f"{max(d.condition for d in found):.1e})"
    ]


def of_beam(found: Fields, taper: float, centre: float, theta_i_deg: np.ndarray) -> list[str]:
    """Remarks on a finite piece: does the beam end before it, does it hold waves that cannot propagate."""
    out = []
    x = found.curve.point[0]
    end = min(centre - x.min(), x.max() - centre)
    amplitude = float(np.exp(-(end**2) / (2 * taper**2)))
    if amplitude > CUT:
        out.append(
            f"the beam is cut at the ends of the profile, where its amplitude is still {amplitude:.2f}: its edges "
            "diffract; take a smaller coherence_um or a longer profile"
        )
    lost = np.array([b.left_out for b in found.beams])
    if lost.max() > LEFT_OUT:
        out.append(
            f"a beam of ℓ = {taper:g} µm at {theta_i_deg[lost.argmax()]:g}° holds {lost.max():.1%} of its power in "
            "waves that do not propagate; they are left out and the beam is wider: take a larger coherence_um"
        )
    return out
