"""Shadows of source and detector in the wave solver: closed forms of facets, and what must not change."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import vgonio as vg
from vgonio.errors import InputError, VgonioWarning
from vgonio.materials import material
from vgonio.surface import Heightfield
from vgonio.surface.visibility import visible
from vgonio.wave import Kirchhoff, reference
from vgonio.wave.amplitudes import HalfVector, LocalFacet
from vgonio.wave.coherence import WindowPlan
from vgonio.wave.job import detector_job
from vgonio.wave.weighted import Place, Shadows, intensity


def gaussian(sigma: float, correlation: float, side: float, pitch: float = 0.5) -> Heightfield:
    n = round(side / pitch)
    return vg.surface.gaussian(rms_um=sigma, correlation_um=correlation, shape=(n, n), pitch_um=pitch, seed=1)


def ridges(period_um: float = 64.0, slope_deg: float = 30.0) -> Heightfield:
    """Facets of ± slope_deg, large against the wavelength."""
    n = 16
    z = np.concatenate([np.arange(n), np.arange(n, 0, -1)]) * period_um / (2 * n) * np.tan(np.deg2rad(slope_deg))
    return Heightfield(np.tile(z, (2, 1)), period_um / (2 * n), periodic=True, interpolation="linear")


def lobe(theta_i: float, theta_o: float, **options) -> float:
    """Reflected power in a lobe of ±8° in the plane, over the incident power."""
    gonio = vg.measure.Gonioreflectometer([theta_i], [theta_o], aperture_deg=16, coherence_um=60)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", VgonioWarning)  # edges of shadows: their error is far below what is tested
        data = gonio.measure(ridges(), Kirchhoff("perfect", [300], tol=1e-2, **options))
    return data.brdf.item() * gonio.detector.projected_solid_angle[0]


def test_facets_in_shadow():
    """θ_i = 70° on facets of 30°: one kind faces away, of the other the part 2 cot θ_i/(tan 30° + cot θ_i) is lit.

    The lobe at θ_o = −10° holds the light on that facet, (P/2)/cos 30° · cos 40°/(P cos 70°) of the incident. Facets
    of 37 µm diffract 300 nm by about 0.5°: the lobe's wings beyond 8° and the seams of the mesh hold a few per cent.
    """
    facet = np.cos(np.deg2rad(40)) / (2 * np.cos(np.deg2rad(30)) * np.cos(np.deg2rad(70)))
    cot = 1 / np.tan(np.deg2rad(70))
    share = 2 * cot / (np.tan(np.deg2rad(30)) + cot)
    assert lobe(70, -10) == pytest.approx(facet, rel=0.05)
    assert lobe(70, -10, shadowing=True) == pytest.approx(facet * share, rel=0.05)


def test_facets_behind_others():
    """The same path backwards: what the detector does not see is missing to the same extent (reciprocity)."""
    forward = lobe(70, -10, shadowing=True) / np.cos(np.deg2rad(10))
    backward = lobe(-10, 70, shadowing=True) / np.cos(np.deg2rad(70))
    assert backward == pytest.approx(forward, rel=0.05)


def test_nothing_changes_where_nothing_is_shadowed():
    """Slopes up to 25°, directions within 45°."""
    surface = gaussian(0.15, 3.0, side=24)
    gonio = vg.measure.Gonioreflectometer([0, 40], range(-45, 46, 15), aperture_deg=4, coherence_um=6)
    plain, shadowed = (gonio.measure(surface, Kirchhoff("Al", [500], shadowing=s)) for s in (False, True))
    assert float((abs(plain.brdf - shadowed.brdf) / plain.brdf.max("theta_o")).max()) < 1e-3  # both to tol
    assert shadowed.attrs["shadow_edge_error"] < 1e-3
    assert "no shadowing" in plain.attrs["method"]
    assert "shadowing of source and detector" in shadowed.attrs["method"]


def test_grazing_light_returns_less():
    """Unshadowed Kirchhoff returns more than it gets at 80°; with shadows clearly less than that."""
    surface = gaussian(0.6, 3.0, side=20, pitch=0.25)
    gonio = vg.measure.Gonioreflectometer.hemisphere([80], resolution_deg=22.5, coherence_um=4)
    plain, shadowed = (
        gonio.measure(surface, Kirchhoff("perfect", [500], tol=3e-2, shadowing=s)).energy_reflected.item()
        for s in (False, True)
    )
    assert plain > 1.1
    assert 0.5 < shadowed < plain - 0.1


def test_edges_of_shadows_that_miss_the_tolerance_are_warned_of():
    surface = gaussian(0.6, 3.0, side=20, pitch=0.5)
    gonio = vg.measure.Gonioreflectometer([75], [-75, 0], aperture_deg=2, coherence_um=4)
    with pytest.warns(VgonioWarning, match="edges of shadows"):
        data = gonio.measure(surface, Kirchhoff("Al", [500], tol=1e-5, shadowing=True, windows=1))
    assert data.attrs["error_achieved"] >= data.attrs["shadow_edge_error"] > 1e-5


def test_orders_have_no_shadows():
    with pytest.raises(InputError, match="scatter"):
        Kirchhoff(shadowing=True).orders(ridges(), [0])


def test_short_wavelengths_become_the_rays_that_are_not_blocked(agreement):
    """λ → 0 with shadows: single reflections of the rays on the same profile at 70°, in a wide cone near grazing.

    Without shadows a third too much at −80°. Windows and rays see the same surface; 3 standard errors of the windows
    and 10 % for the wavelength (σ/λ = 3).
    """
    rng = np.random.default_rng(5)
    f = np.fft.rfftfreq(1800, 0.5)
    row = np.fft.irfft(np.fft.rfft(rng.normal(size=1800)) * np.exp(-((np.pi * 5 * f) ** 2) / 2))
    surface = Heightfield(np.tile((row - row.mean()) / row.std(), (2, 1)), 0.5, periodic=True)  # σ 1 µm, T 5 µm
    gonio = vg.measure.Gonioreflectometer([70], [-80, -60, -40], aperture_deg=14, coherence_um=8)
    rays = gonio.measure(surface, vg.geometric.RayOptics("perfect", [500], rays=100_000, refinement=3))
    expected = rays.brdf_by_bounce.sel(bounce=1).values.ravel()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", VgonioWarning)
        plain, shadowed = (
            gonio.measure(surface, Kirchhoff("perfect", [330], tol=2e-2, shadowing=s)) for s in (False, True)
        )
    error = shadowed.brdf_stderr.values.ravel()
    assert error[0] < 0.15 * expected[0]
    agreement(
        "λ → 0 with shadows, 70°, towards grazing (without shadows a third too much; 3 standard errors + 10 %)",
        "single reflections of rays",
        100 * (shadowed.brdf.values.ravel() / expected - 1),
        100 * (3 * error / expected + 0.1),
        "%",
    )
    assert plain.brdf.values.ravel()[0] > 1.25 * expected[0]


@pytest.mark.parametrize("periodic", [True, False])
def test_shadows_are_looked_up_where_they_were_found(periodic):
    """At the middles of the cells on which they were found, and anywhere within them, also a period further on."""
    surface = vg.surface.gaussian(rms_um=1.0, correlation_um=3.0, shape=(12, 20), pitch_um=0.5).replace(
        periodic=periodic
    )
    direction = np.array([0.8, 0.3, 0.4])
    expected = visible(surface, direction, 3)
    assert 0.2 < expected.mean() < 0.9
    shadows = Shadows(surface, 3)
    for off in (0.02, 0.5, 0.98):
        y, x = ((np.arange(3 * n) + off) * 0.5 / 3 for n in surface.shape)
        np.testing.assert_array_equal(shadows.at(direction, y, x), expected)
        if periodic:
            np.testing.assert_array_equal(shadows.at(direction, y - 6.0, x + 10.0), expected)


def test_shells_add_up_to_what_each_pair_sees():
    """Shared transforms of shells against a direct sum in double precision for each pair of source and element."""
    surface, nm = gaussian(0.6, 3.0, side=16), (500.0, 600.0)
    gonio = vg.measure.Gonioreflectometer([-50, 0, 40, 75], [-80, -60, 0, 30, 70], aperture_deg=1, coherence_um=4)
    plan = WindowPlan.of(surface, 4.0, 1)
    job = detector_job(gonio.incoming, gonio.detector, 2e3 * np.pi / np.array(nm), plan.step, "kirchhoff", 0)
    place = Place.of(surface, plan, plan.windows[0], (0.4, 0.4), "uniform")
    shadows = Shadows.of(surface, (0.4, 0.4))
    for model in (HalfVector("kirchhoff", material("Al"), nm, "s"), LocalFacet("kirchhoff", material("Al"), "s")):
        shells = intensity(place, surface, job, model, nm, shadows, "nufft", 1e-8, 0.0)
        expected = np.empty_like(shells)
        for n in range(len(job.q)):
            seen = np.ones(place.points.z.shape, bool)
            for direction in (job.wi[n], job.views[job.view[n]]):
                mask = shadows.at(direction, place.y, place.x)
                seen = seen if mask is None else seen & mask
            field = model.fields(job.wi[n], nm[job.wavelength[n]], place.facets(surface))[0]
            points = replace(place.points, weight=place.points.weight * seen * field)
            one = job.some(np.array([n]))
            S = reference.transform(points, one.q)[None]
            expected[:, n] = model.intensity(S, one)[:, 0] * (one.prefactor / place.area)
        assert np.abs(shells - expected).max() < 1e-6 * expected.max()
    plain = intensity(place, surface, job, model, nm, None, "nufft", 1e-8, 0.0)
    assert np.abs(plain - expected).max() > 0.1 * expected.max()
