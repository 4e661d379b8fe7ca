"""Levelling, outliers, filling and the Gaussian filters, against polynomials, harmonic functions and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio import surface as sf
from vgonio.errors import InputError, VgonioWarning


def polynomial(shape=(40, 30), pitch=(0.5, 0.25), quadratic=True) -> np.ndarray:
    y, x = ((np.arange(n) + 0.5) * h for n, h in zip(shape, pitch))
    x, y = np.meshgrid(x, y)
    z = 7e4 + 0.1 * x - 0.3 * y
    return z + (0.02 * x**2 - 0.01 * x * y + 0.03 * y**2 if quadratic else 0)


# ---- level
@pytest.mark.parametrize("missing", [False, True])
@pytest.mark.parametrize(("method", "quadratic"), [("plane", False), ("quadratic", True)])
def test_level_removes_what_it_says(rng, method, quadratic, missing):
    z = polynomial(quadratic=quadratic)
    if missing:
        z[rng.random(z.shape) < 0.2] = np.nan
    f = sf.level(sf.Heightfield(z, (0.5, 0.25)), method)
    # heights of 70 mm: 1e-15 of that is what float64 leaves
    assert np.nanmax(np.abs(f.z)) < 1e-9
    np.testing.assert_array_equal(np.isnan(f.z), np.isnan(z))
    assert "levelled" in f.history[-1]


def test_level_is_the_least_squares_fit(rng):
    """Residual of a random field, with missing points: orthogonal to every term, as numpy's lstsq says."""
    z = rng.normal(size=(12, 17))
    z[rng.random(z.shape) < 0.3] = np.nan
    valid = np.isfinite(z)
    y, x = np.mgrid[0.0 : z.shape[0], 0.0 : z.shape[1]]
    for method, terms in (("mean", 1), ("plane", 3), ("quadratic", 6)):
        design = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)[valid][:, :terms]
        expected = z[valid] - design @ np.linalg.lstsq(design, z[valid], rcond=None)[0]
        np.testing.assert_allclose(sf.level(sf.Heightfield(z, 1.0), method).z[valid], expected, atol=1e-12)


def test_level_none_and_tilt_in_history():
    f = sf.Heightfield(polynomial(quadratic=False), (0.5, 0.25))
    assert sf.level(f, "none") is f
    assert f"{np.rad2deg(np.arctan(0.1)):.4g}° along x" in sf.level(f, "plane").history[-1]
    with pytest.raises(InputError, match="did you mean 'plane'"):
        sf.level(f, "plan")


def test_level_of_a_periodic_field_removes_the_mean_only():
    f = sf.gaussian(1, 3, (32, 32), 1.0)
    lifted = f.replace(z=f.z + 5)
    np.testing.assert_allclose(sf.level(lifted, "quadratic").z, f.z, atol=1e-12)


def test_level_profile_of_one_row():
    f = sf.level(sf.Heightfield(np.linspace(0, 3, 50)[None], 1.0), "plane")
    assert np.abs(f.z).max() < 1e-12


# ---- fill
def test_fill_interpolate_reproduces_harmonic_functions(rng):
    """x² − y² and planes solve the discrete Laplace equation exactly; holes do not touch the edge."""
    y, x = np.mgrid[0.0:40.0, 0.0:50.0]
    z = x**2 - y**2 + 3 * x
    holed = z.copy()
    holed[10:20, 10:30] = np.nan
    holed[25:35, 5:8] = np.nan
    with pytest.warns(VgonioWarning, match="11.5%"):
        f = sf.fill(sf.Heightfield(holed, 1.0))
    np.testing.assert_allclose(f.z, z, atol=1e-6 * np.ptp(z))  # conjugate gradients stop at 1e-10 of the residual
    assert "230 missing points" in f.history[-1]
    assert "11.5" in f.history[-1]


def test_fill_interpolate_minds_pitches_and_the_seam():
    y, x = np.mgrid[0.0:30.0, 0.0:30.0] * np.array([2.0, 0.5])[:, None, None]
    z = x**2 - y**2 + 0.3 * x + 0.1 * y  # harmonic in µm, not in samples
    holed = z.copy()
    holed[10:15, 10:15] = np.nan
    f = sf.fill(sf.Heightfield(holed, (2.0, 0.5)))
    np.testing.assert_allclose(f.z, z, atol=1e-6)
    wave = np.cos(2 * np.pi * (np.arange(64) + 0.5) / 64)[None] * np.ones((8, 1))
    holed = wave.copy()
    holed[:, :2] = np.nan
    f = sf.fill(sf.Heightfield(holed, 1.0, periodic=True))
    # across the seam linear between the two rims, which lie symmetric about the crest
    np.testing.assert_allclose(
        f.z[:, :2], np.linspace(wave[0, -1], wave[0, 2], 4)[None, 1:3] * np.ones((8, 1)), atol=1e-8
    )


