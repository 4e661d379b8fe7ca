"""The light that falls on a profile: a plane wave under an amplitude window, or a tapered beam.

A window weighs the points as `Kirchhoff` does (`coherence.Window`); a tapered beam solves the wave equation and is the
one of the rigorous solver (`full_wave.beam`; cf. Thorsos 1988), for comparisons with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..coherence import Window
from ..full_wave.beam import gaussian
from ..quadrature import Complex, Floats
from .curve import Curve

BEAMS = ("window", "tapered")
NODES = 2000  # of the integral of the window's power


@dataclass(frozen=True)
class Beam:
    """Light on a profile: amplitude exp(−(x − centre)²/2ℓ²), on the points ("window") or on z = 0 ("tapered").

    kind : one of BEAMS;  length : ℓ in µm;  half : where the window or the lit part ends, µm;  centre : µm
    """

    kind: str
    length: float
    half: float
    centre: float = 0.0

    def field(self, curve: Curve, k: float, theta: Floats) -> tuple[Complex, Complex]:
        """Incident u and ∂u/∂n on a curve from directions θ (signed, radians): (n, len(theta)) each."""
        if self.kind == "tapered":
            extent = float(np.abs(curve.x - self.centre).max() + np.abs(curve.z).max())
            waves = [gaussian(k, float(t), self.length, self.centre, extent) for t in theta]
            parts = [w.on(curve.x, curve.z, (curve.nx, curve.nz)) for w in waves]
            return np.stack([p[0] for p in parts], axis=1), np.stack([p[1] for p in parts], axis=1)
        x, z = curve.x[:, None], curve.z[:, None]
        s, c = np.sin(theta), np.cos(theta)
        u = self._window(x - self.centre) * np.exp(-1j * k * (s * x + c * z))
        return u, -1j * k * (s * curve.nx[:, None] + c * curve.nz[:, None]) * u

    def _window(self, x: Floats) -> Floats:
        return Window(self.length, (self.half, self.half), (0.0, 0.0)).profile(x, self.half)

    def power(self, k: float, theta: Floats) -> Floats:
        """(len(theta),) incident power per unit length along y, where |u| = 1 carries 1 per µm across."""
        if self.kind == "tapered":
            return np.array([gaussian(k, float(t), self.length, 0.0, self.half).power for t in theta])
        x = (np.arange(NODES) + 0.5) / NODES * 2 * self.half - self.half
        return np.cos(theta) * np.sum(self._window(x) ** 2) * (x[1] - x[0])
