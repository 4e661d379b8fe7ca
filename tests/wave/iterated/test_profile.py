"""Profiles: geometry of points and sight, the propagator, the first reflection against Kirchhoff and closed forms."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from scipy.special import hankel1

import vgonio as vg
from vgonio.directions import Detector
from vgonio.errors import InputError, ToleranceError, VgonioWarning
from vgonio.materials import material
from vgonio.surface import Heightfield
from vgonio.surface.visibility import single_reflections
from vgonio.wave import Kirchhoff
from vgonio.wave.iterated import IteratedKirchhoff
from vgonio.wave.iterated.curve import Curve, sample_curve
from vgonio.wave.iterated.far_field import directions
from vgonio.wave.iterated.propagate import hankel, near_grazing, pair_operators
from vgonio.wave.iterated.sight import look


def rough(sigma: float, correlation: float, side: float = 60.0, pitch: float = 0.1, seed: int = 0) -> Heightfield:
    """A profile of Gaussian statistics: one row of a surface."""
    n = round(side / pitch)
    made = vg.surface.gaussian(
        sigma, correlation, shape=(24, n), pitch_um=(correlation / 4, pitch), seed=seed, exact=False
    )
    return made.replace(z=made.z[:1])


def v_groove(period: float, turns: int = 1, depth: float | None = None) -> Heightfield:
    """90° grooves (or of that depth), walls linear."""
    depth = period / 2 if depth is None else depth
    n = 8
    z = np.abs(np.arange(2 * n) - n) / n * depth
    return Heightfield(np.tile(z, turns)[None], period / (2 * n), periodic=True, interpolation="linear")


# ---- points and sight
def test_arc_length_of_a_sinusoid():
    """The elliptic integral; 1e-5: midpoints of 8 steps an arc."""
    from scipy.special import ellipe

    surface = vg.surface.sinusoid(4.0, 1.0, shape=(2, 400), pitch_um=0.05)
    curve = sample_curve(surface, 0.0, 4.0, 0.05)
    slope = 2 * np.pi * 1.0 / 4.0
    exact = 4 * 2 / np.pi * np.sqrt(1 + slope**2) * ellipe(slope**2 / (1 + slope**2)) / 1 * 1 / 1
    assert curve.ds.sum() == pytest.approx(exact, rel=1e-5)
    assert np.allclose(curve.nx**2 + curve.nz**2, 1)


def test_walls_are_part_of_the_curve():
    surface = vg.surface.lamellar(2.0, 1.5, shape=(2, 40), pitch_um=0.05)
    curve = sample_curve(surface, 0.0, 2.0, 0.03)
    assert curve.ds.sum() == pytest.approx(2.0 + 1.5)  # the wall at x = 1; the one at the seam is the neighbour's
    wall = np.abs(curve.nz) < 1e-9
    assert curve.ds[wall].sum() == pytest.approx(1.5)
    assert np.all(np.abs(curve.x[wall] - 1.0) < 1e-9)


@pytest.mark.parametrize("surface", [rough(0.8, 2.0, side=12, pitch=0.1), v_groove(4.0, 3)], ids=["rough", "grooves"])
def test_sight_equals_looking_at_every_point_between(surface):
    """The running maximum against a loop over all triples."""
    curve = sample_curve(surface, 0.0, 12.0, 0.15)
    found = look(curve)
    pairs = set(zip(found.row.tolist(), found.source.tolist()))
    assert all((j, i) in pairs for i, j in pairs)
    n = len(curve)
    for i in range(0, n, 7):
        for j in range(i + 1, n):
            m = np.arange(i + 1, j)
            line = curve.z[i] + (curve.z[j] - curve.z[i]) * (curve.x[m] - curve.x[i]) / (curve.x[j] - curve.x[i])
            above = curve.z[m] - line
            d = np.array([curve.x[j] - curve.x[i], curve.z[j] - curve.z[i]])
            d /= np.hypot(*d)
            facing = min(d @ [curve.nx[i], curve.nz[i]], -(d @ [curve.nx[j], curve.nz[j]]))
            if np.any(np.abs(above) < 1e-9) or abs(facing) < 1e-5:
                continue  # touching: rounding decides
            assert ((i, j) in pairs) == bool(np.all(above < 0) and facing > 0)


def test_directions_are_seen_as_by_the_surface_module():
    """Against `surface.visibility`, up to the edges of the shadows (one step of each)."""
    from vgonio.surface.visibility import visible

    surface = rough(0.8, 2.0, side=40, seed=2).replace(periodic=False)
    curve = sample_curve(surface, 0.05, 39.95, 0.02)
    sight = look(curve)
    for theta in (-70.0, -30.0, 20.0, 60.0, 85.0):
        seen = sight.seen(curve, np.deg2rad([theta]))[0]
        other = visible(surface, [np.sin(np.deg2rad(theta)), 0, np.cos(np.deg2rad(theta))], refine=5)[0]
        at = np.clip((curve.x / 0.02).astype(int), 0, other.size - 1)
        edges = np.count_nonzero(np.diff(other.astype(int))) + 2
        assert np.count_nonzero(seen != other[at]) <= 4 * edges


# ---- the propagator
def test_hankel_functions():
    t = np.concatenate([np.geomspace(1e-3, 59, 200), np.linspace(60, 3000, 500)])
    h0, h1 = hankel(t)
    assert np.allclose(h0, hankel1(0, t), rtol=1e-8)
    assert np.allclose(h1, hankel1(1, t), rtol=1e-8)


@pytest.mark.parametrize("polarisation", ["TE", "TM"])
def test_fields_of_a_line_source_propagate_to_the_other_wall(polarisation):
    """Two facing walls: the exact field of a line source behind the one, propagated, is that field at the other, and so
    is its slope along the normal.

    u on a closed curve around the source gives u outside of it (Green); an open wall ten wavelengths long and half
    that far away does so up to what leaves around its ends: a few per cent, less with a longer wall.
    """
    k, errors = 2 * np.pi, []
    for half in (8.0, 32.0):
        s = (np.arange(int(40 * half)) + 0.5) / 20 - half
        wall = Curve(s * 0 - 2.0, s, np.ones_like(s), 0 * s, np.full(s.size, 0.05))
        rows = Curve(np.full(5, 2.0), np.linspace(-1, 1, 5), -np.ones(5), np.zeros(5), np.ones(5))
        d = np.hypot(wall.x + 4.0, wall.z)
        u = 0.25j * hankel1(0, k * d)
        v = -0.25j * k * hankel1(1, k * d) * (wall.x + 4.0) / d
        from vgonio.wave.iterated.sight import Sight

        i, j = np.divmod(np.arange(5 * s.size), s.size)
        sight = Sight(i, j, np.zeros(5), np.zeros(5))
        transparent = material(_thin(1.0 + 1e-9))  # r = 0: u and v arrive as they are
        pairs = pair_operators(wall, rows, sight, k, transparent, 1000.0, polarisation)
        d = np.hypot(6.0, rows.z)
        exact = 0.25j * hankel1(0, k * d), 0.25j * k * hankel1(1, k * d) * 6.0 / d  # the normal points to the source
        errors.append([np.max(np.abs(g - e)) / np.max(np.abs(e)) for g, e in zip(pairs.next(u, v), exact)])
    (u_short, v_short), (u_long, v_long) = errors
    assert u_short < 0.06
    assert u_long < 0.6 * u_short
    assert v_long < v_short < 0.06  # to 1/kd of a plane wave's slope


def _thin(n: complex):
    from vgonio.materials import Material

    return Material("index", "test", lambda w: np.full(np.shape(w), n, complex), (1.0, 1e6))


# ---- the first reflection
def test_first_reflection_equals_kirchhoff_apart_from_the_window():
    """bounces = 1, no shadows, R = 1: the same |N|² as C²|S|² but for terms of the window's slope, of order 1/kℓ."""
    errors = []
    for length in (3.0, 10.0):
        surface = rough(0.3, 2.0, side=60, seed=3)
        gonio = vg.measure.Gonioreflectometer([0, 30], range(-70, 71, 5), coherence_um=length, aperture_deg=12)
        one = gonio.measure(surface, IteratedKirchhoff("perfect", [550], bounces=1, shadowing=False, windows=40))
        other = gonio.measure(surface, Kirchhoff("perfect", [550]))
        errors.append(float(np.max(np.abs(one.brdf - other.brdf)) / np.max(other.brdf)))
    assert errors[0] < 2 / (11.4 * 3.0)
    assert errors[1] < 2 / (11.4 * 10.0)


