"""What standard errors of the wave solvers are made of, on numbers whose outcome can be written down."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import vgonio as vg
from vgonio.directions import Detector, Incoming
from vgonio.surface import Heightfield
from vgonio.wave import energy, outcome
from vgonio.wave.coherence import Window, WindowPlan, independent
from vgonio.wave.full_wave.detection import element_means
from vgonio.wave.iterated.outcome import mean
from vgonio.wave.iterated.place import Places
from vgonio.wave.job import Job, parallel

FLAT = Heightfield(np.zeros((40, 40)), 1.0)


def window(y: float, x: float) -> Window:
    return Window(2.0, (6.0, 6.0), (y, x))


def test_two_windows_are_worth_less_than_two():
    """n²/Σρ = 2/(1 + ρ) with ρ = exp(−d²/2ℓ²); on a periodic field the shorter way counts, across both seams."""
    pair = [window(3, 4), window(3 + 1.5, 4 + 2.0)]
    rho = np.exp(-(2.5**2) / (2 * 2.0**2))
    assert independent(pair, FLAT) == pytest.approx(2 / (1 + rho), rel=1e-12)
    apart = [window(0.5, 1.0), window(39.0, 39.0)]
    assert independent(apart, FLAT) == pytest.approx(2, rel=1e-12)
    assert independent(apart, FLAT.replace(periodic=True)) == pytest.approx(2 / (1 + rho), rel=1e-12)


def job_of(weight: np.ndarray, room: float) -> Job:
    """Scattering vectors of one detector element."""
    m = len(weight)
    ints = np.zeros(m, np.int64)
    return Job(np.zeros((m, 3)), np.ones(m), np.zeros((m, 3)), ints, np.zeros((1, 3)), ints, np.zeros((1, 3)),
               weight, ints, (1, 1, 1), room=room)  # fmt: skip


def test_many_windows_tell_the_error_by_their_spread(rng):
    """s/√n_eff with s² = Σ(f − f̄)²/(n − 1) and n_eff the effective number, not that of the windows."""
    f = rng.random((5, 1, 1, 1))
    plan = WindowPlan([None] * 5, 4.2, 0.1, {})
    found, said = outcome.standard_error(
        f.mean(axis=0), (f**2).mean(axis=0), f.mean(axis=0), job_of(np.ones(1), 1.0), plan
    )
    assert found.item() == pytest.approx(f.std(ddof=1) / np.sqrt(4.2), rel=1e-9)
    assert "4.2 effective" in said


@pytest.mark.parametrize(("room", "speckles"), [(np.inf, 16.0), (3.0, 6.0)])
def test_few_windows_tell_it_by_the_directions_within_an_element(rng, room, speckles):
    """Eight directions of equal weight in each of 2 windows, or as many speckles as there is room for: s/√(n − 1)."""
    f = rng.random(8)
    plan = WindowPlan([None] * 2, 2.0, 0.1, {})
    cube = np.full((1, 1, 1), f.mean())
    job = job_of(np.full(8, 1 / 8), room)
    found, _ = outcome.standard_error(cube, cube**2, np.full((1, 1, 1), (f**2).mean()), job, plan)
    assert found.item() == pytest.approx(f.std() / np.sqrt(speckles - 1), rel=1e-9)


def test_total_energy_has_the_error_of_quadrature_and_that_of_the_sample(rng):
    """Over 8 replicates alike in all windows, and over 6 windows (worth 4) alike in all replicates: s/√8 and s/√4."""
    by_replicate, by_window = rng.random((1, 2, 8, 3)), rng.random((6, 2, 1, 3))
    mean_, error = energy.total(by_replicate + np.zeros((6, 1, 1, 1)), 4.0)
    np.testing.assert_allclose(mean_, by_replicate[0].mean(axis=1), rtol=1e-12)
    np.testing.assert_allclose(error, by_replicate[0].std(axis=1, ddof=1) / np.sqrt(8), rtol=1e-9)
    _, error = energy.total(by_window + np.zeros((1, 1, 8, 1)), 4.0)
    np.testing.assert_allclose(error, by_window[:, :, 0].std(axis=0, ddof=1) / np.sqrt(4), rtol=1e-9)


def test_the_part_of_a_source_above_the_horizon_has_all_the_light():
    light = Incoming([0.0, 87.0], divergence_deg=12.0)
    sources, angle, share = parallel(light)
    assert np.all(sources[:, 2] > 0)
    assert 0 < np.sum(angle == 1) < np.sum(angle == 0)
    np.testing.assert_allclose([share[angle == i].sum() for i in (0, 1)], 1, rtol=1e-12)


def sent(values: float, caught: float) -> SimpleNamespace:
    """One window: what it sends out and what it receives."""
    return SimpleNamespace(
        brdf=np.full((1, 1, 1, 1), values), energy=np.full((1, 1, 1), values), caught=np.full((1, 1), caught)
    )


def test_error_of_a_ratio_of_means(rng):
    """Power sent out over power received: no error where they go together, and that of a mean where all receive 1."""
    places = Places([], 3.5, 5, 10.0, 2.0)
    caught = rng.uniform(0.5, 1.5, 5)
    average, error = mean([sent(0.3 * c, c) for c in caught], places, "brdf")
    assert average.item() == pytest.approx(0.3, rel=1e-12)
    assert error.item() == pytest.approx(0, abs=1e-12)
    f = rng.random(5)
    average, error = mean([sent(v, 1.0) for v in f], places, "energy")
    assert average.item() == pytest.approx(f.mean(), rel=1e-12)
    assert error.item() == pytest.approx(f.std(ddof=1) / np.sqrt(3.5), rel=1e-9)
    average, _ = mean([sent(v, c) for v, c in zip(f, caught)], places, "brdf")
    assert average.item() == pytest.approx(f.sum() / caught.sum(), rel=1e-12)


def test_speckles_of_a_cone_in_the_plane():
    """Power 1 + cos 40π s_x over a cone that holds whole cycles: s = 1/√2, n = kℓ w/√(2π) speckles, s/√(n − 1)."""
    half, k, taper = np.deg2rad(5), 10.0, 30.0
    detector = Detector.in_plane([0.0], 10.0)
    width = 2 * np.sin(half)
    cycles = 2 * np.pi * 4 / width
    f, error = element_means(detector, 1.0, k, taper, lambda s: (1 + np.cos(cycles * s))[None], cycles)
    scale = width / detector.projected_solid_angle[0]
    speckles = k * taper * width / np.sqrt(2 * np.pi)
    assert speckles > 5
    assert f.item() == pytest.approx(scale, rel=1e-6)
    assert error.item() == pytest.approx(np.sqrt(0.5 / (speckles - 1)) * scale, rel=1e-6)


def test_orders_reflect_as_their_half_vector_says():
    """Efficiency of glass over that of a perfect reflector is R at half the angle between source and order."""
    grating = vg.surface.sinusoid(period_um=2, amplitude_um=0.05, shape=(2, 200), pitch_um=0.05)
    glass, perfect = (vg.wave.Kirchhoff(m, [500], tol=1e-6).orders(grating, [50]) for m in ("SiO2", "perfect"))
    there = perfect.efficiency.values[0, :, 0] > 1e-6
    theta_d = np.deg2rad(50 - perfect.theta_o.values[0, there, 0]) / 2
    expected = vg.materials.material("SiO2").reflectance(np.cos(theta_d), 500.0)
    np.testing.assert_allclose((glass.efficiency / perfect.efficiency).values[0, there, 0], expected, rtol=1e-6)
    assert np.ptp(expected) > 0.015
