"""Diffraction: sweeps over the surface's integral equation, against the rigorous solver and against themselves."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import vgonio as vg
from vgonio.errors import InputError, VgonioWarning
from vgonio.materials import film, material
from vgonio.surface import Heightfield
from vgonio.wave import FullWave, IteratedKirchhoff
from vgonio.wave.full_wave import scatter_profile
from vgonio.wave.iterated.beam import Beam
from vgonio.wave.iterated.diffraction import diffracted
from vgonio.wave.iterated.equation import Equation, bend, rule_of
from vgonio.wave.iterated.far_field import far_amplitudes
from vgonio.wave.iterated.profile import Light, Stretch, fields
from vgonio.wave.iterated.sight import mean_height
from vgonio.wave.iterated.sweeps import sweep

THETA_I = (0.0, 20.0, 50.0, 70.0)
FINE = np.arange(-79.75, 80.0, 0.5)
K = 2 * np.pi  # λ = 1 µm
NM = 550.0  # of the indices


def rough(sigma: float, correlation: float, seed: int, length: float = 40.0) -> Heightfield:
    n = round(length / min(0.1, correlation / 10))
    pitch = length / n
    made = vg.surface.gaussian(sigma, correlation, (12, n), (correlation / 3, pitch), seed, exact=False)
    return Heightfield(made.z[:1], pitch)


def stretch_of(surface: Heightfield, per: float = 10.0) -> Stretch:
    side = surface.size_um[1]
    return Stretch.of(surface, Beam("tapered", side / 8, side / 2, side / 2), 1 / per)


def powers(surface: Heightfield, name: str, polarisation: str):
    """(t, m) power per radian over incident power: rigorous, of three reflections, with two sweeps; sweeps' change."""
    theta, to = np.deg2rad(THETA_I), np.deg2rad(FINE)
    index = None if name == "perfect" else complex(material(name).index(NM))
    exact = scatter_profile(
        surface.x, surface.z[0], 1.0, THETA_I, polarisation, index, surface.size_um[1] / 8, FINE
    ).density
    stretch = stretch_of(surface)
    light = Light(K, theta, polarisation, material(name), NM)
    u, v = (f.sum(axis=-1) for f in fields(stretch, light, 3, 1e-3, True))
    three = far_amplitudes(stretch.curve, u, v, K, to, stretch.sight.seen(stretch.curve, to))
    swept, done = diffracted(stretch, [light], (u[:, None], v[:, None]), three[:, None], to, 2, 1e-3)
    assert done.left_out == ""
    found = [np.abs(a.T) ** 2 / stretch.beam.power(K, theta)[:, None] for a in (three, swept[:, 0])]
    return exact, *found


def errors(sigma: float, correlation: float, name: str, polarisation: str, count: int):
    """Σ|Δ|/Σ of mean lobes in 4° bins and relative power (t,), of three reflections and with sweeps."""
    every = [powers(rough(sigma, correlation, s), name, polarisation) for s in range(count)]
    exact, *others = (np.mean([e[i] for e in every], axis=0).reshape(4, -1, 8).mean(axis=-1) for i in range(3))
    return [(np.abs(a - exact).sum(1) / exact.sum(1), a.sum(1) / exact.sum(1)) for a in others]


# ---- against the rigorous solver
@pytest.mark.parametrize("polarisation", ["TE", "TM"])
@pytest.mark.parametrize(("sigma", "correlation"), [(1.0, 2.0), (2.0, 2.83), (0.3, 0.85)])
def test_steep_perfect_profiles(sigma, correlation, polarisation, agreement):
    """Slopes 0.7, 1 and 0.5 with T < λ, 0 … 70°: three reflections err by 0.05 … 0.6, with two sweeps by 0.005 at most,
    power within 0.5 %. (30 profiles, and 14 combinations: `benchmarks/multiple_scattering.py`.)"""
    (without, _), (error, power) = errors(sigma, correlation, "perfect", polarisation, 2)
    assert np.all(without > 0.05)
    agreement("iterated Kirchhoff with diffraction, steep profiles, 0 … 70°, Σ|Δ|/Σ", "full wave", 100 * error, 1, "%")
    assert np.allclose(power, 1, atol=0.005)


