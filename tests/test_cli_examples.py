"""Example inputs: that they say what they are, that a second run overwrites nothing, that they are what they say."""

from __future__ import annotations

import json

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
