"""The ICC profile read by LittleCMS, the 3-D LUT by colour-science: neither knows our writers."""

from __future__ import annotations

import ctypes
import datetime as dt
import hashlib
from pathlib import Path

import numpy as np
import pytest

from vgonio import display as vd
from vgonio.display.colorimetry import delta_e
from vgonio.display.cube import signals as cube_signals
from vgonio.display.icc import D50, adaptation
from vgonio.errors import FileFormatError, InputError

RELATIVE_COLORIMETRIC = 1


@pytest.fixture(scope="module")
def panel() -> vd.DisplayModel:
    return vd.fit(vd.virtual_display("wide-gamut", tone="s-curve").measure(vd.ramp_colours(18)))


@pytest.fixture(scope="module")
def icc(panel, tmp_path_factory) -> Path:
    return vd.write_icc(tmp_path_factory.mktemp("icc") / "p.icc", panel, "A wide panel, 130 cd/m²")


def connected(model: vd.DisplayModel, rgb: np.ndarray) -> np.ndarray:
    """XYZ (…, 3) relative to D50 that the profile means: light above black, adapted."""
    white = model.matrix.sum(axis=1)
    return model.linear(rgb) @ (adaptation(white / white[1]) @ model.matrix / white[1]).T


def test_littlecms_reads_the_tags(icc, panel):
    from PIL import ImageCms

    found = ImageCms.ImageCmsProfile(str(icc)).profile
    assert found.version == 4.3
    assert found.profile_description == "A wide panel, 130 cd/m²"
    assert found.is_matrix_shaper
    assert found.rendering_intent == RELATIVE_COLORIMETRIC
    assert (found.device_class, found.xcolor_space.strip(), found.connection_space.strip()) == ("mntr", "RGB", "XYZ")
    np.testing.assert_allclose(found.media_white_point[0], D50, atol=1e-5)
    assert found.luminance[0][1] == pytest.approx(panel.matrix[1].sum(), abs=1e-4)
    white = panel.matrix.sum(axis=1)
    np.testing.assert_allclose(found.chromatic_adaptation[0], adaptation(white / white[1]), atol=1e-5)
    columns = np.array([c[0] for c in (found.red_colorant, found.green_colorant, found.blue_colorant)])
    np.testing.assert_allclose(columns, connected(panel, np.eye(3)), atol=1e-5)  # s15Fixed16 has steps of 1.5e-5
    np.testing.assert_allclose(columns.sum(axis=0), D50, atol=3e-5)


def test_adaptation_is_bradfords():
    """From D65 to D50 as in the sRGB profile of ICC; and white becomes D50 exactly."""
    d65 = np.array([0.9505, 1.0, 1.0891])
    wanted = [[1.0479, 0.0229, -0.0502], [0.0296, 0.9904, -0.0171], [-0.0092, 0.0151, 0.7519]]
    np.testing.assert_allclose(adaptation(d65), wanted, atol=3e-4)
    np.testing.assert_allclose(adaptation(d65) @ d65, D50, atol=1e-12)


def test_littlecms_shows_the_same_colours(icc, panel, rng):
    """Through Pillow, in 8 bits: L* in steps of 0.4, a* and b* in steps of 1, and LittleCMS rounds its own tables."""
    from PIL import Image, ImageCms

    rgb = rng.integers(0, 256, (64, 64, 3), dtype=np.uint8)
    lab_profile = ImageCms.createProfile("LAB")
    transform = ImageCms.buildTransform(str(icc), lab_profile, "RGB", "LAB", renderingIntent=RELATIVE_COLORIMETRIC)
    out = np.asarray(ImageCms.applyTransform(Image.fromarray(rgb), transform)).astype(float)
    shown = np.stack(
        [out[..., 0] / 2.55, *(np.where(out[..., i] > 127, out[..., i] - 256, out[..., i]) for i in (1, 2))], -1
    )
    wanted = lab_d50(connected(panel, rgb / 255))
    inside = np.all(np.abs(wanted[..., 1:]) < 126, axis=-1)
    assert inside.mean() > 0.8
    np.testing.assert_allclose(shown[inside], wanted[inside], atol=1.2)
    assert np.abs(shown - wanted)[inside].mean() < 0.3


def lab_d50(xyz: np.ndarray) -> np.ndarray:
    """CIE 1976, written out."""
    t = xyz / D50
    f = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], axis=-1)


