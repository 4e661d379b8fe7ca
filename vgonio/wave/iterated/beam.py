"""The light that falls on a profile: a plane wave under an amplitude window, or a tapered beam.

A window weighs the points as `Kirchhoff` does (`coherence.Window`), or it is carried along the rays: then a point in
shadow has the weight of the one that casts it, and the light solves the wave equation where kℓ cos θ is large. A
tapered beam does so exactly and is that of the rigorous solver (`full_wave.beam`; cf. Thorsos 1988), for comparisons.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..coherence import Window
from ..full_wave.beam import gaussian
from ..quadrature import Complex, Floats
from .curve import Curve

BEAMS = ("window", "tapered")
NODES = 2000  # of the integral of the window's power
COLLIMATED = 5.0  # kℓ cos θ from which on a window stays the same along the rays


@dataclass(frozen=True)
class Beam:
    """Light on a profile: amplitude exp(−(x − centre)²/2ℓ²), on the points ("window") or on z = 0 ("tapered").

    kind : one of BEAMS;  length : ℓ in µm;  half : where the window or the lit part ends, µm;  centre : µm
    along : whether a window is carried along the rays, from where kℓ cos θ is COLLIMATED on
    """

    kind: str
    length: float
    half: float
    centre: float = 0.0
    along: bool = False

    def field(
        self,
        curve: Curve,
        k: float,
        theta: Floats,
        level: Floats | float = 0.0,
        carried: NDArray[np.bool_] | bool = True,
    ) -> tuple[Complex, Complex]:
        """Incident u and ∂u/∂n on a curve from directions θ (signed, radians): (n, len(theta)) each.

        level : (len(theta),) height in µm at which a window that is carried along is centred
        carried : (len(theta),) whether it may be
        """
        if self.kind == "tapered":
            extent = float(np.abs(curve.x - self.centre).max() + np.abs(curve.z).max())
            waves = [gaussian(k, float(t), self.length, self.centre, extent) for t in theta]
            parts = [w.on(curve.x, curve.z, (curve.nx, curve.nz)) for w in waves]
            return np.stack([p[0] for p in parts], axis=1), np.stack([p[1] for p in parts], axis=1)
        x, z = curve.x[:, None], curve.z[:, None]
        s, c = np.sin(theta), np.cos(theta)
        beam = self.collimated(k, theta) & carried
        slant = np.where(beam, np.tan(theta), 0.0)
        across = x - self.centre - (z - level) * slant
        wave = np.exp(-1j * k * (s * x + c * z))
        u = self.window(across) * wave
        fall = beam * self._fall(across) * (curve.nx[:, None] - slant * curve.nz[:, None])
        return u, -1j * k * (s * curve.nx[:, None] + c * curve.nz[:, None]) * u + fall * wave

    def window(self, x: Floats) -> Floats:
        """Amplitude at distances x, µm, from the middle."""
        return Window(self.length, (self.half, self.half), (0.0, 0.0)).profile(x, self.half)

    def _fall(self, x: Floats) -> Floats:
        """dw/dx."""
        gaussian = np.exp(-(x**2) / (2 * self.length**2))
        return np.where(np.abs(x) < self.half, -x / self.length**2 * gaussian, 0.0)

    def collimated(self, k: float, theta: Floats) -> NDArray[np.bool_]:
        """(len(theta),) whether the light solves the wave equation."""
        if self.kind == "tapered":
            return np.ones(len(theta), bool)
        return self.along & (k * self.length * np.cos(theta) >= COLLIMATED)

    def share(self, lo: float, hi: float) -> float:
        """Of a window's power, what lies between distances lo and hi, µm, from its middle."""
        x = (np.arange(NODES) + 0.5) / NODES * 2 * self.half - self.half
        step, power = x[1] - x[0], self.window(x) ** 2
        inside = np.clip((np.minimum(x + step / 2, hi) - np.maximum(x - step / 2, lo)) / step, 0, 1)
        return float(power @ inside / power.sum())

    def power(self, k: float, theta: Floats) -> Floats:
        """(len(theta),) incident power per unit length along y, where |u| = 1 carries 1 per µm across."""
        if self.kind == "tapered":
            return np.array([gaussian(k, float(t), self.length, 0.0, self.half).power for t in theta])
        x = (np.arange(NODES) + 0.5) / NODES * 2 * self.half - self.half
        return np.cos(theta) * np.sum(self.window(x) ** 2) * (x[1] - x[0])
