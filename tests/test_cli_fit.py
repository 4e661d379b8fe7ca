"""The commands fit and compare on measured data: tables, JSON, files, figures, bad usage."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import vgonio as vg
from vgonio import models
from vgonio.cli import main
from vgonio.compare import fit_global_shift, open_fit
from vgonio.errors import InputError
from vgonio.measure import formats

DEMO = Path(__file__).resolve().parents[1] / "examples" / "demo" / "measured_virtual.json"


def run(*arguments: str | Path) -> int:
    return main([str(a) for a in arguments])


@pytest.fixture(scope="module")
def small(tmp_path_factory) -> Path:
    """A small measurement: every other angle and wavelength of the demo's."""
    data = formats.read(DEMO).isel(wavelength=slice(None, None, 2), theta_i=slice(None, None, 2))
    path = tmp_path_factory.mktemp("data") / "sample.json"
    return formats.write(data, path)


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
    formats.write(other, tmp_path / "other.json")
    assert run("fit", small, tmp_path / "other.json", "--json") == 0
    rows = json.loads(capsys.readouterr().out)["models"]
    assert [(r["sample"], r["model"]) for r in rows] == [
        (s, m) for s in ("sample", "other") for m in ("cook-torrance-1982", "clausen-2022")
    ]


def test_dielectric_with_few_wavelengths(tmp_path, capsys):
    data = models.evaluate(
        "cook-torrance-1982", [0, 30, 60], np.arange(-80, 81, 10), [450, 550, 600, 650], alpha=0.3, eta=1.5, k_d=0.4
    )
    formats.write(data, tmp_path / "white.json")
    assert run("fit", tmp_path / "white.json", "--material", "none", "--model", "cook-torrance-1982") == 0
    assert "eta = 1.5" in capsys.readouterr().out


def test_list_of_models(capsys):
    assert run("fit", "--list", "--json") == 0
    assert {r["model"] for r in json.loads(capsys.readouterr().out)} == set(models.MODELS)


def test_compare_says_how_much_is_explained(small, tmp_path, capsys):
    data = formats.read(small)
    grid = data.theta_i.values, data.theta_o.values, data.wavelength.values
    formats.write(models.evaluate("clausen-2022", *grid, alpha=0.364, h=0.9e-3, w=3.0), tmp_path / "half.json")
    assert run("compare", tmp_path / "half.json", small, "--json", "--figures", tmp_path / "f", "--quiet") == 0
    rows = {(r["of"], r["quantity"].split(" (")[0]): r for r in json.loads(capsys.readouterr().out)}
    half = rows["half", "explained share"]
    assert abs(half["value"] - 0.75) < 4 * half["error"] + 0.02
    assert rows["sample", "reflectance at 0°"]["value"] > 0
    assert (tmp_path / "f" / "explained.png").stat().st_size > 5000


def test_compare_says_where_there_is_no_shift_to_explain(small, tmp_path, capsys):
    data = formats.read(small)
    grid = data.theta_i.values, data.theta_o.values, data.wavelength.values
    formats.write(models.evaluate("clausen-2022", *grid, alpha=0.364, h=0.0, w=3.0), tmp_path / "flat.json")
    assert run("compare", small, tmp_path / "flat.json", "--json", "--quiet") == 0
    (row,) = (r for r in json.loads(capsys.readouterr().out) if r["quantity"].startswith("explained share"))
    assert row["value"] is None
    assert row["unit"].startswith("no significant shift to explain")


