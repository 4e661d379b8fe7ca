"""Every command that takes a file × every kind of file: taken, or refused by what it is and with what takes it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import vgonio as vg
from vgonio.cli import main
from vgonio.errors import FileFormatError
from vgonio.file_kinds import KINDS, kind_of, require_kind

SCENE = """
[surface]
generate = { kind = "gaussian", rms_um = 0.2, correlation_um = 3, shape = [48, 48], pitch_um = 0.5, seed = 1 }
[material]
name = "Al"
[light]
wavelength_nm = [450, 500, 550, 600, 650]
theta_i_deg = [0, 30]
[detector]
theta_o_deg = { start = -60, stop = 60, step = 20 }
aperture_deg = 10
[geometric]
rays = 2000
"""
OUT = "-o ../out"
COMMANDS = {
    "plan": "plan FILE",
    "simulate": f"simulate FILE {OUT}.nc",
    "sweep": f"sweep FILE --dry-run {OUT}.sweep",
    "validate": f"validate FILE {OUT}.nc",
    "report": f"report FILE {OUT}.html",
    "explore": f"explore FILE {OUT}.html",
    "surface info": "surface info FILE",
    "surface convert": "surface convert FILE ../out.x3p",
    "measured info": "measured info FILE",
    "measured convert": "measured convert FILE ../out.csv",
    "calibrate": f"measured calibrate FILE --white white.csv --standard spectralon.json {OUT}.json",
    "white": f"measured calibrate counts.csv --white FILE --standard spectralon.json {OUT}.json",
    "cross-validate": "measured cross-validate FILE spectralon.json",
    "compare": "compare FILE other.csv",
    "fit": "fit FILE --model cook-torrance-1982 --errors none",
    "fit rays": "fit sample.json --model cook-torrance-1982 --errors none --rays FILE",
    "render": f"render FILE {OUT}.png --size 8 --samples 1 --passes 2 --wavelengths 450,550,650",
    "display": "display characterise FILE",
    "tests": "display verify readings.csv --tests FILE",
}
FILES = {
    "scene.toml": "scene",
    "study.toml": "study",
    "normbox.toml": "normbox",
    "rough.npz": "surface",
    "sample.x3p": "surface",
    "height.csv": "surface",
    "sample.json": "measured",
    "other.csv": "measured",
    "sample.bsdf": "measured",
    "counts.csv": "counts",
    "readings.csv": "readings",
    "show.csv": "colours",
    "result.nc": "result",
    "fit.json": "fit",
    "page.html": "page",
    "figure.png": "picture",
}
BRDF = {"measured", "result"}
TAKEN = {
    **dict.fromkeys(("plan", "simulate"), {"scene"}),
    "sweep": {"study"},
    "validate": {"normbox"},
    **dict.fromkeys(("report", "explore"), {"result"}),
    **dict.fromkeys(("surface info", "surface convert"), {"surface"}),
    **dict.fromkeys(("measured info", "measured convert", "cross-validate", "compare", "fit", "fit rays"), BRDF),
    **dict.fromkeys(("calibrate", "white"), {"counts"}),
    "render": BRDF | {"fit"},
    **dict.fromkeys(("display", "tests"), {"readings"}),
}


@pytest.fixture(scope="module")
def kept(tmp_path_factory) -> Path:
    """One file of each kind."""
    folder = tmp_path_factory.mktemp("kinds") / "files"
    assert main(["examples", str(folder), "--quiet"]) == 0
    (folder / "scene.toml").write_text(SCENE)
    assert main(["validate", "--init", str(folder / "normbox.toml")]) == 0
    assert main(["display", "characterise", "--colours", str(folder / "show.csv")]) == 0
    field = vg.surface.gaussian(rms_um=0.3, correlation_um=4, shape=(32, 32), pitch_um=0.5)
    for name in ("rough.npz", "height.csv"):
        vg.surface.write(field, folder / name)
    vg.save(vg.simulate(_dictionary()), folder / "result.nc")
    measured = vg.measure.read(folder / "sample.json")
    vg.measure.write(measured, folder / "sample.bsdf", fill="half-angle")
    fitted = vg.compare.fit_model(measured, "cook-torrance-1982", errors="none")
    vg.compare.save_fit(fitted, folder / "fit.json")
    (folder / "page.html").write_text("<!DOCTYPE html>\n<title>page</title>\n")
    (folder / "figure.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(64))
    return folder


def _dictionary() -> dict:
    import tomllib

    return tomllib.loads(SCENE)


def test_each_kind_is_known(kept) -> None:
    assert {name: kind_of(kept / name) for name in FILES} == FILES
    assert set(FILES.values()) == set(KINDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_wrong_file_is_named_and_sent_where_it_belongs(command, kept, monkeypatch, capsys) -> None:
    monkeypatch.chdir(kept)
    before = sorted(kept.parent.rglob("*"))
    for name, kind in FILES.items():
        if kind in TAKEN[command]:
            continue
        assert main(COMMANDS[command].replace("FILE", name).split()) == 2, name
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert said.startswith(f"vgonio: error: {name} is {KINDS[kind].what}, and "), said
        assert "is needed here: " in said
        assert KINDS[kind].taken.split("FILE")[0] in said
    assert sorted(kept.parent.rglob("*")) == before


@pytest.mark.filterwarnings("ignore::vgonio.errors.VgonioWarning")
@pytest.mark.parametrize(
    "command", ["plan", "sweep", "report", "surface info", "measured info", "calibrate", "display"]
)
def test_the_right_file_is_taken(command, kept, monkeypatch, capsys) -> None:
    monkeypatch.chdir(kept)
    for name, kind in FILES.items():
        if kind in TAKEN[command]:
            assert main(COMMANDS[command].replace("FILE", name).split()) == 0, (name, capsys.readouterr().err)


def test_the_readers_of_python_say_the_same(kept) -> None:
    for read, name in (
        (vg.open, "rough.npz"),
        (vg.surface.read, "result.nc"),
        (vg.measure.read, "scene.toml"),
        (vg.plan, "study.toml"),
        (vg.display.read, "sample.json"),
    ):
        with pytest.raises(FileFormatError, match=f"{name} is {KINDS[FILES[name]].what}, and .* is needed here"):
            read(kept / name)


def test_names_with_blanks_can_be_typed(kept, tmp_path) -> None:
    path = tmp_path / "my scene.toml"
    shutil.copy(kept / "scene.toml", path)
    with pytest.raises(FileFormatError, match=r"simulate '.*my scene\.toml' -o 'my scene'\.nc"):
        require_kind(path, "result")


@pytest.mark.parametrize(
    "name, content",
    [
        ("empty.toml", b""),
        ("half.npz", b"PK\x03\x04 and then nothing"),
        ("h5.nc", b"\x89HDF\r\n\x1a\n" + bytes(50)),
        ("other.csv", b"x,y,z\n1,2,3\n"),
        ("xyz.csv", b"1 2 3\n"),
        ("list.json", b"[1, 2]"),
        ("binary.toml", bytes(range(256))),
    ],
)
def test_what_is_not_certain_is_left_to_its_reader(name, content, tmp_path) -> None:
    (tmp_path / name).write_bytes(content)
    assert kind_of(tmp_path / name) is None
    require_kind(tmp_path / name, "scene")
    assert kind_of(tmp_path / "none") is None
    assert kind_of(tmp_path) is None


def test_a_sweep_is_sent_to_one_of_its_points(tmp_path, monkeypatch, capsys) -> None:
    """The remedy that the message names works."""
    import xarray as xr

    monkeypatch.chdir(tmp_path)
    one = vg.simulate(_dictionary())["rays"].to_dataset()
    data = xr.concat([one, one], xr.Variable("rms_um", [0.1, 0.2]))
    root = xr.Dataset(coords={"rms_um": [0.1, 0.2]})
    vg.save(xr.DataTree.from_dict({"/": root, "/rays": data}), "swept.nc")
    for words in ("report swept.nc", "explore swept.nc", "fit swept.nc", "render swept.nc", "fit swept.nc:rays"):
        assert main(words.split()) == 2
        said = capsys.readouterr().err
        assert "swept.nc is the result of a sweep over rms_um, and one point of it is needed here" in said
    remedy = said.split("in Python, ")[1].split(" keeps one")[0]
    exec(remedy, {"vg": vg})
    assert main(["explore", "point.nc"]) == 0
