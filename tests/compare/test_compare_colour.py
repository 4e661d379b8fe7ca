"""Colour against colour-science's own spectral objects, published pairs of ΔE₀₀ and exact invariances."""

from __future__ import annotations

import functools
import warnings

import numpy as np
import pytest
import xarray as xr

from vgonio import models
from vgonio.compare import colour as own
from vgonio.compare import delta_e_2000, rgb_map, xyz
from vgonio.errors import InputError, VgonioWarning

WHITE = np.array([0.3127 / 0.3290, 1.0, (1 - 0.3127 - 0.3290) / 0.3290])
GRIDS = {
    "20 nm": np.arange(380.0, 781, 20),
    "irregular": np.array([365.0, 420, 421, 480, 550, 555.5, 610, 700, 900]),
    "400 to 700 nm": np.arange(400.0, 701, 10),
    "beyond the table": np.arange(300.0, 1001, 50),
}


@functools.cache
def science():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour


def spectra(values, wavelength, theta_i=(0.0,)) -> xr.Dataset:
    """BRDF of shape (θ_i, θ_o, λ) from values (n, n_λ) along θ_o."""
    values = np.broadcast_to(np.asarray(values, float), (len(theta_i), *np.shape(values)))
    coords = {"theta_i": list(theta_i), "theta_o": np.arange(values.shape[1]) - 40.0, "wavelength": wavelength}
    return xr.Dataset({"brdf": (("theta_i", "theta_o", "wavelength"), values)}, coords=coords)


def smooth_spectra(n: int, wavelength: np.ndarray, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    centre, width, height = rng.uniform(400, 750, n), rng.uniform(40, 200, n), rng.uniform(0.2, 1, n)
    return 0.05 + height[:, None] * np.exp(-(((wavelength - centre[:, None]) / width[:, None]) ** 2))


@pytest.mark.parametrize("name", GRIDS)
def test_a_flat_spectrum_is_exactly_white(name):
    """f cos θ_i = 1 at every wavelength is D65 with Y = 1 and sRGB (1, 1, 1), on any grid and angle; to rounding."""
    w = GRIDS[name]
    theta_i = [0.0, 60.0]
    flat = spectra(np.ones((2, w.size)), w, theta_i) / np.cos(np.radians(xr.DataArray(theta_i, dims="theta_i")))
    np.testing.assert_allclose(xyz(flat), np.broadcast_to(WHITE, (2, 2, 3)), rtol=1e-12)
    rgb = rgb_map(flat, exposure=1.0)
    np.testing.assert_allclose(rgb, 1.0, rtol=1e-12)
    assert rgb.attrs["clipped"] == 0


def test_xyz_equals_the_integral_over_the_linear_interpolant():
    """colour-science integrates the interpolant itself, in steps of 1 nm, as spectral objects.

    The two differ by the scale of the white alone, 2.1e-4 in Z (see the module's text).
    """
    colour = science()
    d65 = colour.SDS_ILLUMINANTS["D65"]
    nm = np.arange(360, 781)
    for w in (GRIDS["20 nm"], GRIDS["irregular"]):
        f = smooth_spectra(4, w)
        fast = xyz(spectra(f, w)).values[0]
        for k, row in enumerate(f):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                sd = colour.SpectralDistribution(np.interp(nm, w, row), nm)
                slow = colour.sd_to_XYZ(sd, illuminant=d65, method="Integration") / 100
            np.testing.assert_allclose(fast[k], slow, rtol=3e-4)


def test_xyz_of_a_fine_grid_equals_astm_e308():
    """An independent method: colour-science's default, at 5 nm, which interpolates smooth spectra by itself."""
    colour = science()
    w = np.arange(380.0, 781, 5)
    f = smooth_spectra(4, w, seed=1)
    fast = xyz(spectra(f, w)).values[0]
    for k, row in enumerate(f):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            slow = colour.sd_to_XYZ(colour.SpectralDistribution(row, w), illuminant=colour.SDS_ILLUMINANTS["D65"]) / 100
        # the two differ by linear against cubic interpolation between 5 nm and the scale of the white
        np.testing.assert_allclose(fast[k], slow, rtol=2e-3)


def test_grids_agree_on_a_piecewise_linear_spectrum():
    def tent(w):
        return np.interp(w, [380, 580, 780], [0.2, 1.0, 0.4])

    fine, coarse = np.arange(380.0, 781, 2), np.array([380.0, 500, 580, 640, 780])
    a, b = (xyz(spectra(tent(w)[None], w)).values for w in (fine, coarse))
    np.testing.assert_allclose(a, b, rtol=1e-12)


# CIE L*a*b* pairs and ΔE₀₀ of Sharma, Wu, Dalal, "The CIEDE2000 color-difference formula", 2005, table 1: numbers 1, 4,
# 7, 10, 14, 17, 25, 31, 34
SHARMA = [
    ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
    ((50.0, -1.3802, -84.2814), (50.0, 0.0, -82.7485), 1.0000),
    ((50.0, 0.0, 0.0), (50.0, -1.0, 2.0), 2.3669),
    ((50.0, 2.4900, -0.0010), (50.0, -2.4900, 0.0010), 7.1792),
    ((50.0, -0.0010, 2.4900), (50.0, 0.0011, -2.4900), 4.7461),
    ((50.0, 2.5, 0.0), (73.0, 25.0, -18.0), 27.1492),
    ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
    ((22.7233, 20.0904, -46.6940), (23.0331, 14.9730, -42.5619), 2.0373),
    ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
]


def spectrum_of(lab, wavelength) -> np.ndarray:
    """Some BRDF (possibly negative) at θ_i = 0 whose "absolute" colour is this L*a*b*."""
    fy = (lab[0] + 16) / 116
    f = np.array([fy + lab[1] / 500, fy, fy - lab[2] / 200])
    target = WHITE * np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29))
    matrix, _ = own.weights(wavelength)
    return np.linalg.lstsq(matrix.T, target, rcond=None)[0] / np.pi


