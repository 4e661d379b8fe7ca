"""A study file is checked before any work starts; a point is known by what it computes."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio.dataset import COORDINATES, VARIABLES
from vgonio.errors import FileFormatError, InputError
from vgonio.studies.gathering import swept_dims
from vgonio.studies.store import Store
from vgonio.studies.study import content_key, load_study
from vgonio.studies.sweeping import todo

SCENE = {
    "surface": {
        "generate": {"kind": "gaussian", "rms_um": 0.5, "correlation_um": 4.0, "shape": [16, 16], "pitch_um": 1}
    },
    "material": {"name": "Al"},
    "light": {"wavelength_nm": 500, "theta_i_deg": 0},
    "detector": {"theta_o_deg": [-30, 0, 30]},
    "geometric": {"rays": 500},
}
RMS, SEED = "surface.generate.rms_um", "surface.generate.seed"


def study(**changes):
    return load_study({"scene": SCENE, "vary": {RMS: [0.1, 0.2, 0.3], SEED: [1, 2]}, **changes})


def test_a_grid_has_all_combinations_the_last_key_fastest():
    made = study()
    assert made.shape == (3, 2)
    assert len(made) == 6
    assert [tuple(v.values()) for v in made.values()][:3] == [(0.1, 1), (0.1, 2), (0.2, 1)]


def test_side_by_side():
    made = study(zip=True, vary={RMS: [0.1, 0.2], SEED: [1, 2]})
    assert [tuple(v.values()) for v in made.values()] == [(0.1, 1), (0.2, 2)]
    with pytest.raises(InputError, match="numbers differ"):
        study(zip=True)


def test_ranges_and_dotted_tables():
    made = study(vary={"surface": {"generate": {"rms_um": {"start": 0.1, "stop": 0.3, "step": 0.1}}}})
    assert made.vary == {RMS: [0.1, 0.2, 0.3]}


def test_a_file_and_its_scene(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "scene.toml").write_text(
        '[surface]\ngenerate = { kind = "flat", shape = [8, 8], pitch_um = 1 }\n[material]\nname = "Al"\n'
        "[light]\nwavelength_nm = 500\ntheta_i_deg = 0\n[detector]\ntheta_o_deg = 0\n[geometric]\n"
    )
    (tmp_path / "study.toml").write_text('scene = "a/scene.toml"\n[vary]\n"material.name" = ["Al", "Au"]\n')
    made = load_study(tmp_path / "study.toml", ["geometric.rays=77"])
    point = made.point({"material.name": "Au"})
    assert (point.material.name, point.geometric.rays) == ("Au", 77)
    assert made.title == "study"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"varies": {}}, "unknown key 'varies'.*did you mean 'vary'"),
        ({"vary": {}}, r"\[vary\] is missing"),
        ({"vary": {RMS: 3}}, "needs a list"),
        ({"vary": {RMS: []}}, "needs a list"),
        ({"vary": {RMS: [1, 1]}}, "twice"),
        ({"vary": {"surface.generate.rms": [1, 2]}}, "no point of it is a valid scene.*rms_um"),
        ({"vary": {"surfaces.level": ["plane"]}}, "unknown.*did you mean 'surface'"),
        ({"vary": {"geometric.rays": [-1, "x"]}}, "no point of it is a valid scene"),
        ({"vary": {RMS: [float("nan"), 0.5]}}, "finite.*nan"),
        ({"vary": {RMS: {"start": 0, "stop": float("inf"), "step": 1}}}, "rms_um.*range"),
        ({"vary": {"output.file": ["a.nc", "b.nc"]}}, "does not change what a point computes"),
        ({"vary": {"light.theta_i_deg": [0, 30]}}, r"axis of each result: give the scene the list.*\[0, 30\]"),
        ({"vary": {"light.wavelength_nm": {"start": 400, "stop": 500, "step": 50}}}, "give the scene the list"),
        ({"vary": {"detector": {"theta_o_deg": [[0, 10], 20]}}}, "give the scene the list"),
        ({"vary": {"light.theta_i_deg": [[0], [0, 30]]}}, "equal length"),
        ({"scene": 3}, "scene.toml"),
        ({"zip": "yes"}, "true or false"),
    ],
)
def test_mistakes_are_one_line(changes, message):
    with pytest.raises(InputError, match=message) as caught:
        study(**changes)
    assert "\n" not in str(caught.value)


def test_files_that_are_no_studies(tmp_path):
    with pytest.raises(FileFormatError, match="no such study"):
        load_study(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_bytes(b"\xff\x00=")
    with pytest.raises(FileFormatError, match="TOML"):
        load_study(tmp_path / "bad.toml")


# ---- identity
def test_the_key_is_that_of_the_content():
    made = study()
    keys = [content_key(made.point(v)) for v in made.values()]
    assert len(set(keys)) == 6
    renamed = load_study({"scene": {**SCENE, "title": "other", "output": {"file": "x.nc"}}, "vary": made.vary})
    assert [content_key(renamed.point(v)) for v in renamed.values()] == keys


def test_the_key_follows_the_bytes_of_the_input_not_its_name(tmp_path):
    def key(name: str, value: float) -> str:
        np.savez(tmp_path / name, z=np.full((8, 8), value), pitch_um=1.0)
        scene = {**SCENE, "surface": {"file": str(tmp_path / name)}}
        made = load_study({"scene": scene, "vary": {"geometric.seed": [0, 1]}})
        return content_key(made.point({"geometric.seed": 0}))

    first = key("a.npz", 0.0)
    assert key("b.npz", 0.0) == first
    assert key("a.npz", 1.0) != first


def test_the_key_follows_the_version(monkeypatch):
    scene = study().scene
    before = content_key(scene)
    monkeypatch.setattr("vgonio.studies.study.__version__", "99.0")
    assert content_key(scene) != before


# ---- names of the dims
def test_names_of_swept_dims_are_short_and_differ():
    vary = {RMS: [1], "material.name": ["Al"], SEED: [1], "geometric.seed": [1], "light.theta_i_deg": [0]}
    dims, coords = swept_dims(load_study({"scene": SCENE, "vary": vary}))
    assert dims == ("rms_um", "material_name", "generate_seed", "geometric_seed", "theta_i_deg")
    assert coords["rms_um"][2] == {"units": "um", "long_name": RMS}


@pytest.mark.parametrize(
    ("key", "dim"),
    [
        ("geometric.rays", "geometric_rays"),
        ("wave.windows", "wave_windows"),
        ("wave.fresnel", "wave_fresnel"),
        ("geometric.max_bounces", "max_bounces"),
    ],
)
def test_no_dim_is_named_as_what_results_hold(key, dim):
    dims, _ = swept_dims(load_study({"scene": SCENE, "vary": {key: [1]}}) if "wave" not in key else _of_waves(key))
    assert dims == (dim,)
    assert dim not in {**COORDINATES, **VARIABLES}


def _of_waves(key):
    values = {"wave.windows": [2, 3], "wave.fresnel": ["half", "local"]}[key]
    return load_study({"scene": {**SCENE, "wave": {}}, "vary": {key: values}})


def test_equal_lists_of_angles_may_vary():
    vary = {"light.theta_i_deg": [[0, 30], {"start": 10, "stop": 20, "step": 10}], "light.wavelength_nm": [500]}
    assert study(vary=vary).shape == (2, 1)


def test_side_by_side_there_is_one_dim():
    dims, coords = swept_dims(study(zip=True, vary={RMS: [0.1, 0.2], SEED: [1, 2]}))
    assert dims == ("point",)
    assert {"point", "rms_um", "generate_seed"} == set(coords)


# ---- what is left to do
def test_what_the_machine_failed_is_tried_again_and_refused_input_is_not(tmp_path):
    """Of six points one is done, one was refused, one lost with its worker; what has ended is counted."""
    made, store = study(), Store.made(tmp_path)
    points = list(made.values())
    keys = [content_key(made.point(v)) for v in points]
    store.result(keys[0]).parent.mkdir(parents=True)
    store.result(keys[0]).write_bytes(b"finished")
    store.fail(keys[1], "no such thing", "input", points[1])
    store.fail(keys[2], "the worker was lost", "machine", points[2])

    def left(retry: bool) -> tuple[list[str], int]:
        ended: list[int] = []
        return [key for key, _, _ in todo(made, store, retry, lambda: ended.append(1))], len(ended)

    assert left(retry=False) == (keys[2:], 2)
    assert left(retry=True) == (keys[1:], 1)


def test_messages_name_the_files_with_their_endings(tmp_path) -> None:
    (tmp_path / "base.toml").write_text('[material]\nname = "Al"\n[surface]\ngenerate = { kind = "flat" }\n')
    path = tmp_path / "bad3.toml"
    path.write_text('scene = "base.toml"\n[vary]\n"material.nme" = [1]\n')
    with pytest.raises(InputError, match=r"^bad3\.toml: no point of it is a valid scene: base\.toml: .*nme"):
        load_study(path)
    path.write_text('scene = "base.toml"\nvarry = 1\n[vary]\n"material.name" = ["Al", "Au"]\n')
    with pytest.raises(InputError, match=r"^bad3\.toml: unknown key 'varry'"):
        load_study(path)
    path.write_text('scene = "base.toml"\n[vary]\n"material.name" = ["Al", "Au"]\n')
    assert load_study(path).title == "bad3"