@pytest.mark.parametrize(
    "arguments, words",
    [
        ([], "nothing to fit"),
        (["SMALL", "--model", "clausen"], "did you mean 'clausen-2022'"),
        (["SMALL", "--model", "two-shifts"], "--rays"),
        (["SMALL", "--rays", "SMALL"], "brdf_by_bounce"),
        (["SMALL", "--wavelengths", "700:400"], "LOW:HIGH"),
        (["SMALL", "--p", "x"], "--p x: a number or fit"),
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
    formats.write(data, tmp_path / "steep.json")
    assert run("fit", tmp_path / "steep.json", "--model", "clausen-2022", "--json", "--figures", tmp_path / "f") == 0
    row = json.loads(capsys.readouterr().out)["models"][0]
    assert "h = 0.004" in row["parameters"]
    assert any("of the incident power" in note or "is negative" in note for note in row["notes"])


def refusal(capsys, *arguments: str | Path) -> str:
    """The one line in which a command refuses its input."""
    assert run(*arguments) == 2
    error = [line for line in capsys.readouterr().err.splitlines() if "warning" not in line]
    assert len(error) == 1
    assert error[0].startswith("vgonio: error: ")
    return error[0]


def test_a_black_surface_cannot_be_fitted(tmp_path, small, capsys):
    """All values 0: one line, and no file."""
    formats.write(formats.read(small) * 0, tmp_path / "zero.csv")
    assert "no value of the BRDF is positive" in refusal(capsys, "fit", tmp_path / "zero.csv", "-o", tmp_path / "f.nc")
    assert not (tmp_path / "f.nc").exists()


@pytest.mark.parametrize("p", ["-1e9", "-3", "5.01", "nan", "inf", "foo"])
def test_exponents_outside_their_bounds_are_refused(small, capsys, p):
    assert f"--p {p}" in refusal(capsys, "fit", small, "--p", p)
    if p != "foo":
        with pytest.raises(InputError, match="from 0 to 5"):
            fit_global_shift(formats.read(small), p=float(p))


def test_a_bad_range_names_its_option(small, capsys):
    assert "--wavelengths foo" in refusal(capsys, "fit", small, "--wavelengths", "foo")


def test_two_wavelengths_are_fitted_without_colour(small, tmp_path, capsys):
    """What needs colour is left out with the reason; the parameters are those of the spectrum within the errors."""
    formats.write(formats.read(small).sel(wavelength=[540, 580]), tmp_path / "two.json")
    assert run("fit", tmp_path / "two.json", "--model", "clausen-2022", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    row = found["models"][0]
    assert row["delta_e"] is None
    assert "alpha = 0.36" in row["parameters"]
    assert any("no dE00" in note and "450 to 650 nm" in note for note in row["notes"])
    assert found["shift"][0]["quantity"] == "left out"
    assert run("fit", tmp_path / "two.json", "--model", "clausen-2022") == 0
    out = capsys.readouterr().out
    assert "no dE00" in out
    assert "Appearance" not in out


def test_where_there_is_no_shift_no_frequency_is_printed(tmp_path, capsys):
    """A BRDF without a shift, 1 % noise: h is zero within its error, and any w fits."""
    data = models.evaluate(
        "cook-torrance-1982", [0, 30, 60], np.arange(-80, 81, 10), np.arange(400, 701, 25), alpha=0.3
    )
    noise = 1 + 0.01 * np.random.default_rng(3).standard_normal(data.brdf.shape)
    formats.write(data.assign(brdf=data.brdf * noise), tmp_path / "flat.json")
    assert run("fit", tmp_path / "flat.json", "--model", "clausen-2022", "--p", "1", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    w = next(r for r in found["shift"] if r["quantity"] == "global shift w")
    assert w["value"] is None
    assert w["unit"] == "no significant shift"
    parameters = found["models"][0]["parameters"]
    assert "no significant shift" in parameters
    assert "w =" not in parameters
    formats.write(data, tmp_path / "exact.json")
    assert run("compare", tmp_path / "flat.json", tmp_path / "exact.json", "--material", "none") == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if "frequency w" in line]
    assert lines
    assert all("no significant shift" in line for line in lines)


@pytest.mark.parametrize(
    "height, error, expected",
    [(1e-3, 1e-4, True), (1e-3, 4e-4, False), (-2.1e-7, 6e-8, False), (-2e-3, 1e-5, True), (1e-3, np.nan, True)],
)
def test_what_counts_as_a_shift(height, error, expected):
    from vgonio.compare.significance import is_shift

    assert is_shift(height, error) is expected


# ---- the material
def test_an_assumed_material_is_said_first(small, capsys):
    assert run("fit", small, "--model", "cook-torrance-1982") == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("material: Al (aluminium) is assumed, none is given: --material NAME changes it")
    assert run("fit", small, "--model", "cook-torrance-1982", "--material", "Al") == 0
    assert "material:" not in capsys.readouterr().out.splitlines()[0]
    # without F in the shift and in the model there is none to assume
    assert run("fit", small, "--model", "lambert-1760", "--p", "0") == 0
    assert "assumed" not in capsys.readouterr().out


def test_a_material_that_the_data_name_is_taken(small):
    from vgonio.cli.fit import _material_of

    data = formats.read(small)
    assert _material_of({"a": data.assign_attrs(material="Cu")})[0] == "Cu"
    name, said = _material_of({"a": data.assign_attrs(material="anodised, from the shelf")})
    assert name == "Al"
    assert "the data name anodised, from the shelf" in said
    two = {"a": data.assign_attrs(material="Cu"), "b": data.assign_attrs(material="Au")}
    assert _material_of(two)[0] == "Al"


def test_wavelengths_beyond_an_assumed_table_ask_for_the_samples_material(small, tmp_path, capsys):
    data = formats.read(small)
    far = data.assign_coords(wavelength=data.wavelength.values * 2)
    formats.write(far, tmp_path / "far.json")
    words = refusal(capsys, "fit", tmp_path / "far.json", "--wavelength-n", "1200")
    assert "no material was given: --material states the sample's own" in words
    assert words.index("name the sample's own material") < words.index("Al:McPeak")
    given = refusal(capsys, "fit", tmp_path / "far.json", "--wavelength-n", "1200", "--material", "Al")
    assert "no material was given" not in given