def test_sharma_pairs_from_spectra(agreement):
    """The published pairs, entered as spectra that have these colours; published to 4 digits, so 1e-4."""
    w = GRIDS["20 nm"]
    a, b = (spectra([spectrum_of(pair[k], w) for pair in SHARMA], w) for k in (0, 1))
    difference = delta_e_2000(a, b, scale="absolute")
    error = np.abs(np.asarray(difference[0]) - [pair[2] for pair in SHARMA]).max()
    agreement("ΔE₀₀, of spectra of these colours", "Sharma's pairs", error, 1e-4)


def test_difference_equals_the_slow_path_of_colour_science():
    colour = science()
    w, nm = GRIDS["20 nm"], np.arange(360, 781)
    f, g = smooth_spectra(4, w, 2), smooth_spectra(4, w, 3)
    fast = delta_e_2000(spectra(f, w), spectra(g, w), scale="reference-Y50").values[0]

    def slow_xyz(row):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            sd = colour.SpectralDistribution(np.interp(nm, w, row), nm)
            return colour.sd_to_XYZ(sd, illuminant=colour.SDS_ILLUMINANTS["D65"], method="Integration")

    white = colour.XYZ_to_xy(slow_xyz(np.ones(w.size)))
    for k in range(4):
        x, y = slow_xyz(f[k]), slow_xyz(g[k])
        lab = [colour.XYZ_to_Lab(v * 0.5 / x[1], white) for v in (x, y)]
        # relative to their own white both paths are the same up to its scale
        assert fast[k] == pytest.approx(float(colour.delta_E(*lab, method="CIE 2000")), rel=1e-3)


def test_scales_of_the_difference():
    w = GRIDS["20 nm"]
    f, g = smooth_spectra(5, w, 4), smooth_spectra(5, w, 5)
    a, b = spectra(f, w, (0.0, 50.0)), spectra(g, w, (0.0, 50.0))
    base = {scale: delta_e_2000(a, b, scale) for scale in own.SCALES}
    # a common factor changes only the absolute difference, a factor on one of them not the normalised one
    common = {scale: delta_e_2000(3 * a, 3 * b, scale) for scale in own.SCALES}
    single = {scale: delta_e_2000(a, 3 * b, scale) for scale in own.SCALES}
    for scale in ("reference-Y50", "normalised"):
        np.testing.assert_allclose(common[scale], base[scale], rtol=1e-9)
    assert abs(common["absolute"] - base["absolute"]).min() > 0.1
    np.testing.assert_allclose(single["normalised"], base["normalised"], rtol=1e-9)
    assert abs(single["reference-Y50"] - base["reference-Y50"]).min() > 1
    # scaled to Y = 0.5 by hand, the absolute difference is the relative one
    factor = 0.5 / (np.pi * xyz(a).sel(xyz="Y", drop=True))
    np.testing.assert_allclose(delta_e_2000(a * factor, b * factor, "absolute"), base["reference-Y50"], rtol=1e-9)
    for scale, difference in base.items():
        assert difference.attrs["scale"] == scale
        assert difference.dims == ("theta_i", "theta_o")
        assert float(abs(delta_e_2000(a, a, scale)).max()) < 1e-9


def test_gaps_and_black_squares_are_counted():
    w = GRIDS["20 nm"]
    f = smooth_spectra(4, w)
    f[0, 3], f[1] = np.nan, 0.0
    a, b = spectra(f, w), spectra(smooth_spectra(4, w), w)
    assert np.isnan(delta_e_2000(a, b)[0]).values.tolist() == [True, True, False, False]
    assert delta_e_2000(a, b).attrs["squares_left_out"] == 2
    # the reference decides: a black prediction is a colour
    assert np.isnan(delta_e_2000(b, a)[0]).values.tolist() == [True, False, False, False]
    rgb = rgb_map(a, chromatic=True)
    assert rgb.attrs["squares_missing"] == 2
    assert np.isfinite(rgb[0, 2:]).all()


