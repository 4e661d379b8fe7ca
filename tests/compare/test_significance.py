"""One rule on what counts as a shift, in every table: by the error of h and by how much of the spectra it describes."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio import models
from vgonio.compare import compare, fit_models, model_table, summary
from vgonio.compare.goodness import spectra_r2
from vgonio.compare.significance import no_shift
from vgonio.report.shifts import global_fit_table

GRID = np.arange(0.0, 61, 15), np.arange(-75.0, 76, 15), np.arange(400.0, 761, 40)


def speckled():
    """A neutral lobe whose spectra have slopes of any sign, and curvatures larger than these: no cosine over θ_m."""
    data = models.evaluate("cook-torrance-1982", *GRID, alpha=0.35)
    rng = np.random.default_rng(5)
    x = (data.wavelength.values - 600) / 200
    waves = [rng.standard_normal((*data.brdf.shape[:2], 1)) * np.sin((k + 1) * 2.2 * x) for k in range(3)]
    return data.assign(brdf=data.brdf * (1 + 0.2 * sum(waves)))


@pytest.mark.parametrize(
    ("height", "error", "r2", "said"),
    [(1e-3, 1e-4, 0.9, ""), (1e-3, 1e-4, np.nan, ""), (1e-3, 1e-4, 0.22, "no shift of this form (r² = 0.22)"),
     (1e-3, 1e-4, -0.114, "no shift of this form (r² = −0.11)"), (1e-3, 5e-4, 0.9, "no significant shift"),
     (-6e-4, np.nan, -3.0, "no shift of this form (r² = −3.00)")],
)  # fmt: skip
def test_the_rule(height, error, r2, said):
    assert no_shift(height, error, r2) == said


def test_all_tables_give_one_answer():
    """The table of `compare`, that of the page and that of the models: w and h are said to mean nothing in each."""
    data = {"waves": speckled(), "measured": models.evaluate("clausen-2022", *GRID, alpha=0.3, h=1.5e-3, w=3.0)}
    comparison = compare(data)
    one = comparison.sel(result="waves")
    why = no_shift(float(one.shift_h), float(one.shift_h_stderr), float(one.shift_r2))
    assert why
    rows = {(r["of"], r["quantity"]): r for r in summary(comparison)}
    assert float(one.shift_r2) < 0.5  # so that no figure of the fit is worth quoting
    for quantity in ("height h", "frequency w", "offset t_y"):
        assert rows["waves", f"{quantity} of the slope"]["unit"] == why
        assert rows["waves", f"{quantity} of the slope"]["value"] is None
    page = {row[0]: row for row in global_fit_table(comparison, {}).rows}
    assert page["waves"][1].endswith(why)
    assert page["waves"][2] == "–"
    fits = fit_models(data, ("clausen-2022",))
    words = {r["sample"]: r["parameters"] for r in model_table(data, fits)}
    assert "no shift of this form" in words["waves"] or "no significant shift" in words["waves"]
    # and where there is one, none of them says so
    assert rows["measured", "height h of the slope"]["value"] == pytest.approx(1.5e-3, rel=1e-3)
    assert "no " not in page["measured"][1] + words["measured"]
    assert "w = 3" in words["measured"]


def test_r2_of_the_spectra_is_one_for_the_truth_and_falls_with_the_noise():
    data = models.evaluate("clausen-2022", *GRID, alpha=0.3, h=1.5e-3, w=3.0)
    assert spectra_r2(data, data) == pytest.approx(1.0, abs=1e-12)
    # a factor that no wavelength knows of is no colour
    assert spectra_r2(data, data.assign(brdf=2 * data.brdf)) == pytest.approx(1.0, abs=1e-12)
    assert spectra_r2(speckled(), data) < 0.5
    assert np.isnan(spectra_r2(data.isel(wavelength=[0, 1]), data))


def test_an_exponent_at_its_bound_is_said_and_a_fixed_one_is_not():
    """f ∝ (F/F_n)^7 asks for more than p = 5 allows."""
    data = models.evaluate("cook-torrance-1982", *GRID, alpha=0.35)
    neutral = models.evaluate("cook-torrance-1982", *GRID, alpha=0.35, material="perfect")
    steep = data.assign(brdf=neutral.brdf * (data.brdf / neutral.brdf) ** 7)
    names = [r["quantity"] for r in summary(compare({"a": steep, "b": data})) if r["of"] == "a"]
    assert "Fresnel exponent p (stopped at its bound 5)" in names
    for choice in ({"p": 5.0}, {"material": None}):
        names = [r["quantity"] for r in summary(compare({"a": steep}, **choice))]
        assert "Fresnel exponent p" in names
