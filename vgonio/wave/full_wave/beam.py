"""A tapered beam: a plane wave whose amplitude on z = 0 is exp(−(x − x₀)²/2ℓ²), as a sum of plane waves.

The sum solves the Helmholtz equation exactly, where the tapered wave of Thorsos (1988) does so to order 1/(kℓ cos θ)²;
on z = 0 both are the same. Waves that would not propagate are left out, which matters at grazing incidence only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .kernels import Complex
from .panels import Floats, composite

REACH = 6.0  # standard deviations of the spectrum that are kept: its amplitude there is 1.5e-8


@dataclass(frozen=True, eq=False)
class Beam:
    """Plane waves from θ (j,), radians, with amplitudes a (j,): ψ_i = Σ a exp(−ik (x sin θ + z cos θ)).

    middle, taper, centre : sin θ_i of its axis, ℓ and x₀ in µm
    power : ∫ of the incident flux through z = 0 over k, |ψ|² µm
    left_out : share of the power in waves that would not propagate
    """

    k: float
    theta: Floats
    amplitude: Complex
    middle: float
    taper: float
    centre: float
    power: float
    left_out: float

    def on(self, x: Floats, z: Floats, normal: tuple[Floats, Floats]) -> tuple[Complex, Complex]:
        """ψ_i and ∂ψ_i/∂n at points (n,)."""
        s, c = np.sin(self.theta), np.cos(self.theta)
        waves = np.exp(-1j * self.k * (x[:, None] * s + z[:, None] * c)) * self.amplitude
        slope = waves * (-1j * self.k) * (normal[0][:, None] * s + normal[1][:, None] * c)
        return waves.sum(axis=1), slope.sum(axis=1)

    def downward(self, theta: Floats) -> Complex:
        """(m,) N of the beam's own far field below, in directions opposite to θ (radians): see `tapered.Fields`."""
        s, c = np.sin(theta), np.cos(theta)
        spectrum = _spectrum(self.k, s, self.middle, self.taper)
        spectrum = np.where(np.abs(s - self.middle) <= REACH / (self.k * self.taper), spectrum, 0.0)
        return -4j * np.pi * self.k * c * spectrum * np.exp(1j * self.k * s * self.centre)


def gaussian(k: float, theta_i: float, taper: float, centre: float, extent: float) -> Beam:
    """The beam from θ_i (radians) with ℓ = `taper` µm around x₀ = `centre`, for points within `extent` µm of there."""
    middle, width = np.sin(theta_i), REACH / (k * taper)
    lowest, highest = (np.arcsin(np.clip(middle + d, -1, 1)) for d in (-width, width))
    t, w = composite(48 + 0.8 * k * (highest - lowest) * extent)
    theta = lowest + (highest - lowest) * (t + 1) / 2
    du = w * (highest - lowest) / 2 * k * np.cos(theta)  # of k sin θ
    spectrum = _spectrum(k, np.sin(theta), middle, taper)
    amplitude = du * spectrum * np.exp(1j * k * np.sin(theta) * centre)
    power = 2 * np.pi * float(np.sum(du * spectrum**2 * np.cos(theta)))
    return Beam(k, theta, amplitude, float(middle), taper, centre, power, _left_out(k, middle, taper))


def _spectrum(k: float, sine: Floats, middle: float, taper: float) -> Floats:
    """Of exp(−x²/2ℓ²) on z = 0, over k sin θ."""
    return np.asarray(taper / np.sqrt(2 * np.pi) * np.exp(-((k * taper * (sine - middle)) ** 2) / 2))


def _left_out(k: float, middle: float, taper: float) -> float:
    from scipy.special import erfc

    return float(erfc(k * taper * (1 - middle)) / 2 + erfc(k * taper * (1 + middle)) / 2)