@pytest.mark.parametrize("polarisation", ["s", "p", "unpolarised"])
def test_flat_mirror_reflects_what_fresnel_says(polarisation):
    """All power, and all of it in one reflection; 1 %: the window's cone at 40° against one angle."""
    surface = vg.surface.flat(shape=(1, 200), pitch_um=0.2)
    gonio = vg.measure.Gonioreflectometer([0, 40], [-40, 0], coherence_um=6, polarisation=polarisation)
    data = gonio.measure(surface, IteratedKirchhoff("Al", [500, 600], tol=1e-6))
    assert np.allclose(data.energy_reflected, data.fresnel_macro, rtol=2e-3)
    assert np.all(data.energy_by_bounce.sel(bounce=[2, 3]) == 0)
    assert data.attrs["bounces_done"] == 1


def test_tapered_beam_carries_its_power():
    surface = vg.surface.flat(shape=(1, 400), pitch_um=0.2)
    gonio = vg.measure.Gonioreflectometer([0, 50], [-50, 0], coherence_um=8)
    data = gonio.measure(surface, IteratedKirchhoff("perfect", [550], beam="tapered"))
    assert np.allclose(data.energy_reflected, 1, atol=2e-4)


# ---- the split
def test_orders_and_their_interference_add_up():
    gonio = vg.measure.Gonioreflectometer([0, 40], range(-80, 81, 10), coherence_um=5)
    data = gonio.measure(rough(1.0, 2.0), IteratedKirchhoff("Al", [550], bounces=4, windows=3))
    assert np.all(data.brdf_by_bounce >= 0)
    assert np.all(data.brdf >= 0)
    parts = data.brdf_by_bounce.sum("bounce") + data.brdf_interference + data.brdf_diffraction
    assert np.allclose(parts, data.brdf)
    parts = data.energy_by_bounce.sum("bounce") + data.energy_interference + data.energy_diffraction
    assert np.allclose(parts, data.energy_reflected)
    energy = data.energy_by_bounce.isel(wavelength=0)
    assert np.all(energy.sel(bounce=2) > 0.03)
    assert np.all(energy.sel(bounce=3) < 0.3 * energy.sel(bounce=2))


