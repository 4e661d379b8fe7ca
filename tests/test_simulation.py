"""A scene becomes a result: which groups there are, what they carry, and what an interruption leaves behind.

The solvers are stand-ins here: what they compute is tested beside them, and the whole chain in contracts/.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio import assembly
from vgonio.dataset import brdf_dataset
from vgonio.errors import FileFormatError, InputError, MaterialError
from vgonio.simulation import simulate, simulated


@dataclass(frozen=True)
class Lambertian:
    """A stand-in: reflectance/π into every direction, or an interruption."""

    wavelength_nm: tuple[float, ...]
    reflectance: float = 0.5
    interrupt: bool = False
    progress: Any = None

    def scatter(self, surface, incoming, detector) -> xr.Dataset:
        if self.interrupt:
            raise KeyboardInterrupt
        if self.progress is not None:
            self.progress(0.5)
        shape = (len(incoming.theta_deg), len(detector), len(self.wavelength_nm))
        brdf = np.full(shape, self.reflectance / np.pi)
        dims = ("theta_i", *detector.dims, "wavelength")
        variables = {"brdf": (dims, brdf), "brdf_stderr": (dims, 0.01 * brdf)}
        return brdf_dataset(variables, incoming.theta_deg, self.wavelength_nm, detector, attrs={"method": "stand-in"})


@pytest.fixture
def stand_ins(monkeypatch):
    """Both solvers replaced; `calls` lists what was asked for and `interrupt` names what is interrupted."""

    class Used:
        calls: list[str] = []
        interrupt = ""

    used = Used()
    used.calls = []

    def solver(name):
        used.calls.append(name)
        return lambda scene, progress: Lambertian(
            tuple(scene.light.wavelength_nm), 0.5, used.interrupt == name, progress
        )

    monkeypatch.setattr(assembly, "rays", lambda scene, progress=None: solver("rays")(scene, progress))
    monkeypatch.setattr(assembly, "waves", lambda scene, theory, progress=None: solver(theory)(scene, progress))
    return used


def scene(**changes: Any) -> dict[str, Any]:
    tables: dict[str, Any] = {
        "title": "test",
        "surface": {"generate": {"kind": "flat", "shape": [32, 32], "pitch_um": 1.0}},
        "material": {"name": "perfect"},
        "light": {"wavelength_nm": [450, 550, 650], "theta_i_deg": [0, 30], "coherence_um": 4},
        "detector": {"theta_o_deg": [-45, -30, 0, 30, 45]},
        "geometric": {"rays": 100},
        "wave": {"theory": ["kirchhoff", "harvey-shack"]},
    }
    return {k: v for k, v in {**tables, **changes}.items() if v is not None}


def test_the_groups_are_those_of_the_scene(stand_ins):
    tree = simulate(scene())
    assert list(tree.children) == ["surface", "rays", "waves", "waves_harvey_shack", "comparison"]
    assert list(dict.fromkeys(stand_ins.calls)) == ["rays", "kirchhoff", "harvey-shack"]  # planned, then made
    assert set(simulated(tree)) == {"rays", "waves", "waves_harvey_shack"}


def test_what_is_absent_is_not_made(stand_ins):
    tree = simulate(scene(wave=None), ["light.wavelength_nm=500"])
    assert list(tree.children) == ["surface", "rays"]
    assert set(stand_ins.calls) == {"rays"}


def test_one_result_with_a_spectrum_is_judged_by_itself(stand_ins):
    tree = simulate(scene(wave=None))
    assert list(tree.children) == ["surface", "rays", "comparison"]
    assert "slope" in tree["comparison"].data_vars


def test_attributes_tell_how_the_result_came_about(stand_ins):
    tree = simulate(scene(wave=None), overrides=["light.theta_i_deg=[10]"])
    assert tree.attrs["title"] == "test"
    assert json.loads(tree.attrs["scene"])["light"]["theta_i_deg"] == [10]
    assert {s["name"] for s in json.loads(tree.attrs["plan"])["stages"]} >= {"trace", "transform", "compare"}
    assert set(json.loads(tree.attrs["seconds"])) >= {"surface", "rays"}
    origin = json.loads(tree.attrs["provenance"])
    assert origin["versions"]["vgonio"] == vg.__version__
    assert origin["cpu_count"] >= 1


def test_inputs_are_identified_by_their_hash(stand_ins, tmp_path):
    import hashlib

    path = tmp_path / "flat.npz"
    vg.surface.write(vg.surface.flat(shape=(32, 32), pitch_um=1.0), path)
    tree = simulate(scene(surface={"file": str(path)}, wave=None))
    assert json.loads(tree.attrs["provenance"])["inputs"] == {"flat.npz": hashlib.sha256(path.read_bytes()).hexdigest()}


def test_the_result_file_holds_the_same_numbers(stand_ins, tmp_path):
    path = tmp_path / "new" / "result.nc"
    tree = simulate(scene(wave=None, output={"file": str(path)}))
    again = vg.open(path)
    xr.testing.assert_identical(again["rays"].to_dataset(), tree["rays"].to_dataset())
    assert [p.name for p in path.parent.iterdir()] == ["result.nc"]


def test_scenes_are_files_dictionaries_and_scenes(stand_ins, tmp_path):
    from vgonio.scene import load_scene

    path = tmp_path / "scene.toml"
    path.write_text(
        '[surface]\ngenerate = { kind = "flat", shape = [8, 8], pitch_um = 1 }\n[material]\nname = "perfect"\n'
        "[light]\nwavelength_nm = 500\ntheta_i_deg = 0\ncoherence_um = 1\n[detector]\ntheta_o_deg = 0\n[geometric]\n"
        '[output]\nfile = "result.nc"\n'
    )
    from_file = simulate(path)
    from_scene = simulate(load_scene(path))
    xr.testing.assert_equal(from_file["rays"].to_dataset(), from_scene["rays"].to_dataset())
    assert (tmp_path / "result.nc").is_file()


def test_progress_is_told_by_part(stand_ins):
    told: list[tuple[str, float]] = []
    simulate(scene(wave=None), progress=lambda part, fraction: told.append((part, fraction)))
    assert [f for p, f in told if p == "rays"] == [0.0, 0.5, 1.0]


def test_an_interruption_keeps_what_was_finished_under_another_name(stand_ins, tmp_path):
    path = tmp_path / "result.nc"
    stand_ins.interrupt = "kirchhoff"
    with pytest.raises(KeyboardInterrupt) as caught:
        simulate(scene(output={"file": str(path)}))
    assert [p.name for p in tmp_path.iterdir()] == ["result.partial.nc"]
    kept = vg.open(tmp_path / "result.partial.nc")
    assert list(kept.children) == ["surface", "rays"]
    assert "interrupted" in kept.attrs
    assert any("result.partial.nc" in note for note in caught.value.__notes__)


@pytest.mark.parametrize("failing", ["vgonio.measure.storage.save", "vgonio.report.page"])
def test_an_interruption_while_writing_loses_nothing(stand_ins, tmp_path, monkeypatch, failing):
    from importlib import import_module

    module, _, name = failing.rpartition(".")
    right, calls = getattr(import_module(module), name), []

    def once(*arguments):
        calls.append(arguments)
        if len(calls) == 1:
            raise KeyboardInterrupt
        return right(*arguments)

    monkeypatch.setattr(import_module(module), name, once)
    with pytest.raises(KeyboardInterrupt) as caught:
        simulate(scene(output={"file": str(tmp_path / "r.nc"), "report": str(tmp_path / "r.html")}))
    kept = "r.partial.nc" if name == "save" else "r.nc"
    assert [p.name for p in tmp_path.iterdir()] == [kept]
    assert {"rays", "waves"} <= set(vg.open(tmp_path / kept).children)
    assert kept in caught.value.__notes__[0]


def test_an_interruption_before_anything_was_finished_leaves_nothing(stand_ins, tmp_path):
    stand_ins.interrupt = "rays"
    with pytest.raises(KeyboardInterrupt):
        simulate(scene(output={"file": str(tmp_path / "result.nc")}))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({"material": {"name": "Unobtainium"}}, MaterialError),
        ({"output": {"file": "result.txt"}}, InputError),
        ({"surface": {"generate": {"kind": "flat", "shape": [32, 32], "pitch_um": -1.0}}}, InputError),
    ],
)
def test_bad_input_is_found_before_any_work(stand_ins, changes, error):
    with pytest.raises(error):
        simulate(scene(**changes))
    assert stand_ins.calls == []


def test_a_result_without_a_brdf_has_nothing_to_show():
    with pytest.raises(InputError, match="no group with a BRDF"):
        simulated(xr.DataTree())


@pytest.mark.parametrize(("asked", "threads"), [("3", 3), ("", None)])
def test_the_ray_tracer_takes_the_threads_of_the_command_line(monkeypatch, asked, threads):
    from vgonio.scene import load_scene

    monkeypatch.setenv("OMP_NUM_THREADS", asked)
    assert assembly.rays(load_scene(scene())).threads == threads


@pytest.mark.parametrize("name", ["scene", "plan", "provenance", "seconds"])
def test_a_result_with_spoilt_attributes_is_refused(stand_ins, tmp_path, name):
    tree = simulate(scene())
    for spoilt in ("{", 7.5):
        tree.attrs[name] = spoilt
        path = vg.save(tree, tmp_path / "result.nc")
        with pytest.raises(FileFormatError, match=name):
            vg.open(path)


def test_a_result_with_a_spoilt_surface_is_refused(stand_ins, tmp_path):
    tree = simulate(scene())
    tree["surface"] = xr.DataTree(tree["surface"].to_dataset().drop_vars("height_density"))
    with pytest.raises(FileFormatError, match="height_density"):
        vg.open(vg.save(tree, tmp_path / "result.nc"))
