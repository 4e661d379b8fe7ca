"""The scene file: ranges, overrides, one-line errors that name the nearest key, and a template that knows every key."""

from __future__ import annotations

import json
import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgonio import scene as scenes
from vgonio.errors import FileFormatError, InputError
from vgonio.scene import TABLES, Scene, expand, load_scene, parse_override


def minimal(**changes: Any) -> dict[str, Any]:
    tables: dict[str, Any] = {
        "surface": {"file": "sample.npz"},
        "material": {"name": "Al"},
        "light": {"wavelength_nm": [450, 550], "theta_i_deg": [0, 30]},
        "detector": {"theta_o_deg": {"start": -60, "stop": 60, "step": 30}},
        "geometric": {},
        "wave": {},
    }
    return {k: v for k, v in {**tables, **changes}.items() if v is not None}


# ---- ranges
def test_range_includes_its_stop():
    assert expand({"start": 380, "stop": 780, "step": 20}) == [380.0 + 20 * i for i in range(21)]
    assert expand({"start": -85, "stop": 85, "step": 5})[-1] == 85.0
    assert expand({"start": 0, "stop": 10, "step": 4}) == [0.0, 4.0, 8.0]
    assert expand({"start": 30, "stop": 0, "step": -15}) == [30.0, 15.0, 0.0]
    assert expand(30) == [30]


@given(start=st.integers(-900, 900), count=st.integers(1, 200), step=st.integers(1, 50))
def test_range_in_tenths_has_neither_gaps_nor_overshoot(start, count, step):
    """Steps of 0.1 are not exact in binary: the stop must be reached all the same, once and never passed."""
    stop = start + (count - 1) * step
    values = expand({"start": start / 10, "stop": stop / 10, "step": step / 10})
    assert values == [round((start + i * step) / 10, 9) for i in range(count)]


@pytest.mark.parametrize(
    "text",
    [
        "{ start = 1, stop = 0, step = 1 }",
        "{ start = 0, stop = 1, step = 0 }",
        "{ start = 0, stop = 1 }",
        "{ start = 0, stop = 1, step = nan }",
        "{ start = 0, stop = 80, step = 1e-9 }",
        "{ start = '0', stop = [], step = 1 }",
    ],
)
def test_impossible_ranges_are_refused(text):
    with pytest.raises(InputError, match="range"):
        load_scene(minimal(), [f"light.theta_i_deg={text}"])


# ---- mistakes
# override → words that the one line has to hold
MISTAKES = {
    "light.wavelenght_nm=500": ("wavelenght_nm", "[light]", "did you mean 'wavelength_nm'"),
    "lihgt.theta_i_deg=3": ("lihgt", "did you mean 'light'"),
    "light.theta_o_deg=[0]": ("theta_o_deg", "[light]", "belongs to [detector]"),
    "surface.s_um=1": ("s_um", "[surface.filter]"),
    "surface.filter={s=1}": ("'s'", "[surface.filter]", "s_um"),
    "light.theta_i_deg={start=0,stop=1,stepp=1}": ("stepp", "did you mean 'step'"),
    "light.surface=1": ("surface", "[light]", "at the top"),
    "surface.pitch_um=0": ("pitch_um", "positive"),
    "surface.pitch_um=-0.5": ("pitch_um", "positive"),
    "surface.pitch_um='a'": ("pitch_um", "number"),
    "surface.level=plan": ("did you mean 'plane'",),
    "surface.periodic=1": ("surface.periodic", "boolean"),
    "surface.height_unit=parsec": ("parsec", "µm"),
    "surface.fill=guess": ("guess", "interpolate"),
    "surface.crop_um=0": ("crop_um",),
    "surface.generate={kind='flat'}": ("either file or generate", "both"),
    "light.theta_i_deg=[0, 90]": ("theta_i_deg", "90"),
    "light.theta_i_deg=[]": ("theta_i_deg", "empty"),
    "light.theta_i_deg=[10, 10]": ("theta_i_deg", "twice"),
    "light.wavelength_nm=[]": ("wavelength_nm", "empty"),
    "light.wavelength_nm=[-1]": ("wavelength_nm", "positive"),
    "light.coherence_um=0": ("coherence_um", "positive"),
    "light.polarisation=x": ("polarisation", "unpolarised"),
    "detector.theta_o_deg=[-95]": ("theta_o_deg", "-95"),
    "detector.aperture_deg=0": ("aperture_deg",),
    "detector.kind=hemi": ("did you mean 'hemisphere'",),
    "detector.kind=hemisphere": ("theta_o_deg", "resolution_deg"),
    "geometric.rays=0": ("geometric.rays", "1"),
    "geometric.rays=1.5": ("geometric.rays", "integer"),
    "geometric.tol=2": ("geometric.tol", "1"),
    "geometric=3": ("[geometric]", "table"),
    "wave.theory=kirchhof": ("did you mean 'kirchhoff'",),
    "wave.theory=[]": ("theory",),
    "wave.method=nuft": ("did you mean 'nufft'",),
    "material.file=Al.yml": ("either name", "file"),
}


