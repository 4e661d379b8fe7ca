"""The display model: forward, backward, fitted from spectra."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio import display as vd
from vgonio.display.colorimetry import delta_e, spectra_to_xyz
from vgonio.errors import InputError


def test_a_fit_recovers_the_display(ideal, model):
    np.testing.assert_allclose(model.black, ideal.black, rtol=1e-12)
    np.testing.assert_allclose(model.primaries, ideal.spectra, atol=1e-9 * ideal.spectra.max())
    assert model.eye == "left"
    assert model.notes == ()


def test_forward_agrees_with_the_display_spectrum_by_spectrum(ideal, model, signals):
    """Between 18 levels the curve is interpolated: found 9·10⁻⁴ of full light, in the toe of the sRGB curve."""
    np.testing.assert_allclose(model.spectra(signals), ideal.show(signals), atol=1.5e-3 * ideal.spectra.max())


def test_equation_5_3_is_the_colour_of_equation_5_1(model, signals):
    by_spectra = spectra_to_xyz(model.spectra(signals), model.wavelength_nm)
    np.testing.assert_allclose(model.xyz(signals), by_spectra, rtol=1e-12)


@pytest.mark.parametrize("gamut", ["clip", "desaturate"])
def test_backward_is_the_inverse_of_forward(model, signals, gamut):
    found = model.backward(model.xyz(signals).reshape(20, 10, 3), gamut)
    assert found.rgb.shape == (20, 10, 3)
    np.testing.assert_allclose(found.rgb.reshape(-1, 3), signals, atol=1e-9)
    assert np.all(found.in_gamut)
    assert np.all(found.cost == 0)
    assert found.report()["out_of_gamut"] == 0


def test_black_and_white_are_the_ends_of_the_signal(model):
    ends = model.backward([model.black_xyz, model.xyz(np.ones(3))])
    np.testing.assert_allclose(ends.rgb, [[0, 0, 0], [1, 1, 1]], atol=1e-9)
    assert np.all(ends.in_gamut)


def test_one_colour_alone(model):
    assert model.backward(model.xyz([0.2, 0.5, 0.7])).rgb == pytest.approx([0.2, 0.5, 0.7], abs=1e-9)


def test_noise_averages_out_over_the_levels():
    """All levels tell the primary: an error of σ/√Σ(l − l̄)², 0.7 σ here; the brightest reading less black has √2 σ."""
    noisy = vd.virtual_display("wide-gamut", floor=3e-5, seed=5)
    true = noisy.spectra
    readings = noisy.measure(vd.ramp_colours(32))
    model = vd.fit(readings)
    black = readings.spectra[0]
    for c in range(3):
        single = readings.ramp(c).spectra[-1] - black
        # a single reading minus black has √2 of the floor
        assert np.std(single - true[c]) == pytest.approx(np.sqrt(2) * 3e-5, rel=0.15)
        assert np.std(model.primaries[c] - true[c]) < 0.6 * np.std(single - true[c])


def test_each_eye_is_a_display_of_its_own(tmp_path):
    left = vd.virtual_display("wide-gamut", white_cd_m2=130).measure(vd.ramp_colours(10), eye="left")
    right = vd.virtual_display("lcd-apple", white_cd_m2=80, black_cd_m2=0.21).measure(vd.ramp_colours(10), eye="right")
    path = vd.write(tmp_path / "left.csv", [left])
    models = [vd.fit(r) for r in (*vd.read(path), right)]
    assert [m.eye for m in models] == ["left", "right"]
    assert models[0].white_xyz[1] == pytest.approx(130)
    assert models[1].white_xyz[1] == pytest.approx(80)
    assert models[1].black_xyz[1] == pytest.approx(0.21)


def test_out_of_gamut_is_clipped_as_stated(model, rng):
    """Clip: each channel's linear light is cut to 0 … 1, so what the model then shows has that light."""
    wanted = model.xyz(rng.random((300, 3))) * rng.uniform(0.2, 2.5, (300, 3))
    found = model.backward(wanted, "clip")
    assert 50 < found.in_gamut.sum() < 250
    assert np.all(np.isfinite(found.rgb))
    np.testing.assert_allclose(model.linear(found.rgb), np.clip(found.linear, 0, 1), atol=1e-9)
    cost = delta_e(model.xyz(found.rgb), wanted, model.white_xyz)
    np.testing.assert_allclose(found.cost, cost, atol=1e-6)
    assert np.all(found.cost[~found.in_gamut] > 0)
    report = found.report()
    assert report["out_of_gamut"] == (~found.in_gamut).sum()
    assert report["largest_cost"] == found.cost.max()


def test_desaturated_colours_keep_hue_and_luminance(model, rng):
    """On the straight line from grey to the wanted colour, of the same luminance, and on the surface of the gamut."""
    colours = vd.grid_colours(51)
    wanted = model.black_xyz + (2.0 * (model.linear(colours) - 0.3) + 0.3) @ model.matrix.T
    found = model.backward(wanted, "desaturate")
    reachable = (wanted[:, 1] > model.black_xyz[1]) & (wanted[:, 1] < model.xyz(np.ones(3))[1])
    chosen = ~found.in_gamut & reachable
    assert chosen.sum() > 50
    shown = model.xyz(found.rgb)[chosen]
    np.testing.assert_allclose(shown[:, 1], wanted[chosen, 1], rtol=1e-9)
    light = model.linear(found.rgb[chosen])
    share = model.matrix[1] / model.matrix[1].sum()
    grey = (light @ share)[:, None]
    edge = np.minimum(light.min(axis=1), 1 - light.max(axis=1))
    np.testing.assert_allclose(edge, 0, atol=1e-9)
    cross = np.cross(light - grey, found.linear[chosen] - grey)
    np.testing.assert_allclose(cross, 0, atol=1e-8)
    # and beyond white or below black it is white or black
    ends = model.backward([3 * model.white_xyz, 0 * model.white_xyz - 1], "desaturate")
    np.testing.assert_allclose(ends.rgb, [[1, 1, 1], [0, 0, 0]], atol=1e-12)


@pytest.mark.parametrize(
    ("colours", "words"),
    [
        (lambda rgb: rgb[1:], "black"),
        (lambda rgb: rgb[:-1], "white"),
        (lambda rgb: rgb[rgb[:, 1] == rgb[:, 0]], "red alone"),
    ],
)
def test_readings_that_are_missing_are_named(ideal, colours, words):
    rgb = colours(vd.ramp_colours(10))
    with pytest.raises(InputError, match=words):
        vd.fit(ideal.measure(rgb))


def test_bad_requests(model):
    with pytest.raises(InputError, match="finite"):
        model.backward([np.nan, 1, 1])
    with pytest.raises(InputError, match="shape"):
        model.backward(np.ones(4))
    with pytest.raises(InputError, match="did you mean 'clip'"):
        model.backward(np.ones(3), "clp")
    with pytest.raises(InputError, match="signal of 1.2"):
        vd.Readings([[1.2, 0, 0]], np.ones((1, 41)), np.linspace(380, 780, 41))
    with pytest.raises(InputError, match="not finite"):
        vd.Readings([[1, 0, 0]], np.full((1, 41), np.nan), np.linspace(380, 780, 41))
    with pytest.raises(InputError, match="divisor"):
        vd.grid_colours(80)


def test_the_package_is_light_to_import():
    """Neither colour-science nor matplotlib is loaded before something is computed or drawn."""
    import subprocess
    import sys

    code = (
        "import sys, vgonio.display; print([m for m in ('colour', 'matplotlib', 'lmfit', 'PIL') if m in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
