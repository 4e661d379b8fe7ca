"""Point 5 of the chapter's extremes: drowned levels, falling and clipped curves, parallel primaries, quantisation."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio import display as vd
from vgonio.display.verification import MEASURED
from vgonio.errors import InputError, VgonioWarning

NM = np.arange(380.0, 781.0, 4.0)


def panel(curve, spectra=None, black_cd_m2=0.21, noise=0.0, seed=0, levels=18):
    """Readings of a display with a tone curve of any shape: curve(signal) → light."""
    base = vd.virtual_display("wide-gamut", white_cd_m2=80, black_cd_m2=black_cd_m2)
    spectra = base.spectra if spectra is None else spectra
    rgb = vd.ramp_colours(levels)
    light = base.black + curve(rgb) @ spectra
    light = light + noise * np.random.default_rng(seed).standard_normal(light.shape)
    return vd.Readings(rgb, light, base.wavelength_nm)


def consistent(model):
    """Everything that a model promises whatever it was fitted to."""
    rng = np.random.default_rng(7)
    rgb = rng.random((100, 3))
    xyz = model.xyz(rgb)
    back = model.backward(xyz)
    np.testing.assert_allclose(model.xyz(back.rgb), xyz, rtol=1e-6, atol=1e-6)
    wild = model.backward(rng.uniform(-50, 300, (100, 3)))
    assert np.all((wild.rgb >= 0) & (wild.rgb <= 1))
    assert np.all(np.isfinite(wild.cost))
    fine = np.linspace(0, 1, 1001)
    assert all(np.all(np.diff(curve(fine)) > 0) for curve in model.curves)


def test_black_above_the_lowest_levels():
    """Levels below 46 of 255 give nothing (an offset of the panel) and the noise of black swamps the next."""
    offset = lambda v: np.clip((v - 0.18) / 0.82, 0, None) ** 2.2  # noqa: E731
    with pytest.warns(VgonioWarning, match="no light above black up to level 41"):
        model = vd.fit(panel(offset))
    consistent(model)
    assert model.curves[0].dark_until == pytest.approx(41 / 255)
    # a dark grey is asked of the first level that has light, not of the drowned ones
    dark = model.backward(model.black_xyz + 1e-3 * model.matrix.sum(axis=1)).rgb
    assert np.all((dark > 0.18) & (dark < 0.3))
    # the same in noise of half the light of black: still rising, and right within the noise
    with pytest.warns(VgonioWarning):
        noisy = vd.fit(panel(offset, noise=0.5 * panel(offset).spectra[0].max()))
    consistent(noisy)
    np.testing.assert_allclose(noisy.linear(vd.grid_colours(85)), offset(vd.grid_colours(85)), atol=5e-3)


def test_curve_that_falls_at_the_top():
    """S-shaped and turning back by 3 % from level 225 on, as analogue inputs did: pooled, and said."""

    def turning(v):
        return np.where(v < 0.88, (v / 0.88) ** 2.2, 1 - 0.25 * (v - 0.88))

    with pytest.warns(VgonioWarning, match="a curve that falls"):
        model = vd.fit(panel(turning))
    consistent(model)
    # the full light is the mean of the levels that were pooled, all within the 3 % that the curve falls by
    assert 0.97 < model.matrix[1].sum() / (80 - 0.21) < 1.0


def test_clipped_curves():
    """Full light is reached at 200 of 255; the signal of a little less lies below the first level beyond that."""
    with pytest.warns(VgonioWarning, match="clipped, no more light from level 21"):
        model = vd.fit(panel(lambda v: np.minimum(v / (200 / 255), 1) ** 2.2))
    consistent(model)
    almost = model.backward(model.black_xyz + 0.97 * model.matrix.sum(axis=1))
    assert np.all(almost.rgb < 215 / 255)
    assert np.all(almost.in_gamut)


def test_clipped_at_both_ends_and_noisy():
    with pytest.warns(VgonioWarning):
        model = vd.fit(panel(lambda v: np.clip((v - 0.1) / 0.7, 0, 1) ** 2, noise=2e-5))
    consistent(model)


@pytest.mark.parametrize(("apart", "low", "high"), [(8.0, 10, 60), (2.0, 50, 400), (0.5, 200, 2000)])
def test_nearly_parallel_primaries(apart, low, high):
    """Green and red bands a few nm apart: the condition number grows as one over the distance, and is reported."""
    bands = [np.exp(-4 * np.log(2) * ((NM - centre) / 30) ** 2) for centre in (540 + apart, 540, 460)]
    rgb = vd.ramp_colours(18)
    spectra = 2e-3 * np.array(bands)
    readings = vd.Readings(rgb, 1e-6 + rgb**2.2 @ spectra, NM)
    with warns_if(apart < 5, "nearly parallel"):
        model = vd.fit(readings)
    assert low < model.condition < high
    assert vd.summary(model)["condition"] == model.condition
    colours = np.random.default_rng(0).random((50, 3))
    np.testing.assert_allclose(model.backward(model.xyz(colours)).rgb, colours, atol=1e-6)


def warns_if(wanted, words):
    from contextlib import nullcontext

    return pytest.warns(VgonioWarning, match=words) if wanted else nullcontext()


def test_condition_of_srgb_is_what_the_message_says():
    from vgonio.display.colorimetry import encoding

    matrix = encoding("sRGB")[1]
    assert np.linalg.cond(matrix / np.linalg.norm(matrix, axis=0)) == pytest.approx(3, abs=0.5)


def test_the_same_channel_twice_has_no_inverse():
    base = vd.virtual_display("wide-gamut")
    with pytest.warns(VgonioWarning, match="nearly parallel"):
        model = vd.fit(panel(lambda v: v**2.2, spectra=base.spectra[[0, 0, 2]]))
    with pytest.raises(InputError, match="parallel in XYZ"):
        model.backward(model.white_xyz)


@pytest.mark.parametrize("name", ["crt-brainard", "lcd-apple"])
def test_colours_out_of_gamut_of_a_small_display(name):
    """Adobe RGB's full green and cyan on an sRGB-like display: clipped, said, and never NaN."""
    from vgonio.display.colorimetry import decode, denormalise

    model = vd.fit(vd.virtual_display(name).measure(vd.ramp_colours(18)))
    wanted = denormalise(
        decode(np.array([[0, 1, 0], [0, 1, 1], [0.5, 0.5, 0.5]]), "Adobe RGB"), model.black_xyz, model.white_xyz
    )
    for gamut in ("clip", "desaturate"):
        found = model.backward(wanted, gamut)
        assert found.in_gamut.tolist() == [False, False, True]
        assert np.all(np.isfinite(found.rgb))
        assert np.all(found.cost[:2] > 2)
    assert found.report()["out_of_gamut"] == 2