@pytest.mark.parametrize(("periodic", "expected"), [(True, 7.0), (False, 3.0)])
def test_fill_nearest_looks_across_the_seam(periodic, expected):
    """Columns 0 … 2 miss; the neighbour of column 0 is the last one of a periodic field, else column 3."""
    z = np.tile(np.arange(8.0), (4, 1))
    z[:, :3] = np.nan
    with pytest.warns(VgonioWarning, match="missing"):
        f = sf.fill(sf.Heightfield(z, 1.0, periodic=periodic), "nearest")
    np.testing.assert_array_equal(f.z[:, 0], expected)
    np.testing.assert_array_equal(f.z[:, 2], 3.0)


def test_fill_never_leaves_the_range_of_the_rim(rng):
    z = rng.normal(size=(30, 30))
    z[rng.random(z.shape) < 0.4] = np.nan
    z[0], z[:, -1] = np.nan, np.nan
    with pytest.warns(VgonioWarning, match="missing"):
        f = sf.fill(sf.Heightfield(z, 1.0))
    assert np.nanmin(z) - 1e-9 <= f.z.min()
    assert f.z.max() <= np.nanmax(z) + 1e-9
    np.testing.assert_array_equal(f.z[np.isfinite(z)], z[np.isfinite(z)])


def test_fill_nearest_against_a_slow_search(rng):
    z = rng.normal(size=(9, 11))
    z[rng.random(z.shape) < 0.08] = np.nan
    for periodic in (False, True):
        f = sf.fill(sf.Heightfield(z, (1.0, 0.7), periodic=periodic), "nearest")
        good = np.argwhere(np.isfinite(z))
        for iy, ix in np.argwhere(np.isnan(z)):
            d = np.abs(good - (iy, ix)).astype(float)
            if periodic:
                d = np.minimum(d, np.array(z.shape) - d)
            distance = np.hypot(d[:, 0] * 1.0, d[:, 1] * 0.7)
            nearest = z[tuple(good[np.isclose(distance, distance.min())].T)]
            assert f.z[iy, ix] in nearest


def test_fill_mean_unknown_and_nothing_to_do():
    z = np.array([[1.0, 2.0, 3.0, 2.0]] * 5)
    complete = sf.Heightfield(z, 1.0)
    assert sf.fill(complete) is complete
    z[2, 1] = np.nan
    assert sf.fill(sf.Heightfield(z, 1.0), "mean").z[2, 1] == pytest.approx(np.nanmean(z))
    with pytest.raises(InputError, match="did you mean 'nearest'"):
        sf.fill(complete, "nearst")


# ---- outliers
def test_spikes_are_removed_and_nothing_else(rng):
    f = sf.gaussian(0.5, 4, (128, 128), 0.5, seed=3)
    z = f.z.copy()
    at = rng.choice(z.size, 40, replace=False)
    z.flat[at] += rng.choice([-1, 1], 40) * rng.uniform(8, 20, 40)
    found = sf.remove_outliers(f.replace(z=z))
    assert set(np.flatnonzero(np.isnan(found.z))) == set(at)
    assert "40 points" in found.history[-1]


@pytest.mark.parametrize(
    "surface",
    [
        sf.sandblasted((128, 128), seed=2),  # sharp ridges
        sf.gaussian(1.0, 1.0, (128, 128), 0.9),  # almost white
        sf.lamellar(4.0, 0.5, shape=(64, 80), pitch_um=0.5),
        sf.blazed(4.0, 0.5, shape=(64, 80), pitch_um=0.25),
        sf.flat((32, 32)),
    ],
    ids=lambda f: f.name,
)
def test_clean_surfaces_lose_nothing(surface):
    assert sf.remove_outliers(surface).missing == 0


def test_outliers_beside_missing_points():
    z = np.random.default_rng(0).normal(size=(40, 40))
    z[5, 5], z[20, 20] = np.nan, 100
    f = sf.remove_outliers(sf.Heightfield(z, 1.0))
    assert np.isnan(f.z[20, 20])
    assert f.missing == 2
    with pytest.raises(InputError, match="odd"):
        sf.remove_outliers(f, size=4)
    with pytest.raises(InputError, match="threshold"):
        sf.remove_outliers(f, threshold=1)


