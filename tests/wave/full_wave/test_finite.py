"""Finite profiles under a tapered beam: closed forms, identities, and Kirchhoff where it holds."""

from __future__ import annotations

import numpy as np
import pytest

import vgonio as vg
from vgonio.materials import fresnel
from vgonio.wave import FullWave, Kirchhoff
from vgonio.wave.full_wave import beam, kernels, scatter_profile, windows


def rough(rms: float, correlation: float, seed: int, length: float = 40.0, n: int = 800):
    """x, z of a Gaussian profile with Gaussian correlation, by a moving average of white noise."""
    h = length / n
    t = np.arange(-3 * correlation, 3 * correlation + h / 2, h)
    kernel = np.exp(-2 * (t / correlation) ** 2)
    noise = np.random.default_rng(seed).normal(size=n + len(t) - 1)
    return (np.arange(n) + 0.5) * h, rms * np.convolve(noise, kernel, "valid") / np.sqrt(np.sum(kernel**2))


def test_beam_is_a_gaussian_on_the_mean_plane():
    k, taper = 2 * np.pi, 4.0
    made = beam.gaussian(k, np.deg2rad(30), taper, 7.0, 30.0)
    x = np.linspace(-10, 24, 200)
    one = np.ones_like(x)
    field, slope = made.on(x, 0 * x, (0 * one, one))
    expected = np.exp(-((x - 7.0) ** 2) / (2 * taper**2) - 1j * k * np.sin(np.deg2rad(30)) * (x - 7.0))
    assert np.abs(field - expected).max() < 1e-7
    # incident flux through z = 0 against the power that the beam states
    flux = -np.trapezoid(np.imag(np.conj(field) * slope), x) / k
    assert flux == pytest.approx(made.power, rel=1e-6)


@pytest.mark.parametrize("index", [None, 1.5, 0.79 + 5.85j])
@pytest.mark.parametrize("polarisation", ["TE", "TM"])
def test_flat_mirror(index, polarisation):
    """Reflected power is that of the beam's plane waves, each with Fresnel's reflectance."""
    x, taper, angles = np.linspace(0, 40, 200), 4.0, np.array([20.0, 56.3])
    found = scatter_profile(x, 0 * x, 1.0, angles, polarisation, index, taper)
    sine = np.linspace(-1, 1, 20001)[1:-1]
    cosine = np.sqrt(1 - sine**2)
    r = fresnel(cosine, 1e9j if index is None else index)[0 if polarisation == "TE" else 1]
    for reflected, middle in zip(found.reflected, np.sin(np.deg2rad(angles))):
        flux = cosine * np.exp(-((2 * np.pi * taper * (sine - middle)) ** 2))
        assert reflected == pytest.approx(np.sum(flux * np.abs(r) ** 2) / np.sum(flux), abs=1e-6)
    assert np.abs(found.balance - 1).max() < 1e-5


@pytest.mark.parametrize("polarisation", ["TE", "TM"])
@pytest.mark.parametrize("index", [None, 1.5, 0.79 + 5.85j])
def test_energy_and_extinction(index, polarisation, agreement):
    """RMS slope 0.35: what comes back, goes in and leaves sideways is all (1e-4); below, the field is nought."""
    x, z = rough(0.35, 1.4, 1)
    found = scatter_profile(x, z, 1.0, [20.0], polarisation, index, 5.0)
    agreement("full wave: energy of finite rough profiles", "1", found.balance[0] - 1, 1e-4)
    fields = found.fields
    px, pz = np.linspace(16, 24, 9), np.full(9, -3.0)
    sx, sz = fields.curve.point
    rx, rz = px[:, None] - sx, pz[:, None] - sz
    r = np.hypot(rx, rz)
    nx, nz = fields.curve.normal
    double = kernels.slope(fields.k, r) * (nx * rx + nz * rz) * fields.curve.weight
    scattered = double @ fields.psi - (kernels.single(fields.k, r) * fields.curve.weight) @ fields.phi
    incident, _ = fields.beams[0].on(px, pz, (0 * px, 0 * px + 1))
    assert np.abs(scattered[:, 0] + incident).max() < 3e-3 * np.abs(incident).max()


def test_panels_converge_on_a_steep_profile():
    """RMS slope 0.7: the angular power changes by less than 1e-4 of its largest value from 0.8 to 0.5 λ panels."""
    x, z = rough(1.0, 2.0, 3)
    out = np.linspace(-85, 85, 171)
    for polarisation in ("TE", "TM"):
        a, b = (scatter_profile(x, z, 1.0, [20.0], polarisation, None, 5.0, out, w).density for w in (0.8, 0.5))
        assert np.abs(a - b).max() < 1e-4 * b.max()


@pytest.mark.parametrize("polarisation", ["TE", "TM"])
def test_light_that_leaves_past_the_ends_is_counted(polarisation):
    """RMS slope 0.7: what is missing above is found below, in the far field of beam and surface together: all of it
    in TE, nine tenths in TM, where the field does not vanish at the ends. With flat ends there is less of it."""
    x, z = rough(1.0, 2.0, 5, 30.0, 600)
    z = z * np.sin(np.pi * np.clip((15.0 - np.abs(x - 15.0)) / 8.0, 0, 1) / 2) ** 2
    flat = np.arange(0.025, 20, 0.05)
    wide_x = np.concatenate([flat - 20, x, 30 + flat])
    wide_z = np.concatenate([0 * flat, z, 0 * flat])
    narrow = scatter_profile(x, z, 1.0, [20.0], polarisation, None, 4.0)
    wide = scatter_profile(wide_x, wide_z, 1.0, [20.0], polarisation, None, 4.0)
    for found in (narrow, wide):
        assert abs(1 - found.balance[0]) < 1e-5 + (1e-3 if polarisation == "TE" else 0.1) * found.lost[0]
    assert wide.lost[0] < narrow.lost[0]


