"""Gratings: one period, the quasi-periodic Green's function, efficiencies of all orders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import lattice, operators, system
from .kernels import Complex
from .panels import Floats, Panels

WOOD = 1e-5  # γ/k below which an order counts as grazing to rounding: the angle is moved by WOOD²
NEAR_WOOD = 0.02  # γ/k below which a result says that it is near an anomaly

Images = dict[int, dict[str, Complex]]


@dataclass(frozen=True, eq=False)
class Diffraction:
    """Orders of one incidence. order : (m,), sin θ_o = −sin θ_i − mλ/P

    sine : (m,) sin θ_o;  efficiency : (m,)
    reflected, absorbed, transmitted : shares of the incident power; absorbed is the flux through the surface,
        transmitted that of the orders inside a loss-free material (NaN in others)
    grazing : smallest |γ/k| of an order in air or a loss-free material, 0 at Wood's anomaly
    """

    order: np.ndarray
    sine: Floats
    efficiency: Floats
    reflected: float
    absorbed: float
    transmitted: float
    unknowns: int
    condition: float
    residual: float
    grazing: float


@dataclass(frozen=True, eq=False)
class Grating:
    """One period of a curve (µm) and what all angles of incidence share: potentials of the near images."""

    curve: Panels
    period: float
    k: float
    index: complex | None
    air: Images
    inside: Images

    @staticmethod
    def of(
        curve: Panels, period: float, wavelength: float, index: complex | None, polarisations: tuple[str, ...]
    ) -> Grating:
        k = 2 * np.pi / wavelength
        wanted = tuple(sorted({n for p in polarisations for n in system.operators_needed(index is None, p)}))
        inside = {} if index is None else _images(k * index, curve, period, ("single", "double"))
        return Grating(curve, period, k, index, _images(k, curve, period, wanted), inside)

    def diffract(self, theta_i: float, polarisations: tuple[str, ...]) -> list[Diffraction]:
        """Efficiencies for a plane wave from θ_i (radians), in each of the polarisations."""
        alpha, grazing = self._alpha(theta_i)
        gamma = np.sqrt(self.k**2 - alpha**2)
        height = float(np.ptp(self.curve.z))
        air = _summed(self.air, alpha, self.period)
        lattice.far_images(self.k, alpha, self.period, height).add(self.curve, air)
        inside = None
        if self.index is not None:
            inside = _summed(self.inside, alpha, self.period)
            lattice.far_images(self.k * self.index, alpha, self.period, height).add(self.curve, inside)
        (x, z), (nx, nz) = self.curve.point, self.curve.normal
        field = np.exp(1j * (alpha * x - gamma * z))[:, None]
        slope = field * (1j * (alpha * nx - gamma * nz))[:, None]
        found = []
        for p in polarisations:
            factor = system.factored(self.curve, self.k, self.index, p, air, inside)
            psi, phi, residual = factor.solve(field, slope)
            found.append(self._orders(alpha, gamma, psi[:, 0], phi[:, 0], p, factor, float(residual[0]), grazing))
        return found

    def _alpha(self, theta_i: float) -> tuple[float, float]:
        """k sin θ of the incident wave, off an exact anomaly; |γ/k| of the order closest to grazing, above or below."""
        alpha = -self.k * np.sin(theta_i)
        grazing = 1.0
        for k in [self.k] + ([] if self.index is None or self.index.imag else [self.k * self.index.real]):
            most = int(np.ceil(k * self.period / np.pi)) + 2
            a = alpha + 2 * np.pi * np.arange(-most, most + 1) / self.period
            grazing = min(grazing, float(np.abs(lattice.gammas(k, a)).min() / k))
        if grazing < WOOD:
            alpha += (-1 if alpha > 0 else 1) * self.k * WOOD**2
        return float(alpha), grazing

    def _orders(
        self, alpha: float, gamma: float, psi: Complex, phi: Complex, polarisation: str, factor: system.Factored,
        residual: float, grazing: float,
    ) -> Diffraction:  # fmt: skip
        n, a, g = self._propagating(self.k, alpha)
        waves = _amplitudes(self.curve, self.period, a, g, psi, phi)
        efficiency = np.abs(waves) ** 2 * g / gamma
        flux = -float(self.curve.weight @ np.imag(np.conj(psi) * phi)) / (gamma * self.period)
        transmitted = np.nan
        if self.index is not None and complex(self.index).imag == 0:
            beta = system.contrast(self.index, polarisation)
            _, a2, g2 = self._propagating(self.k * complex(self.index).real, alpha)
            below = _amplitudes(self.curve, self.period, a2, -g2, psi, beta * phi)
            transmitted = float(np.sum(np.abs(below) ** 2 * g2 / gamma) / np.real(beta))
        return Diffraction(
            -n, a / self.k, efficiency, float(efficiency.sum()), flux, transmitted, factor.unknowns, factor.condition,
            residual, grazing,
        )  # fmt: skip

    def _propagating(self, k: float, alpha: float) -> tuple[np.ndarray, Floats, Floats]:
        """Orders n of a medium that propagate, their α_n and γ_n."""
        n = np.arange(
            np.ceil((-k - alpha) * self.period / (2 * np.pi)), np.floor((k - alpha) * self.period / (2 * np.pi)) + 1
        )
        a = alpha + 2 * np.pi * n / self.period
        some = k**2 - a**2 > 0
        return n[some].astype(np.int64), a[some], np.sqrt(k**2 - a[some] ** 2)


def _amplitudes(curve: Panels, period: float, a: Floats, g: Floats, psi: Complex, phi: Complex) -> Complex:
    """(n,) amplitudes of the plane waves exp(i (a x + g z)) that the surface fields radiate."""
    (x, z), (nx, nz) = curve.point, curve.normal
    wave = np.exp(-1j * (np.outer(a, x) + np.outer(g, z))) * curve.weight
    slope = -1j * (np.outer(a, nx) + np.outer(g, nz))
    return 0.5j / (period * g) * ((wave * slope) @ psi - wave @ phi)


def _images(k: complex, curve: Panels, period: float, wanted: tuple[str, ...]) -> Images:
    near = range(-lattice.NEAR, lattice.NEAR + 1)
    return {m: operators.assemble(k, curve, curve.shifted(m * period), wanted, m == 0) for m in near}


def _summed(images: Images, alpha: float, period: float) -> dict[str, Complex]:
    """Near images with their phases."""
    total = {name: a.copy() for name, a in images[0].items()}
    for m, matrices in images.items():
        for name in total if m else ():
            total[name] += np.exp(1j * alpha * m * period) * matrices[name]
    return total
