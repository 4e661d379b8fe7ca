"""Gloss, haze, reflectance, scatter, the table of models and explained shares, against closed forms and known truth."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

from vgonio import models
from vgonio.compare import (
    appearance,
    explained_shares,
    fit_model,
    fit_models,
    gloss,
    haze,
    model_table,
    reflectance,
    total_integrated_scatter,
)
from vgonio.compare.explained import _share, kind_of
from vgonio.compare.gloss import RECEPTORS_DEG, of_model, reading
from vgonio.directions import Detector, cone_projected_solid_angle, unit_vectors
from vgonio.errors import InputError
from vgonio.models.cook_torrance_1982 import fresnel_dielectric

W = np.arange(400.0, 701, 50)
ONE = np.array([550.0])
FINE = np.arange(-88.0, 88.1, 1)


# ---- gloss
@pytest.mark.parametrize("angle", [20.0, 60.0, 85.0])
def test_polished_black_glass_is_100(angle, agreement):
    """A facet model of index 1.567 as α → 0: the long wings of GGX leave 0.2 % outside at α = 2·10⁻⁴."""
    found = reading(of_model("cook-torrance-1982", ONE, alpha=2e-4, eta=1.567), angle)
    agreement("gloss of polished black glass, 20, 60, 85°", "100", found - 100, 0.3)
    assert reading(of_model("beckmann-1963", ONE, alpha=2e-4, eta=1.567), angle) == pytest.approx(100, abs=0.05)


@pytest.mark.parametrize("angle", [20.0, 60.0, 85.0])
def test_gloss_of_lambert_in_closed_form(angle, agreement):
    """f = 1/π: the projected solid angle of the rectangle, by a fine midpoint rule, over π R.

    The corners of the rectangle cost the polar rule 2·10⁻⁴.
    """
    wide, across = (np.tan(np.radians(a) / 2) for a in RECEPTORS_DEG[angle])
    x, y = np.meshgrid((np.arange(400) + 0.5) / 200 - 1, (np.arange(400) + 0.5) / 200 - 1)
    x, y, t = x * wide, y * across, np.radians(angle)
    # cosine to the normal of a direction (x, y, 1) in the frame of the receptor
    projected = np.mean((np.cos(t) + x * np.sin(t)) / (1 + x**2 + y**2) ** 2) * 4 * wide * across
    expected = 100 * projected / np.pi / fresnel_dielectric(np.cos(t), 1.567)
    error = reading(of_model("lambert-1760", ONE, k_d=1.0), angle) / float(expected) - 1
    agreement("gloss of Lambert, 20, 60, 85°", "closed form", error, 4e-4)


@pytest.mark.parametrize("alpha", [0.05, 0.2])
def test_gloss_of_in_plane_data_against_the_model_in_three_dimensions(alpha):
    """What is beside the plane has to be guessed: the stated error holds the truth, 3 of it at most."""
    parameters = {"alpha": alpha, "eta": 1.5, "k_d": 0.3}
    data = models.evaluate("cook-torrance-1982", [20, 60, 85], FINE, W, **parameters)
    for angle, most in ((20.0, 0.01), (60.0, 0.08), (85.0, 0.8)):
        found, truth = gloss(data, angle), reading(of_model("cook-torrance-1982", W, **parameters), angle)
        assert abs(found.value - truth) < 3 * found.error + 2e-3 * truth
        assert found.error < most * truth
    truth = sum(reading(of_model("cook-torrance-1982", W, **parameters), 20.0, o) for o in (-1.9, 1.9))
    assert haze(data).value == pytest.approx(truth, rel=0.01)


def test_gloss_of_a_fit_is_that_of_its_model():
    data = models.evaluate("cook-torrance-1982", [0, 30, 60], FINE[::4], W, alpha=0.2, eta=1.5, k_d=0.3)
    fit = fit_model(data, "cook-torrance-1982", material=None)
    truth = reading(of_model("cook-torrance-1982", W, alpha=0.2, eta=1.5, k_d=0.3), 60.0)
    assert gloss(fit, 60.0).value == pytest.approx(truth, rel=1e-3)


def test_gloss_that_is_not_covered():
    data = models.evaluate("cook-torrance-1982", [0, 20], FINE, W, alpha=0.02, eta=1.5)
    with pytest.raises(InputError, match="no angle of incidence of 60"):
        gloss(data, 60.0)
    with pytest.raises(InputError, match="20°, 60° and 85°"):
        gloss(data, 45.0)
    with pytest.raises(InputError, match="too coarse"):
        gloss(data.isel(theta_o=slice(None, None, 10)), 20.0)
    cells = models.evaluate("lambert-1760", [20], Detector.hemisphere(10), W, k_d=0.5)
    with pytest.raises(InputError, match="hemisphere"):
        gloss(cells, 20.0)


# ---- reflectance and scatter
def test_reflectance_of_lambert_and_of_cells():
    for data in (
        models.evaluate("lambert-1760", [0], np.arange(-80.0, 81, 5), W, k_d=0.6),
        models.evaluate("lambert-1760", [0, 40], Detector.hemisphere(5), W, k_d=0.6),
        fit_model(models.evaluate("lambert-1760", [0, 40], FINE[::8], W, k_d=0.6), "lambert-1760"),
    ):
        # cells of 5°: their cosine is that of their centre, 0.1 %
        np.testing.assert_allclose(reflectance(data), 0.6, rtol=2e-3)


def test_scatter_of_lambert_is_what_lies_outside_the_cone():
    expected = 1 - np.sin(np.radians(10)) ** 2
    data = models.evaluate("lambert-1760", [0], np.arange(-80.0, 81, 5), W, k_d=0.6)
    np.testing.assert_allclose(total_integrated_scatter(data, 10.0), expected, rtol=1e-6)
    fit = fit_model(models.evaluate("lambert-1760", [0, 40, 85], FINE[::8], W, k_d=0.6), "lambert-1760")
    found = total_integrated_scatter(fit, 10.0).values[:, 0]
    # a cone of half-angle a about a direction at θ holds π sin²a cos θ of the projected hemisphere, at 85° it is cut
    np.testing.assert_allclose(found[:2], 1 - np.sin(np.radians(10)) ** 2 * np.cos(np.radians([0, 40])), rtol=1e-5)
    cut = cone_projected_solid_angle(np.radians(85), np.radians(10))[0] / np.pi
    assert 1 - found[2] == pytest.approx(cut, rel=3e-3)
    with pytest.raises(InputError, match="wider than"):
        total_integrated_scatter(models.evaluate("lambert-1760", [0], Detector.hemisphere(10), W, k_d=0.6))
    with pytest.raises(InputError, match="within 0 to 90"):
        total_integrated_scatter(data, 90)


@pytest.mark.parametrize("phi_i", [0.0, 90.0, 200.0])
def test_scatter_over_cells_is_about_the_mirror_direction(phi_i):
    """All light within 10° of the mirror direction, φ_i + 180°: no scatter beyond 15°; nothing else about others."""
    cells = Detector.hemisphere(3)
    base = models.evaluate("lambert-1760", [40.0], cells, W, k_d=0.5).assign_coords(phi_i=phi_i)
    for turn, expected in ((180.0, 0.0), (0.0, 1.0), (90.0, 1.0)):
        middle = unit_vectors(np.radians(40.0), np.radians(phi_i + turn))
        lobe = (cells.directions @ middle > np.cos(np.radians(10))).astype(float)
        data = base.assign(brdf=base.brdf * xr.DataArray(lobe, dims="cell"))
        np.testing.assert_allclose(total_integrated_scatter(data, 15.0), expected, atol=1e-12)


def test_reflectance_of_facets_in_three_ways():
    """In plane at θ_i = 0 and over cells against the integral of the formula."""
    truth = models.directional_albedo("cook-torrance-1982", [0, 50], W, alpha=0.4)
    plane = models.evaluate("cook-torrance-1982", [0], FINE, W, alpha=0.4)
    np.testing.assert_allclose(reflectance(plane).values[0], truth.values[0], rtol=2e-3)
    cells = models.evaluate("cook-torrance-1982", [0, 50], Detector.hemisphere(3), W, alpha=0.4)
    np.testing.assert_allclose(reflectance(cells), truth, rtol=5e-3)
    with pytest.raises(InputError, match="normal incidence only"):
        reflectance(models.evaluate("cook-torrance-1982", [30], FINE, W, alpha=0.4))
    with pytest.raises(InputError, match="reach 75"):
        reflectance(models.evaluate("cook-torrance-1982", [0], FINE[40:-40], W, alpha=0.4))


def test_rows():
    data = models.evaluate("cook-torrance-1982", [0, 60], FINE, W, alpha=0.3)
    rows = appearance("x", data)
    assert {tuple(r) for r in rows} == {("of", "quantity", "value", "error", "unit")}
    by = {r["quantity"]: r for r in rows}
    assert by["gloss 20° (ISO 2813)"]["value"] is None
    assert "no angle of incidence" in by["gloss 20° (ISO 2813)"]["unit"]
    assert by["gloss 60° (ISO 2813)"]["value"] == pytest.approx(gloss(data, 60.0).value)
    assert 0 < by["reflectance at 0°"]["value"] < 1


# ---- table 4.2
def test_table_of_models():
    grid = np.arange(0.0, 81, 10), np.arange(-80.0, 81, 10), W
    samples = {
        "shifted": models.evaluate("clausen-2022", *grid, alpha=0.35, h=1.8e-3, w=3.0),
        "plain": models.evaluate("cook-torrance-1982", *grid, alpha=0.2),
    }
    rng = np.random.default_rng(0)
    samples = {k: d.assign(brdf=d.brdf * (1 + 0.01 * rng.standard_normal(d.brdf.shape))) for k, d in samples.items()}
    seen: list[float] = []
    table = model_table(samples, fit_models(samples, progress=seen.append))
    rows = {(r["sample"], r["model"]): r for r in table}
    assert len(rows) == 4
    won = rows["shifted", "clausen-2022"]
    assert rows["shifted", "cook-torrance-1982"]["delta_e"] > 4 > 1 > won["delta_e"]
    assert won["gain"] == pytest.approx(rows["shifted", "cook-torrance-1982"]["delta_e"] - won["delta_e"])
    assert won["gain"] > 10 * won["gain_stderr"]
    # where there is no shift nothing is won
    assert abs(rows["plain", "clausen-2022"]["gain"]) < 0.05
    assert seen[-1] == pytest.approx(1)
    assert seen == sorted(seen)
    assert "alpha = 0.35" in won["parameters"]
    # one wavelength has no colour, but errors
    single = {"x": samples["plain"].isel(wavelength=[2])}
    row = model_table(single, fit_models(single, ["cook-torrance-1982"]))[0]
    assert row["delta_e"] is None
    assert row["nrmse"] < 0.05


# ---- explained shares
@pytest.fixture(scope="module")
def shifted() -> xr.Dataset:
    grid = np.arange(0.0, 81, 10), np.arange(-80.0, 81, 10), np.arange(400.0, 701, 20)
    return models.evaluate("clausen-2022", *grid, alpha=0.4, h=1.5e-3, w=3.0)


def noisy(data: xr.Dataset, seed: int, sigma: float = 0.02) -> xr.Dataset:
    return data.assign(brdf=data.brdf * (1 + sigma * np.random.default_rng(seed).standard_normal(data.brdf.shape)))


def tilted(data: xr.Dataset, share: float) -> xr.Dataset:
    """The same surface with that share of the slope."""
    grid = data.theta_i.values, data.theta_o.values, data.wavelength.values
    return models.evaluate("clausen-2022", *grid, alpha=0.4, h=share * 1.5e-3, w=3.0)


def test_shares_are_those_put_in(shifted, agreement):
    """With the fraction c of the slope, 1 − (1 − c)² is explained; noise of both is taken out of the sums."""
    measured = noisy(shifted, 0)
    with_noise = {f"{c:g}": noisy(tilted(shifted, c), 10 + i) for i, c in enumerate((0.0, 0.5, 1.0, -0.5))}
    found = explained_shares(measured, with_noise, p=1.0)
    for name in with_noise:
        expected = 1 - (1 - float(name)) ** 2
        got = found.sel(explanation=name)
        agreement(
            "explained share of a shift, 0, 50, 100, −50 % of the slope put in (4 standard errors + 1 %)",
            "1 − (1 − c)²",
            100 * (float(got.share) - expected),
            400 * float(got.share_stderr) + 1,
            "%",
        )
    assert float(found.share_stderr.max()) < 0.1
    last = found.sel(explanation="global shift")
    assert float(last.share) == pytest.approx(1, abs=0.02)
    assert float(last.significance) > 20
    assert float(last.chi2_reduced) == pytest.approx(1, abs=0.3)
    assert str(last.kind.values) == "empirical model"


@pytest.mark.parametrize("ratio", [0.0, 1.0, 2.0])
def test_the_noise_of_an_explanation_is_not_held_against_it(rng, ratio):
    """The same slopes, three times their error high, found anew with errors `ratio` times as large: all is explained.

    Without its own variance taken out the share would be 1 − ratio²/9.
    """
    truth, sigma = 3e-4 * rng.standard_normal((40, 50)), 1e-4
    dims = ("theta_i", "theta_o")
    own, other = (truth + s * rng.standard_normal(truth.shape) for s in (sigma, ratio * sigma))
    measured = xr.Dataset({"slope": (dims, own), "slope_stderr": (dims, np.full(own.shape, sigma))})
    slope, stderr = (xr.DataArray(v, dims=dims) for v in (other, np.full(own.shape, ratio * sigma)))
    found = _share(measured, slope, stderr, 0, 1)
    assert found["share_stderr"] < 0.03
    assert abs(found["share"] - 1) < 4 * found["share_stderr"] + 1e-3
    assert found["chi2_reduced"] == pytest.approx(1, abs=4 * np.sqrt(2 / truth.size))


def test_noise_explains_nothing(shifted):
    """Where there is no shift at all the function says so instead of dividing noise by noise."""
    flat = tilted(shifted, 0.0)
    refused = 0
    for seed in range(6):
        try:
            found = explained_shares(noisy(flat, seed), {"x": noisy(shifted, 50 + seed)}, p=1.0)
        except InputError as e:
            assert "no significant shift to explain" in str(e)
            refused += 1
            continue
        assert float(found.sel(explanation="x").significance) < 3
    assert refused >= 1


@pytest.mark.parametrize("height", [0.0, 2e-11, 1e-7])
def test_a_share_of_rounding_is_no_number(shifted, height):
    """Slopes of 10⁻¹¹ nm⁻¹ in exact data are far beyond their errors, and no shift at all."""
    grid = shifted.theta_i.values, shifted.theta_o.values, shifted.wavelength.values
    flat = models.evaluate("clausen-2022", *grid, alpha=0.4, h=height, w=3.0)
    with pytest.raises(InputError, match="no significant shift to explain"):
        explained_shares(noisy(flat, 0, 1e-12), {"x": shifted}, p=1.0)


def test_a_small_shift_beyond_its_errors_is_still_explained(shifted):
    grid = shifted.theta_i.values, shifted.theta_o.values, shifted.wavelength.values
    small = models.evaluate("clausen-2022", *grid, alpha=0.4, h=1e-5, w=3.0)
    found = explained_shares(noisy(small, 0, 1e-6), {"x": noisy(small, 1, 1e-6)}, p=1.0)
    assert float(found.share.sel(explanation="x")) == pytest.approx(1, abs=0.02)


def test_what_cannot_be_fitted_is_left_out(shifted):
    found = explained_shares(noisy(shifted, 0), {"short": shifted.isel(wavelength=[0, 1])}, p=1.0)
    assert found.explanation.values.tolist() == ["global shift"]
    assert "short" in found.attrs["left_out"]


def test_kinds(shifted):
    assert kind_of(shifted) == "fitted model"
    assert kind_of(shifted.assign_attrs(method="waves", theory="kirchhoff")) == "single-scatter waves"
    assert kind_of(shifted.assign_attrs(method="waves", theory="iterated-kirchhoff")) == "multiple-scatter waves"
    once = shifted.assign_attrs(method="waves", theory="iterated-kirchhoff", bounces=1)
    assert kind_of(once) == "single-scatter waves"
    assert kind_of(once.assign_attrs(bounces=3)) == "multiple-scatter waves"
    assert kind_of(once.assign_attrs(theory="full-wave")) == "multiple-scatter waves"
    assert kind_of(shifted.assign_attrs(method="ray optics")) == "rays"
    assert json.loads(json.dumps(kind_of(shifted.assign_attrs(method="measured")))) == "other"