def test_littlecms_in_double_precision(icc, panel, rng, agreement):
    """Pillow's own copy of LittleCMS, called directly: what is left is the 16 bits of the tone curve."""
    lib = littlecms()
    handle = lib.cmsOpenProfileFromFile(str(icc).encode(), b"r")
    xyz_profile = lib.cmsCreateXYZProfile()
    double = lambda space: (1 << 22) | (space << 16) | (3 << 3)  # noqa: E731  FLOAT, 3 channels, 8 bytes
    flags = 0x0040 | 0x0100  # no cache, no optimisation
    transform = lib.cmsCreateTransform(handle, double(4), xyz_profile, double(9), RELATIVE_COLORIMETRIC, flags)
    rgb = np.ascontiguousarray(rng.random((3000, 3)))
    shown = np.zeros_like(rgb)
    lib.cmsDoTransform(transform, rgb.ctypes.data, shown.ctypes.data, len(rgb))
    wanted = connected(panel, rgb)
    np.testing.assert_allclose(shown, wanted, atol=5e-5)
    difference = delta_e(shown, wanted, D50)
    agreement("ICC v4 profile, 3,000 colours: mean ΔE₀₀", "LittleCMS in double precision", difference.mean(), 0.005)
    # the darkest, where the curve has few steps of 1/65535
    agreement("the same profile: largest ΔE₀₀", "LittleCMS in double precision", difference.max(), 0.1)


def littlecms() -> ctypes.CDLL:
    import PIL

    found = list((Path(PIL.__file__).parents[1] / "pillow.libs").glob("liblcms2*"))
    if not found:
        pytest.skip("Pillow has no copy of LittleCMS of its own here")
    lib = ctypes.CDLL(str(found[0]))
    for name in ("cmsOpenProfileFromFile", "cmsCreateXYZProfile", "cmsCreateTransform"):
        getattr(lib, name).restype = ctypes.c_void_p
    u32 = ctypes.c_uint32
    lib.cmsCreateTransform.argtypes = [ctypes.c_void_p, u32, ctypes.c_void_p, u32, u32, u32]
    lib.cmsDoTransform.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, u32]
    return lib


def test_an_image_prepared_with_littlecms_looks_right_on_the_display(icc, panel):
    """sRGB patches → profile by LittleCMS → the virtual display: the colour that sRGB means, to 8 bits."""
    from PIL import Image, ImageCms

    from vgonio.display.colorimetry import d65, decode, normalise

    rgb = np.random.default_rng(2).integers(30, 256, (1, 400, 3), dtype=np.uint8)
    transform = ImageCms.buildTransform(
        ImageCms.createProfile("sRGB"), str(icc), "RGB", "RGB", renderingIntent=RELATIVE_COLORIMETRIC
    )
    sent = np.asarray(ImageCms.applyTransform(Image.fromarray(rgb), transform)) / 255
    shown = normalise(panel.xyz(sent), panel.black_xyz, panel.xyz(np.ones(3)))
    difference = delta_e(shown, decode(rgb / 255, "sRGB"), d65())
    assert difference.mean() < 0.5  # rounding twice to 8 bits, 0.24 each
    assert difference.max() < 3


def test_profile_is_whole_and_reproducible(panel, tmp_path):
    """Size and ID (MD5 without flags, intent and ID) as the specification says; the same date, the same bytes."""
    date = dt.datetime(2026, 1, 2, 3, 4, 5, tzinfo=dt.UTC)
    a = vd.write_icc(tmp_path / "a.icc", panel, "x", date).read_bytes()
    b = vd.write_icc(tmp_path / "b.icc", panel, "x", date).read_bytes()
    assert a == b
    assert int.from_bytes(a[:4], "big") == len(a)
    assert a[36:40] == b"acsp"
    blank = bytearray(a)
    blank[44:48], blank[64:68], blank[84:100] = bytes(4), bytes(4), bytes(16)
    assert a[84:100] == hashlib.md5(bytes(blank), usedforsecurity=False).digest()
    count = int.from_bytes(a[128:132], "big")
    for i in range(count):
        place, size = (int.from_bytes(a[136 + 12 * i + k : 140 + 12 * i + k], "big") for k in (0, 4))
        assert place % 4 == 0
        assert place + size <= len(a)
    with pytest.raises(FileFormatError, match="cannot write"):
        vd.write_icc(tmp_path / "no" / "a.icc", panel)


