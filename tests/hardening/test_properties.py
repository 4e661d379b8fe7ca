"""Identities that hold for any input, tried on inputs that nobody thought of: hypothesis, the same in every run."""

from __future__ import annotations

import copy
import math
import tomllib
import warnings

import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import vgonio as vg
from vgonio import compare, measure
from vgonio.compare import colour
from vgonio.directions import frames, half_vectors, unit_vectors
from vgonio.errors import VgonioError
from vgonio.materials.half_space import fresnel
from vgonio.measure.isotropic import IsotropicBrdf, sampled
from vgonio.scene import changed_scene, load_scene, parse_override
from vgonio.studies.study import content_key
from vgonio.surface.mesh import mesh
from vgonio.units import MICROMETRES, degrees, radians, to_um, wavenumber

few = settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
some = settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
angles = st.floats(-89.9, 89.9)
azimuths = st.floats(-360, 720)
seeds = st.integers(0, 2**32 - 1)
shapes = st.tuples(st.integers(4, 24), st.integers(4, 24))


def field(shape, seed, periodic=False, holes=0.0, pitch=(0.7, 1.3)) -> vg.surface.Heightfield:
    rng = np.random.default_rng(seed)
    z = rng.normal(size=shape)
    z[rng.random(shape) < holes] = np.nan
    z[0, 0] = z[-1, -1] = z[0, -1] = z[-1, 0] = 0.5
    return vg.surface.Heightfield(z, pitch, periodic=periodic)


# ---- directions and units
@some
@given(angles, azimuths)
def test_angles_make_a_round_trip_through_vectors(theta, phi):
    w = unit_vectors(radians(theta), radians(phi))
    assert np.linalg.norm(w) == pytest.approx(1, abs=1e-14)
    polar = float(degrees(np.arctan2(np.hypot(w[0], w[1]), w[2])))
    assert polar == pytest.approx(abs(theta), abs=1e-9)
    # (θ, φ) and (−θ, φ + 180°) are the same direction
    np.testing.assert_allclose(w, unit_vectors(radians(-theta), radians(phi + 180)), atol=1e-14)


@some
@given(angles, azimuths, angles, azimuths)
def test_half_vectors_are_reciprocal_and_halfway(a, b, c, d):
    wi, wo = unit_vectors(radians(a), radians(b)), unit_vectors(radians(c), radians(d))
    h = half_vectors(wi, wo)
    np.testing.assert_array_equal(h, half_vectors(wo, wi))
    assert h @ wi == pytest.approx(h @ wo, abs=1e-12)
    assert np.linalg.norm(h) == pytest.approx(1, abs=1e-12)


