"""The commands fit and compare on measured data: tables, JSON, files, figures, bad usage."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import vgonio as vg
from vgonio import models
from vgonio.cli import main
from vgonio.compare import open_fit
from vgonio.measure import readers

DEMO = Path(__file__).resolve().parents[1] / "examples" / "demo" / "measured_virtual.json"


def run(*arguments: str | Path) -> int:
    return main([str(a) for a in arguments])


@pytest.fixture(scope="module")
def small(tmp_path_factory) -> Path:
    """A small measurement: every other angle and wavelength of the demo's."""
    data = readers.read(DEMO).isel(wavelength=slice(None, None, 2), theta_i=slice(None, None, 2))
    path = tmp_path_factory.mktemp("data") / "sample.json"
    return readers.write(data, path)


def test_fit_prints_both_models_and_the_shift(small, capsys):
    assert run("fit", small) == 0
    out = capsys.readouterr().out
    for words in ("global shift h", "cook-torrance-1982", "clausen-2022", "alpha = 0.36", "gloss 60°", "r2 > 0.95"):
        assert words in out


def test_fit_as_json_with_choices(small, capsys):
    assert run("fit", small, "--json", "--p", "0", "--wavelengths", "420:700", "--errors", "none", "--model",
               "clausen-2022", "--exponent", "2", "--scale", "normalised", "--quiet") == 0  # fmt: skip
    found = json.loads(capsys.readouterr().out)
    assert set(found) == {"shift", "models", "appearance", "delta_e_scale"}
    assert found["delta_e_scale"] == "normalised"
    row = found["models"][0]
    assert row["model"] == "clausen-2022"
    assert "h = 0.001" in row["parameters"]
    shift = {r["quantity"]: r["value"] for r in found["shift"]}
    assert shift["global shift p"] == 0


def test_fits_are_kept_and_drawn(small, tmp_path, capsys):
    assert run("fit", small, "-o", tmp_path / "fits.nc", "--figures", tmp_path / "figures") == 0
    tree = vg.open(tmp_path / "fits.nc")
    assert float(tree["sample/clausen-2022"]["h"]) == pytest.approx(1.8e-3, rel=0.02)
    names = {p.name for p in (tmp_path / "figures").iterdir()}
    assert names == {"sample_shift.png", "sample_models.png", "slopes.png"}
    assert "figure:" in capsys.readouterr().out
    assert run("fit", small, "--model", "clausen-2022", "-o", tmp_path / "one.json", "--quiet") == 0
    assert float(open_fit(tmp_path / "one.json")["alpha"]) == pytest.approx(0.364, rel=0.01)


def test_several_samples_make_one_table(small, tmp_path, capsys):
    other = models.evaluate(
        "cook-torrance-1982", [0, 30, 60], np.arange(-80, 81, 10), np.arange(400, 701, 50), alpha=0.2
    )
    readers.write(other, tmp_path / "other.json")
    assert run("fit", small, tmp_path / "other.json", "--json") == 0
    rows = json.loads(capsys.readouterr().out)["models"]
    assert [(r["sample"], r["model"]) for r in rows] == [
        (s, m) for s in ("sample", "other") for m in ("cook-torrance-1982", "clausen-2022")
    ]


def test_dielectric_with_few_wavelengths(tmp_path, capsys):
    data = models.evaluate(
        "cook-torrance-1982", [0, 30, 60], np.arange(-80, 81, 10), [450, 550, 600, 650], alpha=0.3, eta=1.5, k_d=0.4
    )
    readers.write(data, tmp_path / "white.json")
    assert run("fit", tmp_path / "white.json", "--material", "none", "--model", "cook-torrance-1982") == 0
    assert "eta = 1.5" in capsys.readouterr().out


def test_list_of_models(capsys):
    assert run("fit", "--list", "--json") == 0
    assert {r["model"] for r in json.loads(capsys.readouterr().out)} == set(models.MODELS)


def test_compare_says_how_much_is_explained(small, tmp_path, capsys):
    data = readers.read(small)
    grid = data.theta_i.values, data.theta_o.values, data.wavelength.values
    readers.write(models.evaluate("clausen-2022", *grid, alpha=0.364, h=0.9e-3, w=3.0), tmp_path / "half.json")
    assert run("compare", tmp_path / "half.json", small, "--json", "--figures", tmp_path / "f", "--quiet") == 0
    rows = {(r["of"], r["quantity"].split(" (")[0]): r for r in json.loads(capsys.readouterr().out)}
    half = rows["half", "explained share"]
    assert abs(half["value"] - 0.75) < 4 * half["error"] + 0.02
    assert rows["sample", "reflectance at 0°"]["value"] > 0
    assert (tmp_path / "f" / "explained.png").stat().st_size > 5000


@pytest.mark.parametrize(
    "arguments, words",
    [
        ([], "nothing to fit"),
        (["SMALL", "--model", "clausen"], "did you mean 'clausen-2022'"),
        (["SMALL", "--model", "two-shifts"], "--rays"),
        (["SMALL", "--rays", "SMALL"], "brdf_by_bounce"),
        (["SMALL", "--wavelengths", "700:400"], "LOW:HIGH"),
        (["SMALL", "--p", "x"], "no number"),
        (["SMALL", "-o", "a.json"], "one JSON file"),
        (["SMALL", "-o", "a.txt"], ".nc"),
        (["SMALL", "--errors", "x"], "sandwich"),
        (["nowhere.json"], "no such file"),
    ],
)
def test_bad_usage(small, tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert run("fit", *(str(small) if a == "SMALL" else a for a in arguments)) == 2
    captured = capsys.readouterr()
    assert words in captured.err
    assert len(captured.err.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_json_stays_json_with_figures_and_broken_physics_is_noted(tmp_path, capsys):
    """A slope that turns the spectrum over: the fit finds it, and says that the model is negative there."""
    angles = np.arange(-80, 81, 20)
    data = models.evaluate("clausen-2022", [0, 40, 80], angles, [400, 500, 600, 700, 780], alpha=0.3, h=4e-3, w=3.0)
    readers.write(data, tmp_path / "steep.json")
    assert run("fit", tmp_path / "steep.json", "--model", "clausen-2022", "--json", "--figures", tmp_path / "f") == 0
    row = json.loads(capsys.readouterr().out)["models"][0]
    assert "h = 0.004" in row["parameters"]
    assert any("of the incident power" in note or "is negative" in note for note in row["notes"])
