"""Finite profiles under a tapered beam: surface fields, far field, energy balance.

    found = scatter_profile(x_um, z_um, wavelength_um=0.55, theta_i_deg=[20], polarisation="TE",
                            refractive_index=None, taper_um=8.0, theta_o_deg=np.linspace(-89, 89, 400))
    found.density        # (theta_i, theta_o) reflected power per radian over incident power
    found.reflected      # (theta_i,) total reflected power over incident power
    found.lost           # (theta_i,) what runs along the profile and leaves past its ends, into the half-space below
    found.balance        # (theta_i,) reflected + absorbed + lost: 1 when exact

The profile is open: it ends where the beam is weak, and what light reaches its ends leaves there. That is counted by
itself, from the far field of beam and surface together below the profile.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from . import beam, operators, panels, system
from .kernels import Complex
from .panels import Floats, Panels

ORDER = 10  # nodes of a panel
BLOCK = 2_000_000  # exponentials at a time


@dataclass(frozen=True, eq=False)
class Fields:
    """Surface fields of several incidences: psi, phi (N, r), incident beams, and how well the system was solved."""

    curve: Panels
    k: float
    psi: Complex
    phi: Complex
    beams: list[beam.Beam]
    unknowns: int
    condition: float
    residual: Floats

    def amplitude(self, theta: Floats) -> Complex:
        """(r, m) N(θ) of the scattered far field ψ_s = (i/4) (2/πkr)^½ exp(i(kr − π/4)) N in directions θ (radians)."""
        x, z = self.curve.point
        nx, nz = self.curve.normal
        out = np.empty((self.psi.shape[1], len(theta)), np.complex128)
        step = max(1, BLOCK // len(x))
        for start in range(0, len(theta), step):
            t = theta[start : start + step, None]
            s, c = np.sin(t), np.cos(t)
            wave = np.exp(-1j * self.k * (x * s + z * c)) * self.curve.weight
            slope = wave * (-1j * self.k) * (nx * s + nz * c)
            out[:, start : start + step] = (slope @ self.psi - wave @ self.phi).T
        return out

    @property
    def incident(self) -> Floats:
        """(r,) incident power over k."""
        return np.array([b.power for b in self.beams])

    def density(self, theta: Floats) -> Floats:
        """(r, m) scattered power per radian over incident power."""
        return np.asarray(np.abs(self.amplitude(theta)) ** 2 / (8 * np.pi * self.k * self.incident[:, None]))

    def reflected(self) -> Floats:
        """(r,) total power scattered upward over incident power."""
        t, w = self._all_round()
        return np.asarray(self.density(t) @ w)

    def lost(self) -> Floats:
        """(r,) power that leaves past the ends of the profile, into the half-space below, over incident power."""
        t, w = self._all_round()
        below = self.amplitude(t + np.pi) + np.array([b.downward(t) for b in self.beams])
        return np.asarray(np.abs(below) ** 2 @ w / (8 * np.pi * self.k * self.incident))

    def _all_round(self) -> tuple[Floats, Floats]:
        """Directions and weights over a half-space, radians."""
        extent = float(np.ptp(self.curve.x)) + float(np.ptp(self.curve.z))
        t, w = panels.composite(64 + 1.2 * self.k * extent)
        return t * np.pi / 2, w * np.pi / 2

    def absorbed(self) -> Floats:
        """(r,) power through the surface into the material over incident power."""
        flux = -(self.curve.weight @ np.imag(np.conj(self.psi) * self.phi))
        return np.asarray(flux / (self.k * self.incident))


@dataclass(frozen=True, eq=False)
class Piece:
    """An open curve (µm) and the potentials on it, which both polarisations share. index : None for a perfect one"""

    curve: Panels
    k: float
    index: complex | None
    air: system.Operators
    inside: system.Operators | None

    @staticmethod
    def of(curve: Panels, wavelength: float, index: complex | None, polarisations: tuple[str, ...]) -> Piece:
        k = 2 * np.pi / wavelength
        wanted = tuple(sorted({n for p in polarisations for n in system.operators_needed(index is None, p)}))
        inside = None if index is None else operators.assemble(k * index, curve, curve, ("single", "double"), True)
        return Piece(curve, k, index, operators.assemble(k, curve, curve, wanted, True), inside)

    def solve(self, theta_i: Floats, polarisation: str, taper: float, centre: float) -> Fields:
        """Fields for beams from θ_i (r,) radians with ℓ = `taper` around x = `centre`: one factorisation for all."""
        factor = system.factored(self.curve, self.k, self.index, polarisation, self.air, self.inside)
        x, z = self.curve.point
        extent = float(np.abs(x - centre).max() + np.abs(z).max())
        beams = [beam.gaussian(self.k, float(t), taper, centre, extent) for t in theta_i]
        incident = [b.on(x, z, self.curve.normal) for b in beams]
        field, slope = (np.stack([pair[i] for pair in incident], axis=1) for i in (0, 1))
        psi, phi, residual = factor.solve(field, slope)
        return Fields(self.curve, self.k, psi, phi, beams, factor.unknowns, factor.condition, residual)


@dataclass(frozen=True, eq=False)
class Scattering:
    """What `scatter_profile` finds: density (theta_i, theta_o) per radian; reflected, lost and balance (theta_i,)."""

    density: Floats
    reflected: Floats
    lost: Floats
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
    taper = float(np.ptp(x)) / 8 if taper_um is None else float(taper_um)
    theta = np.deg2rad(np.atleast_1d(np.asarray(theta_i_deg, float)))
    one = Piece.of(panels.on_curve(curve, edges, ORDER), wavelength_um, refractive_index, (polarisation,))
    found = one.solve(theta, polarisation, taper, float(x[0] + x[-1]) / 2)
    reflected, lost = found.reflected(), found.lost()
    balance = reflected + lost + (0.0 if refractive_index is None else found.absorbed())
    return Scattering(found.density(np.deg2rad(np.asarray(theta_o_deg, float))), reflected, lost, balance, found)