def test_quantisation_from_8_to_12_bits():
    """Rounding costs ΔE₀₀ in proportion to the step: 0.24 at 8 bits (0.20 … 0.30 by tone curve), a quarter at 10."""
    cost = {}
    for bits in (8, 9, 10, 11, 12):
        display = vd.virtual_display("wide-gamut", tone="s-curve", bits=bits)
        found = vd.examine_virtual(display, vd.patches("cie-224"), bits=bits)[0]
        cost[bits] = found.calibration.statistics()[MEASURED]["mean"]
    assert 0.20 < cost[8] < 0.30
    for bits in (9, 10, 11, 12):
        # the mean over 99 × 3 roundings scatters by some percent; interpolation adds 0.001
        assert cost[bits] == pytest.approx(cost[8] / 2 ** (bits - 8), rel=0.25)


def test_quantised_signals_are_codes():
    v = np.linspace(0, 1, 1000)
    for bits in (8, 10, 12):
        codes = vd.quantise(v, bits) * (2**bits - 1)
        np.testing.assert_allclose(codes, np.round(codes), atol=1e-9)
        assert np.abs(vd.quantise(v, bits) - v).max() <= 0.5 / (2**bits - 1) + 1e-12
    for bad in (5, 17, 8.5, "8"):
        with pytest.raises(InputError, match="bits"):
            vd.quantise(v, bad)


def test_coarse_measurements_still_work():
    """Five levels: a warning, and a curve within a percent."""
    with pytest.warns(VgonioWarning, match="5 levels"):
        model = vd.fit(panel(lambda v: v**2.4, levels=5))
    consistent(model)
    fine = np.linspace(0, 1, 101)
    assert np.abs(model.curves[1](fine) - fine**2.4).max() < 1e-2


def test_spectra_in_the_wrong_unit_are_noticed():
    readings = vd.virtual_display().measure(vd.ramp_colours(18))
    with pytest.warns(VgonioWarning, match="implausible"):
        vd.fit(vd.Readings(readings.rgb, 1e3 * readings.spectra, readings.wavelength_nm))


def test_condition_does_not_depend_on_how_bright_the_channels_are(model):
    from dataclasses import replace

    dim = replace(model, primaries=model.primaries * np.array([100.0, 1.0, 0.01])[:, None])
    assert dim.condition == pytest.approx(model.condition, rel=1e-9)