@pytest.mark.parametrize("polarisation", ["TE", "TM"])
@pytest.mark.parametrize("name", ["Al", "SiO2"])
def test_steep_penetrable_profiles(name, polarisation, agreement):
    """Aluminium, whose surface impedance stands for the inside, and glass with both fields, slope 0.7: 0.08 … 0.6 of
    three reflections, 0.02 with sweeps, power within 2 % (the impedance leaves out sin²θ/n², 1 %)."""
    (without, _), (error, power) = errors(1.0, 2.0, name, polarisation, 2)
    assert np.all(without > 0.07)
    agreement(
        "iterated Kirchhoff with diffraction, steep Al and glass, 0 … 70°, Σ|Δ|/Σ", "full wave", 100 * error, 2, "%"
    )
    assert np.allclose(power, 1, atol=0.02)


@pytest.mark.parametrize("name", ["perfect", "Al", "SiO2"])
def test_deep_gratings(name, agreement):
    """A sinusoid 18 λ × 7 λ: Σ|Δ|/Σ of the orders from 0.2 … 0.5 to 0.006, the impedance's share of it most."""
    surface = vg.surface.sinusoid(10.0, 2.0, (2, 400), 0.025)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", VgonioWarning)
        exact = FullWave(name, [NM]).orders(surface, [0, 20]).efficiency.fillna(0)
        found = [IteratedKirchhoff(name, [NM], sweeps=n).orders(surface, [0, 20]).efficiency for n in (0, 2)]
    error = [(np.abs(f.sel(order=exact.order).fillna(0) - exact).sum("order") / exact.sum("order")) for f in found]
    assert np.all(error[0] > 0.15)
    agreement("iterated Kirchhoff with diffraction, sinusoid 18 λ × 7 λ", "full wave", 100 * error[1], 0.7, "%")


def test_the_impedance_bends_with_the_surface():
    """A sinusoid 1.7 λ × 0.5 λ of aluminium, 24 points per wavelength: 0.14 and 0.20 % of the orders (TE, TM) with the
    curvature in the impedance (Rytov 1940); without it 1.0 and 1.6 %, with the other sign 2.2 and 3.0 %."""
    surface = vg.surface.sinusoid(1.0, 0.15, (2, 400), 0.0025)
    exact = FullWave("Al", [600.0], tol=1e-5).orders(surface, [0]).efficiency.fillna(0)
    solver = IteratedKirchhoff("Al", [600.0], sweeps=6, tol=1e-6, points_per_wavelength=24)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", VgonioWarning)
        found = solver.orders(surface, [0]).efficiency.sel(order=exact.order).fillna(0)
    assert float((np.abs(found - exact).sum("order") / exact.sum("order")).max()) < 0.004


def test_steps_with_walls_at_the_seam():
    """A lamellar grating whose second wall is where its period ends: 0.2 … 0.45 of the orders without sweeps, below 0.1
    with them, which do not resolve the edges (0.03 with 20 points per wavelength)."""
    surface = vg.surface.lamellar(3.0, 0.5, 0.5, (2, 150), 0.02)
    exact = FullWave("perfect", [NM]).orders(surface, [0, 20]).efficiency.sel(polarisation="TE").fillna(0)
    error = []
    for sweeps, per in ((0, 10), (2, 10), (2, 20)):
        solver = IteratedKirchhoff("perfect", [NM], sweeps=sweeps, points_per_wavelength=per)
        got = solver.orders(surface, [0, 20]).efficiency.sel(polarisation="TE", order=exact.order).fillna(0)
        error.append(float((np.abs(got - exact).sum("order") / exact.sum("order")).max()))
    assert error[0] > 0.2
    assert error[1] < 0.06
    assert error[2] < 0.03


