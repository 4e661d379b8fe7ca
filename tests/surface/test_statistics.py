"""Roughness parameters against closed forms, and spectra against Parseval and Wiener–Khinchin."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio import surface as sf
from vgonio.errors import InputError
from vgonio.surface.statistics import UNITS, beckmann_alpha, slopes

WAVE = sf.sinusoid(4.0, 0.3, (16, 400), 0.1)


def test_parameters_of_a_sinusoid():
    p = sf.parameters(WAVE)
    a, k = 0.3, 2 * np.pi / 4
    assert p["Sq"] == pytest.approx(a / np.sqrt(2), rel=1e-12)
    assert p["Sa"] == pytest.approx(2 * a / np.pi, rel=2e-3)  # 40 samples a period: (π/40)²/6 = 1e-3
    assert p["Sz"] == pytest.approx(2 * a * np.cos(np.pi / 40), rel=1e-12)  # crest half a pitch from the sample
    assert p["Ssk"] == pytest.approx(0, abs=1e-12)
    assert p["Sku"] == pytest.approx(1.5, rel=1e-12)
    # derivative of a cubic spline at its samples: fourth order in kh, (kh)⁴/180 = 3e-6
    assert p["Sdq"] == pytest.approx(a * k / np.sqrt(2), rel=1e-5)
    assert p["alpha_x"] == pytest.approx(a * k, rel=1e-5)
    assert p["alpha_y"] == pytest.approx(0, abs=1e-12)
    assert p["alpha"] == pytest.approx(a * k / np.sqrt(2), rel=1e-5)
    assert p["Sal"] == pytest.approx(np.arccos(0.2) / k, rel=1e-3)  # linear between lags of 1/40 period
    assert set(p) == set(UNITS)


def test_slope_and_length_of_a_gaussian_surface():
    """α = 2·Sq/T and Sal = T·√ln 5; the tolerances are 3 standard errors over the correlation cells of the field."""
    rms, length = 0.7, 4.0
    f = sf.gaussian(rms, length, (1024, 1024), 0.5, seed=4)
    p = sf.parameters(f)
    cells = f.area_um2 / (np.pi * length**2)
    assert p["alpha"] == pytest.approx(2 * rms / length, rel=3 / np.sqrt(2 * cells))
    assert p["Sal"] == pytest.approx(length * np.sqrt(np.log(5)), rel=3 / np.sqrt(cells))
    assert p["Ssk"] == pytest.approx(0, abs=3 * np.sqrt(6 / cells))
    assert p["Sku"] == pytest.approx(3, abs=3 * np.sqrt(24 / cells))
    assert p["Sdq"] == pytest.approx(p["alpha"], rel=1e-6)  # Sdq² = var z_x + var z_y without a mean slope
    assert p["alpha"] ** 2 == pytest.approx((p["alpha_x"] ** 2 + p["alpha_y"] ** 2) / 2, rel=1e-12)
    assert beckmann_alpha(f) == p["alpha"]


def test_a_tilt_counts_in_sdq_but_not_in_alpha():
    x = np.arange(50) + 0.5
    f = sf.Heightfield(0.2 * x[None] + np.zeros((40, 1)), 1.0)
    p = sf.parameters(f)
    assert p["Sdq"] == pytest.approx(0.2, rel=1e-10)
    assert p["alpha"] == pytest.approx(0, abs=1e-10)


@pytest.mark.parametrize("periodic", [True, False])
def test_slopes_against_np_gradient(periodic):
    """Smooth field: second-order differences agree to (kh)²/6 with the spline's derivative."""
    f = sf.gaussian(0.5, 10.0, (160, 120), (0.5, 0.4), seed=1).replace(periodic=periodic)
    zx, zy = slopes(f)
    gy, gx = np.gradient(f.z, *f.pitch_um)
    inner = (slice(3, -3), slice(3, -3))
    # k is about 1/T·√2: (kh)²/6 = 8e-4 of the slope, more at crests where it is steep
    scale = np.abs(zx).max()
    assert np.abs(zx - gx)[inner].max() < 5e-3 * scale
    assert np.abs(zy - gy)[inner].max() < 5e-3 * scale


