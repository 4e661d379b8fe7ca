"""Patches: the kernel of pairs against its slow reference, single reflections against Kirchhoff, two and more against
the solver of profiles, which shares no code with it beyond Fresnel's formulas."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest

import vgonio as vg
from vgonio.directions import unit_vectors
from vgonio.errors import BackendError, InputError, ToleranceError, VgonioWarning
from vgonio.materials import film, material
from vgonio.surface import Heightfield
from vgonio.surface.visibility import visible
from vgonio.wave import opencl
from vgonio.wave.coherence import Window
from vgonio.wave.iterated import IteratedKirchhoff
from vgonio.wave.iterated.blocks import levels
from vgonio.wave.iterated.choice import choose
from vgonio.wave.iterated.far_waves import horizon_map
from vgonio.wave.iterated.pair_reference import reflect_reference, seen_from
from vgonio.wave.iterated.pairs import Grid, reflect_blocks, reflect_opencl
from vgonio.wave.iterated.patch import MOST_POINTS, Patch, first_fields
from vgonio.wave.iterated.place import Places


@pytest.fixture(autouse=True)
def device():
    try:
        return opencl.device()
    except BackendError as e:
        pytest.skip(f"no OpenCL device: {e}")


def rough(sigma: float, correlation: float, n: int, pitch: float, seed: int = 1) -> Heightfield:
    return vg.surface.gaussian(sigma, correlation, shape=(n, n), pitch_um=pitch, seed=seed)


def grid_of(surface: Heightfield) -> Grid:
    ip = surface.interpolant
    zx, zy = ip.grid(surface.y, surface.x, dx=1), ip.grid(surface.y, surface.x, dy=1)
    normal = np.stack([-zx, -zy, np.ones_like(zx)])
    return Grid(np.array(surface.z), normal / np.linalg.norm(normal, axis=0), surface.dx)


@pytest.mark.parametrize("index", [None, 1.0 + 6.6j, 1.5])
@pytest.mark.parametrize("n", [37, 48])
def test_kernel_equals_the_reference(index, n, rng, agreement):
    """Two random fields on a steep surface, observers in corners and inside: single precision, 1e-5 of the largest."""
    grid = grid_of(rough(0.4, 1.0, n, 0.08))
    source = rng.normal(size=(2, 12, n, n))
    if index is None:
        source[:, :6] = 0  # N × E vanishes on perfect conductors
    observers = [(0, 0), (n - 1, n - 1), (3, 10), (n // 2, n // 2), (n - 2, 5), (7, n - 1)]
    got = reflect_opencl(grid, source, 2 * np.pi / 0.55, index)
    exact = reflect_reference(grid, source, 2 * np.pi / 0.55, index, observers)
    got = np.stack([got[:, :, y, x] for y, x in observers], axis=-1)
    error = np.max(np.abs(got - exact)) / np.max(np.abs(exact))
    agreement("iterated Kirchhoff, kernel of pairs", "double precision, numpy", error, 1e-5)


@pytest.mark.parametrize("name", ["perfect", "Al"])
def test_blocks_equal_all_pairs(name, agreement):
    """Fields of a second reflection on 10 µm, slopes of 0.5: each level of rules keeps to the error that it promises,
    and what it measures on a few rows is the error of all rows to a factor of 3."""
    surface = rough(1.77, 5.0, 80, 0.2, seed=3)
    patch = Patch.of(surface, Window(10 / 6, (5, 5), (8, 8)), 0.55 / 7, 0.0)
    k, metal = 2 * np.pi / 0.55, material(name)
    index = None if metal.perfect else complex(metal.index(550.0))
    source = first_fields(patch, np.array([0.5, 0, np.sqrt(0.75)]), k, metal, 550.0, 0.0)
    exact = reflect_opencl(patch.grid, source, k, index)
    for asked in (1e-2, 1e-3):
        found, told = reflect_blocks(patch.grid, source, k, index, levels(asked, patch.grid.pitch)[0])
        error = np.linalg.norm(found - exact) / np.linalg.norm(exact)
        agreement("iterated Kirchhoff, blocks of points, 1e-2 and 1e-3 asked for", "all pairs", error, asked)
        assert told / 3 < error < 3 * told


def test_blocks_in_the_solver():
    """Energies and lobe by blocks and by all pairs: within the tolerance; and what is chosen where."""
    surface = rough(2.0, 5.0, 80, 0.25, seed=3)
    gonio = vg.measure.Gonioreflectometer([30], range(-60, 61, 20), coherence_um=None, aperture_deg=6)
    found = [
        gonio.measure(surface, IteratedKirchhoff("perfect", [800], window_um=10, bounces=2, method=m))
        for m in ("blocks", "pairs", "auto")
    ]
    assert 0 < found[0].attrs["pairs_error"] < 1e-3
    assert found[1].attrs["pairs_error"] == 0
    assert [f.attrs["backend"].split()[-1] for f in found] == ["blocks", "pairs", "pairs"]
    assert float(np.abs(found[0].brdf - found[1].brdf).max() / found[1].brdf.max()) < 1e-3
    assert np.allclose(found[0].energy_by_bounce, found[1].energy_by_bounce, atol=1e-4)
    assert float(np.abs(found[2].brdf - found[1].brdf).max()) == 0
    with pytest.raises(InputError, match="blocks"):
        IteratedKirchhoff(method="block")


def test_blocks_are_chosen_where_wide_slopes_see_each_other():
    """2.6·10⁵ points each: on the one most of what is seen is seen as a whole, on the other nearly nothing."""
    for correlation, blocks in ((16.0, True), (2.0, False)):
        surface = rough(0.35 * correlation, correlation, 200, 0.25)
        solver = IteratedKirchhoff("Al", [550], window_um=40, windows=1)
        chosen = choose(solver, surface, Places.of(surface, 40, None, 1))
        assert chosen.blocks == blocks
        assert "seen as a whole" in chosen.why


def test_sight_in_a_valley_and_over_a_ridge():
    """From one side of a valley all of the other is seen, from one side of a ridge nothing is."""
    x = np.abs(np.arange(21) - 10.0) * np.ones((21, 1)) / 2
    valley, ridge = (Grid(s * x, np.zeros((3, 21, 21)), 1.0) for s in (1, -1))
    for iy in (0, 10, 17):
        assert seen_from(valley, iy, 4)[:, 11:].all()
        assert not seen_from(ridge, iy, 4)[:, 11:].any()


def test_rule_of_sight_is_nearly_that_of_a_march():
    """Of pairs that face each other, a few per cent are judged differently: shadows are right to about a cell."""
    patch = Patch.of(rough(1.0, 2.0, 100, 0.1), Window(10 / 6, (5, 5), (5, 5)), 0.1, 0.0)
    assert 0 < patch.sight_error < 0.05


def test_horizons():
    """A wall 2 µm high, 3 µm away; and none behind."""
    z = np.zeros((60, 60))
    z[:, 50:] = 2.0
    found = horizon_map(z, 10, 0.1, np.array([0.0, np.pi, np.pi / 2]))
    assert found[0][20, 9] == pytest.approx(2 / 3.1, rel=1e-5)  # own column 19, wall at 50
    assert found[1][20, 9] == pytest.approx(0.0, abs=1e-6)
    assert found[2][20, 9] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("phi", [0.0, 137.0, 270.0])
def test_points_seen_from_afar(phi):
    """Along azimuths with and without a map of horizons: the running maximum along the lines says so too, but for the
    edges of the shadows."""
    surface = rough(1.0, 2.0, 100, 0.1)
    patch = Patch.of(surface, Window(10 / 6, (5, 5), (5, 5)), 0.1, 0.0)
    assert patch.grid.z.shape == surface.shape
    towards = unit_vectors(np.deg2rad(65.0), np.deg2rad(phi))
    seen, expected = patch.seen(towards), visible(surface, towards)
    assert np.mean(seen != expected) < 0.03
    assert 0.3 < expected.mean() < 0.9


def test_one_reflection_equals_vector_kirchhoff():
    """Gentle slopes, nothing hidden: the Mueller matrices of `Kirchhoff`, to window terms of order 1/kℓ (3 %)."""
    surface = rough(0.08, 1.5, 64, 0.125)
    gonio = vg.measure.Gonioreflectometer([30], range(-60, 61, 20), coherence_um=2.0, aperture_deg=4)
    solver = IteratedKirchhoff("Al", [550], window_um=12, windows=4, bounces=1, polarised=True, energy=False)
    one = gonio.measure(surface, solver)
    assert "energy_reflected" not in one
    other = gonio.measure(surface, vg.wave.Kirchhoff("Al", [550], polarised=True))
    assert one.attrs["windows_used"] == other.attrs["windows_used"] == 4
    peak = other.brdf.max("theta_o")
    assert float((np.abs(one.brdf - other.brdf) / peak).max()) < 0.02
    assert float((np.abs(one.mueller - other.mueller) / peak).max()) < 0.02


@pytest.mark.parametrize("name", ["perfect", "Al"])
def test_a_profile_as_a_patch(name, agreement):
    """The same profile in two and in three dimensions: energies of each order, the BRDF, and the Mueller matrices.

    What differs: the window along y spreads the light by 1/kℓ (4°) out of the cones, points are uniform in x or in arc
    length. 15 % of the BRDF in the 1-norm (7 % with a window of 20 µm); 3 % of the energies.
    """
    n = 120
    row = vg.surface.gaussian(0.9, 2.0, shape=(24, n), pitch_um=(0.5, 0.1), seed=5).z[:1]
    flat = Heightfield(np.repeat(row, n, axis=0), 0.1, periodic=True)
    bumped = np.array(flat.z)
    bumped[0, 0] += 1e-9  # no profile any more
    gonio = vg.measure.Gonioreflectometer([20], range(-70, 71, 10), coherence_um=None, aperture_deg=14)
    solver = IteratedKirchhoff(name, [900], window_um=12, windows=1, polarised=True, points_per_wavelength=7, sweeps=0)
    two = gonio.measure(flat, solver)
    three = gonio.measure(Heightfield(bumped, 0.1, periodic=True), solver)
    assert two.attrs["method"].endswith("two-dimensional")
    assert three.attrs["method"].endswith("three-dimensional")
    error = np.abs(two.energy_by_bounce.values - three.energy_by_bounce.values).max()
    agreement("iterated Kirchhoff on patches, energies", "the solver of profiles", error, 0.03)
    assert two.energy_by_bounce.values[0, 1, 0] > 0.05
    error = 100 * float(np.abs(two.brdf - three.brdf).sum() / two.brdf.sum())
    agreement("iterated Kirchhoff on patches, lobe (the window's width)", "the solver of profiles", error, 15, "%")
    assert float(np.abs(two.mueller - three.mueller).max() / two.brdf.max()) < 0.2


def test_hemisphere_and_missing_light():
    """On a hemisphere the cells add up to the energies; second hits and those outside the patch are shares."""
    gonio = vg.measure.Gonioreflectometer.hemisphere([20], resolution_deg=10)
    data = gonio.measure(rough(0.8, 1.5, 80, 0.1), IteratedKirchhoff("perfect", [900], window_um=8, bounces=2))
    total = (data.brdf.isel(wavelength=0) * gonio.detector.projected_solid_angle).sum("cell")
    assert np.allclose(total, data.energy_reflected.isel(wavelength=0))
    assert 0.75 < data.energy_reflected.item() < 1.2
    assert 0 < data.attrs["sight_error"] < 0.1
    assert 0 < data.second_hits.item() < 1
    assert 0 < data.second_hits_outside.item() < 0.5
    assert np.all(data.brdf >= 0)


def test_gentle_patches_cost_one_reflection_and_bad_ones_are_refused():
    gonio = vg.measure.Gonioreflectometer([0], [0, 10], coherence_um=1)
    gentle = rough(0.05, 1.5, 40, 0.1)
    assert gonio.measure(gentle, IteratedKirchhoff("perfect", [500], window_um=4)).attrs["bounces_done"] == 1
    for bad in ({"beam": "tapered"}, {"shadowing": False, "bounces": 1}):
        with pytest.raises(InputError):
            gonio.measure(gentle, IteratedKirchhoff("perfect", [500], window_um=4, **bad))
    with pytest.raises(InputError, match="Al2O3.*films.*profile"):
        coated = film("Al2O3", 4.0, on="Al")
        gonio.measure(gentle, IteratedKirchhoff(coated, [500], window_um=4))
    with pytest.raises(InputError, match="divergence"), warnings.catch_warnings():
        warnings.simplefilter("ignore", VgonioWarning)
        vg.measure.Gonioreflectometer([0], [0], divergence_deg=2).measure(gentle, IteratedKirchhoff("perfect", [500]))


@pytest.mark.parametrize("wavelength", [500, 610, 777])
def test_patches_of_too_many_points_are_refused_and_what_is_advised_is_not(wavelength):
    """Memory is bounded by the number of points: 128 µm are refused at once, the side or the spacing named are not."""
    surface, spacing = rough(0.5, 10, 64, 2.0), wavelength * 1e-3 / 7
    gonio = vg.measure.Gonioreflectometer([0], [0, 10], coherence_um=1)
    with pytest.raises(ToleranceError, match="points, at most 1.1e.06.*window_um ≤.*points_per_wavelength") as refused:
        gonio.measure(surface, IteratedKirchhoff("perfect", [wavelength], window_um=128))
    side, fewer = (float(n) for n in re.findall(r"≤ ([0-9.]+).* ([0-9.]+) times", str(refused.value))[0])

    def points(side: float, spacing: float) -> int:
        return Patch.of(surface, Window(side / 6, (side / 2, side / 2), (64, 64)), spacing, 0.0).grid.z.size

    for allowed in (points(side, spacing), points(128, spacing * fewer)):
        assert 0.95 * MOST_POINTS < allowed <= MOST_POINTS


def test_turned_surface_and_turned_plane_of_incidence():
    """x and y exchanged with the plane at 90°, and everything at 180° with signs of angles exchanged: the same light.

    The transposed surface is also mirrored, which changes nothing without polarisation. Single precision and the rule
    of sight on diagonals: 2 % of the largest.
    """
    surface = rough(0.5, 1.0, 50, 0.1)
    solver = IteratedKirchhoff("Al", [800], window_um=5, bounces=2, energy=False)

    def measured(one, phi, theta_i, theta_o):
        gonio = vg.measure.Gonioreflectometer([theta_i], theta_o, coherence_um=1, phi_i_deg=phi, aperture_deg=6)
        return gonio.measure(one, solver).brdf.values[0, :, 0]

    angles = np.arange(-60, 61, 20)
    plain = measured(surface, 0, 25, angles)
    turned = measured(surface.replace(z=surface.z.T), 90, 25, angles)
    backward = measured(surface, 180, -25, -angles)
    assert np.max(np.abs(turned - plain)) < 0.02 * plain.max()
    assert np.max(np.abs(backward - plain)) < 1e-3 * plain.max()


def test_profile_at_180_degrees():
    surface = vg.surface.gaussian(0.5, 1.0, (12, 120), (0.5, 0.1), seed=4)
    surface = surface.replace(z=surface.z[:1])
    solver = IteratedKirchhoff("Al", [800], bounces=2)
    values = []
    for phi, sign in ((0, 1), (180, -1)):
        angles = sign * np.array([-40, 10, 30])
        gonio = vg.measure.Gonioreflectometer([25 * sign], angles, coherence_um=1, phi_i_deg=phi)
        values.append(gonio.measure(surface, solver).brdf.values)
    assert np.allclose(values[0], values[1], rtol=1e-9)


# ---- extreme cases
def pillars() -> Heightfield:
    """Square pillars 0.4 µm apart, half as wide, 1 µm high: walls that nearly touch."""
    x = np.arange(40) // 4 % 2
    return Heightfield(1.0 * np.outer(x, x), 0.05, periodic=True, interpolation="nearest")


EXTREME = {
    "one wavelength": (rough(0.2, 0.4, 16, 0.1), 0.6, "curvature"),
    "touching walls": (pillars(), 2.0, "apart"),
    "needles": (Heightfield(np.random.default_rng(0).normal(0, 2, (24, 24)), 0.1), 2.0, "curvature"),
}


@pytest.mark.parametrize("name", EXTREME)
@pytest.mark.parametrize("metal", ["perfect", "SiO2"])
@pytest.mark.parametrize("method", ["pairs", "blocks"])
def test_extreme_patches_give_finite_numbers_and_say_why_not_to_trust_them(name, metal, method):
    """No NaN, nothing negative, 85° included; and a warning that names the reason."""
    surface, window, reason = EXTREME[name]
    gonio = vg.measure.Gonioreflectometer([0, 85], range(-85, 86, 34), aperture_deg=6)
    solver = IteratedKirchhoff(metal, [600], bounces=3, windows=1, window_um=window, method=method, polarised=True)
    with pytest.warns(VgonioWarning, match=reason):
        data = gonio.measure(surface, solver)
    for variable in ("brdf", "brdf_by_bounce", "energy_by_bounce", "energy_reflected"):
        values = data[variable].values
        assert np.isfinite(values).all()
        assert (values >= 0).all()
    assert np.isfinite(data.mueller).all()
    assert reason in data.attrs["remarks"]