@pytest.mark.parametrize("override", MISTAKES)
def test_a_mistake_is_one_line_that_says_where_and_what(override):
    with pytest.raises(InputError) as caught:
        load_scene(minimal(), [override])
    message = str(caught.value)
    assert "\n" not in message
    assert "pydantic" not in message
    for word in MISTAKES[override]:
        assert word in message


def test_an_unknown_key_comes_before_all_other_mistakes_and_the_rest_is_counted():
    with pytest.raises(
        InputError, match=r"unknown key 'pich_um' in \[surface\]: did you mean 'pitch_um'\? \(and 2 more\)"
    ):
        load_scene(minimal(), ["light.coherence_um='x'", "surface.pich_um=1", "wave.tol=0"])


@pytest.mark.parametrize(
    "override",
    [
        "wave.theory=[kirchhoff]",
        "wave.bounces=2",
        "wave.window_um=20",
    ],
)
def test_what_other_theories_lack_is_refused_and_not_dropped(override):
    with pytest.raises(InputError, match=r'is for theory = "iterated-kirchhoff"|is no TOML value'):
        load_scene(minimal(), [override])


def test_settings_that_change_nothing_are_accepted():
    load_scene(minimal(), ["wave.polarised=true"])
    with pytest.raises(InputError, match="alone"):
        load_scene(minimal(), ["wave.polarised=true", "wave.theory=harvey-shack"])
    load_scene(minimal(), ["wave.shadowing=false", "wave.bounces=1", "geometric.polarised=true"])


@pytest.mark.parametrize("table", ["surface", "material", "light", "detector"])
def test_simulation_needs_its_tables(table):
    with pytest.raises(InputError, match=rf"\[geometric\] needs the table \[{table}\]"):
        load_scene(minimal(**{table: None}))


def test_a_scene_that_asks_for_nothing_is_an_error():
    with pytest.raises(InputError, match="nothing to do"):
        load_scene({})
    assert load_scene({"measured": {"file": "a.json"}}).surface is None


@pytest.mark.parametrize(
    ("generate", "words"),
    [
        ({"kind": "gausian", "rms_um": 1}, "did you mean 'gaussian'"),
        ({"rms_um": 1}, "generate.kind"),
        ({"kind": "gaussian", "rms": 1}, "did you mean 'rms_um'"),
    ],
)
def test_generators_are_checked_with_the_scene(generate, words):
    with pytest.raises(InputError) as caught:
        load_scene(minimal(surface={"generate": generate}))
    assert words in str(caught.value)


# ---- overrides
@pytest.mark.parametrize(
    ("text", "keys", "value"),
    [
        ("light.coherence_um=20", ["light", "coherence_um"], 20),
        ("light.theta_i_deg=[0, 30]", ["light", "theta_i_deg"], [0, 30]),
        ("material.name=Al:McPeak", ["material", "name"], "Al:McPeak"),
        ("material.name='Al'", ["material", "name"], "Al"),
        ("surface.file=../a b=c.npz", ["surface", "file"], "../a b=c.npz"),
        ("surface.file=1bar.npz", ["surface", "file"], "1bar.npz"),
        ("surface.generate.rms_um=0.5", ["surface", "generate", "rms_um"], 0.5),
        ("wave.tol=1e-4", ["wave", "tol"], 1e-4),
    ],
)
def test_overrides_are_toml_values_or_bare_words(text, keys, value):
    assert parse_override(text) == (keys, value)