def test_nearest_has_no_slopes_and_flat_has_no_moments():
    assert sf.parameters(sf.lamellar(4, 0.5, shape=(8, 80), pitch_um=0.5))["alpha"] == 0
    p = sf.parameters(sf.flat())
    assert p["Sq"] == p["alpha"] == 0
    assert np.isnan([p["Ssk"], p["Sku"], p["Sal"]]).all()


def test_missing_points_are_left_out(rng):
    f = sf.gaussian(0.5, 6.0, (256, 256), 0.5, seed=2)
    z = f.z.copy()
    z[rng.random(z.shape) < 0.02] = np.nan
    full, holed = sf.parameters(f), sf.parameters(f.replace(z=z))
    for key in ("Sq", "Sa", "Sku", "Sdq", "alpha", "alpha_x", "Sal"):
        assert holed[key] == pytest.approx(full[key], rel=0.01), key  # 2 % of the points, at random


def test_slopes_beside_missing_points_know_both_pitches():
    """Central differences are exact for z = 3 x − 2 y + x y at the sample, NaN beside the hole and at the ends."""
    y, x = (np.arange(6) * 0.5)[:, None], (np.arange(8) * 0.2)[None]
    z = 3 * x - 2 * y + x * y
    z[2, 4] = np.nan
    zx, zy = slopes(sf.Heightfield(z, (0.5, 0.2)))
    known = np.isfinite(zx)
    assert (~known[:, [0, -1]]).all()
    assert list(np.flatnonzero(~known[2, 1:-1]) + 1) == [3, 5]
    np.testing.assert_allclose(zx[known], (3 + y + 0 * x)[known], rtol=1e-12)
    np.testing.assert_allclose(zy[np.isfinite(zy)], (x - 2 + 0 * y)[np.isfinite(zy)], rtol=1e-11)


def test_profile_of_one_row():
    p = sf.parameters(sf.sinusoid(4.0, 0.3, (1, 400), 0.1))
    assert p["Sal"] == pytest.approx(sf.parameters(WAVE)["Sal"], rel=1e-9)
    assert p["alpha_x"] == pytest.approx(0.3 * np.pi / 2, rel=1e-5)


# ---- autocorrelation
def test_autocorrelation_against_the_direct_sum(rng):
    z = rng.normal(size=(8, 10))
    z[rng.random(z.shape) < 0.1] = np.nan
    for periodic in (True, False):
        f = sf.Heightfield(z, (2.0, 0.5), periodic=periodic)
        acf = sf.autocorrelation(f)
        d = z - np.nanmean(z)
        for iy, y in enumerate(acf.y_um):
            for ix, x in enumerate(acf.x_um):
                ly, lx = round(y / 2.0), round(x / 0.5)
                if periodic:
                    products = d * np.roll(d, (-ly, -lx), (0, 1))
                else:
                    a = d[max(-ly, 0) : 8 - max(ly, 0), max(-lx, 0) : 10 - max(lx, 0)]
                    b = d[max(ly, 0) : 8 + min(ly, 0), max(lx, 0) : 10 + min(lx, 0)]
                    products = a * b
                assert acf.values[iy, ix] == pytest.approx(np.nanmean(products) / np.nanmean(d**2), abs=1e-10)
    with pytest.raises(InputError, match="flat"):
        sf.autocorrelation(sf.flat())


def test_autocorrelation_of_a_gaussian_surface_in_the_mean():
    """exp(−r²/T²) over 40 seeds; the standard error is from the scatter of the seeds."""
    length = 3.0
    many = np.array([sf.autocorrelation(sf.gaussian(1, length, (64, 64), 0.75, seed)).values for seed in range(40)])
    acf = sf.autocorrelation(sf.gaussian(1, length, (64, 64), 0.75))
    r2 = acf.y_um[:, None] ** 2 + acf.x_um[None] ** 2
    area = (64 * 0.75) ** 2
    # each field has its own mean removed: it takes the mean of the autocorrelation, πT²/area, with it
    offset = np.pi * length**2 / area
    expected = (np.exp(-r2 / length**2) - offset) / (1 - offset)
    error = many.std(axis=0) / np.sqrt(40)
    assert np.abs(many.mean(axis=0) - expected).max() < 4.5 * error.max()


