"""What rays and waves have to agree on, on the same interpolated surface, and a blazed grating in closed form."""

from __future__ import annotations

import numpy as np
import pytest

import vgonio as vg

ANGLES = np.array([-60, -40, -30, -20, 0, 20])


@pytest.mark.parametrize("theory", ["kirchhoff", "generalized-harvey-shack"])
def test_short_wavelengths_become_rays(theory, agreement):
    """λ → 0, mean over windows and a wide cone: Kirchhoff gives the rays' single-bounce BRDF, GHS that times cos⁴θ_h.

    Gaussian surface, α = 0.2, σ/λ = 2, nothing masked. What is left over 5 standard errors: 6 % of the value for the
    finite wavelength and the cone, over which the lobe is not constant.
    """
    surface = vg.surface.gaussian(rms_um=0.8, correlation_um=8, shape=(192, 192), pitch_um=0.5, seed=3)
    gonio = vg.measure.Gonioreflectometer([30], ANGLES, aperture_deg=12, coherence_um=5)
    waves = gonio.measure(surface, vg.wave.Kirchhoff("perfect", [400], theory=theory)).isel(theta_i=0, wavelength=0)
    rays = gonio.measure(surface, vg.geometric.RayOptics("perfect", [400], rays=300_000, refinement=4))
    rays = rays.isel(theta_i=0, wavelength=0)
    expected = rays.brdf_by_bounce.sel(bounce=1).values
    if theory != "kirchhoff":
        expected = expected * np.cos(np.deg2rad((ANGLES + 30) / 2)) ** 4
    error = np.hypot(waves.brdf_stderr, rays.brdf_stderr).values
    bright = expected > 1e-2 * expected.max()
    assert bright.sum() >= 4
    agreement(
        "λ → 0, Kirchhoff, and GHS over cos⁴θ_h (5 standard errors + 6 %)",
        "single reflections of rays",
        100 * (waves.brdf.values / expected - 1)[bright],
        100 * (5 * error / expected + 0.06)[bright],
        "%",
    )


def test_harvey_shack_keeps_less_light_coherent_off_the_normal():
    """Order 0 of a rough periodic profile is |⟨exp(i q_z z)⟩|²: with q_z = 2k at 60°, that of normal incidence."""
    x = (np.arange(64) + 0.5) / 64
    surface = vg.surface.Heightfield(np.tile(0.08 * np.sin(2 * np.pi * x) + 0.03 * np.cos(6 * np.pi * x), (2, 1)), 0.25)
    surface = surface.replace(periodic=True)
    order = {}
    for theory in ("generalized-harvey-shack", "harvey-shack"):
        data = vg.wave.Kirchhoff("perfect", [500], theory=theory, tol=1e-6).orders(surface, [0, 60])
        order[theory] = data.efficiency.sel(order=0, wavelength=500).values
    generalised, original = order["generalized-harvey-shack"], order["harvey-shack"]
    assert np.isclose(original[0], generalised[0], rtol=1e-4)
    # C² / (cos θ_i cos θ_o) is 1 in the mirror direction of either
    assert np.isclose(original[1], original[0], rtol=1e-4)
    assert generalised[1] > 1.5 * original[1]


def test_blazed_grating_in_closed_form(agreement):
    """A polygon: each side contributes ∫ exp(−i(q_x x + q_z z)) dx in closed form; orders agree to 1e-8."""
    surface = vg.surface.blazed(period_um=2.0, blaze_deg=10.0, shape=(4, 200), pitch_um=0.05)
    x, z = surface.x, surface.z[0]
    x = np.append(x, x[0] + 10.0)
    z = np.append(z, z[0])
    m = np.arange(-4, 5)
    q = np.stack([2 * np.pi * m / 2.0, 0 * m, np.full(m.shape, 19.0)], axis=1)
    a = q[:, :1] * np.diff(x) + q[:, 2:] * np.diff(z)
    start = np.exp(-1j * (q[:, :1] * x[:-1] + q[:, 2:] * z[:-1]))
    sides = start * np.diff(x) * np.exp(-0.5j * a) * np.sinc(a / (2 * np.pi))
    exact = sides.sum(axis=1) * surface.size_um[0]
    found = vg.wave.surface_fourier(surface, q, tol=1e-9)
    error = np.linalg.norm(found - exact) / np.linalg.norm(exact)
    agreement("orders of a blazed grating", "integral over its polygon", error, 1e-8)
    # 10° at q_z = 19 blazes towards the order whose q_x = −q_z tan 10°
    assert abs(m[np.argmax(np.abs(found))] + 19.0 * np.tan(np.deg2rad(10)) * 2 / (2 * np.pi)) < 1
