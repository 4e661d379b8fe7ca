"""Errors of the comparison's figures by draws: against closed forms, and where there can be none."""

from __future__ import annotations

import json

import numpy as np
import pytest

from vgonio import models
from vgonio.cli import main
from vgonio.compare import appearance, rmse
from vgonio.compare.drawn_errors import median_error, standard_errors
from vgonio.measure import formats

GRID = np.arange(0.0, 61, 15), np.arange(-80.0, 81, 10), np.arange(400.0, 701, 50)
SIGMA = 0.01


def noisy(seed=None, **parameters):
    """A lobe with errors of 0.01 sr⁻¹ everywhere, and with their noise where a seed is given."""
    data = models.evaluate("cook-torrance-1982", *GRID, alpha=0.4, **parameters)
    noise = 0.0 if seed is None else SIGMA * np.random.default_rng(seed).standard_normal(data.brdf.shape)
    return data.assign(brdf=data.brdf + noise, brdf_stderr=SIGMA + 0 * data.brdf)


def test_the_error_of_a_mean_is_that_of_noise_shared_by_spectra():
    """σ/√(directions) where a spectrum shares it, σ/√(values) where it does not: the larger; known to 3 %."""
    data = noisy()
    found = standard_errors(lambda d: {"mean": float(d.brdf.mean()), "one": 1.0}, data, draws=500)
    assert found["mean"] == pytest.approx(SIGMA / np.sqrt(GRID[0].size * GRID[1].size), rel=0.13)
    assert "one" not in found
    assert found == standard_errors(lambda d: {"mean": float(d.brdf.mean()), "one": 1.0}, data, draws=500)


def test_the_error_of_rmse_is_the_scatter_of_repeated_measurements():
    """40 pairs of measurements scatter as one pair says; both spreads are known to 11 % (one standard error)."""
    values = [float(rmse(noisy(2 * k, k_d=0.1), noisy(2 * k + 1))) for k in range(40)]
    said = standard_errors(lambda a, b: {"rmse": float(rmse(a, b))}, noisy(k_d=0.1), noisy(), draws=40)["rmse"]
    # the noise here is independent from value to value, that of a whole spectrum weighs √7 times as much
    assert np.std(values, ddof=1) < said < 4 * np.std(values, ddof=1)


def test_without_errors_of_both_there_is_none():
    bare = noisy().drop_vars("brdf_stderr")
    for pair in ((bare, noisy()), (noisy(), bare), (noisy(), noisy().assign(brdf_stderr=0 * noisy().brdf))):
        assert standard_errors(lambda a, b: {"rmse": float(rmse(a, b))}, *pair) == {}


def test_reflectance_has_the_error_of_its_sum():
    """Δρ = π σ √(Σ w²) with weights of a sum near π over 17 angles, both sides averaged: between σπ/√17 and σπ."""
    rows = {r["quantity"]: r for r in appearance("a", noisy())}
    error = rows["reflectance at 0°"]["error"]
    assert np.pi * SIGMA / np.sqrt(17) / 2 < error < np.pi * SIGMA
    bare = {r["quantity"]: r for r in appearance("a", noisy().drop_vars("brdf_stderr"))}
    assert bare["reflectance at 0°"]["error"] is None
    assert bare["reflectance at 0°"]["value"] == rows["reflectance at 0°"]["value"]


def test_error_of_a_median():
    """1.2533 σ/√n for a normal distribution."""
    values = np.random.default_rng(1).standard_normal(2000)
    assert median_error(values) == pytest.approx(1.2533 / np.sqrt(2000), rel=0.35)
    assert np.isnan(median_error(values[:4]))


def test_compare_prints_them(tmp_path, capsys):
    for name, data in (("a.json", noisy(1)), ("b.json", noisy(2, k_d=0.1))):
        formats.write(data, tmp_path / name)
    assert main(["compare", str(tmp_path / "a.json"), str(tmp_path / "b.json"), "--json"]) == 0
    rows = {r["quantity"]: r for r in json.loads(capsys.readouterr().out) if r["of"] == "a and b"}
    named = [q for q in rows if q.startswith(("NRMSE", "RMSE", "mean dE00", "95th", "largest"))]
    assert len(named) == 6
    assert all(0 < rows[q]["error"] < rows[q]["value"] for q in named)
    assert rows["values compared"]["error"] is None
