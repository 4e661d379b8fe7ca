"""Frameworks 1 and 2 on virtual displays: the thesis' numbers in kind, and each deviation found where it is."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio import display as vd
from vgonio.display.colorimetry import chromaticity, encoding
from vgonio.display.verification import MEASURED
from vgonio.errors import InputError

EMISSIVE = {"tone": 2.6, "white_cd_m2": 130.0, "black_cd_m2": 0.04}


def examined(levels=10, bits=None, patches="colorchecker", name="wide-gamut", **deviations) -> vd.Examined:
    display = vd.virtual_display(name, **deviations)
    return vd.examine_virtual(display, vd.patches(patches), levels=levels, bits=bits)[0]


def means(found: vd.Examined) -> dict[str, float]:
    return {name: s["mean"] for name, s in found.calibration.statistics().items()}


@pytest.mark.parametrize("tone", ["srgb", "s-curve", 1.8, 2.2, 2.6])
@pytest.mark.parametrize(("white", "black"), [(130.0, 0.04), (80.0, 0.21)])
def test_without_deviation_and_quantisation_nothing_is_left(tone, white, black, agreement):
    """Ten levels per channel; what is left, at most 0.03, is the interpolation of the tone curves."""
    found = examined(tone=tone, white_cd_m2=white, black_cd_m2=black)
    agreement(
        "calibrated display without deviation or quantisation, ten levels, five tone curves: mean ΔE₀₀",
        "0",
        means(found)[MEASURED],
        0.05,
    )
    assert found.check.statistics()["max"] < 0.05
    assert found.check.spectral_error.max() < 2e-3


@pytest.mark.parametrize("patches", ["colorchecker", "cie-224"])
def test_eight_bits_alone(patches, agreement):
    """0.24 over the tone curves that displays have."""
    cost = [means(examined(bits=8, patches=patches, tone=t))[MEASURED] for t in ("srgb", "s-curve", 2.2, 2.6)]
    agreement("the same with 8 bits, mean over tone curves", "0.24, once found", np.mean(cost), (0.21, 0.27))


def test_with_deviations_as_in_the_thesis(emissive):
    """Mean model error 0.5; calibrated it stays near 1, sRGB and Adobe RGB control are off by several units.

    The thesis measured 0.5 and 1.0, 11.2, 5.7 on a headset whose tone curve is not known; here
    0.5 and 0.8, 6.1, 4.6."""
    assert emissive.check.statistics()["mean"] == pytest.approx(0.5, abs=0.1)
    found = means(emissive)
    assert 0.5 < found[MEASURED] < 1.3
    assert 4 < found["Adobe RGB"] < found["sRGB"] < 12
    assert found["Adobe RGB"] > 4 * found[MEASURED]
    assert emissive.check.assumptions.failing() == []


def test_a_standard_tone_curve_makes_adobe_rgb_control_good():
    """What is wrong with Adobe RGB control of a display near Adobe RGB is the tone curve: else 1 is left."""
    near = means(examined(tone=2.2))
    far = means(examined(tone=2.6))
    assert near["Adobe RGB"] < 1.5
    assert far["Adobe RGB"] > 4
    assert near["sRGB"] > 3  # sRGB values on wide primaries are wrong whatever the tone curve


def test_the_wide_gamut_primaries_lie_near_adobe_rgb():
    model = vd.fit(vd.virtual_display("wide-gamut").measure(vd.ramp_colours(10)))
    distance = np.linalg.norm(chromaticity(model.matrix.T) - encoding("Adobe RGB")[0], axis=1)
    assert np.all(distance < 0.025)
    assert vd.coverage(model, "Adobe RGB") > 0.99


@pytest.mark.parametrize("panel", ["led-lcd", "ccfl-lcd", "crt"])
def test_measured_primaries(shared, panel):
    """LED, CCFL and CRT (Mantiuk 2011): near sRGB, calibrated with and without quantisation; black of 0.21 cd/m²."""
    path = shared / "data" / "displays" / f"emission_spectra_{panel}.csv"
    exact = examined(name=path, white_cd_m2=80, black_cd_m2=0.21, tone="s-curve")
    assert vd.coverage(exact.model, "sRGB") > 0.7
    assert vd.coverage(exact.model, "Adobe RGB") < 0.85
    controls = exact.calibration.targets.controls
    assert np.mean(exact.calibration.delta_e[MEASURED][controls.in_gamut]) < 0.05
    # what is out of gamut costs what the gamut report says: there, relative to the white with black; here without
    out = ~controls.in_gamut
    np.testing.assert_allclose(exact.calibration.delta_e[MEASURED][out], controls.cost[out], rtol=0.15)
    fact = vd.summary(exact.model, exact.check)
    assert fact["contrast"] == pytest.approx(80 / 0.21, rel=1e-6)
    assert fact["black_cd_m2"] == pytest.approx(0.21)


# ---- which assumption fails
CYCLIC = np.array([[0, 1, -1], [-1, 0, 1], [1, -1, 0]])


@pytest.mark.parametrize(
    ("deviation", "failing"),
    [
        ({}, []),
        ({"shift_nm": 4.0}, ["constancy", "tone"]),
        ({"white_boost": 0.1}, ["additivity"]),
        ({"crosstalk": 0.025 * CYCLIC}, ["independence"]),
        ({"crosstalk": 0.05}, ["independence", "additivity"]),
        ({"loading": 0.3}, ["independence", "additivity"]),
    ],
    ids=["none", "wandering bands", "white sub-pixel", "line crosstalk", "crosstalk", "loading"],
)
def test_each_failing_assumption_is_found_by_itself(deviation, failing):
    found = examined(levels=18, **EMISSIVE, **deviation).check.assumptions
    assert found.failing() == failing
    for name, cost in found.costs().items():
        if name not in failing:
            assert cost < 0.6


def test_influence_says_which_channel_disturbs_which(agreement):
    """Red's line reaches green alone: green changes when red is on, by γ·c·v_r/v_g at first order, nobody else does."""
    c = 0.004
    matrix = np.zeros((3, 3))
    matrix[1, 0] = c
    influence = examined(levels=18, tone=2.0, crosstalk=matrix).check.assumptions.influence
    v = np.array([1, 2, 3]) / 3
    g, r = np.meshgrid(v, v)
    # light of green with red on, less that of each alone: (v_g + c v_r)² − v_g² − (c v_r)², over v_g²
    by_hand = np.sum(2 * c * g * r) / np.sum(g**2)
    agreement(
        "influence of channels on each other, crosstalk and loading",
        "closed forms",
        100 * (influence[1, 0] / by_hand - 1),
        1,
        "%",
    )
    others = influence[~np.eye(3, dtype=bool)].reshape(3, 2)
    assert np.abs(np.delete(others.ravel(), 2)).max() < 0.02 * by_hand


