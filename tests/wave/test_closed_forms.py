"""The solver against what scattering theory says of Gaussian surfaces in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import j0, jv

import vgonio as vg
from vgonio.directions import unit_vectors
from vgonio.errors import InputError
from vgonio.materials import material
from vgonio.wave import closed_forms
from vgonio.wave.theories import THEORIES, amplitude, scattering_vector


def in_plane(*degrees: float) -> np.ndarray:
    return unit_vectors(np.deg2rad(np.array(degrees)))


# ---- Beckmann and Spizzichino's ensemble mean
@pytest.mark.parametrize("g", [1e-4, 0.5, 30.0, 2000.0])
def test_the_series_is_the_integral(g):
    """2π ∫ r J₀(qr) exp(−g(1 − exp(−r²/T²)) − r²/4ℓ²) dr by plain quadrature, from a mirror to 7 waves of roughness."""
    sigma, correlation, window = 0.3, 3.0, 8.0
    r = np.linspace(0, 60, 400_001)
    integrand = r * np.exp(-g * (1 - np.exp(-((r / correlation) ** 2))) - r**2 / (4 * window**2))
    q = np.array([[0.0, 0.0, 1.0], [0.4, 0.3, 1.0], [3.0, 0.0, 1.0]]) * [1, 1, np.sqrt(g) / sigma]
    exact = [2 * np.pi * np.trapezoid(integrand * j0(np.hypot(*v[:2]) * r), r) for v in q]
    assert np.allclose(
        closed_forms.mean_intensity(q, sigma, correlation, window), exact, rtol=1e-6, atol=1e-7 * exact[0]
    )


@pytest.mark.parametrize("theory", THEORIES)
@pytest.mark.parametrize("sigma", [0.04, 0.25])
def test_mean_over_windows_is_the_ensemble_mean(theory, sigma, agreement):
    """Two surfaces, some 250 independent windows: 5 standard errors and 2 % of the closed form.

    A window that is cut at 3 ℓ, and its 1 % taken off, has a mirror peak lower by 5 % and wings of 1e-5 of it.
    """
    correlation, window, angles = 2.0, 4.0, [-45, -30, -15, 10]
    gonio = vg.measure.Gonioreflectometer([30], angles, aperture_deg=1e-3, coherence_um=window)
    solver = vg.wave.Kirchhoff("perfect", [600], theory=theory)
    size = {"shape": (240, 240), "pitch_um": 0.4}
    runs = [
        gonio.measure(vg.surface.gaussian(sigma, correlation, seed=s, exact=False, **size), solver) for s in range(2)
    ]
    f = np.mean([r.brdf.values for r in runs], axis=0)[0, :, 0]
    error = np.sqrt(np.sum([r.brdf_stderr.values**2 for r in runs], axis=0))[0, :, 0] / len(runs)
    expected = closed_forms.beckmann(theory, in_plane(30), in_plane(*angles), 600, sigma, correlation, window)
    t = np.linspace(-3, 3, 20001) * window
    g = np.exp(-(t**2) / (2 * window**2)) - np.exp(-4.5)
    peak = (np.trapezoid(g, t) ** 2 / np.trapezoid(g**2, t)) ** 2 / (4 * np.pi * window**2)
    assert 0.94 < peak < 0.96
    expected[1] *= peak if sigma < 0.1 else 1.0  # there is no coherent light in the mirror direction at 0.25 µm
    assert np.median(error / expected) < 0.1
    agreement(
        "ensemble mean on Gaussian surfaces, three theories (5 standard errors + 2 %)",
        "Beckmann and Spizzichino's series",
        100 * (f / expected - 1),
        100 * (5 * error / expected + 0.02 + 1e-5 * expected.max() / expected),
        "%",
    )


# ---- coherent power and total integrated scatter, over all orders of a periodic surface
def power(theory: str, surface, theta: float, wavelength_um: float = 1.0) -> tuple[float, float]:
    """(coherent, total) power on a perfect reflector: every order of the field is a plane wave, no window, no cone."""
    k, side = 2 * np.pi / wavelength_um, surface.size_um[0]
    n = int(2 * side / wavelength_um) + 1
    orders = np.stack(np.meshgrid(np.arange(-n, n + 1), np.arange(-n, n + 1)), -1).reshape(-1, 2)
    wi = in_plane(theta)[0]
    s = orders * 2 * np.pi / side / k - wi[:2]
    up = np.sum(s**2, axis=1) < 1 - 1e-9
    wo = np.column_stack([s[up], np.sqrt(1 - np.sum(s[up] ** 2, axis=1))])
    both = np.broadcast_to(wi, wo.shape)
    q = scattering_vector(theory, np.full(len(wo), k), both, wo)
    q[:, :2] = orders[up] * 2 * np.pi / side
    S = vg.wave.surface_fourier(surface, q, tol=1e-3) / surface.area_um2
    e = amplitude(theory, both, wo) ** 2 * np.abs(S) ** 2 / (wi[2] * wo[:, 2])
    return float(e[np.all(orders[up] == 0, axis=1)].sum()), float(e.sum())


@pytest.mark.parametrize("theory", THEORIES)
@pytest.mark.parametrize("sigma", [0.02, 0.06, 0.12])
def test_total_integrated_scatter(theory, sigma, agreement):
    """T = 5λ, 0 … 60°: 1 − exp(−(4πσ cos θ_i/λ)²), without cos θ_i for OHS, within 4 standard errors over five
    surfaces and 1 % of it (slopes: GHS loses 0.8 % of the power at σ = 0.15 λ, OHS 3 % at 60°)."""
    found = []
    for seed in range(5):
        surface = vg.surface.gaussian(sigma, 5.0, shape=(64, 64), pitch_um=0.5, seed=seed)
        found.append([power(theory, surface, t) for t in (0, 40, 60)])
    coherent, total = np.moveaxis(found, -1, 0)
    expected = closed_forms.total_integrated_scatter(theory, sigma, [0, 40, 60], 1000)
    scattered = 1 - coherent / total
    error = scattered.std(axis=0, ddof=1) / np.sqrt(5)
    assert np.all(error < 0.015)
    agreement(
        "total integrated scatter, T = 5λ, 0 … 60°, three theories (4 standard errors + 1 %)",
        "1 − exp(−(4πσ cos θ_i/λ)²), OHS without cos θ_i",
        scattered.mean(axis=0) - expected,
        4 * error + 0.01 * expected + 1e-4,
    )
    # coherent power, R exp(−(q_z σ)²), needs no gentle slopes: 1e-3 beside the errors
    share = closed_forms.coherent_share(theory, sigma, [0, 40, 60], 1000)
    agreement(
        "coherent power of two-dimensional Gaussian surfaces (4 standard errors + 1e-3)",
        "R exp(−(q_z σ)²)",
        coherent.mean(axis=0) - share,
        4 * coherent.std(axis=0, ddof=1) / np.sqrt(5) + 1e-3,
    )
    assert np.allclose(total, 1, atol=0.03)


def test_beyond_its_range_total_integrated_scatter_fails():
    """T = λ at 60°: a seventh of what GHS should scatter is evanescent; the range in the docstring is a real one."""
    surface = vg.surface.gaussian(0.08, 1.0, shape=(160, 160), pitch_um=0.25, seed=2)
    coherent, total = power("generalized-harvey-shack", surface, 60)
    assert 1 - coherent / total < 0.9 * closed_forms.total_integrated_scatter("kirchhoff", 0.08, 60, 1000)


def test_sinusoid_to_one_in_a_million(agreement):
    """|S|²/A² of order m is J_m(q_z a)² at tol = 1e-7, by transform and by direct sum."""
    surface = vg.surface.sinusoid(period_um=2, amplitude_um=0.1, shape=(64, 1000), pitch_um=0.05)
    m = np.arange(-6, 7)
    for method in ("nufft", "reference", "auto"):
        for q_z in (0.5, 8.0, 22.0, 60.0):
            q = np.stack([np.pi * m, 0 * m, np.full(m.shape, q_z)], axis=1)
            found = np.abs(vg.wave.surface_fourier(surface, q, method=method, tol=1e-7) / surface.area_um2) ** 2
            error = np.abs(found - jv(m, q_z * 0.1) ** 2).max()
            agreement("|S|² of a sinusoid, orders −6 … 6, q_z a up to 6", "J_m(q_z a)²", error, 1e-6)


# ---- slightly rough surfaces
@pytest.mark.parametrize("theory", THEORIES)
def test_first_order_is_the_limit_of_little_roughness(theory, agreement):
    """The n = 1 term of Beckmann's series over a wide window: σ = λ/5000, away from the mirror, to 1e-4."""
    sigma, correlation = 1e-4, 0.4
    wi, wo = in_plane(30), in_plane(-60, -10, 10, 30, 70)
    q = scattering_vector(theory, np.full(5, 2 * np.pi / 0.5), np.broadcast_to(wi, wo.shape), wo)
    spectrum = closed_forms.gaussian_spectrum(q, sigma, correlation)
    linear = closed_forms.linearised(theory, wi, wo, 500, spectrum)
    series = closed_forms.beckmann(theory, wi, wo, 500, sigma, correlation, 200.0)
    assert np.allclose(linear, series, rtol=1e-4)  # at 70° nothing but 7e-11 sr⁻¹
    error = (linear - series) / series.max()
    agreement("slightly rough surfaces, three theories, first order", "Beckmann's series at σ = λ/5000", error, 1e-4)


