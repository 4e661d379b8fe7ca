"""Readings from and to CSV and CGATS, as measuring software writes it; errors that say what is wrong."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from vgonio import display as vd
from vgonio.errors import FileFormatError, InputError, VgonioWarning


@pytest.fixture(scope="module")
def readings() -> vd.Readings:
    display = vd.virtual_display("wide-gamut", noise=0.01, floor=1e-7)
    return display.measure(vd.ramp_colours(10))


def same(a: vd.Readings, b: vd.Readings) -> None:
    np.testing.assert_allclose(a.rgb, b.rgb, atol=1e-9)
    np.testing.assert_allclose(a.spectra, b.spectra, rtol=1e-8)
    np.testing.assert_allclose(a.wavelength_nm, b.wavelength_nm, atol=1e-6)
    assert a.eye == b.eye


@pytest.mark.parametrize("name", ["r.csv", "r.ti3", "r.txt"])
@pytest.mark.parametrize("full_scale", [255, 1023, 100])
def test_round_trip(tmp_path, readings, name, full_scale):
    back = vd.read(vd.write(tmp_path / name, [readings], full_scale))
    assert len(back) == 1
    same(back[0], readings)


def test_two_eyes_in_one_csv(tmp_path, readings):
    both = [
        vd.Readings(readings.rgb, k * readings.spectra, readings.wavelength_nm, e)
        for k, e in ((1, "left"), (2, "right"))
    ]
    back = vd.read(vd.write(tmp_path / "both.csv", both))
    for a, b in zip(back, both):
        same(a, b)
    with pytest.raises(InputError, match="holds one eye"):
        vd.write(tmp_path / "both.ti3", both)


def csv(tmp_path, text):
    path = tmp_path / "r.csv"
    path.write_text(text, encoding="utf-8")
    return path


HEAD = "R,G,B," + ",".join(f"{w}" for w in range(380, 781, 40))


def test_csv_by_hand_with_units(tmp_path):
    row = "255,0,0," + ",".join(["2"] * 11)
    path = csv(tmp_path, f"\ufeff# unit: mW / (sr m² nm)\n# full scale: 1020\n{HEAD}\n\n{row}\n")
    found = vd.read(path)[0]
    assert found.rgb.tolist() == [[0.25, 0, 0]]
    np.testing.assert_allclose(found.spectra, 2e-3)
    assert vd.read(path, unit="W/(sr m2 nm)")[0].spectra[0, 0] == 2
    assert vd.read(path, full_scale=255)[0].rgb[0, 0] == 1


def ti3(tmp_path, readings, normalised=True):
    """A file as Argyll's dispread lays it out: percent, mW, scaled to Y = 100, uneven blanks, a table after it."""
    nm = readings.wavelength_nm
    white = readings.xyz[-1]
    scale = 100 / white[1] if normalised else 1.0
    fields = ["SAMPLE_ID", "RGB_R", "RGB_G", "RGB_B", "XYZ_X", "XYZ_Y", "XYZ_Z", *(f"SPEC_{w:03.0f}" for w in nm)]
    rows = [
        " ".join(map(repr, [i + 1, *(100 * c).tolist(), *(x * scale).tolist(), *(1e3 * scale * s).tolist()]))
        for i, (c, x, s) in enumerate(zip(readings.rgb, readings.xyz, readings.spectra))
    ]
    text = f"""CTI3

DESCRIPTOR "Argyll Calibration Target chart information 3"
ORIGINATOR "Argyll dispread"
CREATED "Thu Apr 19 11:23:45 2012"
KEYWORD "DEVICE_CLASS"
DEVICE_CLASS "DISPLAY"
KEYWORD "LUMINANCE_XYZ_CDM2"
LUMINANCE_XYZ_CDM2 "{white[0]:.9f} {white[1]:.9f} {white[2]:.9f}"
KEYWORD "NORMALIZED_TO_Y_100"
NORMALIZED_TO_Y_100 "{"YES" if normalised else "NO"}"
COLOR_REP "RGB_XYZ"
SPECTRAL_BANDS "{nm.size}"
SPECTRAL_START_NM "{nm[0]:f}"
SPECTRAL_END_NM "{nm[-1]:f}"
# a comment "with a quote
NUMBER_OF_FIELDS {len(fields)}
BEGIN_DATA_FORMAT
{"  ".join(fields)}
END_DATA_FORMAT

NUMBER_OF_SETS {len(rows)}
BEGIN_DATA
"""
    text += "\n".join(rows) + "\nEND_DATA\nCAL\nNUMBER_OF_FIELDS 1\nBEGIN_DATA_FORMAT\nRGB_I\nEND_DATA_FORMAT\n"
    path = tmp_path / "argyll.ti3"
    path.write_text(text + "NUMBER_OF_SETS 1\nBEGIN_DATA\n0.0\nEND_DATA\n", encoding="latin-1")
    return path


@pytest.mark.parametrize("normalised", [True, False])
def test_argylls_files(tmp_path, readings, normalised):
    same(vd.read(ti3(tmp_path, readings, normalised))[0], readings)


