"""Errors of the comparison's figures by draws: against closed forms, and where there can be none."""

from __future__ import annotations

import json

import numpy as np
import pytest

from vgonio import models
from vgonio.cli import main
from vgonio.compare import align, appearance, fit_global_shift
from vgonio.compare.drawn_errors import median_error, standard_errors
from vgonio.compare.looks import READINGS, looks
from vgonio.compare.pair_figures import TEXTS, pair_figures
from vgonio.compare.r2_error import r2_error
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
    found = standard_errors(lambda f: {"mean": float(f.mean()), "one": 1.0}, data, draws=500)
    assert found["mean"] == pytest.approx(SIGMA / np.sqrt(GRID[0].size * GRID[1].size), rel=0.13)
    assert "one" not in found
    assert found == standard_errors(lambda f: {"mean": float(f.mean()), "one": 1.0}, data, draws=500)


TRUTH = {"alpha": 0.3, "h": 1.5e-3}
RELATIVE = 0.01
OF_INDEPENDENT_NOISE = {"delta_e_colour", "r2"}


def repeated(kind, seeds, figures, other):
    """Spread of every figure over measurements repeated with other noise, over the error that they state; by name."""
    grid = np.array([0.0, 20, 60]), np.arange(-80.0, 81, 4), np.arange(450.0, 651, 50)
    truth = [models.evaluate("clausen-2022", *grid, w=3.0, **k) for k in (TRUTH, other)]
    rows = {}
    for k in range(seeds):
        rng = np.random.default_rng(k)
        shape = [1 if kind == "shared" and d == "wavelength" else n for d, n in truth[0].brdf.sizes.items()]
        measured = [
            d.assign(brdf=d.brdf * (1 + RELATIVE * rng.standard_normal(shape)), brdf_stderr=RELATIVE * d.brdf)
            for d in truth
        ]
        for name, pair in figures(*measured).items():
            rows.setdefault(name, []).append(pair)
    values = {name: np.array(pairs) for name, pairs in rows.items()}
    return {name: v[:, 0].std(ddof=1) / np.sqrt(np.mean(v[:, 1] ** 2)) for name, v in values.items()}


def of_pair(reference, predicted):
    return with_errors(pair_figures(*align(reference, predicted), "reference-Y50", 600.0))


def of_all(reference, predicted):
    fit = fit_global_shift(reference, p=1.0)
    r2 = {"r2": (float(fit.r2), r2_error(reference, fit))}
    return of_pair(reference, predicted) | with_errors(looks(reference)[0]) | r2


def with_errors(found):
    stated = [name for name in found if f"{name}_stderr" in found]
    return {name: tuple(float(np.ravel(found[n])[0]) for n in (name, f"{name}_stderr")) for name in stated}


def test_errors_of_all_figures_are_the_spread_of_repeated_measurements(agreement, monkeypatch):
    """Noise of 1 % that is independent from value to value, or shared by each spectrum: the larger spread is stated.

    16 measurements tell a spread to 18 %, 50 draws an error to 10 %: within 2.4 of both.
    """
    monkeypatch.setitem(standard_errors.__kwdefaults__, "draws", 50)
    other = {"alpha": 0.4, "h": 0.5e-3}
    independent, shared = (repeated(kind, 16, of_all, other) for kind in ("independent", "shared"))
    assert set(independent) == {*TEXTS, *READINGS, "reflectance", "tis", "r2"} - {"gloss_85"}
    for name in independent:
        ratio = independent[name] if name in OF_INDEPENDENT_NOISE else shared[name]
        agreement("stated errors of the figures of a comparison", "spread of 16 measurements", ratio, (0.5, 1.5))
        assert max(independent[name], shared[name]) < 1.5


def test_a_difference_that_is_noise_alone_has_the_error_of_noise():
    """Two measurements of the same: their noise is not counted twice, which would be 1.22 times too much."""
    found = repeated("shared", 16, of_pair, TRUTH)
    assert 0.5 < found["nrmse"] < 1.5
    assert 0.5 < found["rmse"] < 1.5


def test_reflectance_has_the_error_of_its_sum():
    """Δρ = π σ √(Σ w²) with weights of a sum near π over 17 angles, both sides averaged: between σπ/√17 and σπ."""
    rows = {r["quantity"]: r for r in appearance("a", noisy())}
    error = rows["reflectance at 0°"]["error"]
    assert np.pi * SIGMA / np.sqrt(17) / 2 < error < np.pi * SIGMA
    bare = {r["quantity"]: r for r in appearance("a", noisy().drop_vars("brdf_stderr"))}
    # what is left is the error of the quadrature
    assert (bare["reflectance at 0°"]["error"] or 0.0) < error
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
    named = [q for q in rows if q.startswith(("NRMSE", "RMSE", "median", "mean dE00", "95th", "largest"))]
    assert len(named) == 7
    assert all(0 < rows[q]["error"] < rows[q]["value"] for q in named)
    assert rows["values compared"]["error"] is None
