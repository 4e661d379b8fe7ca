"""Shift fits: exact recovery, standard errors that hold, gaps, and a slow reference by scipy."""

from __future__ import annotations

import time

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import least_squares

from vgonio import models
from vgonio.compare import fit_global_shift, fit_local_shift, global_fit, two_shift_fit
from vgonio.compare.spectra import normalised_spectra
from vgonio.errors import InputError, MaterialError
from vgonio.materials import material

THETA_I = np.arange(0.0, 81, 20)
THETA_O = np.arange(-80.0, 81, 10)
WAVELENGTH = np.arange(380.0, 781, 20)
H, W = 1.8e-3, 3.0
MODEL = dict(alpha=0.35, h=H, w=W)


def dataset(wavelength=WAVELENGTH, **parameters) -> xr.Dataset:
    return models.evaluate("clausen-2022", THETA_I, THETA_O, wavelength, **(MODEL | parameters))


def true_slope(data: xr.Dataset, t_y: float = 0.0) -> xr.DataArray:
    return H * np.cos(W * np.radians(abs(data.theta_i + data.theta_o) / 2)) + t_y


def noisy(data: xr.Dataset, sigma: float, seed: int) -> xr.Dataset:
    rng = np.random.default_rng(seed)
    return data.assign(brdf=data.brdf * (1 + sigma * rng.standard_normal(data.brdf.shape)))


@pytest.mark.parametrize("p", [1.0, 2.5])
def test_local_fit_recovers_slope_and_exponent(p):
    data = dataset(p=p, t_y=2e-4)
    fit = fit_local_shift(data)
    # the exponent is found to 1e-8 by golden sections; the slope follows it
    np.testing.assert_allclose(fit.slope, true_slope(data, 2e-4), atol=1e-9)
    np.testing.assert_allclose(fit.p, p, atol=1e-6)
    assert float(fit.r2.min()) > 1 - 1e-9
    fixed = fit_local_shift(data, p=p)
    np.testing.assert_allclose(fixed.slope, true_slope(data, 2e-4), atol=1e-15)
    assert fixed.slope.attrs["units"] == fixed.slope_stderr.attrs["units"] == "nm-1"


def test_no_fresnel_term():
    """material=None and "perfect" are F = 1: nothing of a reflectance is divided out."""
    data = dataset(material="perfect")
    for reflector in (None, "perfect"):
        fit = fit_local_shift(data, material=reflector)
        np.testing.assert_allclose(fit.slope, true_slope(data), atol=1e-15)
        assert np.all(fit.p == 0)
        assert fit.attrs["p"] == "fixed at 0"
    # with Al data the Fresnel term then ends up in the slope
    assert abs(fit_local_shift(dataset(), material=None).slope - true_slope(data)).max() > 1e-5


def test_reference_wavelength_between_samples():
    """λ_n = 600 nm is interpolated from 590 and 610 nm: exact for F = 1, where the spectrum is linear."""
    w = np.arange(390.0, 771, 20)
    fit = fit_local_shift(dataset(w, material="perfect"), material=None)
    np.testing.assert_allclose(fit.slope, true_slope(fit), atol=1e-15)
    # with aluminium the curvature of F over 20 nm is left: relative 1e-4 in the normalisation, 1e-6 nm⁻¹ in the slope
    fit = fit_local_shift(dataset(w), p=1.0)
    np.testing.assert_allclose(fit.slope, true_slope(fit), atol=1e-6)


def test_order_of_wavelengths_and_dims_does_not_matter():
    data = noisy(dataset(), 0.02, 0)
    turned = data.isel(wavelength=slice(None, None, -1)).transpose("wavelength", "theta_o", "theta_i")
    a, b = fit_local_shift(data), fit_local_shift(turned)
    for name in a:
        np.testing.assert_allclose(a[name], b[name].transpose(*a[name].dims), rtol=1e-9, equal_nan=True)


def test_local_fit_equals_a_slow_reference():
    """scipy's least_squares on single spectra, from the formula of 4.2, weighted by 1/σ."""
    data = noisy(dataset(), 0.02, 1)
    rng = np.random.default_rng(2)
    sigma = 0.02 * data.brdf * rng.uniform(0.5, 2, data.brdf.shape)
    data["brdf_stderr"] = sigma
    fit = fit_local_shift(data)
    al = material("Al")
    for i, o in ((0, 3), (2, 9), (4, 16)):
        y = (data.brdf[i, o] / data.brdf[i, o].sel(wavelength=600)).values
        cosine = np.cos(np.radians(abs(THETA_I[i] - THETA_O[o]) / 2))
        ratio = al.reflectance(cosine, WAVELENGTH) / al.reflectance(cosine, np.array([600.0]))
        weight = 1 / sigma[i, o].values

        def residual(x, y=y, ratio=ratio, weight=weight):
            return weight * ((1 + 1e-3 * x[0] * (WAVELENGTH - 600)) * ratio ** x[1] - y) * (WAVELENGTH != 600)

        best = min(
            (
                least_squares(residual, (0.0, p), bounds=([-9, 0], [9, 5]), xtol=1e-14, ftol=1e-14)
                for p in (0.5, 2.5, 4.5)
            ),
            key=lambda r: r.cost,
        )
        # least_squares stops where its cost no longer changes: 1e-6 nm⁻¹·10⁻³ in the slope, 1e-3 in p
        assert float(fit.slope[i, o]) == pytest.approx(1e-3 * best.x[0], abs=1e-7)
        assert float(fit.p[i, o]) == pytest.approx(best.x[1], abs=2e-3)


