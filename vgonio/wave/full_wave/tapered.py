"""Finite profiles under a tapered beam: surface fields, far field, energy balance.

    found = scatter_profile(x_um, z_um, wavelength_um=0.55, theta_i_deg=[20], polarisation="TE",
                            refractive_index=None, taper_um=8.0, theta_o_deg=np.linspace(-89, 89, 400))
    found.density        # (theta_i, theta_o) reflected power per radian over incident power
    found.balance        # (theta_i,) total reflected (perfect: 1; with a material: reflected + absorbed) over incident

The profile is open: it ends where the beam is weak, and what little light reaches its ends is diffracted there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import beam, operators, panels, system
from .kernels import Complex
from .panels import Floats, Panels

ORDER = 10  # nodes of a panel


@dataclass(frozen=True, eq=False)
class Fields:
    """Surface fields of several incidences: psi, phi (N, r), incident beams, and how well the system was solved."""

    panels: Panels
    k: float
    psi: Complex
    phi: Complex
    beams: list[beam.Beam]
    unknowns: int
    condition: float
    residual: float

    def amplitude(self, theta: Floats) -> Complex:
        """(r, m) N(θ) of the scattered far field ψ_s = (i/4) (2/πkr)^½ exp(i(kr − π/4)) N in directions θ (radians)."""
        x, z = self.panels.point
        nx, nz = self.panels.normal
        out = np.empty((self.psi.shape[1], len(theta)), np.complex128)
        for start in range(0, len(theta), 256):
            t = theta[start : start + 256, None]
            s, c = np.sin(t), np.cos(t)
            wave = np.exp(-1j * self.k * (x * s + z * c)) * self.panels.weight
            slope = wave * (-1j * self.k) * (nx * s + nz * c)
            out[:, start : start + 256] = (slope @ self.psi - wave @ self.phi).T
        return out

    def density(self, theta: Floats) -> Floats:
        """(r, m) scattered power per radian over incident power."""
        power = np.array([b.power for b in self.beams])
        return np.abs(self.amplitude(theta)) ** 2 / (8 * np.pi * self.k * power[:, None])

    def reflected(self) -> Floats:
        """(r,) total power scattered upward over incident power."""
        extent = float(np.ptp(self.panels.x)) + float(np.ptp(self.panels.z))
        t, w = np.polynomial.legendre.leggauss(64 + int(self.k * extent))
        return np.asarray(self.density(t * np.pi / 2) @ w * np.pi / 2)

    def absorbed(self) -> Floats:
        """(r,) power through the surface into the material over incident power."""
        flux = -(self.panels.weight @ np.imag(np.conj(self.psi) * self.phi))
        return np.asarray(flux / (self.k * np.array([b.power for b in self.beams])))


def solve(
    curve: Panels,
    wavelength: float,
    theta_i: Floats,
    polarisation: str,
    index: complex | None,
    taper: float,
    centre: float,
) -> Fields:
    """Fields on an open curve (µm) for beams from θ_i (r,) radians; `index` n + ik, None for a perfect conductor."""
    k = 2 * np.pi / wavelength
    needed = system.operators_needed(index is None, polarisation)
    air = operators.assemble(k, curve, curve, needed, True)
    inside = None if index is None else operators.assemble(k * index, curve, curve, ("single", "double"), True)
    factor = system.factored(curve, k, index, polarisation, air, inside)
    del air, inside
    x, z = curve.point
    extent = float(np.abs(x - centre).max() + np.abs(z).max())
    beams = [beam.gaussian(k, float(t), taper, centre, extent) for t in theta_i]
    incident = [b.on(x, z, curve.normal) for b in beams]
    field, slope = (np.stack([pair[i] for pair in incident], axis=1) for i in (0, 1))
    psi, phi, residual = factor.solve(field, slope)
    return Fields(curve, k, psi, phi, beams, factor.unknowns, factor.condition, float(residual.max()))


@dataclass(frozen=True, eq=False)
class Scattering:
    """What `scatter_profile` finds: density (theta_i, theta_o) per radian, reflected and balance (theta_i,)."""

    density: Floats
    reflected: Floats
    balance: Floats
    fields: Fields


def scatter_profile(
    x_um: ArrayLike,
    z_um: ArrayLike,
    wavelength_um: float,
    theta_i_deg: ArrayLike,
    polarisation: str = "TE",
    refractive_index: complex | None = None,
    taper_um: float | None = None,
    theta_o_deg: ArrayLike = (),
    panel_wavelengths: float = 0.8,
) -> Scattering:
    """Rigorous scattering by the cubic spline through (x_um, z_um), x ascending, under a Gaussian beam.

    polarisation : "TE" (E along the grooves) or "TM";  refractive_index : n + ik, None for a perfect conductor
    taper_um : ℓ of the amplitude exp(−x²/2ℓ²) on z = 0 at the middle of the profile; None takes an eighth of its length
    theta_o_deg : signed in-plane angles;  panel_wavelengths : length of panels of ten nodes, in wavelengths
    Returns a `Scattering`: reflected power per radian over incident power, and the energy balance.
    """
    from scipy.interpolate import CubicSpline

    x = np.asarray(x_um, float)
    spline = CubicSpline(x, np.asarray(z_um, float))
    tangent = spline.derivative()

    def curve(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        return t, spline(t), np.ones_like(t), tangent(t)

    scale = wavelength_um if refractive_index is None else wavelength_um / max(1.0, complex(refractive_index).real)
    edges = panels.smooth_edges(curve, x[0], x[-1], panel_wavelengths * scale, ORDER, 1e-6 * wavelength_um)
    taper: Any = float(np.ptp(x)) / 8 if taper_um is None else taper_um
    theta = np.deg2rad(np.atleast_1d(np.asarray(theta_i_deg, float)))
    found = solve(
        panels.on_curve(curve, edges, ORDER), wavelength_um, theta, polarisation, refractive_index, taper,
        float(x[0] + x[-1]) / 2,
    )  # fmt: skip
    reflected = found.reflected()
    balance = reflected if refractive_index is None else reflected + found.absorbed()
    return Scattering(found.density(np.deg2rad(np.asarray(theta_o_deg, float))), reflected, balance, found)
