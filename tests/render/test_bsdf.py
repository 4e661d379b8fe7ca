"""The plug-ins as a renderer's own are checked: values, sampling, reciprocity, furnace; in every variant that works."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio import models
from vgonio.errors import InputError, MaterialError
from vgonio.render import bsdf, choose, use

WAVELENGTHS = np.array([450.0, 550.0, 650.0, 750.0])
THETA = np.array([-80.0, -55.0, -20.0, 0.0, 30.0, 60.0, 80.0])
CONDUCTOR = {"type": bsdf.PLAIN, "alpha": 0.3, "material": "Al"}
SHIFTED = {"type": bsdf.EXTENDED, "alpha": 0.3, "material": "Al", "h": 1e-3, "w": 2.0}
K_D = [0.2, 0.4, 0.6, 0.5]
DIFFUSE = {"alpha": 0.4, "eta": 1.5, "k_d": bsdf.spectrum(WAVELENGTHS, K_D), "k_d_mean": 0.4}
DIELECTRIC = {"type": bsdf.PLAIN, **DIFFUSE}
SHIFTED_DIELECTRIC = {"type": bsdf.EXTENDED, "h": -1.5e-3, "w": 1.3, **DIFFUSE}
ALL = {"conductor": CONDUCTOR, "shifted": SHIFTED, "dielectric": DIELECTRIC, "shifted-dielectric": SHIFTED_DIELECTRIC}


def direction(theta, phi=0.0):
    t, p = np.radians(theta), np.radians(phi)
    return [float(np.sin(t) * np.cos(p)), float(np.sin(t) * np.sin(p)), float(np.cos(t))]


def interaction(mi, wi, wavelengths=WAVELENGTHS):
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = mi.Vector3f(*wi)
    si.wavelengths = mi.Spectrum(*(float(w) for w in wavelengths))
    return si


def value(mi, plugin, wi, wo, wavelengths=WAVELENGTHS):
    """f in sr⁻¹ at the four wavelengths."""
    found = plugin.eval(mi.BSDFContext(), interaction(mi, wi, wavelengths), mi.Vector3f(*map(float, wo)))
    return np.array(found, dtype=float).ravel() / wo[2]


def reference(name, theta_i, theta_o):
    """The same from vgonio.models."""
    plain = dict(alpha=0.3, material="Al") if "dielectric" not in name else dict(alpha=0.4, eta=1.5, k_d=K_D)
    if "shifted" in name:
        plain |= dict(h=1e-3, w=2.0) if name == "shifted" else dict(h=-1.5e-3, w=1.3)
        return models.evaluate("clausen-2022", theta_i, theta_o, WAVELENGTHS, clamp=True, **plain).brdf.values
    return models.evaluate("cook-torrance-1982", theta_i, theta_o, WAVELENGTHS, **plain).brdf.values


@pytest.mark.parametrize("name", ALL)
def test_agrees_with_the_models(mi, name, agreement):
    plugin = mi.load_dict(ALL[name])
    expected = reference(name, THETA, THETA)
    found = [[value(mi, plugin, direction(i), direction(o)) for o in THETA] for i in THETA]
    # single precision; at 80° and 80° the cosine of the direction alone costs 1e-6
    agreement("Mitsuba plug-ins in plane, scalar and llvm", "`vgonio.models`", np.divide(found, expected) - 1, 5e-6)


def test_specular_albedo_and_offset(mi):
    """The form of chapter 3: k_s(λ), and c subtracted."""
    k_s = [0.9, 0.8, 0.7, 0.6]
    made = {"k_s": bsdf.spectrum(WAVELENGTHS, k_s), "c": 0.02}
    plugin = mi.load_dict(DIELECTRIC | made)
    parts = reference("dielectric", [40.0], [-30.0])[0, 0] - np.array(K_D) / np.pi
    expected = np.array(K_D) / np.pi + k_s * parts - 0.02
    np.testing.assert_allclose(value(mi, plugin, direction(40), direction(-30)), expected, rtol=5e-6)
    dark = mi.load_dict(DIELECTRIC | {"c": 5.0})
    assert value(mi, dark, direction(0), direction(0)).max() == 0


def test_perfect_reflector_is_the_facets_alone(mi):
    plugin = mi.load_dict({"type": bsdf.PLAIN, "alpha": 0.5, "material": "perfect"})
    expected = models.evaluate("cook-torrance-1982", [40.0], [10.0], WAVELENGTHS, alpha=0.5, material="perfect").brdf
    np.testing.assert_allclose(value(mi, plugin, direction(40), direction(10)), expected.values[0, 0], rtol=5e-6)


@pytest.mark.parametrize("name", ALL)
def test_reciprocity_and_isotropy_off_the_plane(mi, name, rng):
    plugin = mi.load_dict(ALL[name])
    for _ in range(20):
        a, b = rng.uniform(0, 80, 2)
        p, q, turn = rng.uniform(0, 360, 3)
        forth = value(mi, plugin, direction(a, p), direction(b, q))
        np.testing.assert_allclose(value(mi, plugin, direction(b, q), direction(a, p)), forth, rtol=1e-5)
        np.testing.assert_allclose(value(mi, plugin, direction(a, p + turn), direction(b, q + turn)), forth, rtol=1e-4)


def test_shift_is_linear_in_wavelength_and_one_at_600_nm(mi):
    w = [500.0, 600.0, 700.0, 800.0]
    si = [value(mi, mi.load_dict(d), direction(50, 20), direction(30, 140), w) for d in (CONDUCTOR, SHIFTED)]
    ratio = si[1] / si[0]
    from vgonio.models.half_angle import half_angles

    theta_m, _ = half_angles(*np.radians([50, 30, 20, 140]))
    np.testing.assert_allclose(ratio, 1 + 1e-3 * np.cos(2 * theta_m) * (np.array(w) - 600), rtol=2e-6)


@pytest.mark.parametrize("name", ["shifted", "shifted-dielectric"])
def test_negative_shift_is_black(mi, name):
    steep = ALL[name] | {"h": 0.02, "w": 0.0}
    plain = np.array(K_D[:1]) / np.pi if "dielectric" in name else [0.0]
    np.testing.assert_allclose(value(mi, mi.load_dict(steep), direction(0), direction(0))[:1], plain, rtol=1e-6)


def test_nothing_from_below(mi):
    plugin = mi.load_dict(DIELECTRIC)
    si = interaction(mi, direction(30))
    below = mi.Vector3f(0.3, 0.0, -0.8)
    assert np.max(np.array(plugin.eval(mi.BSDFContext(), si, below))) == 0
    assert np.max(np.array(plugin.pdf(mi.BSDFContext(), si, below))) == 0
    sample, weight = plugin.sample(mi.BSDFContext(), interaction(mi, [0.3, 0.0, -0.8]), 0.5, mi.Point2f(0.3, 0.6))
    assert np.max(np.array(weight)) == 0
    assert np.max(np.array(sample.pdf)) == 0


def chi_square(mi, theta, sampled, claimed):
    """Mitsuba's own χ² test over the sphere: samples of one plug-in against the pdf of another."""

    def sample(numbers):
        bs, weight = sampled.sample(mi.BSDFContext(), interaction(mi, direction(theta, 30)), *_split(mi, numbers))
        return bs.wo, weight[0] * 0 + dr.select(bs.pdf > 0, 1.0, 0.0)

    def pdf(wo):
        return claimed.pdf(mi.BSDFContext(), interaction(mi, direction(theta, 30)), wo)

    import drjit as dr

    return mi.chi2.ChiSquareTest(
        domain=mi.chi2.SphericalDomain(), sample_func=sample, pdf_func=pdf, sample_dim=3, sample_count=200_000, res=101
    )