# ---- PSD
@pytest.mark.parametrize("shape", [(32, 48), (33, 47), (80, 16), (1, 64), (64, 1)])
@pytest.mark.parametrize("periodic", [True, False])
def test_parseval(rng, shape, periodic, agreement):
    f = sf.Heightfield(rng.normal(size=shape), (0.5, 0.25), periodic=periodic)
    for window in ("auto", "none", "hann"):
        p = sf.psd(f, window)
        steps = [axis[1] - axis[0] if axis.size > 1 else 1.0 for axis in (p.fy, p.fx)]
        error = p.values.sum() * steps[0] * steps[1] / f.z.var() - 1
        agreement("Parseval of the spectral density", "Sq²", error, 1e-12)
        radial = p.radial()
        # the mean was removed before the window: what it puts back at zero frequency belongs to no ring
        zero = p.values[(p.fy == 0).argmax(), (p.fx == 0).argmax()] * steps[0] * steps[1]
        assert (radial.values * radial.area).sum() + zero == pytest.approx(f.z.var(), rel=1e-12)


def test_psd_of_a_sinusoid_is_two_lines():
    p = sf.psd(WAVE)
    power = p.values * (p.fx[1] - p.fx[0]) * (p.fy[1] - p.fy[0])
    iy, ix = np.nonzero(power > 1e-12)
    np.testing.assert_allclose(p.fx[ix], [-0.25, 0.25])
    np.testing.assert_allclose(p.fy[iy], 0)
    np.testing.assert_allclose(power[iy, ix], 0.3**2 / 4)


def test_psd_of_a_gaussian_surface():
    """Ensemble: Sq²·πT²·exp(−(πTf)²), the transform of exp(−r²/T²)."""
    length = 3.0
    values = np.mean([sf.psd(sf.gaussian(1, length, (96, 96), 0.5, s, exact=False)).values for s in range(60)], axis=0)
    p = sf.psd(sf.gaussian(1, length, (96, 96), 0.5))
    f = np.hypot(p.fy[:, None], p.fx[None])
    expected = np.pi * length**2 * np.exp(-((np.pi * length * f) ** 2))
    ring = (f > 0.03) & (f < 0.3)
    # power in a line is χ² with 2 degrees of freedom, ± pairs are equal: standard error of the mean ratio
    lines = ring.sum() / 2 * 60
    assert np.mean(values[ring] / expected[ring]) == pytest.approx(1, abs=4 / np.sqrt(lines))


def test_psd_refuses_missing_points_and_unknown_windows():
    z = np.zeros((4, 4))
    z[0, 0], z[1, 1] = np.nan, 1
    with pytest.raises(InputError, match="missing"):
        sf.psd(sf.Heightfield(z, 1.0))
    with pytest.raises(InputError, match="did you mean 'hann'"):
        sf.psd(WAVE, "han")


# ---- slopes
def test_slope_distribution():
    f = sf.gaussian(0.7, 4.0, (512, 512), 0.5, seed=4)
    d = sf.slope_distribution(f, bins=61)
    width = d.slope[1] - d.slope[0]
    for density in (d.density_x, d.density_y):
        assert density.sum() * width == pytest.approx(1, rel=1e-12)
    assert d.alpha == pytest.approx(sf.parameters(f)["alpha"], rel=1e-12)
    # Beckmann's α from the histogram itself, bins of width w add w²/12 to a variance
    for density, key in ((d.density_x, "alpha_x"), (d.density_y, "alpha_y")):
        variance = (density * d.slope**2).sum() * width - width**2 / 12
        assert np.sqrt(2 * variance) == pytest.approx(sf.parameters(f)[key], rel=2e-3)
    # a Gaussian surface has Gaussian slopes: largest difference of the cumulative curves (Kolmogorov) over its cells
    cells = f.area_um2 / (np.pi * 4.0**2)
    assert np.abs(np.cumsum(d.density_x - d.gaussian) * width).max() < 1.6 / np.sqrt(cells)
