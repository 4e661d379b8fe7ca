"""Generators: closed forms, statistics to a number of standard errors under fixed seeds, and refusals."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio import surface as sf
from vgonio.errors import InputError
from vgonio.surface.sandblasting import Impacts, impacts, stamped
from vgonio.surface.statistics import beckmann_alpha


def test_sinusoid_at_cell_centres():
    f = sf.sinusoid(period_um=2, amplitude_um=0.1, shape=(64, 1000), pitch_um=0.05)
    assert f.shape == (64, 1000)
    assert f.periodic
    assert f.interpolation == "cubic"
    assert f.is_profile
    np.testing.assert_allclose(f.z[5], 0.1 * np.cos(2 * np.pi * f.x / 2), atol=1e-13)
    np.testing.assert_array_equal(f.z[:, :40], f.z[:, 40:80])  # periods repeat to the last bit
    assert f.period_um == pytest.approx(2.0)
    assert "sinusoid" in f.history[0]
    assert "0.1" in f.history[0]


def test_whole_periods_only_and_the_nearest_is_named():
    with pytest.raises(InputError, match=r"nearest possible period is 2\.94117647 µm"):
        sf.sinusoid(3, 0.1, (4, 1000), 0.05)
    assert sf.sinusoid(50 / 17, 0.1, (4, 1000), 0.05).period_um == pytest.approx(50 / 17)
    with pytest.raises(InputError, match="below two pitches"):
        sf.sinusoid(0.09, 0.1, (4, 1000), 0.05)
    with pytest.raises(InputError, match="nearest possible period is 2 µm"):
        sf.lamellar(50 / 24, 0.1, shape=(4, 1000), pitch_um=0.05)  # whole periods, but not whole pitches


def test_lamellar():
    f = sf.lamellar(period_um=2, depth_um=0.4, duty=0.3, shape=(4, 100), pitch_um=0.1)
    assert f.interpolation == "nearest"
    assert f.periodic
    high = np.arange(100) % 20 < 6
    np.testing.assert_allclose(np.ptp(f.z), 0.4)
    np.testing.assert_array_equal(f.z[2] > 0, high)
    assert f.z.mean() == pytest.approx(0, abs=1e-15)
    with pytest.raises(InputError, match=r"duty = 0\.35"):
        sf.lamellar(2, 0.4, duty=0.34, shape=(4, 100), pitch_um=0.1)


def test_blazed_ramps_have_the_angle():
    f = sf.blazed(period_um=2, blaze_deg=12, shape=(4, 400), pitch_um=0.05)
    assert f.interpolation == "linear"
    steps = np.diff(f.z[0]) / f.dx
    wall = (np.arange(399) + 1) % 40 == 0
    np.testing.assert_allclose(steps[~wall], np.tan(np.deg2rad(12)), rtol=1e-12)
    assert (steps[wall] < 0).all()
    assert wall.sum() == 9
    np.testing.assert_allclose(sf.blazed(2, depth_um=2 * np.tan(np.deg2rad(12)), shape=(4, 400)).z, f.z, atol=1e-14)
    np.testing.assert_allclose(sf.blazed(2, blaze_deg=-12, shape=(4, 400)).z, -f.z, atol=1e-14)
    for wrong in ({}, {"depth_um": 1, "blaze_deg": 3}, {"blaze_deg": 90}):
        with pytest.raises(InputError):
            sf.blazed(2, shape=(4, 400), **wrong)


# ---- random fields
def test_gaussian_scales_exactly_or_in_the_mean():
    for seed in range(3):
        f = sf.gaussian(0.8, 5, (100, 120), 0.5, seed)
        assert np.sqrt(np.mean(f.z**2)) == pytest.approx(0.8, rel=1e-12)
        assert f.z.mean() == pytest.approx(0, abs=1e-12)
    # ensemble: E[var] = Sq²·(1 − πT²/area), the field's own mean removed
    variance = np.array([sf.gaussian(0.8, 3, (64, 64), 0.75, s, exact=False).z.var() for s in range(100)])
    expected = 0.8**2 * (1 - np.pi * 3**2 / (64 * 0.75) ** 2)
    assert variance.mean() == pytest.approx(expected, abs=3.5 * variance.std() / 10)


def test_seeds_decide():
    for make in (
        lambda s: sf.gaussian(1, 3, (32, 32), 1.0, seed=s),
        lambda s: sf.power_law(seed=s, shape=(32, 32)),
        lambda s: sf.sandblasted((64, 64), seed=s),
    ):
        np.testing.assert_array_equal(make(3).z, make(3).z)
        assert np.abs(make(3).z - make(4).z).max() > 0
        assert "seed 3" in make(3).history[-1]
        assert make(3).periodic


def test_gaussian_is_periodic_across_the_seam():
    """Steps across the seam are like those inside: their RMS agrees to 4 standard errors of 512 correlated steps."""
    f = sf.gaussian(1, 5, (512, 512), 0.5, seed=1)
    seam = np.sqrt(np.mean((f.z[:, 0] - f.z[:, -1]) ** 2))
    inside = np.sqrt(np.mean(np.diff(f.z, axis=1) ** 2))
    assert seam == pytest.approx(inside, rel=4 / np.sqrt(2 * 512 * 0.5 / 5))


def test_power_law_has_its_exponent_and_cut_offs():
    f = sf.power_law(0.1, 0.7, (512, 512), 0.5, long_cutoff_um=64, short_cutoff_um=4, seed=2)
    assert f.z.std() == pytest.approx(0.1, rel=1e-12)
    p = sf.psd(f).radial()
    inside = (p.f > 1 / 50) & (p.f < 1 / 4.2)
    # rings weighted by their number of independent lines; slope −2 − 2H = −3.4, its error from the fit's scatter
    fit, cov = np.polyfit(np.log(p.f[inside]), np.log(p.values[inside]), 1, w=np.sqrt(p.area[inside]), cov=True)
    assert fit[0] == pytest.approx(-3.4, abs=4 * np.sqrt(cov[0, 0]))
    assert np.sqrt(cov[0, 0]) < 0.05
    assert p.values[p.f > 1 / 3.9].max() < 1e-12 * p.values.max()
    plateau = p.values[(p.f > 1 / 250) & (p.f < 1 / 70)]
    assert plateau.max() / plateau.min() < 4  # constant but for the speckle of a few lines a ring


@pytest.mark.parametrize(
    "call",
    [
        lambda: sf.gaussian(-1, 5),
        lambda: sf.gaussian(1, 0.1),  # below the pitch of 0.2 µm
        lambda: sf.gaussian(1, 80),  # does not fit 102 µm
        lambda: sf.gaussian(np.nan, 5),
        lambda: sf.gaussian("1 µm", 5),
        lambda: sf.gaussian(1, 5, seed=-1),
        lambda: sf.gaussian(1, 5, seed=0.5),
        lambda: sf.gaussian(1, 5, shape=(512,)),
        lambda: sf.gaussian(1, 5, shape=(512.5, 3)),
        lambda: sf.gaussian(1, 5, shape=(10**6, 10**6)),
        lambda: sf.gaussian(1, 5, pitch_um=0),
        lambda: sf.power_law(hurst=0),
        lambda: sf.power_law(hurst=1.2),
        lambda: sf.power_law(short_cutoff_um=0.3),
        lambda: sf.power_law(short_cutoff_um=50, long_cutoff_um=40),
        lambda: sf.power_law(long_cutoff_um=1000),
        lambda: sf.flat((0, 4)),
        lambda: sf.sinusoid(2, -0.1),
        lambda: sf.sandblasted(bead_diameter_um=50),
        lambda: sf.sandblasted(bead_diameter_um=(100, 70)),
        lambda: sf.sandblasted(depth_um=60),
        lambda: sf.sandblasted(coverage=0),
        lambda: sf.sandblasted(depth_spread=-0.1),
        lambda: sf.sandblasted(resolution_um=-1),
        lambda: sf.sandblasted(resolution_um=1e300),
        lambda: sf.sandblasted(pitch_um=1e300),
        lambda: sf.sandblasted(depth_um=1e-300),
        lambda: sf.sandblasted(bead_diameter_um=(0.01, 0.01), depth_um=0.001),  # ten thousand million of them
        lambda: sf.sandblasted(base=sf.Heightfield(np.zeros((4, 4)), 1.0)),
    ],
)
def test_impossible_input_is_refused_in_one_line(call):
    with pytest.raises(InputError) as e:
        call()
    assert "\n" not in str(e.value)
    assert len(str(e.value)) > 15


# ---- sandblasting
def test_one_cavity_is_a_sphere():
    n, pitch, radius, depth = 128, 0.5, 40.0, 2.0
    hit = Impacts(*(np.array([v]) for v in (30.0, 34.0, radius, depth)))
    z = stamped(np.zeros((n, n)), (pitch, pitch), hit)
    x = (np.arange(n) + 0.5) * pitch
    r2 = (x[None] - 30.0) ** 2 + (x[:, None] - 34.0) ** 2
    expected = np.minimum(0.0, radius - depth - np.sqrt(radius**2 - np.minimum(r2, radius**2)))
    np.testing.assert_allclose(z, expected, atol=1e-12)
    # volume of a spherical cap; the sum over points is exact to the rim's area of a few per cent of a point row
    volume = np.pi * depth**2 * (radius - depth / 3)
    assert -z.sum() * pitch**2 == pytest.approx(volume, rel=2e-3)


def test_cavities_wrap_around_the_seam():
    shape, pitch = (96, 80), (0.5, 0.75)
    hits = impacts((48.0, 60.0), (20, 30), 1.0, 0.3, 3.0, seed=5)
    z = stamped(np.zeros(shape), pitch, hits)
    moved = Impacts((hits.x + 20 * 0.75) % 60.0, (hits.y + 30 * 0.5) % 48.0, hits.radius, hits.depth)
    np.testing.assert_allclose(stamped(np.zeros(shape), pitch, moved), np.roll(z, (30, 20), (0, 1)), atol=1e-9)


def test_impacts_against_a_slow_copy():
    """Every bead over the whole field, with its nearest image: no windows, no early end."""
    shape, pitch = (60, 70), (1.0, 1.0)
    hits = impacts((60.0, 70.0), (40, 50), 2.0, 0.4, 4.0, seed=1)
    y, x = np.mgrid[0:60, 0:70] + 0.5
    z = np.zeros(shape)
    for px, py, radius, depth in zip(hits.x, hits.y, hits.radius, hits.depth):
        ax, ay = np.abs(x - px), np.abs(y - py)
        r2 = np.minimum(ax, 70 - ax) ** 2 + np.minimum(ay, 60 - ay) ** 2
        bottom = z[r2 <= 2 * radius * depth - depth**2].mean() - depth
        bead = np.where(r2 < radius**2, bottom + radius - np.sqrt(np.maximum(radius**2 - r2, 0)), np.inf)
        z = np.minimum(z, bead)
    np.testing.assert_allclose(stamped(np.zeros(shape), pitch, hits), z, atol=1e-12)


def test_depths_scatter_about_the_one_asked_for():
    """Log-normal speeds of mean 1 and the spread asked for: 4 standard errors of some thousand impacts."""
    hits = impacts((2000.0, 2000.0), (80, 80), 3.0, 0.4, 1.5, seed=2)
    n = hits.depth.size
    assert n > 5000
    assert hits.depth.mean() == pytest.approx(3.0, abs=4 * 1.2 / np.sqrt(n))
    assert hits.depth.std() == pytest.approx(1.2, rel=4 * np.sqrt((3 + 16 * 0.16) / n))  # kurtosis of a log-normal
    assert np.log(hits.depth).std() == pytest.approx(np.sqrt(np.log1p(0.16)), rel=4 / np.sqrt(2 * n))


def test_coverage_is_that_of_poisson():
    """Share without any footprint exp(−coverage), over 12 seeds; error from their scatter. Less stays untouched."""
    free, untouched = [], []
    y, x = np.mgrid[0:200, 0:200] * 2.0 + 1.0
    for seed in range(12):
        hits = impacts((400.0, 400.0), (80, 80), 0.5, 0.0, 1.0, seed)
        covered = np.zeros(x.shape, bool)
        for px, py, radius, depth in zip(hits.x, hits.y, hits.radius, hits.depth):
            ax, ay = np.abs(x - px), np.abs(y - py)
            r2 = np.minimum(ax, 400 - ax) ** 2 + np.minimum(ay, 400 - ay) ** 2
            covered |= r2 <= 2 * radius * depth - depth**2
        free.append(np.mean(~covered))
        untouched.append(np.mean(stamped(np.zeros(x.shape), (2.0, 2.0), hits) == 0))
    assert np.mean(free) == pytest.approx(np.exp(-1), abs=3.5 * np.std(free) / np.sqrt(12))
    assert 0.75 * np.exp(-1) < np.mean(untouched) < np.mean(free)


def test_slope_follows_the_depth():
    """Four times the depth on twice the length: the same field with twice the slopes, α ∝ a/R ∝ √depth.

    Not exactly: the rim of the deeper sphere is steeper, ⟨tan²⟩ = −1 − ln(1 − x)/x with x = (a/R)², a ratio of 2.027,
    and the number of impacts is rounded differently (under 2 %).
    """
    shallow = sf.sandblasted((384, 384), 0.5, depth_um=0.5, seed=0)
    deep = sf.sandblasted((384, 384), 1.0, depth_um=2.0, seed=0)
    tangent2 = [-1 - np.log(1 - x) / x for x in (2 * d / 42.5 - (d / 42.5) ** 2 for d in (0.5, 2.0))]
    expected = np.sqrt(tangent2[1] / tangent2[0])
    assert beckmann_alpha(deep) / beckmann_alpha(shallow) == pytest.approx(expected, rel=0.02)


def test_all_lengths_scale():
    one = sf.sandblasted((96, 96), 0.5, (40, 60), 1.0, seed=3)
    ten = sf.sandblasted((96, 96), 5.0, (400, 600), 10.0, seed=3)
    np.testing.assert_allclose(ten.z, 10 * one.z, atol=1e-9)


def test_default_sandblasting_is_plausible_and_a_base_is_kept():
    f = sf.sandblasted(seed=0)
    p = sf.parameters(f)
    assert f.periodic
    assert abs(f.z.mean()) < 1e-12
    assert 1.5 < p["Sq"] < 3.5
    assert 0.2 < p["alpha"] < 0.4
    assert abs(p["Ssk"]) < 0.5
    base = sf.gaussian(0.2, 20, (128, 128), 0.625, seed=1)
    thin = sf.sandblasted(base=base, depth_um=0.3, coverage=0.05, resolution_um=0, seed=2)
    untouched = np.isclose(thin.z - base.z, np.median(thin.z - base.z), atol=1e-12)
    assert 0.9 < untouched.mean() < 1
    assert thin.history[0] == base.history[0]


def test_resolution_blurs_by_its_width():
    """A ridge-free wave of wavelength λ keeps exp(−(π·w/λ)²/(4 ln 2)) of a Gaussian of FWHM w."""
    from vgonio.surface.sandblasting import blurred

    f = sf.sinusoid(5, 1, (8, 500), 0.1)
    expected = np.exp(-((np.pi * 2 / 5) ** 2) / (4 * np.log(2)))
    np.testing.assert_allclose(blurred(f.z, f.pitch_um, 2.0), expected * f.z, atol=1e-13)


def test_one_row_is_a_profile_with_the_same_statistics():
    surfaces = [sf.gaussian(0.5, 3.0, shape=(1, 1024), pitch_um=0.25, seed=s, exact=False) for s in range(40)]
    assert all(s.is_profile for s in surfaces)
    z = np.array([s.z[0] for s in surfaces])
    # 40 profiles of 48 correlation lengths each: the variance is known to 2 %, less what the mean takes
    assert z.var() == pytest.approx(0.25 * (1 - np.sqrt(np.pi) * 3.0 / 256), rel=0.08)
    lag = 12  # 3 µm, one correlation length
    correlation = np.mean(z * np.roll(z, lag, axis=1)) / np.mean(z**2)
    assert correlation == pytest.approx(np.exp(-1), abs=0.05)
    with pytest.raises(InputError, match="does not fit"):
        sf.gaussian(0.5, 200.0, shape=(1, 1024), pitch_um=0.25)