def test_two_reflections_interfere_in_one_direction():
    """Amplitudes add in one polarisation, one window and one direction: p = p₁ + p₂ + 2 √(p₁p₂) cos δ, all δ occur."""
    gonio = vg.measure.Gonioreflectometer([20], range(-60, 61, 4), coherence_um=4, aperture_deg=0.1, polarisation="s")
    solver = IteratedKirchhoff("perfect", [600], bounces=2, windows=1, tol=0.01)
    data = gonio.measure(rough(0.8, 2.0, 30), solver).squeeze()
    one, two = data.brdf_by_bounce.values
    cosine = data.brdf_interference.values / np.maximum(2 * np.sqrt(one * two), 1e-9 * one.max())
    assert np.abs(cosine).max() < 1.01
    assert cosine.min() < -0.9
    assert cosine.max() > 0.9


def test_gentle_slopes_cost_one_reflection():
    """|θ_i| + 3 × 20° < 90° at 0° and 20°, not at 40°."""
    surface = v_groove(10.0, 4, depth=5 * np.tan(np.deg2rad(20)))
    gonio = vg.measure.Gonioreflectometer([0, 20, 40], range(-80, 81, 10), coherence_um=5)
    assert single_reflections(surface, [0, 20, 40]).tolist() == [True, True, False]
    data = gonio.measure(surface, IteratedKirchhoff("perfect", [520], windows=1))
    second = data.energy_by_bounce.sel(bounce=2).isel(wavelength=0).values
    assert second[0] == second[1] == 0 < second[2]


