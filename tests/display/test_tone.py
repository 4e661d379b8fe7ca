"""Tone curves rise and have an inverse whatever was measured; few levels suffice."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio.display import ramp_colours, tone_curve
from vgonio.errors import InputError

FINE = np.linspace(0, 1, 4001)


def slow_isotonic(y: np.ndarray) -> np.ndarray:
    """Min-max formula (Barlow 1972): the value at i is max over j ≤ i of min over k ≥ i of the mean of y[j…k]."""
    n = len(y)
    return np.array([max(min(y[j : k + 1].mean() for k in range(i, n)) for j in range(i + 1)) for i in range(n)])


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.1, 0.5])
@pytest.mark.parametrize("levels", [4, 10, 18, 64])
def test_curves_rise_and_have_an_inverse(rng, noise, levels):
    v = np.linspace(0, 1, levels)
    curve, top = tone_curve(v, 7 * (v**2.2 + noise * rng.standard_normal(levels)))
    light = curve(FINE)
    assert top > 0
    assert np.all(np.diff(light) > 0)
    assert light[0] == 0
    assert light[-1] == 1
    # the inverse is found to rounding of the light; the signal itself only where the curve is not flat
    np.testing.assert_allclose(curve(curve.inverse(light)), light, rtol=0, atol=1e-14)
    back = curve.inverse(light)
    assert np.all(np.diff(back) >= 0)
    if noise == 0:
        np.testing.assert_allclose(back, FINE, atol=1e-9)


def test_levels_are_the_nearest_rising_sequence(rng, agreement):
    v = np.linspace(0, 1, 25)
    y = v**2 + 0.08 * rng.standard_normal(25)
    curve, top = tone_curve(v, y)
    wanted = np.clip(slow_isotonic(y), 0, None)
    wanted[0] = 0
    # 10⁻⁶ of the level is mixed in so that plateaus have an inverse
    error = np.abs(curve.light - wanted / wanted[-1]).max()
    agreement("levels of tone curves", "min-max formula of isotonic regression", error, 1.2e-6)
    assert top == pytest.approx(wanted[-1])


TONES = {
    "gamma": lambda v: v**2.2,
    "linear": lambda v: v,
    "srgb": lambda v: np.where(v < 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4),
    "s-curve": lambda v: 1.6 * v**2.8 / (1 + 0.6 * v**3.5),
    "offset": lambda v: np.clip(1.05 * v - 0.05, 0, None) ** 2.2,
}


@pytest.mark.parametrize(
    ("tone", "ten", "eighteen"),
    [("gamma", 0.01, 0.01), ("linear", 0.01, 0.01), ("srgb", 0.6, 0.25), ("s-curve", 0.1, 0.02), ("offset", 0.2, 0.06)],
)
def test_few_levels_suffice(tone, ten, eighteen):
    """Largest error in L*: what was found (0.46, 0.19 for sRGB, below 0.12 else), with a margin of a third."""
    true = TONES[tone]
    for levels, limit in ((10, ten), (18, eighteen)):
        v = ramp_colours(levels)[1:levels, 0]
        curve, _ = tone_curve([0, *v], true(np.array([0, *v])))
        assert np.abs(lightness(curve(FINE)) - lightness(true(FINE))).max() < limit


def lightness(y: np.ndarray) -> np.ndarray:
    """CIE L* of relative luminance."""
    return np.where(y > (6 / 29) ** 3, 116 * np.cbrt(y) - 16, (29 / 3) ** 3 * y)


def test_repeated_levels_are_averaged(rng):
    v = np.linspace(0, 1, 12)
    once, _ = tone_curve(v, v**2)
    shift = 0.01 * np.array([1, -1])[:, None] * np.ones(12)
    twice, _ = tone_curve(np.tile(v, 2), (v**2 + shift).ravel())
    np.testing.assert_allclose(twice.light, once.light, atol=1e-12)


def test_signals_outside_are_clipped_and_never_nan():
    curve, _ = tone_curve(np.linspace(0, 1, 10), np.linspace(0, 1, 10) ** 2)
    assert curve([-1.0, 2.0]).tolist() == [0, 1]
    assert curve.inverse([-1.0, 0.0, 1.0, 5.0]).tolist() == [0, 0, 1, 1]


@pytest.mark.parametrize(
    ("level", "light", "words"),
    [
        ([0, 0.5, 1], [0, 0.2, 1], "at least 4"),
        ([0.1, 0.4, 0.7, 1], [0, 0.2, 0.5, 1], "from 0.1 to 1"),
        ([0, 0.4, 0.7, 0.9], [0, 0.2, 0.5, 1], "from 0 to 0.9"),
        ([0, 0.4, 0.7, 1], [0, 0, 0, 0], "no light above black"),
        ([0, 0.4, 0.7, 1], [0, 0.2, np.nan, 1], "finite"),
        ([0, 0.4, 0.7, 1], [0, 0.2, 1], "two equal lists"),
    ],
)
def test_levels_that_make_no_curve(level, light, words):
    with pytest.raises(InputError, match=words):
        tone_curve(level, light)