@pytest.mark.parametrize("style", ["SPECTRAL_NM{:.0f}", "nm{:.0f}", "SPECTRAL_{:.0f}"])
def test_other_names_of_spectral_fields(tmp_path, readings, style):
    """RGB in codes of 255 without a word on the scale: the largest value is full scale."""
    path = vd.write(tmp_path / "r.txt", [readings])
    text = path.read_text().replace('KEYWORD "RGB_FULL_SCALE"\nRGB_FULL_SCALE "255"\n', "")
    for w in readings.wavelength_nm:
        text = text.replace(f"SPEC_{w:03.0f}", style.format(w))
    path.write_text(text)
    same(vd.read(path)[0], readings)


def test_wavelengths_between_whole_nanometres(tmp_path, readings):
    """Names of fields are rounded; first, last and number say them exactly."""
    nm = np.linspace(380.2, 779.7, readings.wavelength_nm.size)
    odd = vd.Readings(readings.rgb, readings.spectra, nm)
    same(vd.read(vd.write(tmp_path / "r.cgats", [odd]))[0], odd)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no readings"),
        (f"{HEAD}\n", "no readings"),
        ("X,Y,Z,380\n1,2,3,4\n", "R,G,B and wavelengths"),
        ("R,G,B,380,370\n1,2,3,4,5\n", "must rise"),
        (f"{HEAD}\n255,0,0,1\n", "line 2: 4 numbers, the head has 14"),
        (f"{HEAD}\n255,0,0,{'x,' * 10}1\n", "line 2"),
        (f"{HEAD}\n255,0,0,{'nan,' * 10}1\n", "not finite"),
        (f"{HEAD}\n200,0,0,{'1,' * 10}1\n", "no full scale"),
        (f"# full scale: 100\n{HEAD}\n255,0,0,{'1,' * 10}1\n", "full scale of 100"),
        (f"# full scale: many\n{HEAD}\n255,0,0,{'1,' * 10}1\n", "no number"),
        ("CGATS.17\nBEGIN_DATA\n1\nEND_DATA\n", "BEGIN_DATA_FORMAT"),
        ("CGATS.17\nBEGIN_DATA_FORMAT\nRGB_R RGB_G\nEND_DATA_FORMAT\nBEGIN_DATA\n1 2 3\nEND_DATA\n", "3 values"),
        ("CGATS.17\nBEGIN_DATA_FORMAT\nRGB_R RGB_G\nEND_DATA_FORMAT\nBEGIN_DATA\n1 2\nEND_DATA\n", "no RGB_B"),
        (
            "CGATS.17\nNUMBER_OF_SETS 9\nBEGIN_DATA_FORMAT\nRGB_R RGB_G\nEND_DATA_FORMAT\nBEGIN_DATA\n1 2\nEND_DATA\n",
            "NUMBER_OF_SETS is 9",
        ),
    ],
)
def test_damaged_files(tmp_path, text, words):
    with pytest.raises(FileFormatError, match=words):
        vd.read(csv(tmp_path, text))


def test_unknown_units_endings_and_missing_files(tmp_path, readings):
    with pytest.raises(InputError, match="unit"):
        vd.read(vd.write(tmp_path / "r.csv", [readings]), unit="furlong")
    with pytest.raises(InputError, match="ending"):
        vd.write(tmp_path / "r.xlsx", [readings])
    with pytest.raises(FileFormatError, match="no such"):
        vd.read(tmp_path / "no.csv")
    (tmp_path / "b.csv").write_bytes(bytes(range(256)) * 4)
    with pytest.raises(FileFormatError, match="byte 128 is no text"):
        vd.read(tmp_path / "b.csv")


def test_patches_and_primaries_from_files(tmp_path):
    path = csv(tmp_path, "# mine\nname,400,500,700\ngrey,0.2,0.2,0.2\nred,0.0,0.1,0.6\n")
    found = vd.patches(path)
    assert found.names == ("grey", "red")
    np.testing.assert_allclose(found.at(np.array([380.0, 450, 800]))[1], [0, 0.05, 0.6])
    with pytest.raises(FileFormatError, match="share"):
        vd.patches(csv(tmp_path, "name,400,500\na,20,30\n"))
    with pytest.raises(FileFormatError, match="rows"):
        vd.patches(csv(tmp_path, "name,400,500\na,0.2\n"))
    with pytest.raises(FileFormatError, match="4|columns"):
        vd.primaries(csv(tmp_path, "380,1,2\n390,1,2\n"))
    with pytest.raises(FileFormatError, match="wavelength"):
        vd.primaries(csv(tmp_path, "nm,R,G,B\n"))


def test_argylls_rgb_is_percent_whatever_the_largest_value(tmp_path, readings):
    dim = readings.where(np.flatnonzero(readings.rgb.max(axis=1) < 0.6))
    np.testing.assert_allclose(vd.read(ti3(tmp_path, dim, normalised=False))[0].rgb, dim.rgb, atol=1e-9)


def test_a_luminance_that_does_not_fit_the_spectra_is_noticed(tmp_path, readings):
    path = ti3(tmp_path, readings, normalised=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        vd.read(path)
    with pytest.warns(VgonioWarning, match=r"gives 1.3e\+05 cd/m², the file states 130"):
        vd.read(path, unit="W/(sr m2 nm)")