# ---- ISO 16610-61
def _amplitude(f: sf.Heightfield, period: float, inner: slice = slice(None)) -> float:
    """Amplitude of cos(2πx/period) in the middle row, by least squares."""
    row, x = f.z[f.shape[0] // 2, inner], f.x[inner]
    design = np.stack([np.cos(2 * np.pi * x / period), np.sin(2 * np.pi * x / period), np.ones_like(x)], axis=1)
    return float(np.hypot(*np.linalg.lstsq(design, row, rcond=None)[0][:2]))


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0])
def test_transmission_of_the_gaussian_filter(periodic, ratio, agreement):
    """exp(−π(αλ_c/λ)²) = 2^−(λ_c/λ)²: one half at the cut-off."""
    period = 10.0
    f = sf.sinusoid(period, 1.0, (300, 1000), 0.2).replace(periodic=periodic)
    inner = slice(300, 700)  # more than 1.2 cut-offs from the ends
    s = sf.gaussian_filter(f, s_um=period * ratio)
    error = _amplitude(s, period, inner) - 2.0 ** -(ratio**2)
    agreement("ISO 16610 filter, at half, once and twice its cut-off", "2^−(λ_c/λ)²", error, 1e-3)
    lf = sf.gaussian_filter(f, l_um=period * ratio)
    assert _amplitude(lf, period, inner) == pytest.approx(1 - 2.0 ** -(ratio**2), abs=1e-3)


def test_filter_is_isotropic_across_unequal_pitches():
    y, x = np.mgrid[0:100, 0:200]
    wave = np.cos(2 * np.pi * ((x + 0.5) / 20 + (y + 0.5) / 20))  # periods 10 µm along x, 20 µm along y
    f = sf.Heightfield(wave, (1.0, 0.5), periodic=True)
    wavelength = 1 / np.hypot(1 / 10, 1 / 20)
    s = sf.gaussian_filter(f, s_um=wavelength)
    np.testing.assert_allclose(s.z, 0.5 * wave, atol=1e-12)


def test_filter_against_the_direct_weighted_sum(rng):
    """Field with missing points, not periodic: the definition with explicit weights."""
    z = rng.normal(size=(14, 17))
    z[rng.random(z.shape) < 0.2] = np.nan
    f = sf.Heightfield(z, (1.0, 0.8))
    s = sf.gaussian_filter(f, s_um=9.0)
    width = np.sqrt(np.log(2) / np.pi) * 9.0
    valid = np.argwhere(np.isfinite(z))
    place = valid * f.pitch_um
    weights = np.exp(-np.pi * ((place[:, None] - place[None]) ** 2).sum(axis=-1) / width**2)
    expected = weights @ z[tuple(valid.T)] / weights.sum(axis=1)
    # the sampled Gaussian and its band-limited spectrum differ by 2^−(9/2)² = 8e-7 at the Nyquist frequency
    np.testing.assert_allclose(s.z[tuple(valid.T)], expected, atol=5e-6)
    np.testing.assert_array_equal(np.isnan(s.z), np.isnan(z))


def test_filter_keeps_the_mean_and_constants_at_the_edges():
    f = sf.Heightfield(np.full((20, 30), 3.0), 1.0)
    np.testing.assert_allclose(sf.gaussian_filter(f, s_um=8).z, 3.0, rtol=1e-13)
    np.testing.assert_allclose(sf.gaussian_filter(f, l_um=8).z, 0.0, atol=1e-12)


def test_s_and_l_together_and_bad_cut_offs():
    f = sf.sinusoid(10, 1, (50, 500), 0.2)
    both = sf.gaussian_filter(f, s_um=5, l_um=20)
    assert _amplitude(both, 10) == pytest.approx(2.0**-0.25 * (1 - 2.0**-4), rel=1e-9)
    assert "S-filter 5 µm" in both.history[-1]
    assert "L-filter 20 µm" in both.history[-1]
    assert sf.gaussian_filter(f) is f
    for wrong in ({"s_um": 0.3}, {"l_um": -1}, {"s_um": 5, "l_um": 5}, {"s_um": "wide"}):
        with pytest.raises(InputError):
            sf.gaussian_filter(f, **wrong)


# ---- crop
def test_a_crop_is_the_middle_and_no_longer_periodic():
    z = np.arange(10.0)[:, None] * 100 + np.arange(16.0)
    f = sf.Heightfield(z, (0.5, 0.25), periodic=True)
    part, first = f.cropped((2.0, 1.0)), f.cropped((2.0, 1.0), centre=False)
    assert (part.shape, part.size_um) == ((4, 4), (2.0, 1.0))
    np.testing.assert_array_equal(part.z, z[3:7, 6:10])
    np.testing.assert_array_equal(first.z, z[:4, :4])
    assert not part.periodic
    assert not f.cropped((5.0, 1.0)).periodic
    assert f.cropped((5.0, 4.0)).periodic  # the whole
