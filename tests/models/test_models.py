"""BRDF formulas against closed forms, normalisation integrals and reciprocity."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest

from vgonio import models
from vgonio.errors import InputError, MaterialError, VgonioWarning
from vgonio.materials import fresnel, material
from vgonio.models import beckmann_1963, clausen_2022, cook_torrance_1982, half_angles, walter_2007

ANGLES = np.arange(-80.0, 81, 10)
WAVELENGTHS = np.array([380.0, 500, 600, 780])
SHAPES = pytest.mark.parametrize("shape", [walter_2007, beckmann_1963], ids=["ggx", "beckmann"])


def gauss(a: float, b: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    x, w = np.polynomial.legendre.leggauss(n)
    return (a + b) / 2 + (b - a) / 2 * x, (b - a) / 2 * w


@SHAPES
@pytest.mark.parametrize("alpha", [0.05, 0.35, 1.0])
def test_distribution_is_normalised(shape, alpha):
    # substitution t = α·s/(1 − s) resolves the peak for every α; 1e-9 is far above the quadrature error of 400 nodes
    s, w = gauss(0, 1, 400)
    tan = alpha * s / (1 - s)
    theta = np.arctan(tan)
    jacobian = alpha / (1 - s) ** 2 * np.cos(theta) ** 2
    total = np.sum(w * jacobian * shape.distribution(theta, alpha) * np.cos(theta) * np.sin(theta) * 2 * np.pi)
    assert total == pytest.approx(1, abs=1e-9)


@SHAPES
@pytest.mark.parametrize("theta_o", [0.0, 45.0, 80.0])
def test_masking_keeps_the_projected_area(shape, theta_o):
    """∫ G₁ max(ω_o·h, 0) D dω_h = cos θ_o: the visible facets fill the projected area, whatever the distribution."""
    alpha, theta_o = 0.4, np.radians(theta_o)
    s, w = gauss(0, 1, 300)
    theta = np.arctan(alpha * s / (1 - s))
    w = w * alpha / (1 - s) ** 2 * np.cos(theta) ** 2 * np.sin(theta) * shape.distribution(theta, alpha)
    phi = (np.arange(2000) + 0.5) / 2000 * 2 * np.pi
    cosine = np.cos(theta)[:, None] * np.cos(theta_o) + np.sin(theta)[:, None] * np.sin(theta_o) * np.cos(phi)
    visible = shape.masking(theta_o, alpha) * np.sum(w[:, None] * np.maximum(cosine, 0)) * 2 * np.pi / phi.size
    # the kink of max(…, 0) limits the midpoint rule over φ to about 1e-5
    assert visible == pytest.approx(np.cos(theta_o), abs=5e-5)


def test_ggx_width_convention():
    """At tan θ = α the slope density D cos⁴θ is a quarter of its peak 1/(πα²)."""
    alpha = 0.3
    theta = np.arctan(alpha)
    assert walter_2007.distribution(0.0, alpha) == pytest.approx(1 / (np.pi * alpha**2))
    assert walter_2007.distribution(theta, alpha) * np.cos(theta) ** 4 == pytest.approx(1 / (4 * np.pi * alpha**2))


@SHAPES
def test_masking_limits(shape):
    assert shape.masking(0.0, 0.4) == pytest.approx(1, abs=1e-12)
    theta = np.radians([0, 30, 60, 85, 89.9])
    g = shape.masking(theta, 0.4)
    assert np.all(np.diff(g) < 0)
    assert g[-1] < 0.02
    assert shape.masking(np.radians(-60.0), 0.4) == shape.masking(np.radians(60.0), 0.4)
    assert shape.masking(np.radians(80.0), 1e-4) == pytest.approx(1, abs=1e-6)


def test_half_angles_in_plane_and_out_of_plane():
    i, o = np.radians(ANGLES)[:, None], np.radians(ANGLES)[None, :]
    theta_m, theta_d = half_angles(i, o)
    np.testing.assert_allclose(theta_m, np.abs(i + o) / 2, atol=1e-12)
    np.testing.assert_allclose(theta_d, np.abs(i - o) / 2, atol=1e-12)
    # θ_i = θ_o = 60° at right angles: h ∝ (s, s, 2c), cos 2θ_d = ω_i·ω_o = cos²60° = 1/4
    theta_m, theta_d = half_angles(np.pi / 3, np.pi / 3, 0, np.pi / 2)
    assert np.tan(theta_m) == pytest.approx(np.sqrt(1.5))
    assert np.cos(2 * theta_d) == pytest.approx(0.25)


def test_fresnel_of_cook_torrance_equals_fresnels_equations():
    c = np.cos(np.radians([0, 20, 56.3, 75, 89]))
    rs, rp = fresnel(c, 1.5)
    exact = 0.5 * (abs(rs) ** 2 + abs(rp) ** 2)
    np.testing.assert_allclose(cook_torrance_1982.fresnel_dielectric(c, 1.5), exact, rtol=1e-11)
    assert cook_torrance_1982.fresnel_dielectric(1.0, 1.5) == pytest.approx(0.04)


def test_cook_torrance_at_normal_incidence():
    """θ_i = θ_o = 0: D(0) F/4 = F/(4πα²) for GGX and for Beckmann."""
    f = material("Al").reflectance(1.0, WAVELENGTHS)
    for name in ("ggx", "beckmann"):
        data = models.evaluate("cook-torrance-1982", [0], [0], WAVELENGTHS, alpha=0.2, distribution=name)
        np.testing.assert_allclose(data.brdf.values.ravel(), f / (4 * np.pi * 0.04), rtol=1e-12)


@pytest.mark.parametrize("distribution", ["ggx", "beckmann"])
@pytest.mark.parametrize(
    "name, more", [("cook-torrance-1982", {}), ("clausen-2022", {"h": 1e-3, "w": 3.0, "t_y": 1e-4, "p": 1.5})]
)
def test_reciprocity(name, more, distribution):
    data = models.evaluate(name, ANGLES, ANGLES, WAVELENGTHS, alpha=0.3, distribution=distribution, **more)
    swapped = data.brdf.transpose("theta_o", "theta_i", "wavelength").values
    np.testing.assert_allclose(data.brdf.values, swapped, rtol=1e-12)


def test_shift_is_one_at_the_reference_wavelength_and_linear():
    common = dict(alpha=0.3, material="perfect")
    plain = models.evaluate("cook-torrance-1982", ANGLES, ANGLES, WAVELENGTHS, **common)
    shifted = models.evaluate("clausen-2022", ANGLES, ANGLES, WAVELENGTHS, h=1e-3, w=3.0, **common)
    ratio = shifted.brdf / plain.brdf
    np.testing.assert_allclose(ratio.sel(wavelength=600), 1, rtol=1e-13)
    theta_m = np.abs(ANGLES[:, None] + ANGLES[None, :]) / 2
    slope = (ratio.sel(wavelength=780) - 1) / 180
    np.testing.assert_allclose(slope, 1e-3 * np.cos(3 * np.radians(theta_m)), atol=1e-15)
    # mirror direction: 0.001 nm⁻¹ over 180 nm
    assert ratio.sel(theta_i=40, theta_o=-40, wavelength=780) == pytest.approx(1.18)


def test_without_slope_it_is_cook_torrance():
    common = dict(alpha=0.3, material="Al", k_d=0.2)
    a = models.evaluate("cook-torrance-1982", [0, 40], ANGLES, WAVELENGTHS, **common)
    b = models.evaluate("clausen-2022", [0, 40], ANGLES, WAVELENGTHS, h=0.0, w=3.0, **common)
    np.testing.assert_allclose(a.brdf, b.brdf, rtol=1e-14)


def test_negative_shift_is_reported_and_clamped_only_on_request():
    m = clausen_2022.slope(np.abs(np.radians(ANGLES)) / 2, 8e-3, 3.0)
    expected = np.mean(1 + m[:, None] * (WAVELENGTHS - 600) < 0)
    assert 0 < expected < 1
    arguments = ("clausen-2022", [0], ANGLES, WAVELENGTHS)
    with pytest.warns(VgonioWarning, match="negative"):
        data = models.evaluate(*arguments, alpha=0.3, h=8e-3, w=3.0)
    assert data.attrs["shift_negative_share"] == pytest.approx(expected)
    assert data.attrs["shift_minimum"] == pytest.approx((1 + m[:, None] * (WAVELENGTHS - 600)).min())
    assert float(data.brdf.min()) < 0
    with pytest.warns(VgonioWarning):
        assert float(models.evaluate(*arguments, alpha=0.3, h=8e-3, w=3.0, clamp=True).brdf.min()) == 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert models.evaluate(*arguments, alpha=0.3, h=1e-3, w=3.0).attrs["shift_negative_share"] == 0


def test_diffuse_part_and_dielectric():
    k_d = np.linspace(0.1, 0.4, WAVELENGTHS.size)
    with_diffuse = models.evaluate("cook-torrance-1982", [30], ANGLES, WAVELENGTHS, alpha=0.3, eta=1.5, k_d=k_d)
    without = models.evaluate("cook-torrance-1982", [30], ANGLES, WAVELENGTHS, alpha=0.3, eta=1.5)
    np.testing.assert_allclose((with_diffuse - without).brdf[0], np.tile(k_d / np.pi, (ANGLES.size, 1)), rtol=1e-12)
    # constant index: no colour of its own
    assert np.ptp(without.brdf.values, axis=-1).max() == 0


def test_dataset_and_table():
    data = models.evaluate("clausen-2022", [0, 30], [-30, 0], [500], alpha=0.3, h=1e-3, w=2, material="Al:McPeak")
    assert data.brdf.dims == ("theta_i", "theta_o", "wavelength")
    assert all("units" in data[v].attrs and "long_name" in data[v].attrs for v in data.variables)
    assert data.attrs["method"] == "model"
    assert json.loads(data.attrs["parameters"])["material"] == "Al:McPeak"
    assert {row[0] for row in models.table()} == set(models.MODELS)


@pytest.mark.parametrize(
    "name, more, message",
    [
        ("cook-torrence-1982", {"alpha": 0.3}, "did you mean 'cook-torrance-1982'"),
        ("cook-torrance-1982", {}, "needs alpha"),
        ("cook-torrance-1982", {"alpha": 0.3, "aplha": 1}, "did you mean 'alpha'"),
        ("cook-torrance-1982", {"alpha": 0.0}, "positive"),
        ("cook-torrance-1982", {"alpha": np.nan}, "positive"),
        ("cook-torrance-1982", {"alpha": 0.3, "distribution": "gxx"}, "did you mean 'ggx'"),
        ("cook-torrance-1982", {"alpha": 0.3, "eta": 0.5}, "at least 1"),
        ("cook-torrance-1982", {"alpha": 0.3, "eta": 1.5, "material": "Al"}, "not both"),
        ("cook-torrance-1982", {"alpha": 0.3, "k_d": 1.2}, "albedo"),
        ("cook-torrance-1982", {"alpha": 0.3, "k_d": [0.1, 0.2, 0.3]}, "k_d"),
        ("clausen-2022", {"alpha": 0.3, "h": np.inf, "w": 1}, "finite"),
    ],
)
def test_bad_parameters(name, more, message):
    with pytest.raises(InputError, match=message):
        models.evaluate(name, [0], [0], [500, 600], **more)


def test_bad_grids():
    with pytest.raises(InputError, match="90"):
        models.evaluate("cook-torrance-1982", [90], [0], [500], alpha=0.3)
    with pytest.raises(InputError, match="empty"):
        models.evaluate("cook-torrance-1982", [], [0], [500], alpha=0.3)
    with pytest.raises(MaterialError, match="tabulated"):
        models.evaluate("cook-torrance-1982", [0], [0], [5.0], alpha=0.3)
