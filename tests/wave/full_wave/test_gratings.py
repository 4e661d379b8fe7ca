"""Gratings against closed forms and identities: Fresnel, small perturbations, energy, reciprocity, order."""

from __future__ import annotations

import numpy as np
import pytest

import vgonio as vg
from vgonio.errors import InputError, ToleranceError
from vgonio.materials import Material
from vgonio.wave import FullWave
from vgonio.wave.full_wave import effort, periodic, profile

WAVELENGTH = 550.0
GLASS = Material("glass", "test", lambda w: np.full(np.shape(w), 1.5 + 0j), (100.0, 10_000.0))


def sinusoid(amplitude: float, period: float = 2.0):
    return vg.surface.sinusoid(period_um=period, amplitude_um=amplitude, shape=(2, 200), pitch_um=period / 200)


def lamellar(depth: float, period: float = 1.0, duty: float = 0.5, samples: int = 100):
    return vg.surface.lamellar(period, depth, duty, shape=(2, samples), pitch_um=period / samples)


@pytest.mark.parametrize("made", ["perfect", "Al", GLASS])
def test_a_flat_mirror_is_fresnel(made, agreement):
    """Total reflection in order 0 is |r|² of Fresnel's equations, s for TE and p for TM, at all angles."""
    theta = [0.0, 30.0, 56.31, 85.0]
    data = FullWave(made, [WAVELENGTH], tol=1e-6).orders(vg.surface.flat((1, 8), 0.1), theta)
    for polarisation, light in (("TE", "s"), ("TM", "p")):
        fresnel = vg.materials.material(made).reflectance(np.cos(np.deg2rad(theta)), WAVELENGTH, light)
        one = data.efficiency.sel(polarisation=polarisation, order=0).isel(wavelength=0)
        error = np.abs(one.values - fresnel).max()
        agreement("full wave: a flat mirror, TE and TM", "Fresnel", error, 1e-8)


@pytest.mark.parametrize("amplitude", [0.002, 0.004])
def test_small_perturbation_of_a_perfect_conductor(amplitude):
    """First order in the height (Rice 1951): γ_0 γ a² in TE, (k² − α_0 α)² a²/(γ_0 γ) in TM; the next is (ka)²."""
    theta, k = 25.0, 2 * np.pi / 0.55
    data = FullWave("perfect", [WAVELENGTH], tol=1e-6).orders(sinusoid(amplitude), [theta])
    a0 = -k * np.sin(np.deg2rad(theta))
    for m in (-1, 1):
        a = a0 - m * 2 * np.pi / 2.0
        g0, g = np.sqrt(k**2 - a0**2), np.sqrt(k**2 - a**2)
        found = data.efficiency.sel(order=m).isel(theta_i=0, wavelength=0)
        assert float(found.sel(polarisation="TE")) == pytest.approx(g0 * g * amplitude**2, rel=3 * (k * amplitude) ** 2)
        rice = (k**2 - a0 * a) ** 2 * amplitude**2 / (g0 * g)
        assert float(found.sel(polarisation="TM")) == pytest.approx(rice, rel=3 * (k * amplitude) ** 2)


@pytest.mark.parametrize(
    "surface",
    [sinusoid(0.3), lamellar(0.4), vg.surface.blazed(2.0, blaze_deg=20.0, shape=(1, 80), pitch_um=0.025)],
    ids=["steep sinusoid", "lamellar", "blazed"],
)
@pytest.mark.parametrize("made", ["perfect", GLASS])
def test_energy(surface, made, agreement):
    """Loss-free: orders above, and below in glass, carry all the power (1e-3 at tol = 1e-3, whatever the walls)."""
    data = FullWave(made, [WAVELENGTH]).orders(surface, [0.0, 40.0])
    below = data.energy_transmitted if made is GLASS else 0.0
    assert float(np.abs(data.energy_reflected + below - 1).max()) < 1e-3
    error = np.abs(data.energy_balance - 1).max()
    agreement("full wave: energy of gratings, perfect and glass, walls included", "1", error, 1e-3)


