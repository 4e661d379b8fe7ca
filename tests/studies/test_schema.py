"""The JSON schema of a study: what is documented passes, what it marks makes points that fail."""

from __future__ import annotations

import copy
import json
import re
import tomllib
from importlib.resources import files
from pathlib import Path

import pytest
from jsonschema import Draft7Validator

from vgonio.cli import main
from vgonio.errors import InputError, VgonioError
from vgonio.scene.tables import TABLES
from vgonio.studies import load_study
from vgonio.studies.schema import STUDY_SCHEMA_LINE, study_schema

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def schema() -> Draft7Validator:
    made = study_schema()
    Draft7Validator.check_schema(made)
    return Draft7Validator(made)


def scene() -> dict:
    return tomllib.loads((files("vgonio") / "template.toml").read_text(encoding="utf-8"))


def study(vary: dict, **more) -> dict:
    return {"scene": "scene.toml", "vary": vary, **more}


def documented() -> list[dict]:
    """Every study in the pages, the tests and the contract of the scene file."""
    found = []
    for path in [*ROOT.glob("docs/*.md"), ROOT / "README.md", ROOT / "CONVENTIONS.md"]:
        for block in re.findall(r"^```toml\n(.*?)^```", path.read_text(encoding="utf-8"), flags=re.M | re.S):
            if re.search(r"^\[vary\]", block, flags=re.M):
                found.append(tomllib.loads(block))
    return found


def test_documented_studies_are_valid(schema):
    blocks = documented()
    assert blocks
    for block in blocks:
        assert [e.message for e in schema.iter_errors(block)] == []


GOOD = {
    "a list": study({"light.coherence_um": [10, 20.5]}),
    "a range": study({"surface.generate.seed": {"start": 1, "stop": 20, "step": 1}}),
    "words": study({"material.name": ["Al", "Au"], "wave.theory": ["kirchhoff", "harvey-shack"]}),
    "lists of angles": study({"light.theta_i_deg": [[0, 30, 60], {"start": 0, "stop": 40, "step": 20}]}),
    "tables": study({"light": {"coherence_um": [10, 20]}, "surface": {"generate": {"rms_um": [0.1, 0.2]}}}),
    "a table as a whole": study({"surface.filter": [{"s_um": 2.0}, {"s_um": 4.0}]}),
    "side by side": study({"light.coherence_um": [10, 10], "wave.tol": [1e-3, 1e-2]}, zip=True, title="x"),
}
BAD = {
    "no scene": {"vary": {"light.coherence_um": [10]}},
    "nothing varies": study({}),
    "unknown key": study({"light.coherence_um": [10]}, varied={}),
    "a number": study({"light.coherence_um": 10}),
    "an empty list": study({"light.coherence_um": []}),
    "key of no scene": study({"light.coherence_nm": [10]}),
    "table of no scene": study({"lamp.coherence_um": [10]}),
    "output": study({"output.file": ["a.nc", "b.nc"]}),
    "title": study({"title": ["a", "b"]}),
    "range without step": study({"light.coherence_um": {"start": 1, "stop": 3}}),
    "step of 0": study({"light.coherence_um": {"start": 1, "stop": 3, "step": 0}}),
    "wrong word": study({"wave.theory": ["kirchof"]}),
    "wrong value": study({"light.coherence_um": [-1]}),
    "wrong value in a table": study({"light": {"coherence_um": [-1]}}),
    "zip as a word": study({"light.coherence_um": [10]}, zip="yes"),
}


def accepted(made: dict) -> bool:
    try:
        load_study({**copy.deepcopy(made), "scene": scene()} if "scene" in made else made)
    except InputError:
        return False
    return True


@pytest.mark.parametrize("name", GOOD)
def test_what_is_valid_passes(schema, name):
    assert accepted(GOOD[name])
    assert [e.message for e in schema.iter_errors(GOOD[name])] == []


@pytest.mark.parametrize("name", BAD)
def test_mistakes_are_marked(schema, name):
    assert not accepted(BAD[name])
    assert not schema.is_valid(BAD[name])


WRONG = (-1, 0, 0.5, 1, 1e9, True, "x", [], [1, 2], {}, {"x": 1})


def test_a_value_that_is_marked_makes_a_point_that_fails(schema):
    """Every key of every table at a dozen values: the schema is never stricter than the scene of the point."""
    base = load_study(study({"light.coherence_um": [1]}) | {"scene": scene()})
    marked = 0
    for table, model in TABLES.items():
        for key in model.model_fields if table not in ("output", "material.film") else ():
            for value in WRONG:
                if schema.is_valid(study({f"{table}.{key}": [value]})):
                    continue
                marked += 1
                with pytest.raises(VgonioError):
                    base.point({f"{table}.{key}": value})
    assert marked > 250


def test_the_command_writes_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", "--schema"]) == 0
    assert STUDY_SCHEMA_LINE == "#:schema ./vgonio-study.schema.json"
    assert STUDY_SCHEMA_LINE in capsys.readouterr().out
    assert json.loads((tmp_path / "vgonio-study.schema.json").read_text(encoding="utf-8")) == study_schema()
    assert main(["sweep"]) == 2
    assert "give STUDY" in capsys.readouterr().err
