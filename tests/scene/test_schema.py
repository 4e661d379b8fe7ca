"""The JSON schema of a scene: what is valid passes, and what it refuses the scene's own checks refuse too."""

from __future__ import annotations

import copy
import json
import tomllib
from importlib.resources import files
from pathlib import Path

import pytest
from jsonschema import Draft7Validator

from vgonio.cli import main
from vgonio.errors import InputError
from vgonio.scene import TABLES, load_scene
from vgonio.scene.schema import SCHEMA_LINE, scene_schema, template_comments

ROOT = Path(__file__).resolve().parents[2]
SCENES = sorted(
    p for p in [*ROOT.glob("examples/**/*.toml"), *ROOT.glob("benchmarks/**/*.toml")] if b"[surface]" in p.read_bytes()
)


@pytest.fixture(scope="module")
def schema() -> Draft7Validator:
    made = scene_schema()
    Draft7Validator.check_schema(made)
    return Draft7Validator(made)


def full() -> dict:
    """A scene with every table."""
    text = (files("vgonio") / "template.toml").read_text(encoding="utf-8")
    extra = {"measured": {"file": "sample.json", "theta_i_deg": {"start": 0, "stop": 90, "step": 10}}}
    return tomllib.loads(text) | extra


def accepted(scene: dict) -> bool:
    try:
        load_scene(copy.deepcopy(scene))
    except InputError:
        return False
    return True


def changed(table: str, **values) -> dict:
    scene = full()
    scene[table] = {k: v for k, v in (scene[table] | values).items() if v is not None}
    return scene


def test_the_template_and_our_scenes_are_valid(schema):
    assert list(schema.iter_errors(full())) == []
    assert ROOT / "examples" / "demo" / "scene.toml" in SCENES
    for path in SCENES:
        assert [e.message for e in schema.iter_errors(tomllib.loads(path.read_text(encoding="utf-8")))] == [], path


GOOD = {
    "one angle": changed("light", theta_i_deg=30),
    "a range that stops at 90": changed("light", theta_i_deg={"start": 0, "stop": 90, "step": 20}),
    "falling wavelengths": changed("light", wavelength_nm={"start": 700, "stop": 0, "step": -300}),
    "list of theories": changed("wave", theory=["kirchhoff", "harvey-shack"]),
    "iterated": changed("wave", theory="iterated-kirchhoff", window_um=10, bounces=3),
    "one bounce": changed("wave", bounces=1),
    "a million as 1e6": changed("geometric", rays=1e6),
    "hemisphere": changed("detector", kind="hemisphere", theta_o_deg=None, resolution_deg=5),
    "one film": changed("material", film={"name": "Al2O3", "thickness_nm": 4}),
    "films": changed("material", film=[{"name": "Al2O3", "thickness_nm": 4}, {"file": "a.yml", "thickness_nm": 0}]),
    "two pitches": changed("surface", generate=None, file="a.npz", pitch_um=[0.5, 0.6], height_unit="nm"),
    "crop": changed("surface", crop_um=[10, 20.5], filter={"s_um": 2}),
    "flat": changed("surface", generate={"kind": "flat", "shape": [8, 8], "pitch_um": 1}),
    "only a measurement": {"measured": {"file": "a.json"}},
    "only a surface": {"surface": {"file": "a.npz"}},
}
BAD = {
    "unknown table": full() | {"lights": {}},
    "unknown key": changed("wave", theorie="kirchhoff"),
    "unknown word": changed("wave", theory="kirchof"),
    "unknown method": changed("wave", method="fft"),
    "theory twice": changed("wave", theory=["kirchhoff", "kirchhoff"]),
    "no theory": changed("wave", theory=[]),
    "window without iterated": changed("wave", window_um=10),
    "text for a number": changed("light", coherence_um="30"),
    "angle of 90": changed("light", theta_i_deg=[0, 90]),
    "angle twice": changed("light", theta_i_deg=[10, 10]),
    "no angle": changed("light", theta_i_deg=[]),
    "negative wavelength": changed("light", wavelength_nm=-550),
    "range without step": changed("light", wavelength_nm={"start": 400, "stop": 700}),
    "range with a typo": changed("light", wavelength_nm={"start": 400, "stop": 700, "stepp": 1, "step": 50}),
    "step of 0": changed("light", wavelength_nm={"start": 400, "stop": 700, "step": 0}),
    "no wavelength": changed("light", wavelength_nm=None),
    "polarisation": changed("light", polarisation="x"),
    "tolerance of 1": changed("wave", tol=1),
    "half a ray": changed("geometric", rays=0.5),
    "no rays": changed("geometric", rays=0),
    "tracer": changed("geometric", tracer="optix"),
    "hemisphere with angles": changed("detector", kind="hemisphere"),
    "plane with resolution": changed("detector", resolution_deg=5),
    "plane without angles": changed("detector", theta_o_deg=None),
    "wide cone": changed("detector", aperture_deg=91),
    "fine hemisphere": changed("detector", kind="hemisphere", theta_o_deg=None, resolution_deg=0.1),
    "two materials": changed("material", file="a.yml"),
    "no material": changed("material", name=None),
    "film without thickness": changed("material", film={"name": "Al2O3"}),
    "film of two": changed("material", film={"name": "Al2O3", "file": "a.yml", "thickness_nm": 1}),
    "two surfaces": changed("surface", file="a.npz"),
    "no surface": changed("surface", generate=None),
    "pitch of a generated one": changed("surface", pitch_um=1),
    "negative pitch": changed("surface", generate=None, file="a.npz", pitch_um=-1),
    "unit": changed("surface", generate=None, file="a.npz", height_unit="parsec"),
    "kind": changed("surface", generate={"kind": "gausian", "shape": [8, 8], "pitch_um": 1}),
    "parameter of another kind": changed("surface", generate={"kind": "flat", "shape": [8, 8], "rms_um": 1}),
    "gaussian without correlation": changed("surface", generate={"kind": "gaussian", "rms_um": 1}),
    "fill": changed("surface", fill="guess"),
    "rays without light": {k: v for k, v in full().items() if k != "light"},
    "nothing to do": {"title": "nothing"},
    "table as a number": full() | {"light": 3},
}
# what a schema cannot say, or not without restating the program
BEYOND = {
    "empty range": changed("light", wavelength_nm={"start": 700, "stop": 400, "step": 50}),
    "range that reaches 90": changed("light", theta_i_deg={"start": 0, "stop": 90, "step": 10}),
    "polarised Harvey-Shack": changed("wave", theory="harvey-shack", polarised=True),
}