def test_the_spectrum_holds_the_variance():
    f = np.linspace(-20, 20, 801)
    q = np.stack(np.meshgrid(f, f), -1)
    total = closed_forms.gaussian_spectrum(q, 0.2, 1.5).sum() * (f[1] - f[0]) ** 2 / (4 * np.pi**2)
    assert total == pytest.approx(0.04, rel=1e-9)


@pytest.mark.parametrize("polarisation", ["s", "p"])
@pytest.mark.parametrize("name", ["Al", "SiO2"])
def test_rice_s_factor_is_the_reflectance_in_the_mirror_direction(polarisation, name):
    """Q = R there (cos⁴ of the scalar theories and of Rice are the same); Fresnel from the materials, to rounding."""
    metal = material(name)
    index = complex(np.ravel(metal.index([550.0]))[0])
    for theta in (0.0, 30.0, 75.0):
        wi, wo = in_plane(theta), in_plane(-theta)
        vector = closed_forms.rayleigh_rice(polarisation, wi, wo, 550, 1.0, index)
        scalar = closed_forms.linearised("kirchhoff", wi, wo, 550, 1.0)
        expected = metal.reflectance(np.cos(np.deg2rad(theta)), 550, polarisation)
        assert vector[0] / scalar[0] == pytest.approx(float(np.ravel(expected)[0]), rel=1e-12)