def _split(mi, numbers):
    return numbers[0], mi.Point2f(numbers[1], numbers[2])


@pytest.mark.parametrize("theta", [0.0, 50.0, 80.0])
@pytest.mark.parametrize("name", ["conductor", "shifted-dielectric"])
def test_samples_follow_the_pdf(llvm, name, theta, tmp_path, monkeypatch, agreement):
    """At the level of 1 %, shared by the six cases (Šidák)."""
    monkeypatch.chdir(tmp_path)  # Mitsuba writes what it found there
    plugin = llvm.load_dict(ALL[name])
    test = chi_square(llvm, theta, plugin, plugin)
    assert test.run(0.01, 6, quiet=True)
    agreement(
        "samples of the plug-ins, 0, 50 and 80° (α off by 7 % fails): p of Mitsuba's χ² test",
        "their density, at 1 % for all six",
        test.p_value,
        (1 - 0.99 ** (1 / 6), 1),
    )


def test_a_wrong_pdf_fails_that_test(llvm, tmp_path, monkeypatch):
    """The χ² test can fail: samples of a slightly different roughness are found out."""
    monkeypatch.chdir(tmp_path)
    right, wrong = (llvm.load_dict(CONDUCTOR | {"alpha": a}) for a in (0.3, 0.32))
    assert not chi_square(llvm, 50.0, right, wrong).run(0.01, 1, quiet=True)


