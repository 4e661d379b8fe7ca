"""The further formulas and what they keep of physics: closed forms, other quadratures, the wave solver."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio import models
from vgonio.directions import Detector, unit_vectors
from vgonio.errors import InputError
from vgonio.materials import material
from vgonio.models import Geometry, krywonos_2011
from vgonio.wave import closed_forms

ANGLES = np.arange(-80.0, 81, 20)
EVERY = {
    "lambert-1760": {"k_d": 0.5},
    "oren-nayar-1994": {"sigma_deg": 20.0, "k_d": 0.7},
    "cook-torrance-1982": {"alpha": 0.3, "k_d": 0.1, "c": 0.01},
    "beckmann-1963": {"alpha": 0.3, "eta": 1.5, "k_d": 0.3},
    "clausen-2022": {"alpha": 0.3, "h": 1e-3, "w": 3.0, "k_d": 0.1},
    "two-shifts": {"alpha": 0.3, "h1": 1e-3, "w1": 3.0, "h2": -1e-3, "w2": 2.0, "single_share": 0.7},
    "harvey-1976": {"l": 0.01, "s": -2.5, "k_s": 3.0},
    "krywonos-2011": {"rms_um": 0.01, "b_um": 5.0, "c_psd": 3.0},
}


def test_every_model_is_here():
    assert set(EVERY) == set(models.MODELS)


@pytest.mark.parametrize("name", EVERY)
def test_every_model_is_reciprocal_out_of_plane_and_the_same_in_plane(name, rng):
    theta_i, theta_o, phi = rng.uniform(0, 1.4, 50), rng.uniform(0, 1.4, 50), rng.uniform(0, 6, 50)
    g = Geometry.of(theta_i, theta_o, 0.3, phi)
    a, b = (models.brdf(name, x, [450, 650], **EVERY[name]) for x in (g, g.swapped))
    np.testing.assert_allclose(a, b, rtol=1e-10)
    # the signed in-plane angles are the same directions as polar angle and azimuth
    plane = models.evaluate(name, [40], ANGLES, [450, 650], **EVERY[name]).brdf.values[0]
    full = Geometry.of(np.radians(40), np.radians(abs(ANGLES)), 0.0, np.where(ANGLES < 0, np.pi, 0.0))
    np.testing.assert_allclose(models.brdf(name, full, [450, 650], **EVERY[name]), plane, rtol=1e-9)


@pytest.mark.parametrize("name", EVERY)
def test_physics_of_well_behaved_parameters(name):
    report = models.physics(name, [450, 650], **EVERY[name])
    broken = json.loads(report.attrs["broken"])
    # the constant c of 3.1 is subtracted from everything: 0.01 is less than k_d/pi here
    assert broken == []
    assert report.albedo.dims == ("theta_i", "wavelength")
    assert 0 < float(report.albedo.min())
    assert report.attrs["albedo_largest"] <= 1


def test_lambert():
    data = models.evaluate("lambert-1760", [0, 60], ANGLES, [400, 500, 600], k_d=[0.1, 0.2, 0.3])
    np.testing.assert_allclose(data.brdf, np.broadcast_to(np.array([0.1, 0.2, 0.3]) / np.pi, data.brdf.shape))
    albedo = models.directional_albedo("lambert-1760", [0, 40, 85], [500], k_d=0.6)
    # the disc rule integrates a constant over the unit disc: 1e-6 is its error at 85°, where the rim is near
    np.testing.assert_allclose(albedo, 0.6, rtol=1e-6)


def test_oren_nayar_in_numbers():
    """σ = 0 is Lambert; at normal incidence only A is left; 45° retro by hand."""
    flat = models.evaluate("oren-nayar-1994", [0, 50], ANGLES, [500], sigma_deg=0.0, k_d=0.8)
    np.testing.assert_allclose(flat.brdf, 0.8 / np.pi)
    s2 = np.radians(30) ** 2
    a, b = 1 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
    assert float(models.directional_albedo("oren-nayar-1994", 0, 500, sigma_deg=30, k_d=1)[0, 0]) == pytest.approx(
        a, rel=1e-6
    )
    rough = models.evaluate("oren-nayar-1994", [45], [-45, 45], [500], sigma_deg=30, k_d=1).brdf.values.ravel()
    np.testing.assert_allclose(rough, [a / np.pi, (a + b * np.sin(np.pi / 4)) / np.pi], rtol=1e-12)


@pytest.mark.parametrize("alpha", [0.005, 0.02, 0.3, 0.8])
@pytest.mark.parametrize("theta_i", [0.0, 60.0, 80.0])
def test_albedo_of_facets_against_an_integral_over_normals(alpha, theta_i, agreement):
    """∫ f cos θ_o dω_o = ∫ D G (ω_i·h)/cos θ_i dω_h: another variable, another quadrature."""
    albedo = float(models.directional_albedo("cook-torrance-1982", theta_i, 500, alpha=alpha, material="perfect")[0, 0])
    x, dx = np.polynomial.legendre.leggauss(400)
    u = (x + 1) / 2
    theta = np.arctan(alpha * u / (1 - u))
    weight = dx / 2 * alpha / (1 - u) ** 2 * np.cos(theta) ** 2 * np.sin(theta)
    phi = (np.arange(400) + 0.5) / 400 * 2 * np.pi
    ti = np.radians(theta_i)
    h = np.stack(np.broadcast_arrays(np.sin(theta)[:, None] * np.cos(phi), np.sin(theta)[:, None] * np.sin(phi),
                                     np.cos(theta)[:, None]))  # fmt: skip
    wi = np.array([np.sin(ti), 0, np.cos(ti)])
    cos_d = np.einsum("k,kij->ij", wi, h)
    wo_z = 2 * cos_d * h[2] - wi[2]
    seen = (cos_d > 0) & (wo_z > 0)
    theta_o = np.arccos(np.clip(wo_z, 1e-9, 1))
    ggx = models.walter_2007
    g = ggx.masking(ti, alpha) * ggx.masking(theta_o, alpha)
    parts = ggx.distribution(theta, alpha)[:, None] * g * cos_d / np.cos(ti) * seen
    expected = np.sum(weight[:, None] * parts) * 2 * np.pi / phi.size
    # the horizon is a step for the rule over normals (1e-4); the disc rule holds 1e-3 at the smallest alpha
    error = albedo / expected - 1
    agreement("directional albedo of facets, α 0.005 … 0.8, 0 … 80°", "integral over the normals", error, 1e-3)


def test_harvey_lobe_in_closed_form():
    l, s, peak = 0.02, -2.7, 5.0
    expected = peak * 2 * np.pi * l**2 / (s + 2) * ((1 + 1 / l**2) ** ((s + 2) / 2) - 1)
    albedo = models.directional_albedo("harvey-1976", 0, 500, l=l, s=s, k_s=peak)
    assert float(albedo[0, 0]) == pytest.approx(expected, rel=1e-6)
    data = models.evaluate("harvey-1976", [30], [-30], [400, 500], l=l, s=s, k_s=[5, 6])
    np.testing.assert_allclose(data.brdf.values.ravel(), [5, 6])


def test_smooth_surface_scatters_the_share_of_its_roughness(agreement):
    """A narrow lobe at normal incidence: TIS = R (4πσ/λ)²; cos θ_o of a lobe 0.02 wide costs less than 1 %."""
    wavelength = np.array([400.0, 700.0])
    albedo = models.directional_albedo("krywonos-2011", 0, wavelength, rms_um=0.004, b_um=60.0, c_psd=5.0)
    expected = material("Al").reflectance(1.0, wavelength) * (4 * np.pi * 4 / wavelength) ** 2
    agreement("smooth-surface model, total scatter", "R (4πσ/λ)²", albedo.values[0] / expected - 1, 0.01)


def test_smooth_surface_against_the_wave_solver(agreement):
    """Mean over 24 Gaussian surfaces of the wave solver's GHS: the formula with the surfaces' own spectrum.

    A Gaussian spectrum exp(−q²T²/4) is the limit C → ∞ of the ABC form with B = T/√(2C): C = 200 is within 1 % here.
    """
    rms, correlation, wavelength, c = 0.01, 1.0, 600.0, 200.0
    theta_o = np.array([-20.0, -15, 2, 7])
    gonio = vg.measure.Gonioreflectometer([5.0], theta_o, aperture_deg=2.0, coherence_um=4)
    solver = vg.wave.Kirchhoff("Al", [wavelength], theory="generalized-harvey-shack", tol=1e-3)
    surfaces = (
        vg.surface.gaussian(rms_um=rms, correlation_um=correlation, shape=(128, 128), pitch_um=0.2, seed=seed)
        for seed in range(24)
    )
    found = [gonio.measure(surface, solver).brdf.values.ravel() for surface in surfaces]
    mean, error = np.mean(found, axis=0), np.std(found, axis=0) / np.sqrt(len(found))
    expected = models.evaluate(
        "krywonos-2011", [5], theta_o, [wavelength], rms_um=rms, b_um=correlation / np.sqrt(2 * c), c_psd=c
    ).brdf.values.ravel()
    # 4 standard errors of the speckle and 5 % for the finite C and the width of window and cone
    agreement(
        "smooth-surface model (GHS, ABC; 4 standard errors + 5 %)",
        "wave solver, mean of 24 surfaces",
        100 * (mean / expected - 1),
        100 * (4 * error / expected + 0.05),
        "%",
    )


@pytest.mark.parametrize("theta_i", [0.0, 40.0, 70.0])
def test_smooth_surface_is_the_linearised_theory(theta_i):
    """At every angle: R times `wave.closed_forms.linearised` of generalised Harvey–Shack with the same spectrum."""
    theta_o, nm, shape = np.array([-80.0, -60, -20, 0, 35, 75]), 500.0, {"rms_um": 0.005, "b_um": 2.0, "c_psd": 3.0}
    wi, wo = unit_vectors(np.radians(theta_i)), unit_vectors(np.radians(theta_o))
    q = 2 * np.pi / 0.5 * np.abs(np.sin(np.radians(theta_i)) + np.sin(np.radians(theta_o)))
    rough = closed_forms.linearised("generalized-harvey-shack", wi, wo, nm, krywonos_2011.psd(q, *shape.values()))
    expected = rough * material("Al").reflectance(np.cos(np.radians(np.abs(theta_i - theta_o)) / 2), nm)
    found = models.evaluate("krywonos-2011", [theta_i], theta_o, [nm], **shape).brdf.values[0, :, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    f = np.linspace(0, 400, 400_001)  # ∫ PSD d²q/(4π²) = σ², but for the tail: 1/(1 + (q B)²)^(1/2)
    inside = np.trapezoid(f * krywonos_2011.psd(f, *shape.values()), f) / (2 * np.pi)
    assert inside == pytest.approx(0.005**2 * (1 - 1 / np.hypot(1, 400 * 2.0)), rel=1e-4)


def test_multiple_reflections_shift_about_back_scattering():
    """All light reflected twice: 1 + h₂ Δλ at every back-scattering pair, with cos(w₂ θ_i) in the mirror direction."""
    theta, nm = np.radians([0.0, 20, 50, 75]), np.array([500.0, 600, 700])
    given = {"h1": 9.0, "w1": 9.0, "h2": 1e-3, "w2": 1.7, "single_share": 0.0}
    back = models.two_shifts.shift_factor(Geometry.of(theta, theta), nm, **given)
    np.testing.assert_allclose(back, np.tile([0.9, 1.0, 1.1], (4, 1)), rtol=1e-12)
    mirror = models.two_shifts.shift_factor(Geometry.of(theta, -theta), nm, **given)
    np.testing.assert_allclose(mirror, 1 + 1e-3 * np.outer(np.cos(1.7 * theta), nm - 600), rtol=1e-12)


def test_broken_physics_is_said():
    steep = json.loads(models.physics("clausen-2022", [380, 600, 780], alpha=0.3, h=8e-3, w=3.0).attrs["broken"])
    assert any("negative" in s and "780 nm" in s or "380 nm" in s for s in steep)
    bright = models.physics("clausen-2022", [600, 780], alpha=0.1, h=4e-3, w=1.0, material="perfect")
    assert any("of the incident power" in s for s in json.loads(bright.attrs["broken"]))
    # the model's own minimum is where it says
    report = models.physics("cook-torrance-1982", [500], alpha=0.2, c=0.05)
    where = [report.attrs["minimum_theta_i"]], [report.attrs["minimum_theta_o"]]
    at = models.evaluate("cook-torrance-1982", *where, [500], alpha=0.2, c=0.05)
    assert at.brdf.item() == pytest.approx(report.attrs["brdf_minimum"])
    assert at.brdf.item() < 0
    share = xr.DataArray(
        [[1.0, 0.2], [0.9, 0.9]], {"theta_i": [0.0, 80], "theta_o": [-80.0, 80]}, ("theta_i", "theta_o")
    )
    report = models.physics("two-shifts", [500, 700], **(EVERY["two-shifts"] | {"single_share": share}))
    # the share of this table is not symmetric in source and detector
    assert any("not reciprocal" in s for s in json.loads(report.attrs["broken"]))
    assert np.isnan(report.attrs["albedo_largest"])


def test_two_shifts_contain_the_single_one():
    one = models.evaluate("clausen-2022", ANGLES[:4], ANGLES, [400, 700], alpha=0.3, h=1e-3, w=3.0)
    two = models.evaluate(
        "two-shifts", ANGLES[:4], ANGLES, [400, 700], alpha=0.3, h1=1e-3, w1=3.0, h2=5e-3, w2=1.0, single_share=1.0
    )
    np.testing.assert_allclose(one.brdf, two.brdf, rtol=1e-13)
    table = xr.DataArray(
        np.linspace(0.2, 0.8, 6).reshape(2, 3),
        {"theta_i": [0.0, 60], "theta_o": [-60.0, 0, 60]},
        ("theta_i", "theta_o"),
    )
    found = models.two_shifts.share_at(Geometry.of(np.radians([0, 30, 60, 80]), np.radians([0, -60, 60, 85])), table)
    np.testing.assert_allclose(found, [0.32, 0.38, 0.8, 0.8])


def test_hemisphere():
    detector = Detector.hemisphere(10.0)
    data = models.evaluate("cook-torrance-1982", [0, 30], detector, [500], alpha=0.5, material="perfect")
    assert data.brdf.dims == ("theta_i", "cell", "wavelength")
    total = (data.brdf[..., 0] * detector.projected_solid_angle).sum("cell")
    albedo = models.directional_albedo("cook-torrance-1982", [0, 30], [500], alpha=0.5, material="perfect")
    # cells of 10°: the midpoint rule of a lobe of 27° is good to 2 %
    np.testing.assert_allclose(total, albedo.values[:, 0], rtol=0.02)


@pytest.mark.parametrize(
    "name, more, message",
    [
        ("oren-nayar-1994", {"sigma_deg": 95, "k_d": 1}, "0…90"),
        ("oren-nayar-1994", {"sigma_deg": 20}, "needs k_d"),
        ("harvey-1976", {"l": 0, "k_s": 1}, "positive"),
        ("harvey-1976", {"l": 0.1, "k_s": -1}, "none negative"),
        ("harvey-1976", {"l": 0.1, "k_s": 1, "s": 2}, "wings"),
        ("krywonos-2011", {"rms_um": 0.01, "b_um": 1, "c_psd": 2.0}, "above 2"),
        ("beckmann-1963", {"alpha": 0.1, "distribution": "ggx"}, "no parameter 'distribution'"),
        ("two-shifts", EVERY["two-shifts"] | {"single_share": 1.2}, "0…1"),
        ("cook-torrance-1982", {"alpha": 0.1, "c": np.nan}, "finite"),
    ],
)
def test_bad_parameters(name, more, message):
    with pytest.raises(InputError, match=message):
        models.evaluate(name, [0], [0], [500, 600], **more)


def test_a_share_read_off_a_table_can_be_given_again():
    """The weights of an interpolation add up to 1 + 2e-16; a share of 1 stays one, and no fit fails of it."""
    axis = np.linspace(0.1, 60.0, 13)
    table = xr.DataArray(np.ones((13, 13)), {"theta_i": axis, "theta_o": axis}, ("theta_i", "theta_o"))
    grid = np.radians(np.linspace(0.0, 70.0, 997))
    found = models.two_shifts.share_at(Geometry.of(grid, grid[::-1]), table)
    assert models.two_shifts.share_at(Geometry.of(grid, grid[::-1]), found) is not None
    assert found.max() == 1.0
    np.testing.assert_allclose(found, 1.0, rtol=1e-15)