def test_loading_takes_the_same_from_all(agreement):
    """Light × (1 − a·mean): in pairs a channel loses a/3 of the other's light."""
    a = 0.03
    found = examined(levels=18, tone=1.0, loading=a).check.assumptions
    v = np.array([1, 2, 3]) / 3
    i, j = np.meshgrid(v, v, indexing="ij")
    # relative to each alone, which has lost a·v/3 already
    by_hand = -np.sum(a / 3 * i * j) / np.sum(i * (1 - a / 3 * i))
    off = found.influence[~np.eye(3, dtype=bool)]
    agreement(
        "influence of channels on each other, crosstalk and loading", "closed forms", 100 * (off / by_hand - 1), 2, "%"
    )
    alone = 1 - a / 3 * found.grey_levels
    np.testing.assert_allclose(found.luminance, (1 - a * found.grey_levels) / alone - 1, rtol=0.02)


def test_drift_and_noise_are_what_they_are_called():
    still = vd.virtual_display("wide-gamut", black_cd_m2=0.0)
    drifting = vd.virtual_display("wide-gamut", black_cd_m2=0.0, drift=0.05)
    white = np.ones((101, 3))
    ratio = drifting.show(white).sum(axis=1) / still.show(white).sum(axis=1)
    np.testing.assert_allclose(ratio, 1 - 0.05 * np.arange(101) / 100, rtol=1e-12)
    noisy = vd.virtual_display("wide-gamut", black_cd_m2=0.0, noise=0.02, floor=1e-6)
    spread = noisy.show(white) - still.show(white)
    bright = still.show(white[:1])[0] > 1e-3
    # 101 readings × bright bands: the standard deviation is known to 1/√(2n)
    relative = (spread / still.show(white))[:, bright]
    assert np.std(relative) == pytest.approx(0.02, rel=4 / np.sqrt(2 * relative.size))
    dark = noisy.show(np.zeros((50, 3)))
    assert np.std(dark) == pytest.approx(1e-6, rel=4 / np.sqrt(2 * dark.size))
    # and the same reading is the same whatever is asked beside it
    np.testing.assert_array_equal(noisy.show(white)[7], noisy.show(white[:1], start=7)[0])


def test_figures_of_framework_1():
    found = examined(levels=10, bits=8, **EMISSIVE, crosstalk=0.03).check
    s = found.statistics()
    assert len(found.rgb) == 64
    assert s["mean"] == pytest.approx(found.delta_e.mean())
    assert s["above_1"] == pytest.approx(np.mean(found.delta_e > 1))
    assert 0 < s["above_2"] <= s["above_1"] < 1 or s["above_2"] == 0
    # the spectrum is compared too: 3 % of crosstalk at γ 2.6 are several percent of light
    assert 0.01 < found.spectral_error.max() < 0.3