@pytest.mark.parametrize("name", GOOD)
def test_what_is_valid_passes(schema, name):
    assert accepted(GOOD[name])
    assert [e.message for e in schema.iter_errors(GOOD[name])] == []


@pytest.mark.parametrize("name", BAD)
def test_mistakes_are_marked(schema, name):
    assert not accepted(BAD[name])
    assert not schema.is_valid(BAD[name])


@pytest.mark.parametrize("name", BEYOND)
def test_what_is_left_to_our_own_checks(schema, name):
    assert schema.is_valid(BEYOND[name])
    assert not accepted(BEYOND[name])


WRONG = (-1, 0, 0.5, 1, 1e9, True, "x", [], [1, 2], ["x"], {}, {"x": 1})


def test_the_schema_is_never_stricter_than_the_scene(schema):
    """Every key of every table at a dozen values: what the schema refuses, the scene refuses."""
    refused, marked = 0, 0
    for table, model in TABLES.items():
        for key in model.model_fields:
            for value in WRONG:
                scene = full()
                inner = scene
                for part in table.split("."):
                    inner = inner.setdefault(part, {})
                inner[key] = value
                valid, ours = schema.is_valid(scene), accepted(scene)
                assert valid or not ours, (table, key, value)
                refused += not ours
                marked += not ours and not valid
    assert refused > 400
    # of what the scene refuses, an editor marks nearly all: 639 of 641 as this was written
    assert marked > 0.99 * refused


def test_every_key_is_explained():
    made = scene_schema()
    for name, model in TABLES.items():
        for key, value in made["$defs"][model.__name__]["properties"].items():
            assert "$ref" in value or value.get("description"), (name, key)
    comments = template_comments()
    wave = made["$defs"]["Wave"]["properties"]["tol"]
    assert wave["description"] == comments["wave"]["tol"] == "relative to the largest brdf in theta_o"
    assert wave["default"] == 1e-3
    assert made["$defs"]["Geometric"]["description"] == "rays"


def test_init_writes_the_schema_and_names_it(tmp_path, capsys):
    scene = tmp_path / "scene.toml"
    assert main(["init", "--schema", str(scene)]) == 0
    assert scene.read_text(encoding="utf-8").splitlines()[0] == SCHEMA_LINE == "#:schema ./vgonio.schema.json"
    assert json.loads((tmp_path / "vgonio.schema.json").read_text(encoding="utf-8")) == scene_schema()
    load_scene(scene)
    scene.write_text("# mine\n", encoding="utf-8")
    (tmp_path / "vgonio.schema.json").unlink()
    capsys.readouterr()
    assert main(["init", "--schema", str(scene)]) == 0
    assert scene.read_text(encoding="utf-8") == "# mine\n"
    assert (tmp_path / "vgonio.schema.json").is_file()
    assert f"first line has to be {SCHEMA_LINE}" in capsys.readouterr().out
    assert main(["init", str(scene)]) == 2
