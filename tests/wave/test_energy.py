"""Total reflected power on request, against what closed forms say of the theories."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

import vgonio as vg
from vgonio.materials import material
from vgonio.surface import Heightfield
from vgonio.wave import Kirchhoff
from vgonio.wave.energy import NODES, _density, _disc, _facets, _mirror, _points


def gaussian(sigma: float, correlation: float, side: float) -> Heightfield:
    n = round(side / 0.5)
    return vg.surface.gaussian(rms_um=sigma, correlation_um=correlation, shape=(n, n), pitch_um=0.5, seed=1)


def measured(surface: Heightfield, theta_i: list[float], coherence_um: float, name="perfect", nm=(500,), **options):
    gonio = vg.measure.Gonioreflectometer(theta_i, [-t for t in theta_i], aperture_deg=4, coherence_um=coherence_um)
    return gonio.measure(surface, Kirchhoff(name, nm, tol=1e-2, **options))


def pull(data, expected) -> np.ndarray:
    return ((data.energy_reflected - expected) / data.energy_reflected_stderr).values.ravel()


def test_flat_mirror_reflects_as_fresnel_says():
    flat = Heightfield(np.zeros((32, 32)), 2.5, periodic=True)
    data = measured(flat, [0, 45, 75], 15, "Al", (450, 650), energy=True)
    expected = material("Al").reflectance(np.cos(np.deg2rad([0, 45, 75])), [450, 650])
    assert np.allclose(data.fresnel_macro, expected)
    assert np.abs(pull(data, expected)).max() < 4  # six values
    # a lobe as wide as the directions are dense: the quadrature is good to 1 %
    assert data.energy_reflected_stderr.max() < 0.01
    assert data.energy_reflected_stderr.attrs["units"] == "1"
    assert "energy_reflected" not in measured(flat, [0], 15)


def test_a_smooth_surface_keeps_its_power():
    """4π σ cos θ_i/λ = 0.63 at 60°: a third is scattered, the rest stays in the mirror direction; together 1.

    Kirchhoff's total is exact for gentle slopes only: 2 % allowed beside the errors.
    """
    data = measured(gaussian(0.05, 5, 60), [0, 60], 12, energy=True)
    assert np.all(np.abs(data.energy_reflected - 1) < 4 * data.energy_reflected_stderr + 0.02)


def test_generalized_harvey_shack_loses_power_on_slopes():
    """λ → 0: the mean of cos⁴θ_h over facets, ∫ D cos θ_h cos⁴θ_h dω, as facets at normal incidence are all seen."""
    surface = gaussian(1.0, 7.0, 80)
    zx, zy = (surface.interpolant.grid(surface.y, surface.x, **d) for d in ({"dx": 1}, {"dy": 1}))
    expected = float(np.mean((1 + zx**2 + zy**2) ** -2.0))
    assert 0.8 < expected < 0.9
    data = measured(surface, [0], 8, nm=(300,), theory="generalized-harvey-shack", energy=True)
    assert data.energy_reflected_stderr.item() < 0.03
    assert np.abs(pull(data, expected)).max() < 3
    assert pull(data, 1.0).max() < -4


def test_renormalised_when_asked_and_recorded():
    surface = gaussian(0.6, 5, 60)
    options = {"theory": "generalized-harvey-shack", "nm": (400, 600), "name": "Al"}
    plain = measured(surface, [0, 40], 6, energy=True, **options)
    scaled = measured(surface, [0, 40], 6, renormalise=True, **options)
    factor = plain.fresnel_macro / plain.energy_reflected
    assert np.allclose(scaled.renormalisation, factor)
    for name in ("brdf", "brdf_stderr"):
        assert scaled[name].dims == plain[name].dims
        assert np.allclose(scaled[name], plain[name] * factor)
    assert np.allclose(scaled.energy_reflected, plain.energy_reflected)  # as found, not as scaled
    assert "renormalised" in scaled.attrs
    assert "renormalised" not in plain.attrs


def test_orders_hold_the_energy_and_are_renormalised():
    surface = vg.surface.sinusoid(period_um=2, amplitude_um=0.1, shape=(4, 200), pitch_um=0.05)
    options = {"material": "Al", "wavelength_nm": [450, 650], "tol": 1e-5}
    plain = Kirchhoff(**options).orders(surface, [0, 50])
    assert "energy_reflected" not in plain
    told = Kirchhoff(**options, energy=True).orders(surface, [0, 50])
    assert np.allclose(told.energy_reflected, plain.efficiency.sum("order"))
    assert np.allclose(told.fresnel_macro, material("Al").reflectance(np.cos(np.deg2rad([0, 50])), [450, 650]))
    assert np.abs(told.energy_reflected / told.fresnel_macro - 1).max() > 1e-3  # evanescent orders carry nothing
    scaled = Kirchhoff(**options, renormalise=True).orders(surface, [0, 50])
    assert np.allclose(scaled.efficiency.sum("order"), told.fresnel_macro)
    assert np.allclose(scaled.efficiency, plain.efficiency * scaled.renormalisation)
    assert scaled.efficiency.dims == plain.efficiency.dims
    assert scaled.renormalisation.attrs["units"] == "1"


def test_unshadowed_kirchhoff_returns_too_much_at_grazing(agreement):
    """λ → 0 at 85°, α = 0.294: ⟨max(0, c − s·t)⟩/c over normal slopes t, c Φ(c/s) + s φ(c/s) over c = 1.53; a property
    of the theory. (Facets whose light would go down are few.)"""
    surface = gaussian(1.0, 6.8, 120)
    slope = float(np.sqrt(np.mean(surface.interpolant.grid(surface.y, surface.x, dx=1) ** 2)))
    c, s = np.cos(np.deg2rad(85)), slope * np.sin(np.deg2rad(85))
    expected = (c * norm.cdf(c / s) + s * norm.pdf(c / s)) / c
    assert 1.45 < expected < 1.6
    data = measured(surface, [85], 6, nm=(400,), energy=True, windows=36)
    assert data.energy_reflected_stderr.item() < 0.12
    agreement(
        "unshadowed Kirchhoff at 85°, α = 0.29: 1.53 times the incident power comes back",
        "closed form",
        pull(data, expected),
        3,
        "standard errors",
    )
    assert pull(data, 1.0).min() > 3


@pytest.mark.parametrize(("theta", "width", "slopes"), [(0.0, 0.02, (0.1, 0.1)), (50.0, 0.01, (0.2, 0.05))])
def test_density_of_the_directions(theta, width, slopes):
    """With f = 1/density the sum over all directions is the area of the disc that they can reach, π."""
    rng = np.random.default_rng(0)
    wi = np.array([np.sin(np.deg2rad(theta)), 0, np.cos(np.deg2rad(theta))])
    found = []
    for _ in range(20):
        u = [_points(n, rng) for n in NODES]
        s = np.concatenate([_disc(u[0]), _mirror(u[1], wi, width), _facets(u[2], wi, np.array(slopes))])
        s = s[np.sum(s**2, axis=1) < 1]
        wo = np.column_stack([s, np.sqrt(1 - np.sum(s**2, axis=1))])
        found.append(np.sum(1 / _density(wo, wi, width, np.array(slopes))))
    assert np.mean(found) == pytest.approx(np.pi, abs=4 * np.std(found) / np.sqrt(20))
    assert np.std(found) < 0.2


def test_shadows_that_are_not_there_cost_no_power():
    """Slopes below 5° hide nothing from the cells' centres, up to 83°: the same directions, on finer points."""
    surface = gaussian(0.05, 5.0, 30)
    plain, shadowed = (
        measured(surface, [60], 6, shadowing=s, energy=True).energy_reflected.item() for s in (False, True)
    )
    assert shadowed == pytest.approx(plain, rel=1e-2)