def test_exposure_and_clipping():
    w = GRIDS["20 nm"]
    grey = spectra(np.outer([0.1, 0.5, 1.0, 2.0], np.ones(w.size)), w)
    rgb = rgb_map(grey, exposure=0.5)
    linear = np.array([0.05, 0.25, 0.5, 1.0])
    np.testing.assert_allclose(
        rgb[0, :, 0], np.where(linear > 0.0031308, 1.055 * linear ** (1 / 2.4) - 0.055, 0), rtol=1e-9
    )
    assert rgb.attrs["clipped"] == 0
    rgb = rgb_map(grey, exposure=1.0)
    assert (rgb.attrs["exposure"], rgb.attrs["clipped"], rgb.attrs["clipped_bright"]) == (1.0, 0.25, 0.25)
    automatic = rgb_map(grey)
    assert automatic.attrs["exposure"] == pytest.approx(1 / np.percentile([0.1, 0.5, 1, 2], 98))
    assert rgb.rgb.values.tolist() == ["R", "G", "B"]
    assert rgb.attrs["units"] == "1"
    # a saturated colour is outside sRGB, though not bright
    assert rgb_map(spectra(np.exp(-(((w - 520) / 15) ** 2))[None], w), exposure=1.0).attrs["clipped_bright"] == 0
    assert rgb_map(spectra(np.exp(-(((w - 520) / 15) ** 2))[None], w), exposure=1.0).attrs["clipped"] == 1


def test_chromatic_map_has_equal_luminance():
    w = GRIDS["20 nm"]
    data = models.evaluate("clausen-2022", [0, 40, 80], range(-80, 81, 20), w, alpha=0.35, h=1.8e-3, w=3)
    rgb = rgb_map(data, chromatic=True)
    linear = np.where(rgb > 0.04045, ((rgb + 0.055) / 1.055) ** 2.4, rgb / 12.92)
    luminance = linear @ np.array([0.2126, 0.7152, 0.0722])
    # the coefficients of the standard are rounded to 4 digits
    np.testing.assert_allclose(luminance, 0.5, atol=2e-4)
    assert rgb.attrs["clipped"] == 0
    # forward reddish, back bluish (thesis, section 4.3)
    forward, back = rgb.sel(theta_i=40, theta_o=-40), rgb.sel(theta_i=40, theta_o=40)
    assert float(forward.sel(rgb="R") - forward.sel(rgb="B")) > 0.05
    assert float(back.sel(rgb="B") - back.sel(rgb="R")) > 0.02


@pytest.mark.parametrize(
    "wavelength, message", [([550.0], "single wavelength"), ([1000.0, 1100], "100%"), ([600.0, 700, 800], "450 to 650")]
)
def test_wavelengths_that_show_no_colour(wavelength, message):
    data = spectra(np.ones((2, len(wavelength))), wavelength)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for function in (xyz, rgb_map, lambda d: delta_e_2000(d, d)):
            with pytest.raises(InputError, match=message):
                function(data)


def test_a_narrow_range_warns_and_says_how_much():
    data = spectra(np.ones((1, 3)), [450.0, 550, 650])
    own._weights.cache_clear()
    with pytest.warns(VgonioWarning, match="of Z"):
        share = xyz(data).attrs["weight_beyond_ends"]
    # the share of z̄·D65 below 450 nm: the sum over colour-science's own 1 nm table gives 0.42
    assert share == pytest.approx(0.420, abs=0.001)


def test_bad_choices():
    data = spectra(np.ones((1, 21)), GRIDS["20 nm"])
    with pytest.raises(InputError, match="did you mean 'absolute'"):
        delta_e_2000(data, data, scale="absolut")
    with pytest.raises(InputError, match="outside the common wavelengths"):
        delta_e_2000(data, data, scale="normalised", wavelength_n_nm=800)
    for exposure in (0.0, -1.0, np.nan):
        with pytest.raises(InputError, match="exposure"):
            rgb_map(data, exposure=exposure)


def test_emitted_light_ends_where_its_spectrum_does():
    """Light of 1 from 500 to 600 nm: sums of the observer over it, nothing beyond; a ramp alike."""
    cmfs = science().MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    inside = (cmfs.wavelengths >= 500) & (cmfs.wavelengths <= 600)
    weights = own.emitted_weights(np.array([500.0, 520, 600]))
    np.testing.assert_allclose(weights.sum(axis=0), cmfs.values[inside].sum(axis=0), rtol=1e-12)
    rising = (cmfs.wavelengths - 500) / 100
    np.testing.assert_allclose(
        np.array([0.0, 0.2, 1.0]) @ weights, (rising[:, None] * cmfs.values)[inside].sum(axis=0), rtol=1e-12
    )
