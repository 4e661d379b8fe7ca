"""Normals, masking and the microfacet prediction against closed forms, and traced single reflections against both."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import erf

import vgonio as vg
from vgonio.errors import InputError
from vgonio.geometric import RayOptics, microfacet
from vgonio.materials import material
from vgonio.measure import Gonioreflectometer
from vgonio.surface import Heightfield

SLOPE = 0.2  # largest one-axis slope of the bumps: nothing is masked up to 74°


def bumps(n: int = 512) -> Heightfield:
    """One period of a paraboloid on a square: all slopes up to SLOPE are equally frequent on either axis."""
    x = np.arange(n) - n / 2  # a sample on the crease between bumps: no facet bridges it
    z = -(x**2 + x[:, None] ** 2) * SLOPE / n
    return Heightfield(z - z.mean(), 1.0, periodic=True, interpolation="linear")


def closed_ndf(theta_h):
    """D = P₂₂ / cos⁴θ_h with P₂₂ = 1/(2·SLOPE)² where both slopes are within ±SLOPE."""
    return 1 / (2 * SLOPE) ** 2 / np.cos(theta_h) ** 4


def rough(alpha: float, n: int = 256, seed: int = 0) -> Heightfield:
    """Gaussian heights and correlation, T = 10 samples: slopes of the mesh are within a few per cent of alpha/√2."""
    return vg.surface.gaussian(rms_um=alpha * 5, correlation_um=10, shape=(n, n), pitch_um=1.0, seed=seed)


def smith(alpha, theta):
    """Smith's G₁ of a Gaussian distribution of slopes (Smith 1967; Walter 2007, Beckmann)."""
    a = 1 / (alpha * np.tan(np.maximum(theta, 1e-6)))
    return 1 / (1 + (erf(a) - 1) / 2 + np.exp(-(a**2)) / (2 * a * np.sqrt(np.pi)))


@pytest.mark.parametrize("azimuthal", [False, True])
@pytest.mark.parametrize("surface", [bumps(64), rough(0.4, 64), vg.surface.sandblasted(shape=(64, 64), pitch_um=1.0)])
def test_ndf_is_normalised(surface, azimuthal):
    data = microfacet.ndf(surface, resolution_deg=5, azimuthal=azimuthal)
    assert np.isclose((data.ndf * data.projected_solid_angle).sum(), 1, rtol=1e-9)
    for name in data.variables:
        assert data[name].attrs["units"]


def test_ndf_of_bumps_in_closed_form():
    """Rings that lie within the square of slopes, tan θ_h < SLOPE; the lattice of 512² slopes sets the tolerance."""
    data = microfacet.ndf(bumps(), resolution_deg=3)
    inside = data.theta_h < 10
    expected = closed_ndf(np.deg2rad(data.theta_h))
    assert np.allclose(data.ndf[inside], expected[inside], rtol=0.02)
    assert np.all(data.ndf[data.theta_h > 18] == 0)
    assert np.isclose(data.attrs["slope_rms_x"], SLOPE / np.sqrt(3), rtol=1e-3)


def test_ndf_of_a_gaussian_surface_is_beckmanns():
    surface = rough(0.4, 512, seed=2)
    data = microfacet.ndf(surface, resolution_deg=4)
    alpha2 = data.attrs["slope_rms_x"] ** 2 + data.attrs["slope_rms_y"] ** 2
    t = np.deg2rad(data.theta_h)
    expected = np.exp(-(np.tan(t) ** 2) / alpha2) / (np.pi * alpha2 * np.cos(t) ** 4)
    # some 2000 independent patches of T², spread over the rings: 10 % on the slopes that are frequent
    assert np.allclose(data.ndf[:7], expected[:7], rtol=0.1)


@pytest.mark.parametrize("surface", [rough(0.5, 96), rough(0.5, 96).replace(periodic=False)])
def test_visible_area_is_the_ground_seen_from_there(surface, agreement):
    """∫ G₁ D (ω·m)⁺ dω_m = cos θ on every height field, whatever its shape: 4 standard errors."""
    data = microfacet.masking(surface, [0, 30, -60, 85], phi_deg=20, points=10_000)
    visible, error = data.masking * data.projected_area, data.masking_stderr * data.projected_area
    far = np.maximum(np.abs(visible - np.cos(np.deg2rad(data.theta))) - 1e-6, 0) / np.maximum(error, 1e-9)
    agreement("visible projected area", "cos θ", far, 4, "standard errors")
    assert data.masking[0] == 1
    assert np.isclose(data.projected_area[0], 1, rtol=1e-9)
    assert data.masking[3] < 0.6


def test_nothing_is_masked_below_the_greatest_slope():
    data = microfacet.masking(bumps(64), [0, 40, 70], points=2000)
    assert np.all(data.masking == 1)
    assert np.allclose(data.projected_area, np.cos(np.deg2rad(data.theta)), rtol=1e-9)


def test_walls_mask_half_of_a_grating():
    """Lamellar grating of equal lands and grooves, 45°, depth = groove width: the groove's floor is hidden."""
    z = np.tile([0.0, 0, 0, 0, 4, 4, 4, 4], (4, 2))
    surface = Heightfield(z, 1.0, periodic=True, interpolation="nearest")
    data = microfacet.masking(surface, [45], points=20_000)
    # per period of 8: tops and floors 8 cos 45°, the facing wall 4 sin 45°; seen are 4 cos 45° and the wall
    assert np.isclose(data.projected_area[0], (8 + 4) / 8 * np.sqrt(0.5), rtol=1e-9)
    error = np.sqrt(2 / 9 / 20_000)  # binomial
    assert abs(data.masking[0] - 8 / 12) < 4 * error
    assert np.isclose(data.masking_stderr[0], error, rtol=0.02)
    assert np.isclose(microfacet.ndf(surface).attrs["area_ratio"], (8 + 2 * 4) / 8)