def test_calibration_against_the_reference_by_hand():
    """Framework 2 for one patch, written out: reflectance × white → XYZ → (X − K)/(W − K) → signal → shown."""
    display = vd.virtual_display("wide-gamut", tone=2.2, white_cd_m2=80, black_cd_m2=0.21)
    model = vd.fit(display.measure(vd.ramp_colours(18)))
    nm = display.wavelength_nm
    grey = vd.Patches(("grey",), nm, np.full((1, nm.size), 0.2))
    found = vd.targets(model, grey, bits=None)
    k, w = 0.21, 80.0
    light = (0.2 * w - k) / (w - k)
    assert found.reference[0, 1] == pytest.approx(light, rel=1e-9)
    np.testing.assert_allclose(found.rgb[MEASURED][0], light ** (1 / 2.2), atol=1e-5)
    np.testing.assert_allclose(found.rgb["Adobe RGB"][0], light ** (256 / 563), atol=1e-6)
    check = vd.check_calibration(found, lambda rgb: display.measure(rgb).xyz)
    assert check.delta_e[MEASURED][0] < 1e-3


def test_another_illuminant_is_seen_under_its_own_white(model, ideal):
    """A perfect diffuser is the display's white under any light."""
    nm = np.arange(380.0, 781.0, 10.0)
    white = vd.Patches(("white", "grey"), nm, np.outer([1.0, 0.2], np.ones(nm.size)))
    warm = nm / 560
    found = vd.targets(model, white, bits=None, illuminant=(nm, warm))
    np.testing.assert_allclose(found.rgb[MEASURED][0], 1, atol=1e-6)
    assert np.ptp(found.rgb["sRGB"][1]) < 1e-3  # black is not white: a trace of its colour
    with pytest.raises(InputError, match="illuminant"):
        vd.targets(model, white, illuminant=(nm, warm[1:]))


def test_from_files_as_from_the_display(tmp_path, emissive):
    """The way of a user: readings and test colours as files, the same verdict."""
    display = vd.virtual_display("wide-gamut", **EMISSIVE, crosstalk=0.02)
    patches = vd.patches("colorchecker")
    direct, everything = vd.examine_virtual(display, patches, levels=18)
    path = vd.write(tmp_path / "all.csv", [everything])
    found = vd.examine(vd.read(path)[0], patches=patches)
    assert len(found.check.rgb) == 64
    assert found.check.statistics()["mean"] == pytest.approx(direct.check.statistics()["mean"], abs=1e-3)
    for name, mean in means(direct).items():
        assert means(found)[name] == pytest.approx(mean, abs=1e-3)
    only_ramps = everything.where(np.arange(53))
    assert vd.examine(only_ramps).check is None
    with pytest.raises(InputError, match="24 of 24 colours were not measured"):
        vd.examine(only_ramps, patches=patches)


def test_unknown_deviations_and_names():
    with pytest.raises(InputError, match="did you mean 'crosstalk'"):
        vd.virtual_display("wide-gamut", crostalk=0.1)
    with pytest.raises(InputError, match="wide-gamut"):
        vd.virtual_display("widegamut")
    with pytest.raises(InputError, match="exponent"):
        vd.virtual_display("wide-gamut", tone=9.0).show(np.ones((1, 3)))
    with pytest.raises(InputError, match="outside the triangle"):
        vd.virtual_display("wide-gamut", white_xy=(0.7, 0.2))
    with pytest.raises(InputError, match="white > black"):
        vd.virtual_display("wide-gamut", white_cd_m2=1, black_cd_m2=2)
    with pytest.raises(InputError, match="cie-224"):
        vd.patches("sg")


def test_the_light_of_black_belongs_to_no_channel():
    """A display that obeys the model, however bright its black: no assumption costs anything."""
    found = examined(levels=18, tone=2.2, white_cd_m2=80, black_cd_m2=8.0).check.assumptions
    assert max(found.costs().values()) < 1e-3
    np.testing.assert_allclose(found.luminance, 0, atol=1e-9)


def test_patches_are_lit_by_the_measured_white(model):
    """Not by the sum of the primaries, where that is another: reflectance × measured white, integrated by hand."""
    from dataclasses import replace

    from vgonio.display.colorimetry import normalise, spectra_to_xyz

    nm = model.wavelength_nm
    tilted = replace(model, white=model.white * np.linspace(0.8, 1.2, nm.size))
    ramp = np.linspace(0.1, 0.9, nm.size)
    found = vd.targets(tilted, vd.Patches(("ramp",), nm, ramp[None]))
    wanted = normalise(spectra_to_xyz(ramp * tilted.white, nm), tilted.black_xyz, tilted.white_xyz)
    np.testing.assert_allclose(found.reference[0], wanted, rtol=1e-12)


def test_a_virtual_display_drifts_through_the_whole_session():
    display = vd.virtual_display("wide-gamut", drift=0.05)
    _, everything = vd.examine_virtual(display, vd.patches("colorchecker"), levels=10)
    for i in (0, 29, 30, 60, len(everything) - 1):
        alone = display.show(everything.rgb[i : i + 1], start=i)[0]
        np.testing.assert_allclose(everything.spectra[i], alone, rtol=1e-12)