@pytest.mark.parametrize("wavelength", [WAVELENGTH, np.arange(390.0, 771, 20)], ids=["on grid", "between"])
def test_standard_errors_of_local_slopes(wavelength):
    """The scatter of (m − true)/stderr over 85 spectra × 10 seeds is 1; its own standard error is 2.4 %, 4 of these."""
    truth = dataset(wavelength)
    pulls = []
    for seed in range(10):
        fit = fit_local_shift(noisy(truth, 0.02, seed), p=1.0)
        pulls.append(((fit.slope - true_slope(truth)) / fit.slope_stderr).values.ravel())
    # Student's t with 19 degrees of freedom has a standard deviation of 1.06
    assert np.std(pulls) == pytest.approx(1.06, abs=0.1)


def test_standard_error_of_a_fitted_exponent_is_not_too_small():
    truth = dataset()
    fits = [fit_local_shift(noisy(truth, 0.005, seed)) for seed in range(10)]
    pulls = np.stack([(f.slope - true_slope(truth)) / f.slope_stderr for f in fits])
    # the bounds of p cut off the widest excursions, so the scatter may be smaller than the error says
    assert 0.6 < np.std(pulls) < 1.2


def test_weights_are_used():
    """Half the wavelengths (not λ_n) with ten times the noise: with weights the slopes are nearer to the truth."""
    truth = dataset()
    sigma = np.where(np.arange(WAVELENGTH.size) % 2, 0.01, 0.1)
    rng = np.random.default_rng(3)
    data = truth.assign(brdf=truth.brdf * (1 + sigma * rng.standard_normal(truth.brdf.shape)))
    weighted = fit_local_shift(data.assign(brdf_stderr=truth.brdf * sigma), p=1.0)
    plain = fit_local_shift(data, p=1.0)
    error = [float(abs(f.slope - true_slope(truth)).mean()) for f in (weighted, plain)]
    # 1/√(Σ 1/σ²) against √(Σ σ²)/n: about a seventh, less the error of f(λ_n), which both share
    assert error[0] < 0.3 * error[1]
    pull = ((weighted.slope - true_slope(truth)) / weighted.slope_stderr).values
    assert 0.8 < np.std(pull) < 1.3
    assert (weighted.attrs["weights"], plain.attrs["weights"]) == ("brdf_stderr", "equal")


def test_gaps_and_black_spectra_are_nan_and_counted():
    data = dataset()
    data["brdf"][0, 0] = np.nan
    data["brdf"][0, 1] = 0.0
    data["brdf"][0, 2, 11] = np.nan  # 600 nm, where it is normalised
    data["brdf"][0, 3, 5:8] = np.nan
    data["brdf"][0, 4, 3:11] = np.nan
    data["brdf"][0, 4, 12:] = np.nan  # three values besides 600 nm
    fit = fit_local_shift(data)
    assert np.isnan(fit.slope[0, :6]).values.tolist() == [True, True, True, False, True, False]
    assert fit.attrs["spectra_left_out"] == 4
    assert float(fit.slope[0, 3]) == pytest.approx(float(true_slope(data)[0, 3]), abs=1e-9)
    assert np.isfinite(fit_local_shift(data, p=1.0).slope[0, 4])
    # all missing: NaN and a full count, no crash
    assert fit_local_shift(data.where(False)).attrs["spectra_left_out"] == 85
    glob = fit_global_shift(data)
    assert float(glob.h) == pytest.approx(H, rel=1e-6)
    assert glob.attrs["spectra_left_out"] == 3


def test_flat_spectrum_has_no_r2():
    flat = dataset().assign(brdf=xr.ones_like(dataset().brdf))
    fit = fit_local_shift(flat, material=None)
    assert np.all(fit.slope == 0)
    assert np.isnan(fit.r2).all()


