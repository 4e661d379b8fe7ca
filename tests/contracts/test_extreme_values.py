"""Values at the ends of what numbers hold: materials, models, displays, JSON give the limit or say what is wrong."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator

import numpy as np
import pytest

import vgonio as vg
from vgonio.cli.common import print_json
from vgonio.errors import InputError, MaterialError
from vgonio.materials import Material, film, fresnel

COS = np.array([1e-100, 1e-12, 1e-6, 1e-3, 0.1, 0.5, 1.0])


@pytest.fixture(autouse=True)
def no_warnings_of_numpy() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        yield


def constant(index: complex) -> Material:
    return Material(f"n + ik = {index}", "made up", lambda um: np.full(np.shape(um), index, complex), (1.0, 1e6))


# ---- materials
def test_an_index_of_one_reflects_nothing_at_any_angle():
    """√(n² − sin²) would be rounding at grazing incidence: 3e-11 of the light at cos θ_i = 1e-6, all at 1e-12."""
    rs, rp = fresnel(COS, 1.0)
    assert not rs.any()
    assert not rp.any()


@pytest.mark.parametrize("excess", [1e-6, 1e-9, 1e-12])
def test_an_index_close_to_one(excess):
    """r_s → (c − √(c² + 2δ))/(c + √(c² + 2δ)) for n = 1 + δ (δ² is beyond the digits of 2δ)."""
    root = np.sqrt(COS**2 + 2 * excess + excess**2)
    expected = -(2 * excess + excess**2) / (COS + root) ** 2
    # δ is known to 2.2e-16 in 1 + δ
    assert np.allclose(fresnel(COS, 1 + excess)[0].real, expected, rtol=4e-16 / excess, atol=1e-15)


@pytest.mark.parametrize("index", [1e-100, 1e99, 1e99j, 1e100])
def test_indices_far_from_all_matter(index):
    reflectance = constant(index).reflectance(COS, 550.0)
    assert np.all((reflectance >= 0) & (reflectance <= 1 + 1e-12))
    with pytest.raises(MaterialError, match="up to"):
        constant(1e200).reflectance(COS, 550.0)


def test_films_of_air_and_of_nothing():
    glass, air = constant(1.5), constant(1.0)
    assert not film(air, 100.0, on=air).reflectance(COS, 550.0).any()
    assert film(glass, 0.0, on=air).reflectance(COS, 550.0).max() < 1e-20
    bare = glass.reflectance(COS, 550.0)
    assert np.allclose(film(air, 0.0, on=glass).reflectance(COS, 550.0), bare, atol=1e-9)


# ---- models
@pytest.mark.parametrize(
    ("model", "name", "others"),
    [
        ("cook-torrance-1982", "alpha", {}),
        ("cook-torrance-1982", "eta", {"alpha": 0.2}),
        ("beckmann-1963", "alpha", {}),
        ("harvey-1976", "l", {"k_s": 1.0, "k_d": 0.1}),
        ("krywonos-2011", "b_um", {"rms_um": 0.01}),
    ],
)
def test_parameters_of_models_at_both_ends(model, name, others):
    def value(size: float) -> np.ndarray:
        return vg.models.evaluate(model, [0, 40], [-40, 0, 30], [500, 600], **others, **{name: size}).brdf.values

    for size in (1e-50, 1e50) if name != "eta" else (1.0, 1e50):
        assert np.isfinite(value(size)).all()
    for size in (1e-200, 1e300):
        with pytest.raises(InputError, match=name):
            value(size)


def test_steep_spectra_fall_to_nothing():
    steep = vg.models.evaluate("krywonos-2011", [40], [-40, 0], [500], rms_um=0.01, b_um=1.0, c_psd=1e6).brdf
    assert steep.sel(theta_o=0).item() == 0
    assert steep.sel(theta_o=-40).item() > 0


# ---- displays
@pytest.mark.parametrize("factor", [1e-200, 1.0, 1e200])
def test_the_condition_of_primaries_does_not_know_how_bright_they_are(factor):
    readings = vg.display.virtual_display().measure(vg.display.ramp_colours(16))
    brighter = vg.display.Readings(readings.rgb, readings.spectra * factor, readings.wavelength_nm)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vg.errors.VgonioWarning)  # such a white is implausible
        models = [vg.display.fit(r) for r in (readings, brighter)]
    assert models[1].condition == pytest.approx(models[0].condition, rel=1e-9)


@pytest.mark.parametrize("white", [(0.3, 0.0), (0.3, -0.1), (np.nan, 0.3)])
def test_a_white_without_luminance(white):
    with pytest.raises(InputError, match="white_xy"):
        vg.display.virtual_display(white_xy=white)


# ---- JSON
def test_json_knows_no_infinity(capsys):
    """RFC 8259 has neither NaN nor Infinity: other programs refuse them."""
    print_json({"a": np.float64("inf"), 2: [np.nan, 1.5, None, True], "c": {"d": (np.int64(3), "µ")}})
    text = capsys.readouterr().out
    found = json.loads(text, parse_constant=pytest.fail)
    assert found == {"a": None, "2": [None, 1.5, None, True], "c": {"d": [3, "µ"]}}