def samples(mi, plugin, theta, count, wavelengths=WAVELENGTHS, seed=0):
    """(count, 4) weights f cos/pdf, (count,) pdf and (count, 3) directions of one direction of view."""
    import drjit as dr

    if not mi.variant().startswith("scalar"):
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, count)
        si = interaction(mi, direction(theta), wavelengths)
        bs, weight = plugin.sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d())
        dr.eval(bs, weight)
        pdf = np.broadcast_to(np.array(bs.pdf, float), count)
        return np.array(weight, float).T, pdf, np.array(bs.wo, float).T
    numbers = np.random.default_rng(seed).random((count, 3))
    found = []
    si = interaction(mi, direction(theta), wavelengths)
    for one, *two in numbers:
        bs, weight = plugin.sample(mi.BSDFContext(), si, float(one), mi.Point2f(*map(float, two)))
        found.append((np.array(weight, float).ravel(), float(bs.pdf), np.array(bs.wo, float).ravel()))
    return tuple(np.stack(x) for x in zip(*found))


@pytest.mark.parametrize("name", ["conductor", "shifted-dielectric"])
def test_weight_is_value_over_pdf(mi, name):
    plugin = mi.load_dict(ALL[name])
    weight, pdf, wo = samples(mi, plugin, 60.0, 200)
    up = wo[:, 2] > 1e-3
    for w, p, d in list(zip(weight[up], pdf[up], wo[up]))[:50]:
        np.testing.assert_allclose(value(mi, plugin, direction(60), d) * d[2] / p, w, rtol=1e-3)


def albedo(mi, plugin, theta, count=200_000, wavelengths=WAVELENGTHS):
    """Reflected share of the power from that direction (4,), with its standard error."""
    weight, _, _ = samples(mi, plugin, theta, count, wavelengths)
    return weight.mean(axis=0), weight.std(axis=0) / np.sqrt(count)


@pytest.mark.parametrize("alpha", [0.05, 0.3, 0.8])
def test_white_furnace(llvm, alpha, agreement):
    """Perfect facets reflect at most everything: what is masked is lost, nothing is gained."""
    plugin = llvm.load_dict({"type": bsdf.PLAIN, "alpha": alpha, "material": "perfect"})
    for theta in (0.0, 30.0, 60.0, 80.0, 87.0):
        mean, error = albedo(llvm, plugin, theta)
        agreement(
            "white furnace of the plug-ins, α 0.05 … 0.8, 0 … 87°: reflected share",
            "at most 1, within 4 standard errors",
            mean,
            (0.4, 1 + 4 * error.max()),
        )
    # hardly rough and near the normal: nothing is masked
    if alpha == 0.05:
        assert albedo(llvm, plugin, 0.0)[0].min() > 0.99


