"""`vgonio display`: the way of a user from the list of colours to the verdict, and what is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

from vgonio import display as vd
from vgonio.cli import main

VIRTUAL = ["--virtual", "wide-gamut", "--set", "tone=2.6", "--set", "crosstalk=0.02"]


def shown_colours(path):
    """What a person with a meter does: show each colour of a list on the (virtual) display and measure it."""
    scale = float(path.read_text().splitlines()[0].split(":")[1])
    return np.loadtxt(path, delimiter=",", skiprows=2) / scale


def test_from_colours_to_the_verdict(tmp_path, capsys):
    headset = {
        "left": vd.virtual_display("wide-gamut", tone=2.6, crosstalk=0.02),
        "right": vd.virtual_display("wide-gamut", tone=2.4, white_cd_m2=120, crosstalk=0.02),
    }
    assert main(["display", "characterise", "--colours", str(tmp_path / "show.csv"), "--levels", "10"]) == 0
    rgb = shown_colours(tmp_path / "show.csv")
    assert len(rgb) == len({tuple(c) for c in rgb.tolist()})
    measured = [d.measure(rgb, eye=eye) for eye, d in headset.items()]
    readings = vd.write(tmp_path / "readings.csv", measured)

    folder = tmp_path / "calibration"
    assert main(["display", "calibrate", str(readings), "-o", str(folder), "--source", "Adobe RGB", "--size", "9"]) == 0
    names = {p.name for p in folder.iterdir()}
    assert names == {f"display_{eye}{end}" for eye in headset for end in (".icc", ".cube", "_colours.csv")}

    tests = [
        vd.write(tmp_path / f"{eye}.csv", [d.measure(shown_colours(folder / f"display_{eye}_colours.csv"), eye=eye)])
        for eye, d in headset.items()
    ]
    page = tmp_path / "page.html"
    capsys.readouterr()
    command = ["display", "verify", str(readings), "--tests", str(tests[0]), "--tests", str(tests[1])]
    assert main([*command, "--patches", "colorchecker", "--report", str(page), "--json", "--quiet"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert [f["eye"] for f in facts] == ["left", "right"]
    for fact, white in zip(facts, (130, 120)):
        assert fact["delta_e"]["colours"] == 64
        assert fact["white_cd_m2"] == pytest.approx(white, rel=0.06)  # crosstalk adds some percent
        assert 0.3 < fact["delta_e"]["mean"] < 1
        assert fact["reproduction"]["measured profile"]["mean"] < 1.3
        assert fact["reproduction"]["sRGB"]["mean"] > 4
    assert "<svg" in page.read_text(encoding="utf-8")


def test_a_virtual_display_in_one_command(tmp_path, capsys):
    saved = tmp_path / "r.ti3"
    assert main(["display", "characterise", *VIRTUAL, "--save", str(saved), "--json", "--quiet"]) == 0
    direct = json.loads(capsys.readouterr().out)
    assert main(["display", "characterise", str(saved), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["delta_e"]["mean"] == pytest.approx(
        direct[0]["delta_e"]["mean"], 1e-6
    )
    assert main(["display", "verify", *VIRTUAL, "--patches", "cie-224"]) == 0
    table = capsys.readouterr().out
    assert "reproduction measured profile mean" in table
    assert "contrast" in table


def test_one_file_for_each_eye(tmp_path, capsys):
    for name, white in (("a", 100), ("b", 90)):
        display = vd.virtual_display("lcd-apple", white_cd_m2=white)
        vd.write(tmp_path / f"{name}.ti3", [vd.examine_virtual(display)[1]])
    files = [str(tmp_path / "a.ti3"), str(tmp_path / "b.ti3")]
    assert main(["display", "characterise", *files, "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert [(f["eye"], round(f["white_cd_m2"])) for f in facts] == [("a", 100), ("b", 90)]
    # test colours without names go to the eyes in order
    assert main(["display", "verify", *files, "--tests", files[0], "--tests", files[1], "--quiet", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[1]["delta_e"]["max"] < 0.1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["characterise"], "readings are needed"),
        (["characterise", "r.csv", "--virtual", "wide-gamut"], "readings are needed"),
        (["characterise", "r.csv"], "no such table of readings"),
        (["characterise", "--virtual", "wide"], "wide-gamut"),
        (["characterise", "--virtual", "wide-gamut", "--set", "crostalk=1"], "crosstalk"),
        (["characterise", "--virtual", "wide-gamut", "--levels", "2"], "levels"),
        (["characterise", "--virtual", "wide-gamut", "--report", "p.pdf"], "html"),
        (["verify", "--virtual", "wide-gamut", "--patches", "colourchecker"], "colorchecker"),
        (["calibrate", "--virtual", "wide-gamut", "--source", "AdobeRGB"], "Adobe RGB"),
        (["calibrate", "--virtual", "wide-gamut", "--size", "1000"], "size"),
        (["calibrate", "--virtual", "wide-gamut", "--gamut", "cut"], "gamut"),
        (["calibrate", "--virtual", "wide-gamut", "--bits", "3"], "bits"),
    ],
)
def test_bad_input_is_one_line_and_status_2(tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert main(["display", *arguments]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert [p for p in tmp_path.rglob("*") if p.is_file()] == []


def test_only_ramps_cannot_verify(tmp_path, capsys):
    path = vd.write(tmp_path / "r.csv", [vd.virtual_display().measure(vd.ramp_colours(10))])
    assert main(["display", "characterise", str(path)]) == 0
    assert main(["display", "verify", str(path)]) == 2
    assert "no test colours" in capsys.readouterr().err
    assert main(["display", "verify", str(path), "--set", "drift=1"]) == 2


def test_deviations_of_a_real_display_are_refused(tmp_path, capsys):
    path = vd.write(tmp_path / "r.csv", [vd.virtual_display().measure(vd.ramp_colours(10))])
    assert main(["display", "characterise", str(path), "--set", "drift=1"]) == 2
    assert "as they were measured" in capsys.readouterr().err


def test_what_was_not_tested_is_null_in_json(tmp_path, capsys):
    """Test colours without single channels: independence and additivity have nothing to compare with."""
    display = vd.virtual_display()
    path = vd.write(tmp_path / "r.csv", [display.measure(vd.ramp_colours(10))])
    mixed = vd.grid_colours(85)
    mixed = mixed[np.all(mixed > 0, axis=1)]
    tests = vd.write(tmp_path / "t.csv", [display.measure(mixed)])
    page = tmp_path / "p.html"
    assert (
        main(["display", "verify", str(path), "--tests", str(tests), "--json", "--quiet", "--report", str(page)]) == 0
    )
    found = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)[0]["assumptions"]
    assert found["independence"] is found["additivity"] is found["tone"] is None
    assert found["constancy"] < 0.01
    assert "not tested" in page.read_text(encoding="utf-8")


def test_spectra_that_are_no_light_are_refused(tmp_path, capsys):
    """All radiances negative: the ramps rise downwards as well as any, but white has no light."""
    display = vd.virtual_display("wide-gamut")
    real = display.measure(vd.ramp_colours(10))
    path = vd.write(tmp_path / "negative.csv", [vd.Readings(real.rgb, -real.spectra, real.wavelength_nm)])
    assert main(["display", "characterise", str(path)]) == 2
    error = capsys.readouterr().err.strip()
    assert "no radiances of a display" in error
    assert "\n" not in error


@pytest.mark.parametrize("option", [("--source", "Adobe RGBx"), ("--gamut", "cut"), ("--size", "1")])
def test_a_refused_calibration_makes_no_folder(tmp_path, option):
    folder = tmp_path / "new" / "calibration"
    assert main(["display", "calibrate", "--virtual", "wide-gamut", "-o", str(folder), *option]) == 2
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("text, message", [("", "it is empty"), ("name,400,500\n", "a head alone")])
def test_patches_of_an_empty_file(tmp_path, capsys, text, message):
    (tmp_path / "patches.csv").write_text(text)
    assert main(["display", "verify", "--virtual", "wide-gamut", "--patches", str(tmp_path / "patches.csv")]) == 2
    assert message in capsys.readouterr().err