@pytest.mark.parametrize("call", [fit_local_shift, fit_global_shift])
def test_bad_input(call):
    data = dataset()
    with pytest.raises(InputError, match="at least 3 wavelengths"):
        call(data.isel(wavelength=[0]))
    with pytest.raises(InputError, match="outside the wavelengths"):
        call(data, wavelength_n_nm=900)
    with pytest.raises(InputError, match="too few to fit p"):
        call(data.isel(wavelength=[0, 5, 11, 15]))
    with pytest.raises(InputError, match="'fit'"):
        call(data, p="free")
    with pytest.raises(InputError, match="p_bounds"):
        call(data, p_bounds=(2, 1))
    with pytest.raises(MaterialError, match="unknown material"):
        call(data, material="Unobtainium")
    assert np.isfinite(call(data.isel(wavelength=[0, 11, 20]), p=1.0).r2).all()


def test_bad_input_of_the_global_fit():
    with pytest.raises(InputError, match="at least 5 usable spectra"):
        fit_global_shift(dataset().where(False))
    with pytest.raises(InputError, match="t_y"):
        fit_global_shift(dataset(), t_y="free")
    with pytest.raises(InputError, match="w_bounds"):
        fit_global_shift(dataset(), w_bounds=(0, 3))


@pytest.mark.parametrize("h, w, t_y, p", [(1.8e-3, 3.0, 0.0, 1.0), (1e-3, 6.5, 3e-4, 2.0), (-8e-4, 1.5, -2e-4, 0.5)])
def test_global_fit_recovers_its_parameters(h, w, t_y, p):
    data = dataset(h=h, w=w, t_y=t_y, p=p)
    fit = fit_global_shift(data)
    assert float(fit.h) == pytest.approx(h, rel=1e-5)
    assert float(fit.w) == pytest.approx(w, rel=1e-5)
    assert float(fit.t_y) == pytest.approx(t_y, abs=1e-8)
    assert float(fit.p) == pytest.approx(p, rel=1e-4)
    assert float(fit.r2) > 1 - 1e-8
    theta_m = abs(data.theta_i + data.theta_o) / 2
    np.testing.assert_allclose(fit.theta_m, theta_m, atol=1e-9)
    np.testing.assert_allclose(fit.slope_global, h * np.cos(w * np.radians(theta_m)) + t_y, atol=1e-8)
    assert fit.h.attrs["units"] == fit.t_y.attrs["units"] == fit.slope_global.attrs["units"] == "nm-1"


def test_global_fit_with_fixed_parameters():
    fit = fit_global_shift(dataset(), p=1.0, t_y=0.0)
    assert (float(fit.p), float(fit.t_y)) == (1.0, 0.0)
    assert np.isnan(fit.p_stderr)
    assert np.isnan(fit.t_y_stderr)
    assert fit.attrs["t_y"] == "fixed at 0 nm-1"


def test_standard_errors_of_the_global_fit(agreement):
    """Pulls of h, w and t_y over 25 seeds: their root mean square is 1 within 4 of its standard errors, 14 % each."""
    truth = dataset()
    pulls = []
    for seed in range(25):
        fit = fit_global_shift(noisy(truth, 0.02, seed), p=1.0)
        pulls.append([float((fit[k] - v) / fit[f"{k}_stderr"]) for k, v in (("h", H), ("w", W), ("t_y", 0.0))])
    agreement(
        "global shift on 2 % noise, 25 seeds: RMS pulls of h, w, t_y",
        "stated errors: 1",
        np.sqrt(np.mean(np.square(pulls), axis=0)),
        (0.43, 1.57),
    )


def test_standard_error_of_one_common_slope_is_that_of_a_mean():
    """Slopes that differ from spectrum to spectrum about a constant, no noise else: s/√n, to 1/n (small samples)."""
    rng = np.random.default_rng(1)
    m = 4e-4 + 2e-4 * rng.standard_normal((5, 17, 1))
    data = dataset(material="perfect").assign(brdf=lambda d: xr.ones_like(d.brdf) * (1 + m * (WAVELENGTH - 600)))
    s = normalised_spectra(data, None, 600.0)
    best = {"h": 0.0, "w": 1.0, "t_y": 1e3 * m.mean(), "p": 0.0}  # in µm⁻¹
    expected = 1e3 * m.std(ddof=1) / np.sqrt(m.size)
    assert global_fit._sandwich(s, s.used, best, ["t_y"])["t_y"] == pytest.approx(expected, rel=0.01)

    def two(v):
        return (1 + 1e-3 * v["h1"] * s.offset) * np.ones((m.size, 1))

    found = two_shift_fit._errors(np.sqrt(s.weight), two, {"h1": 1e3 * m.mean()}, ["h1"], s.values)
    assert found["h1"] == pytest.approx(expected, rel=0.01)


