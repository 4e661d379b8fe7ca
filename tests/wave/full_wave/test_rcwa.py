"""A second rigorous method beside the integral equations: Fourier modes of a lamellar grating (RCWA), written here.

Moharam and Gaylord 1981, TM with the inverse rule (Li 1996), as one linear system. On a metal it converges as 1/N in
TM: truncated at 80 it returns the reference of `gratings_rigorous.json` to 3·10⁻⁷ and is 1.4·10⁻³ off where it goes.
"""

from __future__ import annotations

import numpy as np
import pytest

import vgonio as vg
from vgonio.wave.full_wave import periodic, profile

PERIOD, DEPTH, WAVELENGTH, INDEX, THETA = 2.0, 0.1, 0.4, 0.375150842 + 4.226433266j, np.deg2rad(30.0)


def rcwa(polarisation: str, order: int, index: complex = INDEX, period: float = PERIOD) -> dict[int, float]:
    """Efficiency by contract order of ridges half a period wide on a substrate of the same material."""
    eps, k0 = index**2, 2 * np.pi / WAVELENGTH
    n, h = np.arange(-order, order + 1), np.arange(-2 * order, 2 * order + 1)
    kx = np.sin(THETA) + n * WAVELENGTH / period
    step = np.where(h == 0, 0.5, np.sin(np.pi * h / 2) / np.where(h == 0, 1, np.pi * h))

    def toeplitz(ridge: complex) -> np.ndarray:
        return ((h == 0) + (ridge - 1) * step)[(n[:, None] - n) + 2 * order]

    one, kk = np.eye(len(n)), np.diag(kx)
    inverse = toeplitz(1 / eps)
    straight = toeplitz(eps)
    if polarisation == "TE":
        q2, w = np.linalg.eig(kk @ kk - straight)
    else:
        q2, w = np.linalg.eig(np.linalg.inv(inverse) @ (kk @ np.linalg.solve(straight, kk) - one))
    q = np.sqrt(q2 + 0j)
    q = np.where(q.real < 0, -q, q)
    v = w * q if polarisation == "TE" else inverse @ (w * q)
    x = np.exp(-k0 * q * DEPTH)
    above = np.sqrt(1 - kx**2 + 0j)
    below = np.sqrt(eps - kx**2 + 0j) / (1 if polarisation == "TE" else eps)
    incident = (n == 0).astype(complex)
    zero = 0 * one
    system = np.block(
        [
            [one, zero, -w, -w * x],
            [-1j * np.diag(above), zero, v, -v * x],
            [zero, one, -w * x, -w],
            [zero, 1j * np.diag(below), v * x, -v],
        ]
    )
    right = np.concatenate([-incident, -1j * above * incident, 0 * incident, 0 * incident])
    reflected = np.linalg.solve(system, right)[: len(n)]
    # the light comes from +θ here as there; this n counts along sin θ_o = +sin θ_i + nλ/P on the mirror side
    return {int(m): float(abs(r) ** 2 * a.real / np.cos(THETA)) for m, r, a in zip(n, reflected, above)}


@pytest.fixture(scope="module")
def ours() -> dict[str, dict[int, float]]:
    surface = vg.surface.lamellar(PERIOD, DEPTH, 0.5, shape=(1, 20), pitch_um=0.1)
    curve = profile.one_period(surface, WAVELENGTH, profile.Resolution(0.25, 1e-9, 12, 2))
    grating = periodic.Grating.of(curve, PERIOD, WAVELENGTH, INDEX, ("TE", "TM"))
    found = grating.diffract(THETA, ("TE", "TM"))
    return {p: dict(zip(d.order.tolist(), d.efficiency)) for p, d in zip(("TE", "TM"), found)}


def test_te(ours, agreement):
    """Fourier modes converge as N⁻³: 7e-5 at 40, 3e-6 at 120."""
    modes = rcwa("TE", 120)
    error = max(abs(modes[m] - e) for m, e in ours["TE"].items())
    agreement("full wave: an aluminium lamellar grating, TE, 120 modes", "RCWA written here", error, 5e-6)


def test_tm(ours, agreement):
    """The difference falls with the truncation as 1/N or faster, and is nought in the limit to a tenth of the last."""

    def errors(order: int) -> np.ndarray:
        modes = rcwa("TM", order)
        return np.array([modes[m] - e for m, e in ours["TM"].items()])

    e = {n: errors(n) for n in (40, 80, 160)}
    size = {n: np.abs(v).max() for n, v in e.items()}
    assert size[160] < 0.6 * size[80] < 2e-3
    agreement("full wave: an aluminium lamellar grating, TM, 160 modes", "RCWA written here", size[160], 1e-3)


def test_glass_by_both(agreement):
    """No absorption, both polarisations: modes converge quickly in glass."""
    surface = vg.surface.lamellar(PERIOD, DEPTH, 0.5, shape=(1, 20), pitch_um=0.1)
    curve = profile.one_period(surface, WAVELENGTH, profile.Resolution(0.2, 1e-9, 10, 1))
    grating = periodic.Grating.of(curve, PERIOD, WAVELENGTH, 1.5 + 0j, ("TE", "TM"))
    for p, d in zip(("TE", "TM"), grating.diffract(THETA, ("TE", "TM"))):
        modes = rcwa(p, 60, 1.5 + 0j)
        error = max(abs(modes[m] - e) for m, e in zip(d.order.tolist(), d.efficiency))
        agreement("full wave: a lamellar grating of glass, TE and TM", "RCWA written here", error, 1e-5)