# ---- the equation and the sweeps themselves
@pytest.mark.parametrize("polarisation", ["TE", "TM"])
@pytest.mark.parametrize("name", ["perfect", "SiO2"])
def test_the_rule_of_the_points_converges(name, polarisation):
    """The solution with 8, 12 and 24 points per wavelength: errors of the first two fall by 1.5² or more."""
    surface, theta, to = rough(1.0, 2.0, 4, 20.0), np.deg2rad([20.0]), np.deg2rad(FINE)
    lobes = []
    for per in (8, 12, 24):
        curve, beam = (s := stretch_of(surface, per)).curve, s.beam
        equation = Equation.of(curve, K, material(name), NM, polarisation, rule_of(material(name), NM, per)[0])
        a, right = equation.rows(0, len(curve)), equation.right(*beam.field(curve, K, theta))
        u, v = equation.fields(np.linalg.solve(np.eye(len(a)) - a, right))
        lobes.append(np.abs(far_amplitudes(curve, u, v, K, to, None)) ** 2)
    error = [np.abs(one - lobes[2]).max() / lobes[2].max() for one in lobes[:2]]
    assert error[1] < error[0] / 1.5**2
    assert error[1] < 2e-3


@pytest.mark.parametrize("name", ["perfect", "Al", "SiO2"])
@pytest.mark.parametrize("polarisation", ["TE", "TM"])
def test_sweeps_end_at_the_solution(name, polarisation):
    """From nothing: the change falls from sweep to sweep, by tens, to the direct solution at 1e-8."""
    surface, theta = rough(1.0, 2.0, 5, 25.0), np.deg2rad([0.0, 50.0])
    stretch = stretch_of(surface)
    equation = Equation.of(stretch.curve, K, material(name), NM, polarisation, rule_of(material(name), NM, 10.0)[0])
    light = stretch.incident(K, theta)
    nothing = tuple(np.zeros_like(f) for f in light)
    change = [sweep(equation, light, nothing, n, 0.0).change.max() for n in (1, 2, 3)]
    assert change[0] > 10 * change[1] > 100 * change[2]
    a = equation.rows(0, len(stretch.curve))
    direct = equation.fields(np.linalg.solve(np.eye(len(a)) - a, equation.right(*light)))
    swept = sweep(equation, light, nothing, 20, 1e-24)
    for got, expected in zip((swept.u, swept.v), direct):
        assert np.allclose(got, expected, atol=1e-8 * np.abs(expected).max())


def test_curvature_from_the_turning_of_normals():
    """A circle of 3 µm radius, a valley: +1/3 (ends: one-sided)."""
    x = np.linspace(-1.5, 1.5, 301)
    surface = Heightfield(3 - np.sqrt(9 - x**2)[None], 0.01)
    curve = stretch_of(surface, 20).curve
    assert np.allclose(bend(curve)[20:-20], 1 / 3, rtol=1e-3)


def test_mean_height_where_light_arrives():
    """A step of 1 µm in the middle of 10, light from the higher side at 45°: 5 µm at 1, then 1 of shadow, 4 at 0."""
    x = np.array([0.0, 5.0, 5.0, 10.0])
    z = np.array([0.0, 0.0, 1.0, 1.0])
    assert mean_height(x, z, np.ones(4), np.deg2rad(45)) == pytest.approx(5 / 9)
    # from the lower side the wall is lit: 1 µm of beam at 0.5
    assert mean_height(x, z, np.ones(4), np.deg2rad(-45)) == pytest.approx((0.5 + 5) / 11)
    assert mean_height(x, z, np.ones(4), 0.0) == pytest.approx(0.5)


# ---- the solver
@pytest.mark.parametrize("polarisation", ["s", "p"])
def test_power_is_whole_and_the_default_is_quiet(polarisation, agreement):
    """Windows of ℓ = 5 λ, slope 0.7, 0 … 70°: power 1 to 2.5 % (the window's own waves at 70°, kℓ cos θ = 11, and what
    leaves past the ends), and the error of the spacing below the default tol, 2 … 10 % without sweeps."""
    gonio = vg.measure.Gonioreflectometer([0, 20, 50, 70], range(-80, 81, 4), coherence_um=5, polarisation=polarisation)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*instead of")
        data = gonio.measure(rough(1.0, 2.0, 3, 60.0), IteratedKirchhoff("perfect", [1000], windows=2))
    power = data.energy_reflected.values
    agreement("iterated Kirchhoff with diffraction, perfect, windows, power", "1", power, (0.975, 1.025))
    assert data.attrs["error_achieved"] < 1e-3
    assert data.attrs["sweeps_done"] == 2
    assert np.all(np.abs(data.energy_diffraction) < 0.3)
    assert float(np.abs(data.energy_diffraction).max()) > 0.02


