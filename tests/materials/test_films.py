"""Thin films against closed forms: no film, quarter waves, energy, Airy's formula, the signs of r_s and r_p."""

from __future__ import annotations

import numpy as np
import pytest

import vgonio as vg
from vgonio.errors import FileFormatError, InputError, MaterialError
from vgonio.materials import Coated, Material, film, fresnel, material, stack
from vgonio.scene import load_scene

COS = np.linspace(0, 1, 41)
WAVELENGTHS = np.array([400.0, 550.0, 700.0])


def constant(index: complex) -> Material:
    return Material(f"n{index:.4g}", "constant", lambda w: np.full(np.shape(w), index, complex), (100.0, 2000.0))


def airy(cos_i, wavelength_nm, film_index, thickness_nm, below):
    """One film in closed form: r = (r12 + r23 e^{2iδ}) / (1 + r12 r23 e^{2iδ}), Born and Wolf 1999, 1.6.4."""
    sin2 = 1 - cos_i**2
    kz = [np.emath.sqrt(n**2 - sin2) for n in (1.0 + 0j, film_index + 0j, below + 0j)]
    phase = np.exp(4j * np.pi * kz[1] * thickness_nm / wavelength_nm)
    out = []
    for power in (0, 2):  # s: k_z, p: k_z / n²
        a, b, c = (k / n**power for k, n in zip(kz, (1.0, film_index, below)))
        r12, r23 = (a - b) / (a + b), (b - c) / (b + c)
        out.append((r12 + r23 * phase) / (1 + r12 * r23 * phase))
    return out


@pytest.mark.parametrize("name", ["Al", "SiO2", "Ag"])
def test_no_thickness_is_no_film(name):
    for bare, coated in zip(
        material(name).amplitudes(COS, WAVELENGTHS), film("Al2O3", 0, on=name).amplitudes(COS, WAVELENGTHS)
    ):
        assert coated.shape == (41, 3)
        assert np.abs(bare - coated).max() < 1e-10


@pytest.mark.parametrize("thickness", [4.0, 137.0, 2000.0])
@pytest.mark.parametrize("below", ["Al", "SiO2"])
def test_one_film_is_airys_formula(thickness, below, agreement):
    """Amplitudes with their phases and signs, on a metal and on glass, from normal to grazing incidence."""
    cos = np.linspace(0.001, 1, 101)
    n1, n2 = material("Al2O3").index(550.0), material(below).index(550.0)
    got = film("Al2O3", thickness, on=below).amplitudes(cos, 550.0)
    for r, expected in zip(got, airy(cos, 550.0, n1, thickness, n2)):
        error = np.abs(r - expected).max()
        agreement("thin films on metal and glass, amplitudes with phase", "Airy's formula", error, 1e-9)


def test_signs_are_those_of_fresnel():
    """r_p = +1, r_s = −1 for a perfect conductor; both −1 at grazing incidence; opposite signs at normal incidence."""
    metal = film(constant(1.5), 10, on=constant(1e3j))
    rs, rp = metal.amplitudes(np.array([0.0, 1.0]), 550.0)
    assert np.allclose([rs[0], rp[0]], -1, atol=1e-7)  # far more terms there than for any real metal
    assert np.isclose(rs[1], -rp[1])
    assert fresnel(1.0, 1e3j)[1].real > 0.99
    assert rp[1].real > 0.9
    # the field of p under exp(−iωt), k > 0: a film delays, so the phase of r grows with its thickness
    phase = [np.angle(film(constant(1.5), d, on=constant(1e3j)).amplitudes(1.0, 550.0)[1]) for d in (0, 5, 10)]
    assert np.all(np.diff(phase) > 0)


def test_quarter_waves():
    """n = √n_glass, a quarter wave thick: no reflection. A half wave: as if it were not there. n > n_glass: maximum."""
    glass, n = constant(1.5), np.sqrt(1.5)
    assert film(constant(n), 550 / 4 / n, on=glass).reflectance(1.0, 550.0) < 1e-16
    assert np.isclose(film(constant(2.3), 550 / 2 / 2.3, on=glass).reflectance(1.0, 550.0), 0.04, rtol=1e-9)
    expected = ((1 - 2.3**2 / 1.5) / (1 + 2.3**2 / 1.5)) ** 2
    assert np.isclose(film(constant(2.3), 550 / 4 / 2.3, on=glass).reflectance(1.0, 550.0), expected, rtol=1e-9)