@pytest.mark.parametrize("text", ["light", "=3", "light..x=3", "light.x=[1, 2", "light.x=", "light.x={a=1"])
def test_broken_overrides_are_refused(text):
    with pytest.raises(InputError, match="--set"):
        parse_override(text)


def test_overrides_leave_the_given_dictionary_alone():
    given = minimal()
    before = json.dumps(given)
    assert load_scene(given, ["light.coherence_um=7"]).light.coherence_um == 7
    assert json.dumps(given) == before


def test_an_override_can_add_a_table():
    scene = load_scene(minimal(wave=None), ["wave.theory=harvey-shack"])
    assert scene.wave.theory == ["harvey-shack"]


# ---- files
def test_paths_are_relative_to_the_scene_file(tmp_path):
    (tmp_path / "deep").mkdir()
    path = tmp_path / "deep" / "scene.toml"
    path.write_text('[surface]\nfile = "../sample.npz"\n[output]\nfile = "out/result.nc"\n')
    scene = load_scene(path)
    assert scene.inputs == [tmp_path / "sample.npz"]
    assert scene.resolve(scene.output.file) == tmp_path / "deep" / "out" / "result.nc"
    assert scene.name == "scene"


@pytest.mark.parametrize("content", [b"[surface\n", b"a = = 3", b"\xff\xfe\x00", b"a = 1\na = 2"])
def test_a_file_that_is_no_toml_is_named(tmp_path, content):
    path = tmp_path / "scene.toml"
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match="scene.toml is no valid TOML"):
        load_scene(path)


def test_a_missing_scene_and_a_folder_are_named(tmp_path):
    with pytest.raises(FileFormatError, match="no such scene file"):
        load_scene(tmp_path / "none.toml")
    with pytest.raises(FileFormatError, match="is a folder: a scene file is needed"):
        load_scene(tmp_path)


def test_a_scene_survives_its_own_json():
    scene = load_scene(minimal(), ["surface.filter={s_um=2}", 'wave.theory=["kirchhoff", "harvey-shack"]'])
    assert load_scene(json.loads(scene.to_json())) == scene


# ---- the template of `vgonio init`
def _template() -> str:
    return (files("vgonio") / "template.toml").read_text(encoding="utf-8")


def test_the_template_is_a_valid_scene():
    scene = load_scene(tomllib.loads(_template()))
    assert scene.geometric is not None
    assert scene.wave is not None


def test_the_template_with_everything_commented_in_names_every_key():
    """Every key of every table stands in the template, so that `vgonio init` documents all there is."""
    template = _template()
    known = {key for table in TABLES.values() for key in table.model_fields} | set(Scene.model_fields)
    absent = {key for key in known if key not in template}
    assert absent == set()


def test_the_demo_scene_is_valid():
    path = Path(__file__).resolve().parents[2] / "examples" / "demo" / "scene.toml"
    scene = load_scene(path)
    assert len(scene.light.wavelength_nm) == 21
    assert len(scene.light.theta_i_deg) == 9
    assert len(scene.detector.theta_o_deg) == 35


def test_generators_named_in_scenes_exist():
    import vgonio as vg

    assert [k for k in scenes.GENERATORS if not callable(getattr(vg.surface, k, None))] == []


def test_theories_and_methods_are_those_of_the_wave_solver():
    from vgonio.scene.tables import METHODS, THEORIES
    from vgonio.wave import fourier, theories

    further = {"full-wave", "iterated-kirchhoff"}  # solvers of their own
    assert set(theories.THEORIES) == set(THEORIES) - further
    assert set(METHODS) == set(fourier.METHODS)


def test_tracers_and_estimators_are_those_of_the_ray_solver():
    from vgonio.geometric.sampling import ESTIMATORS
    from vgonio.geometric.tracers import TRACERS
    from vgonio.scene import tables

    assert set(tables.TRACERS) == set(TRACERS)
    assert tables.ESTIMATORS == ESTIMATORS
    for key in ("tracer", "estimator"):
        with pytest.raises(InputError, match="known"):
            load_scene(minimal(), [f"geometric.{key}=optix"])
