"""Emission spectra to XYZ, the Adobe RGB normalisation, encodings."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio.display import colorimetry as c
from vgonio.errors import InputError


def test_a_watt_of_green_light_is_683_lumens():
    """By definition at 555 nm, where ȳ is 1: a band 1 nm wide holds 683 cd/m² per W/(sr m²)."""
    nm = np.arange(380.0, 781.0, 1.0)
    line = (nm == 555).astype(float)
    assert c.spectra_to_xyz(line, nm)[1] == pytest.approx(683, rel=1e-4)


def test_xyz_against_colour_science():
    """Sum of colour-science over its own 1 nm grid, for the light of D65: the same to rounding."""
    import colour

    d65 = colour.SDS_ILLUMINANTS["D65"].copy().align(colour.SpectralShape(360, 830, 1))
    cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(d65.shape)
    theirs = colour.sd_to_XYZ(d65, cmfs, k=683, method="Integration")
    np.testing.assert_allclose(c.spectra_to_xyz(d65.values, d65.wavelengths), theirs, rtol=1e-9)
    np.testing.assert_allclose(c.chromaticity(theirs), [0.3127, 0.3290], atol=5e-5)


@pytest.mark.parametrize("step", [2, 5, 10])
def test_coarser_grids_give_the_same_colour(step):
    """Bands 40 nm wide on 2 … 10 nm: linear interpolation is off by h²/12 · 8 ln 2/w²
    at the top of a band, a little more on its flanks."""
    fine, coarse = np.arange(380.0, 781.0), np.arange(380.0, 781.0, step)
    band = [np.exp(-4 * np.log(2) * ((nm - 531) / 40) ** 2) for nm in (fine, coarse)]
    a, b = c.spectra_to_xyz(band[0], fine), c.spectra_to_xyz(band[1], coarse)
    np.testing.assert_allclose(b, a, rtol=1.1 * 8 * np.log(2) / 12 * (step / 40) ** 2)


def test_normalisation_by_black_and_white():
    black, white = np.array([0.2, 0.21, 0.3]), np.array([75.0, 80.0, 85.0])
    np.testing.assert_allclose(c.normalise([black, white], black, white), [[0, 0, 0], c.d65()], atol=1e-15)
    some = np.random.default_rng(0).random((20, 3)) * 80
    np.testing.assert_allclose(c.denormalise(c.normalise(some, black, white), black, white), some, rtol=1e-12)


def test_normalisation_is_that_of_the_adobe_document():
    """Adobe RGB (1998), section 4.2.2: its reference display (160 and 0.5557 cd/m², D65) on its own formula."""
    xw, xk = np.array([152.07, 160.00, 174.25]), np.array([0.5282, 0.5557, 0.6052])
    xyz = np.array([60.0, 50.0, 70.0])
    by_hand = (xyz - xk) / (xw - xk) * xw / xw[1]
    np.testing.assert_allclose(c.normalise(xyz, xk, xw), by_hand, rtol=3e-5)  # its white has five digits


@pytest.mark.parametrize("name", ["sRGB", "Adobe RGB", "Display P3"])
def test_encodings_against_colour_science(name):
    import colour

    rgb = np.random.default_rng(1).random((50, 3))
    xyz = c.decode(rgb, name)
    np.testing.assert_allclose(c.encode(xyz, name), rgb, atol=1e-6)
    np.testing.assert_allclose(c.encode(c.d65(), name), 1, atol=1e-6)
    theirs = colour.RGB_to_XYZ(rgb, c.ENCODINGS[name], apply_cctf_decoding=True)
    np.testing.assert_allclose(xyz, theirs, atol=3e-4)  # the standards print their matrices with four digits


def test_delta_e_is_relative_to_the_given_white():
    """ΔL* = 100 − 50: ΔE₀₀ of greys depends on S_L alone (Sharma 2005, eq. 16), at L̄ = 75."""
    white = np.array([40.0, 50.0, 30.0])
    y50 = ((50 + 16) / 116) ** 3
    s_l = 1 + 0.015 * (75 - 50) ** 2 / np.sqrt(20 + (75 - 50) ** 2)
    assert float(c.delta_e(white * y50, white, white)) == pytest.approx(50 / s_l, rel=1e-6)


def test_what_is_refused():
    with pytest.raises(InputError, match="400 to 700 nm"):
        c.spectra_to_xyz(np.ones(20), np.linspace(420, 700, 20))
    with pytest.raises(InputError, match="rising"):
        c.spectra_to_xyz(np.ones(20), np.linspace(780, 380, 20))
    with pytest.raises(InputError, match="Adobe RGB"):
        c.encode(np.ones(3), "AdobeRGB")
    with pytest.raises(InputError, match="not above black"):
        c.normalise(np.ones(3), np.ones(3), np.ones(3))


def test_nothing_is_emitted_beyond_the_ends_of_a_spectrum():
    short = np.arange(400.0, 701.0, 5.0)
    padded = np.concatenate([[380.0, 399.999], short, [700.001, 780.0]])
    spectrum = np.linspace(1, 2, short.size)
    a = c.spectra_to_xyz(spectrum, short)
    b = c.spectra_to_xyz(np.concatenate([[0, 0], spectrum, [0, 0]]), padded)
    np.testing.assert_allclose(a, b, rtol=1e-4)