def test_arguments_are_checked():
    for bad in ({"bounces": 0}, {"window_um": -1}, {"beam": "laser"}, {"tol": 2}, {"points_per_wavelength": 1}):
        with pytest.raises(InputError, match=next(iter(bad))):
            IteratedKirchhoff("perfect", [500], **bad)
    with pytest.raises(InputError, match="shadowing"):
        IteratedKirchhoff("perfect", [500], shadowing=False)
    with pytest.raises(ToleranceError, match="points"):
        gonio = vg.measure.Gonioreflectometer([0], [0], coherence_um=None)
        gonio.measure(rough(0.3, 2.0, side=4000, pitch=1.0), IteratedKirchhoff("perfect", [400]))
    with pytest.raises(InputError, match="larger than the surface"):
        gonio = vg.measure.Gonioreflectometer([0], [0])
        gonio.measure(rough(0.3, 2.0).replace(periodic=False), IteratedKirchhoff("perfect", [400], window_um=100))


def test_reflection_near_grazing():
    """A plane wave's r where the source is far or the angle steep, a perfect conductor's where it is near on a metal,
    nothing where the medium reflects nothing."""
    c, metal = np.full(3, 0.02), np.full(3, 0.17 + 0.02j)
    r = (c - metal) / (c + metal)
    near, middle, far = near_grazing(r, c, metal, np.array([1e-3, 30.0, 1e5]), np.array(1.0))
    assert near == pytest.approx(1.0, abs=0.1)
    assert far == pytest.approx(r[0], abs=0.01)
    assert near.real > middle.real > far.real
    assert near_grazing(np.ones(1), c[:1], 0 * metal[:1], np.ones(1), np.array(1.0)) == pytest.approx(1.0)
    assert near_grazing(np.zeros(1), c[:1], c[:1] + 0j, np.ones(1), np.array(0.0)) == pytest.approx(0.0)


@pytest.mark.parametrize("surface", [rough(0.8, 2.0, side=12), rough(0.8, 2.0, side=12).replace(z=np.zeros((1, 120)))])
def test_an_error_of_the_spacing_above_tol_is_told(surface):
    """tol ends the series of reflections alone: the error of the points is compared with it, and the tol that the
    warning names is kept."""
    gonio = vg.measure.Gonioreflectometer([30], range(-80, 81, 20))
    with pytest.warns(VgonioWarning, match=r"error .* instead of 1\.0e-30.* points_per_wavelength, or tol = ") as said:
        data = gonio.measure(surface, IteratedKirchhoff("Al", [550], tol=1e-30, sweeps=0))
    assert data.attrs["error_achieved"] > 1e-30
    named = float(next(str(w.message) for w in said if "instead of" in str(w.message)).rsplit("tol = ", 1)[1])
    assert data.attrs["error_achieved"] <= named < 10 * data.attrs["error_achieved"]
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*instead of")
        gonio.measure(surface, IteratedKirchhoff("Al", [550], tol=max(named, 1e-9), sweeps=0))


@pytest.mark.parametrize("theta", [0.0, 84.0, -88.0])
def test_a_cone_catches_what_is_above_the_horizon(theta):
    """Power of 1 per radian: the angle of the cone above the horizon over ∫ cos θ dω."""
    detector = Detector.in_plane([theta], 10.0)
    to = directions(detector, 1.0, 0.5, 400.0)
    assert np.abs(to.theta).max() < np.pi / 2
    angle = np.deg2rad(min(theta + 5, 90.0) - max(theta - 5, -90.0))
    found = to.means(np.ones(len(to.theta)))
    assert found[0] == pytest.approx(angle / detector.projected_solid_angle[0], rel=0.01)
    assert to.total(np.ones(len(to.theta))) == pytest.approx(np.pi, rel=1e-12)