def test_a_good_conductor_is_nearly_a_perfect_one():
    wi, wo = in_plane(50), in_plane(-70, -20, 40)
    for polarisation in "sp":
        good = closed_forms.rayleigh_rice(polarisation, wi, wo, 550, 1.0, 1e5j)
        assert np.allclose(good, closed_forms.rayleigh_rice(polarisation, wi, wo, 550, 1.0), rtol=1e-3)


def test_where_the_theories_part(agreement):
    """60° retro: Kirchhoff 16 times Rice's s, Rice's p 49 times; in the mirror direction all but OHS are one."""
    found = closed_forms.parting(60, [60, -60])
    agreement(
        "Kirchhoff over Rayleigh–Rice s, slightly rough, 60° retro and mirror: factors 16 and 1",
        "closed forms by hand",
        np.array(found["kirchhoff"]) / [16, 1] - 1,
        1e-6,
    )
    assert found["rayleigh-rice p"] == pytest.approx([(1 + 0.75) ** 2 / 0.25**2, 1])
    assert found["generalized-harvey-shack"] == pytest.approx([1, 1])
    assert found["harvey-shack"] == pytest.approx([4, 4])
    # near the normal nothing but OHS's factor tells them apart: 1 % at 5°
    assert all(np.allclose(v, 1, atol=0.04) for v in closed_forms.parting(5, [-5, 0, 5]).values())


def test_bad_input():
    with pytest.raises(InputError, match="plane of incidence"):
        closed_forms.rayleigh_rice("s", in_plane(30), np.array([[0.1, 0.3, 0.9]]), 500, 1.0)
    with pytest.raises(InputError, match="polarisation"):
        closed_forms.rayleigh_rice("x", in_plane(30), in_plane(30), 500, 1.0)
    with pytest.raises(InputError, match="did you mean"):
        closed_forms.total_integrated_scatter("kirchof", 0.1, 0, 500)
