"""The quasi-periodic Green's function: near images one by one, all others as a short sum of plane waves.

With field factor exp(iαP) from one period to the next, the images |m| > M are a geometric series under the integral
H₀(kr) = (1/π) ∫ exp(iκ|x| + itz) dt/κ, κ = (k² − t²)^½ (Linton 1998, J. Eng. Math. 33, 377; Yasumoto and Yoshitomi
1999). Between its poles t = ±γ_n, where κ = ±α_n, the path is laid through the complex plane, where the trapezoidal
rule converges exponentially; a pole −γ_n that the path passes on the other side adds its residue, which is one order of
the grating. So the sum stays accurate however close an order comes to grazing (γ_n → 0, Wood's anomaly), where the
function itself grows as 1/γ_n.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .kernels import Complex
from .panels import Floats, Panels

NEAR = 1  # images on each side that are summed one by one
DIGITS = 27.0  # nepers that the path and its rule keep
GROWTH = 5.0  # nepers by which a plane wave may grow over the height of the profile
BUMPS = (0.0, 0.4, 0.8)  # how far the path sinks at t = 0, in units of its height elsewhere


@dataclass(frozen=True, eq=False)
class FarImages:
    """Σ_j c_j exp(i (p_j Δx + t_j Δz)): all images but those within NEAR periods. c, p, t : (j,)"""

    c: Complex
    p: Complex
    t: Complex

    def value(self, dx: Floats, dz: Floats) -> Complex:
        """(n,) the sum at differences target − source, µm."""
        return np.exp(1j * (np.outer(dx, self.p) + np.outer(dz, self.t))) @ self.c

    def add(self, targets: Panels, out: dict[str, Complex]) -> None:
        """Add the potentials of these images to matrices of one curve (see `operators.assemble`), in place."""
        x, z = targets.point
        nx, nz = targets.normal
        phase = np.outer(x - x.mean(), self.p) + np.outer(z - z.mean(), self.t)
        # growing and shrinking factors are shared out evenly: neither side overflows
        to, back = np.exp(1j * phase) * self.c, np.exp(-1j * phase).T * targets.weight
        along = 1j * (np.outer(nx, self.p) + np.outer(nz, self.t))
        if "single" in out:
            out["single"] += to @ back
        if "double" in out:
            out["double"] += to @ (back * -along.T)
        if "adjoint" in out:
            out["adjoint"] += (to * along) @ back


def far_images(k: complex, alpha: float, period: float, height: float) -> FarImages:
    """All images beyond ±NEAR for |Δx| ≤ period and |Δz| ≤ height (µm); k (Im ≥ 0) and alpha in rad/µm."""
    empty = np.zeros(0, np.complex128)
    if complex(k).imag * NEAR * period > DIGITS + 6:
        return FarImages(empty, empty, empty)
    gamma, order_alpha = _orders(k, alpha, period)
    t, dt, low = _path(k, gamma, period, height)
    kappa = np.sqrt(k**2 - t**2 + 0j)
    c, p = [], []
    for side in (1.0, -1.0):
        turn = 1j * (kappa - side * alpha) * period
        c.append(0.25j / np.pi * dt / kappa * np.exp(turn * (NEAR + 1)) / -np.expm1(turn))
        p.append(side * kappa)
    c.append(0.5j / (period * gamma[low]))
    p.append(order_alpha[low].astype(np.complex128))
    found = FarImages(np.concatenate(c), np.concatenate(p), np.concatenate([t, t, -gamma[low]]))
    size = np.abs(found.c) * np.exp(np.abs(found.p.imag) * period + np.abs(found.t.imag) * height)
    some = size > np.exp(-DIGITS) * 1e-2
    return FarImages(found.c[some], found.p[some], found.t[some])


def _orders(k: complex, alpha: float, period: float) -> tuple[Complex, Floats]:
    """γ_n (Im ≥ 0) and α_n of the orders whose poles could matter to the path."""
    most = int(np.ceil(3 * abs(k) * period / (2 * np.pi))) + 3
    order_alpha: Floats = np.asarray(alpha + 2 * np.pi * np.arange(-most, most + 1) / period)
    return gammas(k, order_alpha), order_alpha


def gammas(k: complex, alpha: Floats) -> Complex:
    """(n,) γ = (k² − α²)^½ with Im γ ≥ 0, and Re γ ≥ 0 where it is real."""
    root = np.sqrt(complex(k) ** 2 - alpha**2 + 0j)
    return np.where(root.imag < 0, -root, root)


def _path(k: complex, gamma: Complex, period: float, height: float) -> tuple[Complex, Complex, np.ndarray]:
    """Nodes t (j,) and weights dt (j,) of the path that keeps furthest from all poles; which −γ_n lie above it."""
    end = np.sqrt(abs(k) ** 2 + ((DIGITS + GROWTH) / (NEAR * period)) ** 2)
    depth = min(GROWTH / max(height, 1e-9), abs(k) / 2, 8 / period)
    fine = np.linspace(-end, end, 4001)
    best: tuple[float, float] = (-1.0, 0.0)
    singular = np.concatenate([gamma, -gamma, [k, -k]])
    for bump in BUMPS:
        curve = fine - 1j * _sink(fine, depth, bump)
        clear = float(np.abs(curve[:, None] - singular).min())
        if clear > best[0] * 1.05:
            best = (clear, bump)
    clear, bump = best
    step = 2 * np.pi * min(clear, 1.2 * depth) / (DIGITS * 1.6)
    n = int(np.ceil(end / step))
    tau = (np.arange(-n, n + 1)) * end / n
    derivative = 1 - 1j * _sink(tau, depth, bump, True)
    low = -gamma.imag > -_sink(-gamma.real, depth, bump)  # the proper path runs above all of them
    return tau - 1j * _sink(tau, depth, bump), derivative * end / n, low


def _sink(tau: Floats, depth: float, bump: float, derivative: bool = False) -> Floats:
    """How far below the real axis the path runs at Re t = τ: odd far out, so that κ keeps Im κ > 0; a bump at 0."""
    u = tau / depth
    hump = bump * np.exp(-(u**2))
    if derivative:
        return 1 / np.cosh(np.clip(u, -300, 300)) ** 2 - 2 * u * hump
    return depth * (np.tanh(u) + hump)