@pytest.mark.parametrize("source", ["sRGB", "Adobe RGB", "Display P3"])
def test_colour_science_reads_the_lut(panel, tmp_path, source, agreement):
    import colour

    table = vd.lut(panel, source, 17)
    found = colour.read_LUT(str(vd.write_cube(tmp_path / "l.cube", table, 'a "title"')))
    assert found.name == "a 'title'"
    assert found.table.shape == (17, 17, 17, 3)
    np.testing.assert_allclose(found.domain, [[0, 0, 0], [1, 1, 1]])
    agreement(".cube table, as read", "colour-science's reader", np.abs(found.table - table).max(), 2e-7)


def test_the_lut_does_what_the_model_does(panel, tmp_path, rng, agreement):
    """Applied by colour-science at random colours: what is left is the interpolation, as `lut_error` says it."""
    import colour

    table = vd.lut(panel, "sRGB", 33)
    lut = colour.read_LUT(str(vd.write_cube(tmp_path / "l.cube", table, "t")))
    rgb = rng.random((500, 3))
    got = lut.apply(rgb, interpolator=colour.algebra.table_interpolation_trilinear)
    difference = delta_e(panel.xyz(got), panel.xyz(cube_signals(panel, rgb, "sRGB")), panel.white_xyz)
    stated = vd.lut_error(panel, table, "sRGB")
    assert difference.mean() == pytest.approx(stated["mean"], rel=0.5)
    assert difference.max() < 1
    agreement(".cube table, 33 points, interpolated: mean ΔE₀₀", "the model of the display", stated["mean"], 0.05)


def test_the_lut_gets_better_with_its_size(panel, agreement):
    """The mean error of linear interpolation falls as the square of the step."""
    error = [vd.lut_error(panel, vd.lut(panel, "Adobe RGB", n), "Adobe RGB")["mean"] for n in (9, 17, 33)]
    order = np.log2(np.divide(error[:-1], error[1:]))
    agreement("order of the .cube table's error in its step", "second order expected", order, (1.6, 2.5))


def test_white_stays_white_and_black_black(panel):
    table = vd.lut(panel, "sRGB", 5)
    np.testing.assert_allclose(table[0, 0, 0], 0, atol=1e-9)
    np.testing.assert_allclose(table[-1, -1, -1], 1, atol=1e-6)
    # axes: red first. Full red of sRGB needs most of the red channel
    assert table[-1, 0, 0].argmax() == 0
    assert table[0, 0, -1].argmax() == 2


def test_red_varies_fastest_in_the_file(panel, tmp_path):
    table = vd.lut(panel, "sRGB", 3)
    lines = vd.write_cube(tmp_path / "l.cube", table, "t").read_text().splitlines()
    rows = np.array([line.split() for line in lines if line[0].isdigit()], float)
    np.testing.assert_allclose(rows[1], table[1, 0, 0], atol=1e-7)
    np.testing.assert_allclose(rows[3], table[0, 1, 0], atol=1e-7)
    np.testing.assert_allclose(rows[9], table[0, 0, 1], atol=1e-7)


def test_luts_that_are_refused(panel, tmp_path):
    with pytest.raises(InputError, match="size of the LUT"):
        vd.lut(panel, size=1)
    with pytest.raises(InputError, match="encoding"):
        vd.lut(panel, "rec709")
    with pytest.raises(InputError, match="LUT of shape"):
        vd.write_cube(tmp_path / "a.cube", np.zeros((3, 3, 2, 3)), "t")
    with pytest.raises(InputError, match="0 … 1"):
        vd.write_cube(tmp_path / "a.cube", np.full((3, 3, 3, 3), np.nan), "t")


def test_through_the_lut_the_display_shows_what_srgb_means(panel):
    """Also of a display whose white is not the sum of its channels: the LUT's white is full signal."""
    from vgonio.display.colorimetry import d65, decode, normalise

    rgb = vd.grid_colours(51)
    uneven = vd.fit(vd.virtual_display("wide-gamut", white_boost=0.2).measure(vd.ramp_colours(18)))
    for model in (panel, uneven):
        shown = normalise(model.xyz(cube_signals(model, rgb, "sRGB")), model.black_xyz, model.xyz(np.ones(3)))
        difference = delta_e(shown, decode(rgb, "sRGB"), d65())
        # 0.3 % of sRGB, beside the line from red to blue, lie outside and are clipped
        assert np.mean(difference < 1e-4) > 0.85
        assert difference.max() < 0.5
