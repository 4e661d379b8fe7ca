"""The same pair gives the same figures everywhere, and what a figure cannot tell is said in its place."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import xarray as xr

from vgonio import models
from vgonio.compare import compare, explained_shares, fit_global_shift, fit_local_shift
from vgonio.compare.bright import bright, bright_spectra, numerical_floor
from vgonio.compare.spectra import inside_table
from vgonio.compare.summary import summary
from vgonio.errors import InputError, MaterialError
from vgonio.report import page

W = np.arange(400.0, 701, 50)
ANGLES = np.array([0.0, 20, 40, 60]), np.arange(-60.0, 61, 20)


def made(scale=1.0, noise=0.02, seed=0, wavelength=W, **attrs):
    data = models.evaluate("clausen-2022", *ANGLES, wavelength, alpha=0.35, h=1.5e-3, w=3.0, material="Al")
    rng = np.random.default_rng(seed)
    f = scale * data.brdf * (1 + noise * rng.standard_normal(data.brdf.shape))
    return xr.Dataset({"brdf": f, "brdf_stderr": noise * f}, attrs={"method": "rays: geometric optics", **attrs})


def waves(theory, **keywords):
    return made(method=f"waves: {theory}", theory=theory, **keywords)


RAYS = made()
KIRCHHOFF = waves("kirchhoff", scale=2.0, seed=1)
MEASURED = made(scale=1.3, seed=2, method="measured")


def rows(comparison):
    return {(row["of"], row["quantity"]): row for row in summary(comparison)}


def test_a_pair_has_the_same_figures_in_any_company():
    """In either order, with a measurement beside it, and in the verdict of the result that holds it."""
    found = [
        compare({"waves": KIRCHHOFF, "rays": RAYS}),
        compare({"rays": RAYS, "waves": KIRCHHOFF}),
        compare({"rays": RAYS, "measured": MEASURED, "waves": KIRCHHOFF}),
    ]
    assert [f.attrs["reference"] for f in found] == ["rays", "rays", "measured"]
    pairs = [f.sel(pair="waves and rays") for f in found]
    difference = (KIRCHHOFF.brdf - RAYS.brdf).values
    expected = float(np.sqrt(np.mean(difference**2)) / RAYS.brdf.mean())
    for pair in pairs:
        assert float(pair["nrmse"]) == pytest.approx(expected, rel=1e-12)
        for name in ("median_difference", "delta_e_mean", "delta_e_colour", "nrmse_stderr"):
            assert float(pair[name]) == pytest.approx(float(pairs[0][name]), rel=1e-12), name
    tree = xr.DataTree.from_dict({"rays": RAYS, "waves": KIRCHHOFF})
    shown = " ".join(str(tree.vgonio.verdict()).split())
    share, error = 100 * expected, 100 * float(pairs[0]["nrmse_stderr"])
    told = re.search(r"NRMSE over the mean of .*?: ([\d.]+) ± ([\d.]+) %", shown)
    assert float(told[1]) == pytest.approx(share, abs=error)
    assert float(told[2]) == pytest.approx(error, rel=0.3)
    assert re.search(r"colour alone [\d.± ]+ \(of \d+ directions where both are bright\)", shown)


def test_asked_for_it_is_the_reference_of_its_pairs_alone():
    found = compare({"rays": RAYS, "measured": MEASURED, "waves": KIRCHHOFF}, reference="waves")
    assert set(found.pair.values.tolist()) == {"rays and waves", "measured and waves", "rays and measured"}


def test_the_median_slope_is_that_of_bright_directions():
    """Dark directions with a steep slope of their own: the median, its count and the page's means leave them out."""
    steep = xr.DataArray(1 + 0.01 * (W - 600), dims="wavelength", coords={"wavelength": W})
    dark = 1e-5 * float(RAYS.brdf.max()) * steep.clip(0.01)
    data = RAYS.where(RAYS.theta_o < 5, RAYS * 0 + dark)
    both = compare({"a": data, "waves": KIRCHHOFF})
    lit = bright_spectra(data)
    np.testing.assert_array_equal(both.slope_bright.sel(result="a"), lit)
    slopes = both.slope.sel(result="a")
    (name,) = [q for of, q in rows(both) if of == "a" and q.startswith("median slope")]
    assert f"({int(lit.sum())} of {slopes.size} directions" in name
    value = rows(both)["a", name]["value"]
    assert value == pytest.approx(float(slopes.where(lit).median()), rel=1e-9)
    assert abs(float(slopes.median()) - value) > 1e-4


def test_below_the_numerical_error_of_waves_nothing_is_bright():
    loose = KIRCHHOFF.assign_attrs(error_achieved=0.2)
    assert numerical_floor(loose) == 0.2
    assert numerical_floor(RAYS.assign_attrs(error_achieved=0.2)) == 0  # of rays a standard error, not a floor
    peak = loose.brdf.max("theta_o")
    np.testing.assert_array_equal(bright(loose), loose.brdf > 0.2 * peak)
    assert int(bright(loose).sum()) < int(bright(KIRCHHOFF).sum())
    # of rays, what does not exceed its own error
    noisy = RAYS.assign(brdf_stderr=RAYS.brdf * xr.where(RAYS.theta_o > 0, 1.5, 0.1))
    assert not bright(noisy).sel(theta_o=20).any()
    assert bright(noisy).sel(theta_o=-20).all()


