"""Example inputs: that they say what they are, that a second run overwrites nothing, that they are what they say."""

from __future__ import annotations

import json
import zipfile

import numpy as np
import pytest

import vgonio as vg
from vgonio.cli import main
from vgonio.cli.examples import FILES, MODEL


@pytest.fixture(scope="module")
def examples(tmp_path_factory):
    folder = tmp_path_factory.mktemp("a folder") / "new"
    assert main(["examples", str(folder)]) == 0
    return folder


def test_all_are_written_and_text_says_that_it_is_no_measurement(examples) -> None:
    assert sorted(p.name for p in examples.iterdir()) == sorted(FILES)
    for path in examples.glob("*.csv"):
        assert "# NOT A MEASUREMENT. Made by `vgonio examples`" in path.read_text()[:300], path.name
    for path in examples.glob("*.json"):
        assert json.loads(path.read_text())[0]["provenance"].startswith("NOT A MEASUREMENT"), path.name
    assert vg.measure.read(examples / "sample.json").attrs["provenance"].startswith("NOT A MEASUREMENT")
    assert "GENERATED" in (examples / "study.toml").read_text()
    with zipfile.ZipFile(examples / "sample.x3p") as archive:
        assert b"<Comment>NOT A MEASUREMENT. Made by `vgonio examples`" in archive.read("main.xml")


def test_a_generated_height_field_is_of_no_instrument(examples, capsys) -> None:
    assert main(["surface", "info", str(examples / "sample.x3p"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["instrument"] == "software (vgonio)"


def test_a_second_run_overwrites_only_when_told(examples, capsys) -> None:
    (examples / "white.csv").write_text("mine")
    assert main(["examples", str(examples)]) == 2
    assert "--force" in capsys.readouterr().err
    assert (examples / "white.csv").read_text() == "mine"
    assert main(["examples", str(examples), "--force"]) == 0
    assert (examples / "white.csv").read_text() != "mine"


@pytest.mark.filterwarnings("ignore::vgonio.errors.VgonioWarning")
def test_they_are_what_they_say(examples, tmp_path, capsys) -> None:
    """Noise of 2 %, a bias of 1 %, and counts whose calibration is the BRDF they were made of."""
    surface = vg.surface.read(examples / "sample.x3p")
    assert 0.005 < surface.missing / np.prod(surface.shape) < 0.02
    theta_o, nm = np.arange(-80.0, 81, 5), np.arange(400.0, 701, 50)
    truth = vg.models.evaluate("clausen-2022", [0, 10, 20, 30, 40, 50, 60], theta_o, nm, **MODEL)["brdf"]
    for name, bias in (("sample.json", 0.0), ("other.csv", 0.01)):
        off = (vg.measure.read(examples / name)["brdf"] / truth - 1 - bias).values
        count = np.isfinite(off).sum()
        assert abs(np.nanstd(off) - 0.02) < 4 * 0.02 / np.sqrt(2 * count)
        assert abs(np.nanmean(off)) < 4 * 0.0202 / np.sqrt(count)
    given = ["counts.csv", "--white", "white.csv", "--standard", "spectralon.json", "-o"]
    words = [str(examples / w) if "." in w else w for w in given]
    assert main(["measured", "calibrate", *words, str(tmp_path / "made.json")]) == 0
    made = vg.measure.read(tmp_path / "made.json")
    # the stage's 0.1° acts through the slope of the lobe, a few per cent; a wrong scale would be off everywhere
    assert abs(float((made["brdf"] / truth).median()) - 1) < 0.01
    capsys.readouterr()


def refusal(capsys, *words: str) -> str:
    assert main(list(words)) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    return err


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("measured cross-validate sample.json other.csv --wavelength 0.55", 550),
        (
            "measured calibrate counts.csv --white white.csv --standard spectralon.json -o no.json --standard-nm 0.533",
            533,
        ),
        ("fit sample.json --wavelengths 0.4:0.7", 700),
        ("fit sample.json --wavelength-n 0.6", 600),
        ("render sample.json -o no.png --wavelengths 0.4:0.72:0.02", 720),
        ("render sample.json -o no.png --wavelengths 0.55", 550),
    ],
)
def test_micrometres_are_told_from_nanometres(words, meant, examples, monkeypatch, capsys) -> None:
    """Refused before anything is written."""
    monkeypatch.chdir(examples)
    before = sorted(examples.iterdir())
    said = refusal(capsys, *words.split())
    assert f"wavelengths are in nm, was {meant} meant?" in said
    assert sorted(examples.iterdir()) == before


def test_wavelengths_that_are_wrong_in_both_units_get_no_such_hint(examples, monkeypatch, capsys) -> None:
    monkeypatch.chdir(examples)
    said = refusal(capsys, *"measured cross-validate sample.json other.csv --wavelength 900".split())
    assert said.endswith("cover 400 to 700 nm only\n")


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ("cook-torance-1982:alpha=0.3", "no model 'cook-torance-1982': did you mean 'cook-torrance-1982'?"),
        ("foo:alpha=1", "no model 'foo': known: beckmann-1963, clausen-2022"),
        ("foo", "there is no such file, and no model 'foo'"),
        ("foo.json", "no such file: foo.json"),
        ("foo.nc:rays", "no such result file: foo.nc"),
    ],
)
def test_a_material_that_is_neither_file_nor_model(spec, said, examples, monkeypatch, capsys) -> None:
    monkeypatch.chdir(examples)
    assert said in refusal(capsys, "render", spec, "-o", "no.png")


@pytest.mark.parametrize("command", ["init", "examples"])
def test_where_nothing_can_be_written(command, tmp_path, monkeypatch, capsys) -> None:
    """One new folder is made; several, a folder in place of a file and a file in place of a folder are refused."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("mine")
    end = "/x.toml" if command == "init" else ""
    assert "make it first" in refusal(capsys, command, f"no/such/one{end}")
    assert "is not a writable folder" in refusal(capsys, command, f"file{end}")
    if command == "init":
        for more in ([], ["--force"], ["--schema"]):
            assert "folder is a folder: name a file in it" in refusal(capsys, command, "folder", *more)
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["file", "folder"]
    assert main([command, f"new{end}"]) == 0
    assert any((tmp_path / "new").iterdir())