@pytest.mark.parametrize("made", ["perfect", "Al", GLASS])
def test_reciprocity(made):
    """η_m(θ_i) = η_m(θ'), with the source put where the order went: any profile, here one without symmetry."""
    surface = vg.surface.blazed(1.5, blaze_deg=15.0, shape=(1, 60), pitch_um=0.025)
    solver = FullWave(made, [WAVELENGTH], tol=1e-4)
    there = solver.orders(surface, [20.0])
    for m in (-1, 1):
        out = float(there.theta_o.sel(order=m).isel(theta_i=0, wavelength=0))
        back = solver.orders(surface, [out])
        assert float(back.theta_o.sel(order=m).squeeze()) == pytest.approx(20.0, abs=1e-9)
        gone = there.efficiency.sel(order=m).values.ravel()
        assert np.abs(back.efficiency.sel(order=m).values.ravel() - gone).max() < 2e-4 * gone.max() + 1e-6


def test_order_of_convergence():
    """On a smooth profile the error falls at least as the panel length to the number of nodes."""

    def efficiency(p: int, count: float) -> np.ndarray:
        curve = profile.one_period(sinusoid(0.2), 0.55, profile.Resolution(2.4 / count, 1.0, p))
        return periodic.Grating.of(curve, 2.0, 0.55, 0.79 + 5.85j, ("TM",)).diffract(0.3, ("TM",))[0].efficiency

    exact = efficiency(14, 10)
    for p, counts in ((4, [8, 12, 18]), (6, [6, 9, 13])):
        errors = [np.abs(efficiency(p, n) - exact).max() for n in counts]
        assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] > p - 0.3


@pytest.fixture(scope="module")
def fine():
    """TM efficiencies of walls at 20° on panels of 13 nodes, shrinking more often: converged to 1e-7."""
    surface = lamellar(0.2, 1.2, samples=120)
    curve = profile.one_period(surface, 0.55, profile.Resolution(0.3, 1e-9, 13, 2))
    grating = periodic.Grating.of(curve, 1.2, 0.55, FullWave("Al").index(WAVELENGTH), ("TM",))
    return surface, grating.diffract(np.deg2rad(20.0), ("TM",))[0]


@pytest.mark.parametrize("tol", [1e-2, 1e-3, 1e-4, 1e-5])
def test_tolerance_is_met(tol, fine, agreement):
    """Error against a far finer solution, relative to the largest efficiency: corners of a metal in TM."""
    surface, exact = fine
    found = FullWave("Al", [WAVELENGTH], polarisation="TM", tol=tol).orders(surface, [20.0])
    assert found.attrs["error_achieved"] <= tol
    efficiency = found.efficiency.sel(order=exact.order).values.ravel()
    error = np.abs(efficiency - exact.efficiency).max() / exact.efficiency.max()
    agreement("full wave: walls of aluminium, TM, over the largest efficiency", "far finer panels", error, tol)


def test_symmetry_and_signs():
    """Order m leaves at sin θ_o = −sin θ_i − mλ/P; mirrored profile and light give mirrored orders."""
    up = vg.surface.blazed(1.5, blaze_deg=15.0, shape=(1, 60), pitch_um=0.025)
    down = vg.surface.blazed(1.5, blaze_deg=-15.0, shape=(1, 60), pitch_um=0.025)
    solver = FullWave("Al", [WAVELENGTH], tol=1e-4)
    a, b = solver.orders(up, [20.0]), solver.orders(down, [-20.0])
    for m in (-2, -1, 0, 1):
        one, other = a.efficiency.sel(order=m).values, b.efficiency.sel(order=-m).values
        assert np.abs(one - other).max() < 1e-4
        sine = np.sin(np.deg2rad(float(a.theta_o.sel(order=m).squeeze())))
        assert sine == pytest.approx(-np.sin(np.deg2rad(20.0)) - m * 0.55 / 1.5, abs=1e-12)
    # facets that fall towards the source (normal tilted to −x for a ramp that rises with x) send light to −θ side
    assert float(a.efficiency.sel(order=1).mean()) != pytest.approx(float(a.efficiency.sel(order=-1).mean()), rel=0.1)