def test_error_of_the_value_between_two_samples():
    """f(λ_n) = (1 − t) f₁ + t f₂ of independent samples: (1 − t)² + t², 0.625 a quarter of the way, 1 at a sample."""
    data = dataset(np.arange(390.0, 771, 20))
    data["brdf_stderr"] = xr.full_like(data.brdf, 0.01)
    for wavelength_n, expected in ((595.0, 0.75**2 + 0.25**2), (600.0, 0.5), (590.0, 1.0)):
        s = normalised_spectra(data, "Al", wavelength_n)
        samples = 1 / s.weight[:, -1]  # those of one spectrum are alike
        np.testing.assert_allclose(s.anchor_variance / samples, expected, rtol=1e-9)


def test_an_error_far_below_the_others_does_not_rule_the_fit():
    """A lucky estimate counts as no less than 1 % of the median; one that is not known counts as the median."""
    data = dataset()
    sigma = xr.full_like(data.brdf, 0.01) * data.brdf.sel(wavelength=600)  # of the normalised spectra: 0.01
    sigma[0, 3, 4], sigma[0, 3, 5], sigma[0, 3, 6] = 1e-9 * sigma[0, 3, 4], np.nan, 2 * sigma[0, 3, 6]
    s = normalised_spectra(data.assign(brdf_stderr=sigma), "Al", 600.0)
    np.testing.assert_allclose(s.weight[3, 3:7], [1, 1e4, 1, 0.25], rtol=1e-9)


def test_degenerate_global_fit_has_no_standard_error():
    """Without any shift w cannot be told: no error is given for it, and h is zero within its own."""
    fit = fit_global_shift(dataset(h=0.0), p=1.0)
    assert abs(float(fit.h)) < 1e-9
    assert np.isnan(fit.w_stderr)
    fits = [fit_global_shift(noisy(dataset(h=0.0), 0.02, seed), p=1.0) for seed in range(5)]
    # h takes the best of many frequencies, so its pull is not normal; below 3e-5 nm⁻¹ it is noise, 2e-4/√85
    assert max(abs(float(f.h)) for f in fits) < 3e-5
    assert sum(bool(np.isnan(f.w_stderr)) for f in fits) >= 3


def test_hemisphere_takes_the_half_vector_of_full_directions():
    theta_o, phi_o = np.array([0.0, 40, 40, 40, 60]), np.array([0.0, 180, 0, 90, 200])
    wi = np.array([np.sin(np.radians(40)), 0, np.cos(np.radians(40))])
    s, c = np.sin(np.radians(theta_o)), np.cos(np.radians(theta_o))
    wo = np.stack([s * np.cos(np.radians(phi_o)), s * np.sin(np.radians(phi_o)), c], axis=1)
    half = (wi + wo) / np.linalg.norm(wi + wo, axis=1)[:, None]
    slope = H * np.cos(W * np.arccos(half[:, 2]))
    values = 1 + slope[None, :, None] * (WAVELENGTH - 600)
    data = xr.Dataset(
        {"brdf": (("theta_i", "cell", "wavelength"), values)},
        coords={
            "theta_i": [40.0],
            "wavelength": WAVELENGTH,
            "cell": np.arange(5),
            "theta_o": ("cell", theta_o),
            "phi_o": ("cell", phi_o),
        },
    )
    np.testing.assert_allclose(fit_local_shift(data, material=None).slope[0], slope, atol=1e-15)
    fit = fit_global_shift(data, material=None, t_y=0.0)
    assert float(fit.h) == pytest.approx(H, rel=1e-5)
    assert float(fit.w) == pytest.approx(W, rel=1e-5)


def test_speed_of_the_local_fit():
    """300 spectra × 100 wavelengths in under 1 s (about 0.05 s here), the processor's, the best of three."""
    data = models.evaluate(
        "clausen-2022", np.arange(0, 80, 8), np.linspace(-85, 85, 30), np.linspace(380, 780, 100), **MODEL
    )
    taken = []
    for _ in range(3):
        begin = time.process_time()
        fit_local_shift(data)
        taken.append(time.process_time() - begin)
    assert min(taken) < 1.0


def test_a_spectrum_that_vanishes_at_lambda_n_is_left_out():
    """The dark directions of a grating hold numbers of 1e-300: divided by one another they are no spectra."""
    wavelength = np.array([450.0, 550.0, 600.0, 650.0, 750.0])
    theta = np.arange(-60.0, 61.0, 10.0)
    values = np.tile(1 + 0.001 * (wavelength - 600), (1, theta.size, 1))
    values[0, 3] = [1e-3, 1e-3, 1e-300, 1e-3, 1e-3]
    data = xr.Dataset(
        {"brdf": (("theta_i", "theta_o", "wavelength"), values)},
        coords={"theta_i": [30.0], "theta_o": theta, "wavelength": wavelength},
    )
    found = fit_global_shift(data, material=None)
    slope = found["slope_global"].isel(theta_i=0).drop_sel(theta_o=-30)
    np.testing.assert_allclose(slope, 0.001, atol=1e-6)
    assert fit_local_shift(data, material=None).attrs["spectra_left_out"] == 1