def test_a_stack_of_quarter_waves():
    """Ten pairs of high and low index: R = ((1 − Y)/(1 + Y))², Y = (n_H/n_L)^20 n_H²/n_glass … with a last H layer."""
    high, low = 2.3, 1.46
    layers = [(constant(high), 550 / 4 / high), (constant(low), 550 / 4 / low)] * 10 + [
        (constant(high), 550 / 4 / high)
    ]
    y = (high / low) ** 20 * high**2 / 1.5
    mirror = stack(layers, on=constant(1.5))
    assert np.isclose(mirror.reflectance(1.0, 550.0), ((1 - y) / (1 + y)) ** 2, rtol=1e-9)
    assert np.all(mirror.reflectance(COS, WAVELENGTHS) <= 1 + 1e-9)


def test_order_of_layers_and_splitting():
    """A film in two parts is one film, and the layer that is named first is the outer one."""
    a, b, base = constant(1.4), constant(2.2), constant(1.5)
    one = film(a, 90, on=base).amplitudes(COS, 550.0)
    two = stack([(a, 30), (a, 60)], on=base).amplitudes(COS, 550.0)
    assert np.allclose(one, two, atol=1e-10)
    outer = stack([(a, 80), (b, 50)], on=base)
    assert np.allclose(outer.amplitudes(COS, 550.0), film(a, 80, on=film(b, 50, on=base)).amplitudes(COS, 550.0))
    assert abs(outer.reflectance(1.0, 550.0) - stack([(b, 50), (a, 80)], on=base).reflectance(1.0, 550.0)) > 0.01
    assert stack([], on="Al").name == "Al"


def test_energy():
    """Lossless films on glass let through what they do not reflect: R = 1 − T with T from the same closed form."""
    cos, n1, n2, d = np.linspace(0.05, 1, 20), 1.9, 1.5, 210.0
    coated = film(constant(n1), d, on=constant(n2))
    kz = [np.emath.sqrt(n**2 - (1 - cos**2)) for n in (1.0 + 0j, n1 + 0j, n2 + 0j)]
    delta = 2 * np.pi * kz[1] * d / 550.0
    for polarisation, power in (("s", 0), ("p", 2)):
        a, b, c = (k / n**power for k, n in zip(kz, (1.0, n1, n2)))
        t = 2 * a / ((a + c) * np.cos(delta) - 1j * (b + a * c / b) * np.sin(delta))
        transmitted = (c / a).real * np.abs(t) ** 2
        assert np.allclose(coated.reflectance(cos, 550.0, polarisation) + transmitted, 1, atol=1e-9)
    absorbing = film(constant(2 + 0.5j), 40, on="Al").reflectance(COS, WAVELENGTHS)
    assert np.all((absorbing >= 0) & (absorbing <= 1 + 1e-9))


@pytest.mark.parametrize("index", [1e-3 + 1e3j, 1e3 + 1e3j, 1.0001, 0.05 + 3j, 1e-3j + 1])
def test_extreme_indices_are_finite(index):
    for made in (film(constant(index), 50, on="Al"), film("Al2O3", 50, on=constant(index))):
        r = made.reflectance(COS, 550.0)
        assert np.all(np.isfinite(r) & (r >= 0) & (r <= 1 + 1e-6))


def test_opaque_films_hide_what_is_below(capsys):
    """Half a micrometre of silver: what is below does not matter, and nothing is printed about it."""
    a, b = film("Ag", 5000, on="Al"), material("Ag")
    assert np.allclose(a.reflectance(COS, 550.0), b.reflectance(COS, 550.0), atol=1e-9)
    assert capsys.readouterr().out == ""


def test_a_name_is_the_material_again():
    made = film("SiO2", 12.5, on=film("Al2O3", 4, on="Al:McPeak"))
    assert made.name == "SiO2 12.5 nm on Al2O3 4 nm on Al:McPeak"
    again = material(made.name)
    assert isinstance(again, Coated)
    assert np.array_equal(again.reflectance(COS, 550.0), made.reflectance(COS, 550.0))
    assert made.source.count("refractiveindex.info") == 3