@some
@given(angles, azimuths)
def test_frames_are_rotations(theta, phi):
    w = unit_vectors(radians(theta), radians(phi))[None]
    m = frames(w)[0]
    np.testing.assert_allclose(m @ m.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(m) == pytest.approx(1)
    np.testing.assert_allclose(m[:, 2], w[0], atol=1e-15)


@some
@given(st.floats(-1e6, 1e6), st.sampled_from(sorted(MICROMETRES)), st.floats(1, 1e5))
def test_units_make_round_trips(value, unit, nm):
    assert degrees(radians(value)) == pytest.approx(value, rel=1e-14, abs=1e-300)
    assert value * to_um(unit) / to_um(unit) == pytest.approx(value, rel=1e-14)
    assert wavenumber(nm) * nm * 1e-3 == pytest.approx(2 * np.pi, rel=1e-14)


# ---- Fresnel and films
indices = st.complex_numbers(min_magnitude=0.05, max_magnitude=20, allow_nan=False).map(
    lambda z: complex(abs(z.real) + 0.01, abs(z.imag))
)


@some
@given(st.floats(0, 1), indices)
def test_no_interface_reflects_more_than_arrives(cos_i, index):
    r_s, r_p = (abs(complex(r)) ** 2 for r in fresnel(cos_i, index))
    assert 0 <= r_s <= 1 + 1e-12
    assert 0 <= r_p <= 1 + 1e-12
    # at normal incidence s and p are the same; at grazing all is reflected
    np.testing.assert_allclose(*(abs(r) ** 2 for r in fresnel(1.0, index)), atol=1e-12)
    np.testing.assert_allclose([abs(r) ** 2 for r in fresnel(0.0, index)], 1, atol=1e-12)


@few
@given(st.floats(0, 89), st.floats(0, 2000), st.sampled_from(["MgF2:Li-o", "SiO2", "Al2O3"]), st.floats(400, 700))
def test_a_loss_free_film_on_glass_loses_nothing(theta, thickness, layer, nm):
    """0 ≤ R ≤ 1, and half a wave more, λ/(2 n cos), is nothing: light comes back, or goes on into the glass."""
    coated = vg.materials.film(layer, thickness, on="SiO2")
    r = float(coated.reflectance(np.cos(radians(theta)), nm))
    assert 0 <= r <= 1
    n = vg.materials.material(layer).index(nm).real
    assume(abs(complex(vg.materials.material(layer).index(nm)).imag) < 1e-9)
    half_wave = nm / (2 * np.sqrt(n**2 - np.sin(radians(theta)) ** 2))
    thicker = vg.materials.film(layer, thickness + float(half_wave), on="SiO2")
    assert float(thicker.reflectance(np.cos(radians(theta)), nm)) == pytest.approx(r, abs=1e-9)


# ---- surfaces
@some
@given(shapes, seeds, st.sampled_from(["none", "mean", "plane", "quadratic"]), st.booleans())
def test_levelling(shape, seed, method, periodic):
    f = field(shape, seed, periodic, holes=0.1)
    done = vg.surface.level(f, method)
    assert done.shape == f.shape
    assert done.pitch_um == f.pitch_um
    np.testing.assert_array_equal(np.isnan(done.z), np.isnan(f.z))
    np.testing.assert_allclose(vg.surface.level(done, method).z, done.z, atol=1e-9)  # twice is once
    if method != "none":
        assert np.nanmean(done.z) == pytest.approx(0, abs=1e-9)
        x, y = np.meshgrid(f.x, f.y)
        tilted = f.with_history(f.z + (0 if periodic or method == "mean" else 0.3 * x - 0.2 * y) + 7, "tilted")
        np.testing.assert_allclose(vg.surface.level(tilted, method).z, done.z, atol=1e-8)


@few
@given(shapes, seeds, st.sampled_from(["interpolate", "nearest", "mean"]))
def test_filling_changes_nothing_that_was_there(shape, seed, method):
    f = field(shape, seed, holes=0.3)
    done = vg.surface.fill(f, method)
    assert done.missing == 0
    there = np.isfinite(f.z)
    np.testing.assert_array_equal(done.z[there], f.z[there])
    assert np.nanmin(f.z) - 1e-9 <= done.z.min() <= done.z.max() <= np.nanmax(f.z) + 1e-9
    np.testing.assert_array_equal(vg.surface.fill(done, method).z, done.z)


@few
@given(shapes, seeds, seeds, st.floats(-3, 3), st.floats(3.0, 8.0))
def test_the_filter_is_linear_and_keeps_constants(shape, a, b, factor, s_um):
    f, g = field(shape, a, True), field(shape, b, True)
    smooth = lambda z: vg.surface.gaussian_filter(f.with_history(z, "x"), s_um=s_um).z  # noqa: E731
    np.testing.assert_allclose(smooth(f.z + factor * g.z), smooth(f.z) + factor * smooth(g.z), atol=1e-10)
    np.testing.assert_allclose(smooth(np.full(shape, 2.5)), 2.5, atol=1e-12)
    assert smooth(f.z).mean() == pytest.approx(f.z.mean(), abs=1e-12)
    assert smooth(f.z).std() <= f.z.std() + 1e-12
    # a shift of a periodic field is a shift of what is filtered
    np.testing.assert_allclose(smooth(np.roll(f.z, (2, 3), (0, 1))), np.roll(smooth(f.z), (2, 3), (0, 1)), atol=1e-10)


@few
@given(st.integers(8, 40), st.integers(8, 40), seeds, st.floats(0.5, 2.0))
def test_parseval(ny, nx, seed, pitch):
    """The power spectrum of a periodic field, integrated, is its mean square height; a Fourier sum says the same."""
    f = field((ny, nx), seed, True, pitch=(pitch, 1.3))
    spectrum = np.abs(np.fft.fft2(f.z - f.z.mean())) ** 2
    assert spectrum.sum() / (ny * nx) ** 2 == pytest.approx(vg.surface.parameters(f)["Sq"] ** 2, rel=1e-9)


@few
@given(st.integers(4, 20), st.integers(4, 20), seeds, st.floats(2.0, 9.0), st.floats(2.0, 9.0))
def test_cropping_takes_what_lies_there(ny, nx, seed, ly, lx):
    f = field((ny, nx), seed)
    assume(2 * f.dy <= ly <= f.size_um[0] and 2 * f.dx <= lx <= f.size_um[1])
    part = f.cropped((ly, lx))
    assert part.pitch_um == f.pitch_um
    assert all(abs(p - w) <= d for p, w, d in zip(part.size_um, (ly, lx), f.pitch_um))
    windows = np.lib.stride_tricks.sliding_window_view(f.z, part.shape)
    same = [w - w.mean() for w in windows.reshape(-1, *part.shape)]
    assert any(np.allclose(w, part.z - part.z.mean(), atol=1e-12) for w in same)


@few
@given(st.floats(0.01, 3.0), st.floats(2.5, 10.0), seeds, st.sampled_from([(32, 32), (48, 20), (1, 128)]))
def test_generated_roughness_is_as_asked(rms, correlation, seed, shape):
    make = lambda s: vg.surface.gaussian(rms_um=rms, correlation_um=correlation, shape=shape, pitch_um=1.0, seed=s)  # noqa: E731
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        f = make(seed)
        assert f.z.mean() == pytest.approx(0, abs=1e-9 * rms)
        np.testing.assert_array_equal(make(seed).z, f.z)
        assert not np.array_equal(make((seed + 1) % 2**32).z, f.z)
        assert vg.surface.parameters(f)["Sq"] == pytest.approx(rms, rel=1e-9)


@few
@given(shapes, seeds, st.booleans(), st.integers(1, 3))
def test_a_mesh_has_no_holes(shape, seed, periodic, refinement):
    """Facets look up, their shadows tile the plane, and each edge inside belongs to two of them."""
    f = field(shape, seed, periodic)
    m = mesh(f, refinement)
    a, b, c = (m.vertices[m.faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    assert (across[:, 2] > 0).all()
    area = np.prod(np.ptp(m.vertices[:, :2], axis=0))
    assert across[:, 2].sum() / 2 == pytest.approx(area, rel=1e-9)
    assert np.linalg.norm(across, axis=1).sum() >= across[:, 2].sum()
    edges = np.sort(np.concatenate([m.faces[:, [0, 1]], m.faces[:, [1, 2]], m.faces[:, [2, 0]]]), axis=1)
    count = np.unique(edges, axis=0, return_counts=True)[1]
    assert set(count) <= {1, 2}
    ny, nx = (len(np.unique(np.round(m.vertices[:, k], 6))) for k in (1, 0))
    assert (count == 1).sum() == 2 * (nx - 1) + 2 * (ny - 1)  # those of the rim


# ---- rays and waves
@settings(few, max_examples=8)
@given(seeds, st.floats(-80, 80), st.floats(0, 360), st.floats(0.05, 1.5))
def test_a_perfect_reflector_returns_everything(seed, theta, phi, height):
    f = field((12, 12), seed, True).with_history(height * field((12, 12), seed, True).z, "scaled")
    gonio = measure.Gonioreflectometer(theta_i_deg=[theta], theta_o_deg=[0], phi_i_deg=phi)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        rays = gonio.measure(f, vg.geometric.RayOptics("perfect", wavelength_nm=[400, 700], rays=300, seed=1))
    total = rays.energy_by_bounce.sum("bounce") + rays.energy_absorbed + rays.energy_lost
    np.testing.assert_allclose(total, 1, atol=1e-9)
    assert (rays.energy_absorbed == 0).all()
    # linear in the spectrum: two wavelengths that reflect alike are alike
    np.testing.assert_array_equal(rays.brdf.isel(wavelength=0), rays.brdf.isel(wavelength=1))


@settings(few, max_examples=12)
@given(seeds, st.floats(-6, 6), st.floats(-6, 6), st.floats(0.5, 12), st.floats(-2, 2))
def test_the_fourier_integral(seed, qx, qy, qz, lift):
    """|S| ≤ A; S(−q) = S(q)*; lifting the surface turns the phase by q_z; with q = 0 it is the area."""
    f = field((8, 9), seed, True).with_history(0.2 * field((8, 9), seed, True).z, "small")
    q = np.array([[qx, qy, qz], [-qx, -qy, -qz], [0.0, 0.0, 0.0]])
    transform = lambda g, at: vg.wave.surface_fourier(g, at, None, method="reference", tol=1e-7)  # noqa: E731
    s = transform(f, q)
    area = f.area_um2
    assert abs(s[0]) <= area * (1 + 1e-6)
    assert s[1] == pytest.approx(np.conj(s[0]), abs=1e-9 * area)
    assert s[2] == pytest.approx(area, rel=1e-9)
    lifted = transform(f.with_history(f.z + lift, "lifted"), q[:1])
    assert lifted[0] == pytest.approx(s[0] * np.exp(-1j * qz * lift), abs=2e-6 * area)
    # a periodic field shifted by whole samples, at a q of its grid: a phase alone
    k = 2 * np.pi * np.array([2 / f.size_um[1], 1 / f.size_um[0]])
    grid = np.array([[k[0], k[1], qz]])
    moved = transform(f.with_history(np.roll(f.z, 3, axis=1), "moved"), grid)
    expected = transform(f, grid) * np.exp(-1j * k[0] * 3 * f.dx)
    assert moved[0] == pytest.approx(expected[0], abs=2e-6 * area)


# ---- BRDFs
def brdf(level=0.2, tilt=0.1, nm=(450, 550, 650)) -> xr.Dataset:
    made = IsotropicBrdf(
        np.array(nm, float), lambda wi, wo: (level + tilt * wi[:, 2:] * wo[:, 2:]) * np.linspace(0.9, 1.1, len(nm)), ""
    )
    return sampled(made, [0, 30, 60], np.arange(-75, 76, 15))


positive = st.floats(0.01, 0.25)


@settings(few, max_examples=12)
@given(positive, positive, positive, positive)
def test_metrics(a, b, c, d):
    one, two = brdf(a, b), brdf(c, d)
    assert float(compare.rmse(one, one)) == 0
    assert float(compare.rmse(one, two)) == pytest.approx(float(compare.rmse(two, one)), rel=1e-12)
    assert float(np.abs(compare.nse(one, one)).max()) == 0
    scaled = two.assign(brdf=2 * one.brdf)
    assert float(compare.nrmse(one, scaled)) >= 1 - 1e-9  # at least as far as the mean itself
    three = brdf(a, d)
    sides = [float(compare.rmse(x, y)) for x, y in ((one, two), (two, three), (one, three))]
    assert sides[2] <= sides[0] + sides[1] + 1e-12


@few
@given(positive, positive, st.floats(0.01, 100))
def test_a_fitted_shift_does_not_depend_on_the_scale(a, b, factor):
    one = brdf(a, b, nm=(400, 450, 500, 550, 600, 650, 700))
    two = one.assign(brdf=factor * one.brdf)
    fits = [compare.fit_local_shift(d, material=None) for d in (one, two)]
    for name in fits[0].data_vars:
        if fits[0][name].dtype.kind == "f" and name.startswith("slope"):
            np.testing.assert_allclose(fits[0][name], fits[1][name], rtol=1e-6, atol=1e-10)


@settings(few, max_examples=12)
@given(positive, positive, st.sampled_from(["a.json", "a.csv", "a.nc", "a.astm"]))
def test_what_is_written_is_read(tmp_path_factory, a, b, name):
    path = tmp_path_factory.mktemp("round") / name
    data = brdf(a, b)
    back = measure.read(measure.write(data, path))
    np.testing.assert_allclose(back.brdf, data.brdf.transpose(*back.brdf.dims), rtol=1e-8)  # nine digits
    np.testing.assert_array_equal(back.theta_o, data.theta_o)


@some
@given(st.lists(st.floats(0, 1), min_size=3, max_size=3))
def test_colours_make_a_round_trip(rgb):
    """sRGB → XYZ → sRGB by the matrix of the other direction; white is white, ΔE of a colour with itself 0."""
    linear = np.where(np.array(rgb) <= 0.04045, np.array(rgb) / 12.92, ((np.array(rgb) + 0.055) / 1.055) ** 2.4)
    to_linear = colour.linear_srgb(np.eye(3))
    back = colour.srgb(linear @ np.linalg.inv(to_linear))
    np.testing.assert_allclose(back, rgb, atol=2e-6)  # the two branches of sRGB meet within that
    lab = colour.lab(linear @ np.linalg.inv(to_linear))
    assert float(colour.delta_e(lab, lab)) == 0


# ---- scenes and studies
numbers = st.floats(0.01, 100, allow_nan=False)
words = st.text(st.characters(blacklist_categories=("Cs", "Cc")), max_size=20)


@st.composite
def scenes(draw) -> dict:
    """A valid scene, any of it."""
    lists = st.lists(st.integers(-89, 89), min_size=1, max_size=4, unique=True)
    ranges = st.fixed_dictionaries(
        {"start": st.integers(-80, 0), "stop": st.integers(1, 80), "step": st.integers(1, 40)}
    )
    made = {
        "title": draw(words),
        "surface": {
            "generate": {"kind": "gaussian", "rms_um": draw(numbers), "correlation_um": draw(numbers), "shape": [8, 8],
                         "pitch_um": draw(numbers), "seed": draw(st.integers(0, 99))},
            "level": draw(st.sampled_from(["none", "plane", "quadratic"])),
        },
        "material": {"name": draw(st.sampled_from(["Al", "Al:McPeak", "perfect"]))},
        "light": {
            "wavelength_nm": draw(st.lists(st.integers(400, 700), min_size=1, max_size=5, unique=True)),
            "theta_i_deg": draw(lists | ranges),
            "coherence_um": draw(numbers),
            "polarisation": draw(st.sampled_from(["unpolarised", "s", "p"])),
        },
        "detector": {"theta_o_deg": draw(lists | ranges), "aperture_deg": draw(st.floats(0.1, 60))},
        "geometric": {"rays": draw(st.integers(1, 10**6)), "seed": draw(st.integers(0, 99))},
    }  # fmt: skip
    if draw(st.booleans()):
        made["wave"] = {"tol": draw(st.floats(1e-6, 0.5)), "shadowing": draw(st.booleans())}
    return made


@some
@given(scenes())
def test_a_scene_makes_a_round_trip(data):
    """Dictionary → scene → JSON, TOML → the same scene, and what was given is not changed."""
    import json

    before = copy.deepcopy(data)
    scene = load_scene(data)
    assert data == before
    again = load_scene(json.loads(scene.to_json()))
    assert again.to_dict() == scene.to_dict()
    assert load_scene(tomllib.loads(toml(scene.to_dict()))).to_dict() == scene.to_dict()
    assert load_scene(scene.to_dict()).to_dict() == scene.to_dict()


def toml(value, top=True) -> str:
    """The dictionary as TOML: strings, numbers and booleans as JSON has them, tables inline."""
    import json

    if isinstance(value, dict):
        items = [f"{json.dumps(k)} = {toml(v, False)}" for k, v in value.items()]
        return "\n".join(items) if top else "{ " + ", ".join(items) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(toml(v, False) for v in value) + "]"
    return json.dumps(value, ensure_ascii=False) if not isinstance(value, float) else repr(value)


@few
@given(
    scenes(),
    st.sampled_from(["light.coherence_um", "geometric.rays", "detector.aperture_deg", "title"]),
    numbers,
    words,
)
def test_overrides_say_what_the_scene_would(data, key, number, word):
    value = {"geometric.rays": int(number) + 1, "title": word, "detector.aperture_deg": min(number, 80.0) + 0.1}.get(
        key, number
    )
    scene = load_scene(data)
    text = f"{key}={toml(value, False)}"
    keys, parsed = parse_override(text)
    assert (".".join(keys), parsed) == (key, value)
    changed = changed_scene(scene, {key: value})
    assert load_scene(scene, [text]).to_dict() == changed.to_dict() == load_scene(data, [text]).to_dict()


@some
@given(st.text(max_size=40))
def test_any_override_is_taken_or_refused(text):
    try:
        keys, _ = parse_override(text)
        assert all(keys)
    except VgonioError as e:
        assert "\n" not in str(e)


@few
@given(scenes(), st.randoms(use_true_random=False))
def test_the_name_of_a_point_is_its_content(data, random):
    """The order of keys, the title and the output are nothing; any number that changes is."""
    scene = load_scene(data)

    def shuffled(value):
        if not isinstance(value, dict):
            return value
        items = list(value.items())
        random.shuffle(items)
        return {k: shuffled(v) for k, v in items}

    key = content_key(scene)
    assert content_key(load_scene(shuffled(data) | {"title": "x", "output": {"file": "r.nc"}})) == key
    other = copy.deepcopy(data)
    other["light"]["coherence_um"] = math.nextafter(data["light"]["coherence_um"], 1000.0)
    assert content_key(load_scene(other)) != key