@pytest.mark.parametrize("name", ["Al", "SiO2"])
def test_the_default_is_quiet_on_rough_metal_and_glass(name):
    """Error of the spacing below 1 %, at which a warning begins after sweeps; with three points it is told."""
    gonio = vg.measure.Gonioreflectometer([0, 60], range(-80, 81, 4), coherence_um=3)
    surface = rough(1.0, 2.0, 3, 30.0)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*instead of")
        data = gonio.measure(surface, IteratedKirchhoff(name, [700], windows=1))
    assert 1e-4 < data.attrs["error_achieved"] < 1e-2
    with pytest.warns(VgonioWarning, match="instead of"):
        gonio.measure(surface, IteratedKirchhoff("perfect", [700], windows=1, points_per_wavelength=3.5))


def test_what_has_no_rule_keeps_its_reflections():
    """Silicon needs 17 points per wavelength; films on metal have an impedance, on glass none; needles do not settle;
    a window of one wavelength is no beam. Each is said, and the sum of reflections stays."""
    assert rule_of(material("Al"), NM, 10)[0] == "impedance"
    assert rule_of(material("SiO2"), NM, 10)[0] == "media"
    assert rule_of(film("Al2O3", 4.0, on="Al"), NM, 10)[0] == "impedance"
    assert rule_of(film("MgF2:Li-o", 100.0, on="SiO2"), NM, 10)[0] is None
    assert rule_of(material("Si"), NM, 17)[0] == "media"
    surface = rough(0.6, 1.5, 1, 20.0)
    needles = Heightfield(np.random.default_rng(0).normal(0, 1, (1, 100)), 0.1)
    for one, name, width, said in (
        (surface, "Si", 1.0, "points_per_wavelength ≥ 17"),
        (surface, "perfect", 0.4, "too narrow for a beam at θ_i = 20°"),
        (needles, "perfect", 0.5, "do not settle at θ_i = 20°"),
    ):
        gonio = vg.measure.Gonioreflectometer([20], [-20, 0], coherence_um=width)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", VgonioWarning)
            data = gonio.measure(one, IteratedKirchhoff(name, [NM], windows=1))
        assert said in data.attrs["diffraction_left_out"]
        assert np.all(data.brdf_diffraction == 0)
        assert np.all(data.energy_diffraction == 0)


def test_without_sweeps_there_is_no_diffraction():
    gonio = vg.measure.Gonioreflectometer([20], range(-60, 61, 20), coherence_um=3)
    surface = rough(1.0, 2.0, 2, 30.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", VgonioWarning)
        for solver in (IteratedKirchhoff("Al", [900], sweeps=0), IteratedKirchhoff("Al", [900], bounces=1)):
            data = gonio.measure(surface, solver)
            assert np.all(data.brdf_diffraction == 0)
            assert data.attrs["sweeps_done"] == 0
    with pytest.raises(InputError, match="at least 2"):
        IteratedKirchhoff("Al", sweeps=1)


@pytest.mark.parametrize("polarisation", ["TE", "TM"])
def test_the_first_reflection_is_where_the_source_is_seen(polarisation):
    """Light at 70° on steep slopes: nothing behind a hill, also on slopes that face the source; elsewhere as without
    shadows."""
    stretch, theta = stretch_of(rough(1.0, 2.0, 3)), np.deg2rad([70.0, -70.0])
    light = Light(K, theta, polarisation, material("Al"), NM)
    seen, facing = stretch.sight.seen(stretch.curve, theta).T, stretch.facing(theta).T > 0
    assert (facing & ~seen).mean() > 0.05
    for shaded, whole in zip(light.first(stretch, True), light.first(stretch, False)):
        assert np.all(shaded[~seen] == 0)
        np.testing.assert_array_equal(shaded[seen], whole[seen])