def test_scatter_spreads_the_orders():
    """Power in cones that hold one order each is its efficiency; between orders there is nothing."""
    surface = sinusoid(0.05)
    orders = FullWave("Al", [WAVELENGTH]).orders(surface, [30.0])
    where = orders.theta_o.isel(theta_i=0, wavelength=0).dropna("order")
    angles = sorted([*where.values.tolist(), 0.5 * float(where[1] + where[2])])
    gonio = vg.measure.Gonioreflectometer([30.0], angles, aperture_deg=4.0, coherence_um=30.0)
    data = gonio.measure(surface, FullWave("Al", [WAVELENGTH]))
    share = data.brdf.isel(theta_i=0, wavelength=0) * gonio.detector.projected_solid_angle
    for m, theta in zip(where.order.values, where.values):
        expected = float(orders.efficiency.sel(order=m).isel(theta_i=0, wavelength=0).mean())
        assert float(share.sel(theta_o=theta)) == pytest.approx(expected, rel=1e-3, abs=1e-9)
    assert float(share.min()) < 1e-12
    hemisphere = vg.measure.Gonioreflectometer.hemisphere([30.0], resolution_deg=10.0, coherence_um=30.0)
    caught = hemisphere.measure(surface, FullWave("Al", [WAVELENGTH]))
    total = float((caught.brdf.isel(theta_i=0, wavelength=0) * hemisphere.detector.projected_solid_angle).sum())
    assert total == pytest.approx(float(caught.energy_reflected.squeeze()), rel=1e-3)


# ---- what it refuses
def test_refusals():
    rough = vg.surface.gaussian(rms_um=0.1, correlation_um=1.0, shape=(32, 64), pitch_um=0.1, seed=0)
    solver = FullWave("Al", [WAVELENGTH])
    gonio = vg.measure.Gonioreflectometer([0.0], [0.0])
    with pytest.raises(InputError, match="varies along y"):
        gonio.measure(rough, solver)
    with pytest.raises(InputError, match="turn it by 90°"):
        gonio.measure(vg.surface.Heightfield(sinusoid(0.1).z.T, 0.01), solver)
    with pytest.raises(InputError, match="not periodic"):
        solver.orders(rough.replace(z=rough.z[:1], periodic=False), [0.0])
    with pytest.raises(InputError, match="phi_i_deg"):
        vg.measure.Gonioreflectometer([0.0], [0.0], phi_i_deg=45).measure(sinusoid(0.1), solver)
    with pytest.raises(InputError, match="divergence_deg"):
        vg.measure.Gonioreflectometer([0.0], [0.0], divergence_deg=1).measure(sinusoid(0.1), solver)
    with pytest.raises(InputError, match="films"):
        FullWave(vg.materials.film("Al2O3", 4.0, on="Al"), [WAVELENGTH])
    with pytest.raises(InputError, match="allowed are TE, TM, both"):
        FullWave("Al", [WAVELENGTH], polarisation="te")
    with pytest.raises(InputError, match="exclude each other"):
        vg.measure.Gonioreflectometer([0.0], [0.0], polarisation="s").measure(
            sinusoid(0.1), FullWave("Al", [WAVELENGTH], polarisation="TM")
        )


def test_too_large_is_refused_before_memory_is_taken():
    long = vg.surface.sinusoid(period_um=2000, amplitude_um=0.1, shape=(1, 4000), pitch_um=0.5)
    with pytest.raises(ToleranceError, match=f"at most {effort.MOST_UNKNOWNS:,} unknowns"):
        FullWave("Al", [WAVELENGTH]).orders(long, [0.0])


def test_turned_by_180_degrees():
    """φ_i = 180° looks at the same cross-section from the other side."""
    surface = vg.surface.blazed(1.5, blaze_deg=15.0, shape=(1, 60), pitch_um=0.025)
    solver = FullWave("Al", [WAVELENGTH])
    angles = [-45.0, -20.0, 0.0, 20.0, 45.0]
    one = vg.measure.Gonioreflectometer([20.0], angles, aperture_deg=10).measure(surface, solver)
    turned = vg.measure.Gonioreflectometer([-20.0], angles, aperture_deg=10, phi_i_deg=180).measure(surface, solver)
    assert np.allclose(one.brdf.values, turned.brdf.values[:, ::-1], rtol=1e-9, atol=1e-12)