@pytest.mark.parametrize("alpha", [0.2, 0.35, 0.5])
def test_smiths_masking(alpha, agreement):
    """Gaussian surfaces, 0 … 80°: within 0.015 of Smith's G₁.

    Smith leaves out the correlation of heights and slopes, and a sample of 25² correlation lengths is not the ensemble;
    each is about 0.005 at 80°.
    """
    surface = rough(alpha, 256, seed=4)
    slopes = microfacet.ndf(surface).attrs
    a = np.hypot(slopes["slope_rms_x"], slopes["slope_rms_y"])
    data = microfacet.masking(surface, [0, 20, 40, 60, 70, 80], points=20_000)
    error = data.masking - smith(a, np.deg2rad(data.theta))
    agreement("masking of Gaussian surfaces, slopes 0.2 … 0.5, 0 … 80°", "Smith's G₁", error, 0.015)


@pytest.mark.parametrize("name", ["Al", "SiO2"])
def test_single_reflections_of_unmasked_bumps_in_closed_form(name, agreement):
    """f = D F / (4 cos θ_i cos θ_o), averaged over the cone: 4 standard errors and 0.5 % for the lattice of slopes."""
    theta_i, aperture = 20.0, 6.0
    gonio = Gonioreflectometer([theta_i], [-37, -30, -20, -10, -3], aperture_deg=aperture)
    traced = gonio.measure(bumps(), RayOptics(name, [450, 650], rays=200_000, seed=1))
    assert float(traced.energy_by_bounce.sel(bounce=slice(2, None)).sum()) < 1e-9
    wi = gonio.incoming.vectors[0]
    half = np.deg2rad(aperture / 2)
    r = np.arccos(1 - (np.arange(40) + 0.5) / 40 * (1 - np.cos(half)))
    psi = np.arange(48) * 2 * np.pi / 48
    local = np.stack(
        [np.outer(np.sin(r), np.cos(psi)), np.outer(np.sin(r), np.sin(psi)), np.repeat(np.cos(r)[:, None], 48, 1)], -1
    ).reshape(-1, 3)
    for k, frame in enumerate(vg.directions.frames(gonio.detector.directions)):
        wo = local @ frame.T
        h = (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)
        f = closed_ndf(np.arccos(h[:, 2]))[:, None] * material(name).reflectance(h @ wi, [450.0, 650.0])
        expected = (f / (4 * wi[2])).mean(axis=0) / wo[:, 2].mean()  # D F / (4 cos cos) · cos θ_o dω, over ∫ cos θ_o dω
        got, error = traced.brdf_by_bounce[0, 0, k], traced.brdf_stderr[0, k]
        agreement(
            "single reflections of an unmasked surface (4 standard errors + 0.5 %, lattice of slopes)",
            "D F/(4 cos cos), closed form",
            100 * (got / expected - 1),
            100 * (4 * error / expected + 0.005),
            "%",
        )


def test_prediction_beside_traced_single_reflections(agreement):
    """A rough surface, 40°, masked: D F G₂ / (4 cos cos) of the same facets; within 4 standard errors.

    The prediction takes F at the centre of the cone: below 0.3 % for aluminium at 2.5° from it.
    """
    surface = rough(0.8, 256)
    gonio = Gonioreflectometer([40], range(-60, 41, 20), aperture_deg=5)
    traced = gonio.measure(surface, RayOptics("Al", [550], rays=300_000, seed=2))
    predicted = microfacet.prediction(surface, "Al", [550], gonio.incoming, gonio.detector, points=4000)
    single, error = traced.brdf_by_bounce[0], traced.brdf_by_bounce_stderr[0]
    spread = np.hypot(error, predicted.brdf_unmasked * predicted.masking_2_stderr)
    agreement(
        "masked single reflections (4 standard errors + 0.3 %)",
        "D F G₂/(4 cos cos) of the mesh",
        100 * (single / predicted.brdf - 1),
        100 * (4 * spread / predicted.brdf + 0.003),
        "%",
    )
    assert np.all(predicted.brdf <= predicted.brdf_unmasked)
    assert float(predicted.masking_2.min()) < 0.95
    assert predicted.brdf.dims == traced.brdf.dims
    for name in predicted.variables:
        assert predicted[name].attrs["units"]


def test_masking_in_retroreflection_is_correlated():
    """Seen and lit from one side: what source sees the detector sees, G₂ = G₁ there, more than the product."""
    surface = rough(0.8, 256)
    gonio = Gonioreflectometer([50], [50], aperture_deg=5)
    data = microfacet.prediction(surface, "Al", [550], gonio.incoming, gonio.detector, points=4000)
    assert data.brdf.item() > 1.03 * data.brdf_uncorrelated.item()


def test_flat_and_empty_directions():
    flat = Heightfield(np.zeros((4, 4)), 1.0, periodic=True)
    gonio = Gonioreflectometer([30], [-30, 0])
    data = microfacet.prediction(flat, "perfect", [550], gonio.incoming, gonio.detector)
    assert np.isclose(data.brdf[0, 0, 0] * gonio.detector.projected_solid_angle[0], 1, rtol=1e-3)
    assert data.brdf[0, 1, 0] == 0
    assert np.isnan(data.masking_2[0, 1])
    with pytest.raises(InputError):
        microfacet.masking(flat, [95])
    with pytest.raises(InputError):
        microfacet.masking(flat, [0], points=0)