def test_smooth_profile_is_as_kirchhoff_says():
    """RMS slope 0.035, heights of λ/10: tangent planes are right, to the edges of the windows (a few per cent)."""
    x, z = rough(0.055, 2.2, 2, 24.0, 240)
    row = vg.surface.Heightfield(z[None] - z.mean(), pitch_um=0.1)
    # Kirchhoff's window is two-dimensional: cones that take in what it spreads across the plane (99 %)
    wide = row.replace(z=np.repeat(row.z, 240, axis=0))
    gonio = vg.measure.Gonioreflectometer([0.0, 30.0], np.arange(-60, 61, 10), aperture_deg=10.0, coherence_um=4.0)
    rigorous = gonio.measure(row, FullWave("Al", [550.0]))
    scalar = gonio.measure(wide, Kirchhoff("Al", [550.0]))
    a, b = rigorous.brdf.values[..., 0], scalar.brdf.values[..., 0]
    assert np.abs(a - b).sum(axis=1).max() < 0.03 * b.sum(axis=1).min()
    assert rigorous.attrs["windows"] == 1
    assert np.abs(rigorous.energy_balance.values - 1).max() < 1e-3


def test_steep_profile_is_not_as_kirchhoff_says():
    """RMS slope 0.7: single scattering misses power that the rigorous solution and the metal's balance have."""
    x, z = rough(0.7, 1.4, 4, 24.0, 480)
    row = vg.surface.Heightfield(z[None] - z.mean(), pitch_um=0.05)
    gonio = vg.measure.Gonioreflectometer([20.0], np.arange(-80, 81, 4), aperture_deg=4.0, coherence_um=4.0)
    rigorous = gonio.measure(row, FullWave("perfect", [550.0]))
    scalar = gonio.measure(row.replace(z=np.repeat(row.z, 480, axis=0)), Kirchhoff("perfect", [550.0]))
    a, b = rigorous.brdf.values[0, :, 0], scalar.brdf.values[0, :, 0]
    assert np.abs(a - b).sum() > 0.15 * a.sum()
    assert float(rigorous.energy_reflected.squeeze()) > 0.98


def test_polarisation_follows_the_light():
    x, z = rough(0.1, 1.0, 6, 16.0, 160)
    row = vg.surface.Heightfield(z[None], pitch_um=0.1)
    light = {"theta_i_deg": [20.0], "theta_o_deg": [-30, -20, 0], "coherence_um": 2.0}
    found = {
        p: vg.measure.Gonioreflectometer(**light, polarisation=p).measure(row, FullWave("Al", [550.0]))
        for p in ("unpolarised", "s", "p")
    }
    both = found["unpolarised"].brdf_by_polarisation
    assert np.allclose(found["s"].brdf, both.sel(polarisation="TE"), rtol=1e-9)
    assert np.allclose(found["p"].brdf, both.sel(polarisation="TM"), rtol=1e-9)
    assert np.allclose(found["unpolarised"].brdf, both.mean("polarisation"), rtol=1e-12)
    assert list(found["s"].polarisation.values) == ["TE"]


def test_windows_give_a_standard_error(monkeypatch):
    """Many windows along a profile: their spread over the root of how many are independent; cells of a hemisphere hold
    the power that is reflected."""
    seen, detected = [], windows._detected
    monkeypatch.setattr(windows, "_detected", lambda *a: seen.append(detected(*a)) or seen[-1])
    x, z = rough(0.1, 1.0, 7, 40.0, 400)
    row = vg.surface.Heightfield(z[None], pitch_um=0.1)
    gonio = vg.measure.Gonioreflectometer.hemisphere([0.0], resolution_deg=15.0, coherence_um=2.0)
    data = gonio.measure(row, FullWave("Al", [550.0]))
    assert (n := data.attrs["windows"]) > 5
    independent = windows.centres(row, 2.0, None)[1]
    assert independent < 0.9 * n
    te_tm = np.array([brdf for brdf, _ in seen[-2 * n :]]).reshape(n, 2, -1)
    variance = (te_tm.var(axis=0, ddof=1) / independent).mean(axis=0)  # TE and TM see the same windows: no √2 less
    np.testing.assert_allclose(data.brdf_stderr.values.ravel(), np.sqrt(variance), rtol=1e-6, atol=1e-12)
    caught = float((data.brdf.squeeze() * gonio.detector.projected_solid_angle).sum())
    assert caught == pytest.approx(float(data.energy_reflected.squeeze()), rel=1e-3)


def test_enhanced_backscattering():
    """σ = 1.2 λ, T = 2.4 λ, perfect, TM: a peak in the retro direction, less than twice its surroundings (O'Donnell and
    Mendez 1987), for two angles of incidence. 36 profiles: speckle of some 12 % on the peak."""
    out = np.arange(-30, 31, 1.0)
    theta = np.array([0.0, 8.0])
    mean = np.zeros((2, len(out)))
    for seed in range(36):
        x, z = rough(1.2, 2.4, seed, 32.0, 640)
        mean += scatter_profile(x, z, 1.0, theta, "TM", None, 4.5, out, 1.1).density / 36
    peak = np.mean([mean[i][np.abs(out - t) <= 1.5].mean() for i, t in enumerate(theta)])
    beside = [mean[i][(np.abs(out - t) > 8) & (np.abs(out - t) < 22)].mean() for i, t in enumerate(theta)]
    assert 1.3 < peak / np.mean(beside) < 2.2