def test_bad_films():
    with pytest.raises(MaterialError, match="0 nm or more"):
        film("Al2O3", -1)
    with pytest.raises(MaterialError, match="perfect"):
        film("Al2O3", 4, on="perfect")
    with pytest.raises(MaterialError, match="one by one"):
        film(film("Al2O3", 4), 4)
    with pytest.raises(MaterialError, match="no single refractive index"):
        film("Al2O3", 4).index(550.0)
    with pytest.raises(MaterialError, match="thinner than"):
        film("SiO2", 3e6, on="Al").reflectance(1.0, 550.0)
    with pytest.raises(MaterialError, match="tabulated"):
        film("Al2O3", 4, on="Al").check([5000.0])
    with pytest.raises(MaterialError, match="unknown material"):
        film("Al2O4", 4)


def test_rays_waves_models_and_comparison_take_a_film():
    """A flat sample: all the power in the mirror direction is the film's reflectance, by rays and by waves."""
    coated = film("Al2O3", 60, on="Al")
    flat = vg.surface.flat(shape=(64, 64), pitch_um=1.0)
    gonio = vg.measure.Gonioreflectometer([30], [-30], aperture_deg=6, coherence_um=10)
    expected = coated.reflectance(np.cos(np.pi / 6), [450.0, 650.0])
    cone = gonio.detector.projected_solid_angle[0]
    rays = gonio.measure(flat, vg.geometric.RayOptics(coated, [450, 650], rays=500))
    waves = gonio.measure(flat, vg.wave.Kirchhoff(coated, [450, 650]))
    assert np.allclose(rays.brdf[0, 0] * cone, expected, rtol=1e-6)
    assert np.allclose(waves.brdf[0, 0] * cone, expected, rtol=0.01)
    assert rays.attrs["material"] == waves.attrs["material"] == "Al2O3 60 nm on Al"
    model = vg.models.evaluate("cook-torrance-1982", [0], [0], [450, 650], alpha=0.3, material=coated)
    bare = vg.models.evaluate("cook-torrance-1982", [0], [0], [450, 650], alpha=0.3, material="Al")
    ratio = coated.reflectance(1.0, [450.0, 650.0]) / material("Al").reflectance(1.0, [450.0, 650.0])
    assert np.allclose((model.brdf / bare.brdf).values.ravel(), ratio)


def scene(**more):
    return {
        "surface": {"generate": {"kind": "flat", "shape": [16, 16], "pitch_um": 1.0}},
        "material": {"name": "Al", **more},
        "light": {"wavelength_nm": [550], "theta_i_deg": [30]},
        "detector": {"theta_o_deg": [-30]},
        "geometric": {"rays": 200, "polarised": True},
    }


def test_films_and_mueller_matrices_in_a_scene():
    for films in ([{"name": "Al2O3", "thickness_nm": 60.0}], {"name": "Al2O3", "thickness_nm": 60.0}):
        tree = vg.simulate(scene(film=films))
        assert tree["rays"].attrs["material"] == "Al2O3 60 nm on Al"
        assert np.allclose(tree["rays"]["mueller"][..., 0, 0], tree["rays"]["brdf"])
        expected = film("Al2O3", 60, on="Al").reflectance(np.cos(np.pi / 6), 550.0)
        assert np.isclose(tree["rays"]["energy_by_bounce"].sum(), expected, rtol=1e-6)


def test_mistakes_in_a_scenes_films_are_one_line():
    for films, words in (
        ([{"name": "Al2O3"}], ["thickness_nm", "missing"]),
        ([{"name": "Al2O3", "thicknes_nm": 4.0}], ["thickness_nm", "material.film"]),
        ([{"name": "Al2O3", "thickness_nm": -4.0}], ["thickness_nm", "-4"]),
        ([{"thickness_nm": 4.0}], ["name", "file"]),
    ):
        with pytest.raises(InputError) as e:
            load_scene(scene(film=films))
        assert all(word in str(e.value) for word in words)
        assert "\n" not in str(e.value)
    with pytest.raises((MaterialError, FileFormatError)):
        vg.plan(scene(film=[{"name": "Al2O4", "thickness_nm": 4.0}]))