def test_albedo_equals_the_integral(llvm, agreement):
    """The sampled albedo against a quadrature of vgonio's formula over the hemisphere: 4 standard errors."""
    mean, error = albedo(llvm, llvm.load_dict(CONDUCTOR), 40.0)
    from vgonio.materials import material
    from vgonio.models import half_angles, walter_2007

    c = (np.arange(2000) + 0.5) / 2000  # cos θ_o, the measure of solid angle
    phi = (np.arange(720) + 0.5) / 720 * np.pi
    t = np.arccos(c)[:, None]
    theta_m, theta_d = half_angles(np.radians(40.0), t, 0.0, phi[None, :])
    masked = walter_2007.masking(np.radians(40.0), 0.3) * walter_2007.masking(t, 0.3)
    f = walter_2007.distribution(theta_m, 0.3) * masked / (4 * np.cos(np.radians(40.0)))
    angles = np.linspace(0, np.pi / 2, 500)
    r = np.stack(
        [np.interp(theta_d, angles, column) for column in material("Al").reflectance(np.cos(angles), WAVELENGTHS).T]
    )
    integral = np.mean(f * r, axis=(1, 2)) * 2 * np.pi
    agreement(
        "albedo of the plug-ins, sampled, beyond 1e-4",
        "quadrature over the hemisphere",
        np.maximum(np.abs(mean - integral) - 1e-4, 0) / error,
        4,
        "standard errors",
    )


def test_shift_can_exceed_the_furnace(llvm):
    """A strong shift reflects more than arrives at long wavelengths; λ_n itself is left alone."""
    perfect = {"alpha": 0.1, "material": "perfect"}
    w = [420.0, 600.0, 700.0, 780.0]
    plain, _ = albedo(llvm, llvm.load_dict({"type": bsdf.PLAIN, **perfect}), 0.0, wavelengths=w)
    mean, error = albedo(
        llvm, llvm.load_dict({"type": bsdf.EXTENDED, "h": 1e-3, "w": 1.0, **perfect}), 0.0, wavelengths=w
    )
    assert mean[3] > 1.15
    assert mean[0] < 0.83
    np.testing.assert_allclose(mean[1], plain[1], rtol=1e-5)
    # linear in λ − 600 nm
    np.testing.assert_allclose((mean[3] - mean[1]) / 180, (mean[1] - mean[0]) / 180, rtol=1e-3)


def test_variants_agree_on_the_same_random_numbers():
    """scalar and llvm run the same code: the same directions, weights and pdf for the same numbers."""

    def run(mi):
        plugin = mi.load_dict(SHIFTED_DIELECTRIC)
        found = []
        for one, x, y in np.random.default_rng(1).random((40, 3)):
            bs, weight = plugin.sample(
                mi.BSDFContext(), interaction(mi, direction(40)), mi.Float(float(one)), mi.Point2f(float(x), float(y))
            )
            row = [np.array(v, float).ravel() for v in (bs.wo, bs.pdf, weight)]
            found.append(np.concatenate(row))
        return np.array(found)

    if not choose("auto").variant.startswith("llvm"):
        pytest.skip(choose("auto").why)
    first = run(use("scalar"))
    second = run(use("llvm"))
    np.testing.assert_allclose(second, first, rtol=2e-4, atol=2e-5)


@pytest.mark.parametrize(
    "wrong, said",
    [
        ({"alpha": 0.0}, "alpha = 0"),
        ({"h": float("nan")}, "h = nan"),
        ({"material": "Unobtainium"}, "unknown material"),
        ({"material": "Al", "wavelength_min": 10.0}, "tabulated"),
        ({"eta": 0.9}, "eta = 0.9"),
    ],
)
def test_impossible_parameters(mi, wrong, said):
    with pytest.raises((InputError, MaterialError, RuntimeError), match=said):
        mi.load_dict(SHIFTED | wrong)
