"""Two weighted shifts against the single one of 4.5: where it wins, where it does not, and the share it needs."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio import models
from vgonio.compare import delta_e_2000, fit_global_shift, fit_local_shift, fit_two_shifts, fitted_spectra, single_share
from vgonio.errors import InputError

THETA_I = np.arange(0.0, 81, 20)
THETA_O = np.arange(-80.0, 81, 10)
WAVELENGTH = np.arange(380.0, 781, 20)


def compensating_share() -> xr.DataArray:
    """Half of the light is reflected once at normal incidence, more about the mirror direction at grazing angles."""
    i, o = np.radians(THETA_I)[:, None], np.radians(THETA_O)
    return xr.DataArray(
        0.5 - 0.4 * np.sin(i) * np.sin(o), {"theta_i": THETA_I, "theta_o": THETA_O}, ("theta_i", "theta_o")
    )


def compensating(power: float = 0.6, sigma: float = 0.01, seed: int = 0) -> xr.Dataset:
    """Thesis figure 4.11 b, from another formula than the model's: once reflected light ∝ λ^a, the rest ∝ λ^−a.

    So at normal incidence both cancel in every direction; at grazing incidence forward and back-scattering tilt.
    """
    s = compensating_share()
    base = models.evaluate("cook-torrance-1982", THETA_I, THETA_O, WAVELENGTH, alpha=0.6, material="perfect")
    x = base.wavelength / 600
    noise = 1 + sigma * np.random.default_rng(seed).standard_normal(base.brdf.shape)
    return base.assign(brdf=base.brdf * (s * x**power + (1 - s) * x**-power) * noise)


def test_two_shifts_beat_one_where_both_compensate():
    data = compensating()
    local = fit_local_shift(data, material=None)
    at_normal = np.abs(local.slope.sel(theta_i=0)).max()
    # no tilt at normal incidence, both signs at 80°: the data are of the kind of figure 4.11 b
    assert at_normal < 5 * float(local.slope_stderr.sel(theta_i=0).mean())
    assert float(local.slope.sel(theta_i=80, theta_o=-80)) > 5e-4
    assert float(local.slope.sel(theta_i=80, theta_o=80)) < -5e-4
    one, two = fit_global_shift(data, material=None), fit_two_shifts(data, compensating_share(), material=None)
    explained = [1 - float(((f.slope_global - local.slope) ** 2).sum() / (local.slope**2).sum()) for f in (one, two)]
    assert explained[0] < 0.8
    assert explained[1] > 0.97
    assert two.attrs["aic"] < one.attrs["aic"] - 50
    assert float(two.r2) > float(one.r2) + 0.2
    # the slopes of λ^±a at λ_n, apart from what a straight line makes of the curvature of λ^−a: up to 15 %
    assert float(two.h1) == pytest.approx(0.6 / 600, rel=0.2)
    assert float(two.h2) == pytest.approx(-0.6 / 600, rel=0.2)


def test_nothing_is_gained_where_4_5_is_true():
    rng = np.random.default_rng(1)
    data = models.evaluate("clausen-2022", THETA_I, THETA_O, WAVELENGTH, alpha=0.4, h=1.5e-3, w=3.0)
    data = data.assign(brdf=data.brdf * (1 + 0.01 * rng.standard_normal(data.brdf.shape)))
    one, two = fit_global_shift(data, p=1.0, t_y=0.0), fit_two_shifts(data, compensating_share(), p=1.0)
    # two more parameters: 4 in AIC; it may not be better
    assert two.attrs["aic"] > one.attrs["aic"]
    # with single reflections only it is 4.5
    same = fit_two_shifts(data, 1.0, p=1.0)
    assert float(same.h1) == pytest.approx(float(one.h), rel=1e-3)
    assert float(same.w1) == pytest.approx(float(one.w), rel=1e-3)


def test_stated_errors():
    share = compensating_share()
    truth = {"h1": 1e-3, "w1": 2.0, "h2": -2e-3, "w2": 1.5}
    clean = models.evaluate("two-shifts", THETA_I, THETA_O, WAVELENGTH, alpha=0.5, single_share=share, **truth)
    pulls = []
    for seed in range(12):
        noise = np.random.default_rng(seed).standard_normal(clean.brdf.shape)
        fit = fit_two_shifts(clean.assign(brdf=clean.brdf * (1 + 0.02 * noise)), share, p=1.0)
        pulls.append([(float(fit[k]) - v) / float(fit[f"{k}_stderr"]) for k, v in truth.items()])
    # 48 values: their RMS is known to 10 %; correlated ones to less
    assert np.sqrt(np.mean(np.square(pulls))) == pytest.approx(1.05, abs=0.4)


def test_share_from_a_traced_decomposition():
    surface = vg.surface.gaussian(rms_um=2.0, correlation_um=5.0, shape=(96, 96), pitch_um=0.5, seed=1)
    gonio = vg.measure.Gonioreflectometer([0, 40, 70], [-70, -40, 0, 40, 70], aperture_deg=10)
    rays = gonio.measure(surface, vg.geometric.RayOptics("perfect", [500, 600], rays=60_000))
    share = single_share(rays)
    assert share.dims == ("theta_i", "theta_o")
    assert 0 <= float(share.min()) < float(share.max()) <= 1
    # steep slopes: what comes straight back at normal incidence was mostly reflected twice
    parts = rays.brdf_by_bounce.sel(wavelength=600, theta_i=0, theta_o=0)
    assert float(share.sel(theta_i=0, theta_o=0)) == pytest.approx(float(parts.sel(bounce=1) / parts.sum("bounce")))
    assert float(share.sel(theta_i=0, theta_o=0)) < 0.5 < float(share.sel(theta_i=0, theta_o=-70))
    for i, o in ((0, 40), (40, 70), (0, 70)):
        assert float(share.sel(theta_i=i, theta_o=o)) == pytest.approx(float(share.sel(theta_i=o, theta_o=i)))
    holes = rays.assign(brdf_by_bounce=rays.brdf_by_bounce.where(rays.theta_o != 70, 0.0))
    assert bool(single_share(holes).notnull().all())
    with pytest.raises(InputError, match="brdf_by_bounce"):
        single_share(rays.drop_vars("brdf_by_bounce"))


def test_fitted_spectra_and_shares_of_r2():
    data = models.evaluate("clausen-2022", THETA_I, THETA_O, WAVELENGTH, alpha=0.4, h=1.5e-3, w=3.0)
    local, one = fit_local_shift(data, p=1.0), fit_global_shift(data, p=1.0, t_y=0.0)
    assert local.attrs["r2_above_0.95"] == local.attrs["r2_above_0.90"] == 1
    for fit in (local, one):
        np.testing.assert_allclose(fitted_spectra(data, fit).brdf, data.brdf, rtol=1e-5)
        assert float(delta_e_2000(data, fitted_spectra(data, fit)).max()) < 1e-3
        # without the linear factor the colour is wrong
        assert float(delta_e_2000(data, fitted_spectra(data, fit, fresnel_only=True)).max()) > 3
    two = fit_two_shifts(data, 1.0, p=1.0)
    two.attrs["material"] = "Al"
    np.testing.assert_allclose(fitted_spectra(data, two).brdf, data.brdf, rtol=1e-5)


def test_range_of_wavelengths():
    data = models.evaluate("clausen-2022", THETA_I, THETA_O, WAVELENGTH, alpha=0.4, h=1.5e-3, w=3.0)
    bent = data.assign(brdf=data.brdf.where(data.wavelength >= 450, 2 * data.brdf))
    for fit in (fit_local_shift, fit_global_shift):
        a, b = fit(bent, p=1.0, wavelength_range_nm=(460, 780)), fit(data, p=1.0, wavelength_range_nm=(460, 780))
        name = "slope" if "slope" in a else "h"
        np.testing.assert_array_equal(a[name], b[name])
    two = fit_two_shifts(bent, 1.0, p=1.0, wavelength_range_nm=(460, 780))
    assert float(two.h1) == pytest.approx(1.5e-3, rel=1e-4)
    with pytest.raises(InputError, match="at least 3"):
        fit_local_shift(data, wavelength_range_nm=(590, 610))


def test_speed_of_local_fits():
    """300 spectra × 100 wavelengths: 0.06 s measured with p free; below 1 s is asked, the best of three."""
    import time

    grid = np.arange(0.0, 81, 10), np.arange(-80.0, 81, 5), np.arange(380, 780, 4.0)
    data = models.evaluate("clausen-2022", *grid, alpha=0.4, h=1e-3, w=3.0)
    taken = []
    for _ in range(3):
        began = time.process_time()
        fit_local_shift(data)
        taken.append(time.process_time() - began)
    assert min(taken) < 1


def test_bad_input():
    data = compensating()
    with pytest.raises(InputError, match="usable spectra"):
        fit_two_shifts(data.isel(theta_i=[0], theta_o=[0, 1, 2]), 0.5, material=None)
    with pytest.raises(InputError, match="0…1"):
        fit_two_shifts(data, 1.5, material=None)