def test_a_fit_that_is_no_shift_of_this_form_has_words_for_figures():
    """Slopes of ±0.3 %/nm at random over directions: no height, offset, exponent or explained share of the fit."""
    rng = np.random.default_rng(3)
    slope = xr.DataArray(3e-3 * rng.choice([-1, 1], (4, 7)), dims=("theta_i", "theta_o"))
    line = 1 + slope * xr.DataArray(W - 600, dims="wavelength")
    data = RAYS.assign(brdf=line.clip(0.05) * 0.3, brdf_stderr=0 * RAYS.brdf + 1e-3)
    fit = fit_global_shift(data, None, 0.0)
    assert float(fit.r2) < 0.5
    left_out = json.loads(explained_shares(data, {"same": data}, None).attrs["left_out"])
    assert "no explanation" in left_out["global shift"]
    opposite = data.assign(brdf=0.6 - data.brdf).assign_attrs(KIRCHHOFF.attrs)
    found = compare({"waves": opposite, "measured": data.assign_attrs(method="measured")}, material=None)
    table = rows(found)
    for quantity in ("height h of the slope", "offset t_y of the slope"):
        assert table["measured", quantity]["value"] is None
        assert table["measured", quantity]["unit"].startswith("no s")
    assert table["measured", "r2 of the global shift"]["value"] is not None
    assert "global shift" not in found.explanation.values.tolist()
    why = table["explained share of measured by global shift", "left out"]["unit"]
    assert "no explanation" in why
    (share,) = [row for (of, q), row in table.items() if of == "waves" and q.startswith("explained share")]
    assert share["value"] < 0
    assert "worse than no shift" in share["quantity"]
    assert "σ" not in share["quantity"]


def test_a_wavelength_outside_of_the_table_costs_itself_alone():
    """1064 nm, where the table of Cheng's aluminium ends at 1000: left out with words, the shift is of the rest."""
    whole = made(method="measured")
    infrared = xr.concat([whole, whole.isel(wavelength=[-1]).assign_coords(wavelength=[1064.0])], "wavelength")
    infrared.attrs = whole.attrs
    kept, words = inside_table(infrared, "Al")
    assert kept.sizes["wavelength"] == whole.sizes["wavelength"]
    assert words.startswith("1064 nm: the table of 'Al' ends there")
    for fit in (fit_local_shift, fit_global_shift):
        a, b = (fit(d, "Al", 1.0) for d in (infrared, whole))
        name = "slope" if fit is fit_local_shift else "slope_global"
        np.testing.assert_allclose(a[name], b[name], rtol=1e-9)
        assert a.attrs["wavelengths_left_out"] == words
        assert b.attrs["wavelengths_left_out"] == ""
    assert fit_local_shift(infrared, None, 0.0).attrs["wavelengths_left_out"] == ""
    found = compare({"rays": RAYS, "measured": infrared}, p=1.0)
    assert json.loads(found.attrs["skipped"])["wavelengths of the shift of measured"] == words
    assert np.isfinite(found["shift_h"].sel(result="measured"))
    with pytest.raises((InputError, MaterialError)):
        fit_local_shift(infrared.assign_coords(wavelength=infrared.wavelength * 1e4), "Al", 1.0, 6e6)


def test_a_colour_says_of_how_many_directions_it_is():
    found = compare({"waves": KIRCHHOFF, "rays": RAYS})
    row = rows(found)["waves and rays", "directions of the colour alone, both bright"]
    count = int((bright_spectra(RAYS) & bright_spectra(KIRCHHOFF)).sum())
    assert row["value"] == count
    assert int(found.directions_of_colour[0]) == count


def test_the_page_shows_no_parameters_of_what_is_no_shift(tmp_path):
    rng = np.random.default_rng(3)
    slope = xr.DataArray(3e-3 * rng.choice([-1, 1], (4, 7)), dims=("theta_i", "theta_o"))
    line = (1 + slope * xr.DataArray(W - 600, dims="wavelength")).clip(0.05)
    data = RAYS.assign(brdf=line * 0.3, brdf_stderr=0 * RAYS.brdf + 1e-3)
    from vgonio.report.shifts import global_fit_table

    table = global_fit_table(compare({"rays": data, "waves": KIRCHHOFF}, material=None), {})
    (row,) = [r for r in table.rows if r[0] == "rays"]
    assert row[1].startswith("no s")
    assert row[2:5] == ("–", "–", "–")
    assert page(xr.DataTree.from_dict({"rays": data}), tmp_path / "p.html")


def test_the_page_says_below_what_the_waves_know_nothing():
    from vgonio.report.sections import floor_words

    assert "numerical error of waves, 0.2 % of the largest" in floor_words(
        {"waves": KIRCHHOFF.assign_attrs(error_achieved=0.002)}
    )
    assert floor_words({"rays": RAYS}) == ""
