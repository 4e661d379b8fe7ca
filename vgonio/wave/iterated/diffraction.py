"""The last term of iterated Kirchhoff on profiles: what sweeps over the integral equation add to tangent planes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..quadrature import Complex, Floats
from .equation import Equation, rule_of
from .far_field import far_amplitudes
from .sweeps import sweep

SETTLED = 0.02  # mean square change by the last sweep over the field's up to which its field is taken

if TYPE_CHECKING:
    from .profile import Light, Stretch


@dataclass(frozen=True)
class Diffraction:
    """What the sweeps did. sweeps : most that were done;  change : mean square change of the field by the last one over
    that of the field, the largest;  rule : of the surface (`equation.RULES`);  left_out : why there was none, for all
    or some of the light;  swept : for each angle of incidence, whether it was"""

    sweeps: int = 0
    change: float = 0.0
    rule: str = ""
    left_out: str = ""
    swept: tuple[bool, ...] = ()

    @staticmethod
    def worst(parts: Iterable[Diffraction]) -> Diffraction:
        """Of several windows, wavelengths and polarisations together."""
        every = list(parts)
        rule, left_out = (
            ", ".join(dict.fromkeys(t for t in texts if t)) for texts in zip(*((d.rule, d.left_out) for d in every))
        )
        swept = tuple(any(row) for row in zip(*(d.swept for d in every)))
        return Diffraction(max(d.sweeps for d in every), max(d.change for d in every), rule, left_out, swept)


def diffracted(
    stretch: Stretch, lights: list[Light], start: tuple[Complex, Complex], total: Complex, theta: Floats, sweeps: int,
    tol: float,
) -> tuple[Complex, Diffraction]:  # fmt: skip
    """Far amplitudes (m, lights, t) at `theta` (m,) of the fields `start` (n, lights, t) after at most so many sweeps.

    `total` (m, lights, t), those of the tangent planes, is left where light meets the profile once, where it is no beam
    (`Beam.collimated`), where the sweeps do not settle, and for materials without a rule.
    """
    some, none = lights[0], (False,) * len(lights[0].theta)
    again, wide = stretch.again(some.theta), stretch.beam.collimated(some.k, some.theta)
    if not (stretch.sight.row.size and again.any()):
        return total, Diffraction(swept=none)
    per = 2 * np.pi / some.k / float(stretch.curve.ds.max())
    rule, why = rule_of(some.material, some.wavelength_nm, per)
    if rule is None:
        return total, Diffraction(left_out=why, swept=none)
    if not wide[again].all():
        why = f"a window too narrow for a beam at θ_i = {_angles(some.theta[again & ~wide])}"
    on = np.flatnonzero(again & wide)
    if not on.size:
        return total, Diffraction(left_out=why, swept=none)
    incident = stretch.incident(some.k, some.theta[on])
    whole, parts = total.copy(), []
    settled = np.ones(len(on), bool)
    for i, light in enumerate(lights):
        equation = Equation.of(stretch.curve, light.k, light.material, light.wavelength_nm, light.polarisation, rule)
        found = sweep(equation, incident, (start[0][:, i, on], start[1][:, i, on]), sweeps, tol)
        whole[:, i, on] = far_amplitudes(stretch.curve, found.u, found.v, light.k, theta, None)
        settled &= found.change <= SETTLED
        parts.append(Diffraction(found.done, float(found.change.max()), rule))
    lost = on[~settled]
    whole[..., lost] = total[..., lost]
    swept = np.zeros(len(some.theta), bool)
    swept[on[settled]] = True
    reasons = [why, f"sweeps that do not settle at θ_i = {_angles(some.theta[lost])}" if lost.size else ""]
    said = Diffraction(0, 0.0, rule, ", ".join(r for r in reasons if r), tuple(swept.tolist()))
    return whole, replace(Diffraction.worst([said, *parts]), swept=said.swept)


def _angles(theta: Floats) -> str:
    return ", ".join(f"{abs(np.rad2deg(t)):.3g}°" for t in theta)
