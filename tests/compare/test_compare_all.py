"""The comparison group: names, units, gaps, single wavelengths, mixed grids, the summary and the way to disk."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest
import xarray as xr

from vgonio import compare as vgc
from vgonio import models
from vgonio.compare import compare, delta_e_2000, fit_global_shift, fit_local_shift, nrmse, rmse, summary
from vgonio.errors import FileFormatError, InputError
from vgonio.measure import storage

THETA_I, THETA_O = np.arange(0.0, 61, 20), np.arange(-60.0, 61, 15)
WAVELENGTH = np.arange(400.0, 761, 40)


def model(theta_i=THETA_I, theta_o=THETA_O, wavelength=WAVELENGTH, h=1.5e-3, alpha=0.3) -> xr.Dataset:
    return models.evaluate("clausen-2022", theta_i, theta_o, wavelength, alpha=alpha, h=h, w=3.0)


@pytest.fixture
def results() -> dict[str, xr.Dataset]:
    """Measured with gaps and noise, waves on another grid, rays with black directions."""
    measured = model()
    noise = np.random.default_rng(0).standard_normal(measured.brdf.shape)
    measured["brdf"] = (measured.brdf * (1 + 0.01 * noise)).where(measured.theta_i != measured.theta_o)
    waves = model(THETA_I[1:], np.arange(-75.0, 76, 15), np.arange(400.0, 761, 20), alpha=0.25)
    rays = model(h=0.0)
    rays["brdf"][0, 0] = 0.0
    rays["solid_angle"] = ("theta_o", np.full(THETA_O.size, 1e-3))
    return {"measured": measured, "rays": rays.set_coords("solid_angle"), "waves": waves}


def test_values_are_those_of_the_single_functions(results):
    found = compare(results)
    assert found.result.values.tolist() == ["rays", "waves", "measured"]
    assert found.pair.values.tolist() == ["rays and waves", "rays and measured", "waves and measured"]
    assert found.pair_reference.values.tolist() == ["waves", "measured", "measured"]
    assert found.attrs["reference"] == "measured"
    pair = found.sel(pair="waves and measured")
    reference, predicted = results["measured"], results["waves"]
    assert float(pair.nrmse) == pytest.approx(float(nrmse(reference, predicted)), rel=1e-12)
    assert float(pair.rmse) == pytest.approx(float(rmse(reference, predicted)), rel=1e-12)
    spectral = rmse(reference, predicted, ("theta_i", "theta_o"))
    np.testing.assert_array_equal(pair.rmse_spectral.sel(wavelength=spectral.wavelength), spectral)
    difference = delta_e_2000(reference, predicted)
    on_grid = pair.delta_e_2000.sel(theta_i=difference.theta_i, theta_o=difference.theta_o)
    np.testing.assert_array_equal(on_grid, difference)
    assert float(pair.values_left_out) == 10 * int((THETA_I[1:, None] == THETA_O[None, :]).sum())
    local, fit = fit_local_shift(results["waves"]), fit_global_shift(results["waves"])
    one = found.sel(result="waves", theta_i=local.theta_i, theta_o=local.theta_o)
    np.testing.assert_array_equal(one.slope, local.slope)
    np.testing.assert_array_equal(one.slope_global, fit.slope_global)
    assert float(one.shift_h) == float(fit.h)
    # outside the grid of a result there is nothing
    assert np.isnan(found.slope.sel(result="waves", theta_i=0)).all()
    assert np.isnan(found.slope.sel(result="rays", theta_o=75)).all()
    assert np.isnan(found.slope.sel(result="rays", theta_i=0, theta_o=-60))


def test_units_on_everything_and_a_way_to_disk(results, tmp_path):
    found = compare(results)
    assert all("units" in found[v].attrs and "long_name" in found[v].attrs for v in found.variables)
    tree = xr.DataTree.from_dict({**results, "comparison": found})
    back = storage.open(storage.save(tree, tmp_path / "r.nc"))["comparison"].to_dataset()
    xr.testing.assert_equal(back, found)
    assert back.attrs == found.attrs
    # the comparison of the tree is that of its results, and leaves the comparison itself out
    xr.testing.assert_equal(compare(storage.open(tmp_path / "r.nc")), found)


def test_reference_and_choices(results):
    found = compare(results, reference="rays", material=None, scale="normalised")
    assert found.result.values.tolist() == ["measured", "waves", "rays"]
    # against what was asked for, and a measurement never against another
    assert set(found.pair_reference.values.tolist()) == {"measured", "rays"}
    assert found.attrs["material"] == "none (F = 1)"
    assert found.attrs["delta_e_scale"] == "normalised"
    assert np.nanmax(found.slope_p) == 0
    with pytest.raises(InputError, match="did you mean 'rays'"):
        compare(results, reference="ray")
    with pytest.raises(InputError, match="absolute"):
        compare(results, scale="absolut")


def test_single_wavelength_leaves_colour_and_shift_out_and_says_so():
    found = compare({"rays": model(wavelength=[550.0]), "waves": model(wavelength=[550.0], alpha=0.4)})
    assert {"slope", "delta_e_2000", "shift_h"}.isdisjoint(found.data_vars)
    assert found.nrmse.item() > 0
    skipped = json.loads(found.attrs["skipped"])
    assert set(skipped) == {"local shift of rays", "local shift of waves", "colour of rays and waves"}
    assert "3 wavelengths" in skipped["local shift of rays"]
    assert any(row["quantity"] == "left out" and "3 wavelengths" in row["unit"] for row in summary(found))


def test_few_wavelengths_fix_the_exponent():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = compare({"rays": model(wavelength=[450.0, 550, 650])})
    assert np.all(found.slope_p == 1)
    assert json.loads(found.attrs["skipped"]) == {}
    assert "pair" not in found.dims


def test_what_has_nothing_in_common_is_skipped_not_fatal(results):
    results["far"] = model([65.0], [70.0, 75])
    results["empty"] = results["rays"].where(False)
    results["far red"] = model(wavelength=np.arange(800.0, 901, 20))
    found = compare(results)
    skipped = json.loads(found.attrs["skipped"])
    assert "no theta_i in common" in skipped["far and measured"]
    assert "no wavelengths in common" in skipped["far red and measured"]
    assert "usable spectra" in skipped["global shift of empty"]
    assert "outside the wavelengths" in skipped["local shift of far red"]
    assert np.isnan(found.slope.sel(result="empty")).all()
    assert np.isnan(found.nrmse.sel(pair="rays and empty"))
    assert "rays and measured" in found.pair
    for row in summary(found):
        assert set(row) == {"of", "quantity", "value", "error", "unit"}
        assert row["value"] is None or np.isfinite(row["value"])


def test_a_material_outside_its_table_costs_the_shift_only():
    data = {"rays": model(wavelength=[450.0, 500, 600, 650, 900])}
    data["waves"] = data["rays"] * 1.1
    found = compare(data, material="SiO2:Malitson", p=1.0)  # real index: fine
    assert np.isfinite(found.slope).all()
    skipped = json.loads(compare(data, material="Unobtainium").attrs["skipped"])
    assert "unknown material" in skipped["local shift of rays"]


def test_several_theories_become_several_results(results):
    theories = xr.concat([results["rays"], 2 * results["rays"]], "theory", join="exact").assign_coords(
        theory=["kirchhoff", "harvey-shack"]
    )
    found = compare({"waves": theories})
    assert found.result.values.tolist() == ["waves:kirchhoff", "waves:harvey-shack"]
    assert found.nrmse.item() == pytest.approx(
        float(np.sqrt((theories.brdf[0] ** 2).mean()) / (2 * theories.brdf[0].mean()))
    )


def test_hemispheres_and_in_plane_do_not_mix(results):
    shape = (1, 3, WAVELENGTH.size)
    hemisphere = xr.Dataset(
        {"brdf": (("theta_i", "cell", "wavelength"), np.linspace(1, 2, np.prod(shape)).reshape(shape))},
        coords={
            "theta_i": [20.0],
            "wavelength": WAVELENGTH,
            "cell": [0, 1, 2],
            "theta_o": ("cell", [0.0, 30, 30]),
            "phi_o": ("cell", [0.0, 0, 180]),
        },
    )
    found = compare({"rays": hemisphere, "waves": 1.1 * hemisphere})
    assert found.slope.dims == ("result", "theta_i", "cell")
    assert found.delta_e_2000.dims == ("pair", "theta_i", "cell")
    assert found.nrmse.item() == pytest.approx(
        0.1 / 1.1 * float(np.sqrt((hemisphere.brdf**2).mean()) / hemisphere.brdf.mean())
    )
    mixed = compare({"rays": hemisphere, "measured": results["measured"]})
    assert "hemisphere" in json.loads(mixed.attrs["skipped"])["rays"]
    assert mixed.result.values.tolist() == ["measured"]


def test_summary_rows(results):
    rows = summary(compare(results))
    table = {(row["of"], row["quantity"]): row for row in rows}
    assert table["waves and measured", "NRMSE of the BRDF"]["unit"] == "1"
    height = table["measured", "height h of the slope"]
    assert abs(height["value"] - 1.5e-3) < 4 * height["error"]
    assert height["unit"] == "nm-1"
    assert json.loads(json.dumps(rows)) == rows


def test_nothing_to_compare():
    with pytest.raises(InputError, match="nothing to compare"):
        compare({})
    with pytest.raises(InputError, match="nothing to compare"):
        compare(xr.DataTree())
    with pytest.raises(FileFormatError, match="'a'"):
        compare({"a": xr.Dataset({"x": 1})})


def test_public_names():
    assert {"nse", "rmse", "nrmse", "align", "rgb_map", "delta_e_2000", "fit_local_shift", "fit_global_shift"} <= set(
        vgc.__all__
    )
    assert all(callable(getattr(vgc, name)) for name in vgc.__all__)
