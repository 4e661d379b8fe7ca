"""The file of the calibration: what is kept comes back, what does not fit is not used, with reason and command."""

from __future__ import annotations

import json
import os
from dataclasses import replace

import pytest

import vgonio as vg
from vgonio.accuracy import Speeds, calibration, calibration_path
from vgonio.accuracy.built_in import BUILT_IN, MACHINE
from vgonio.cli import main
from vgonio.errors import FileFormatError, InputError

SOME = {
    **{name: 1.5e-7 for name in Speeds.__dataclass_fields__ if name not in ("fixed", "loading")},
    "fixed": {"rays": 0.1},
    "loading": {"start": (0.5, 1e8), "rays": (0.0, 1e7)},
}


@pytest.fixture
def quick(tmp_path, monkeypatch):
    """A file of its own, and trials that take no time."""
    path = tmp_path / "folder" / "calibration.json"
    monkeypatch.setenv("VGONIO_CALIBRATION", str(path))
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    monkeypatch.setattr("vgonio.accuracy.trials.measured", lambda processor_time, threads: iter([SOME]))
    return path


def test_what_is_kept_comes_back(quick):
    made = vg.accuracy.calibrate()
    assert calibration() == made
    assert (made.threads, made.why_not) == (2, "")
    assert made.speeds.fixed["rays"] == 0.1
    assert made.speeds.loading["start"] == (0.5, 1e8)
    assert [p.name for p in quick.parent.iterdir()] == ["calibration.json"]  # nothing temporary is left


def test_each_number_of_threads_has_its_entry(quick, monkeypatch):
    two = vg.accuracy.calibrate()
    assert calibration(1).why_not == "not for 1 thread"
    assert str(calibration(1)).startswith("calibrated on this machine")
    assert calibration(1).speeds == two.speeds  # still nearer than another machine's
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    one = vg.accuracy.calibrate()
    assert calibration(1) == one
    assert calibration(2) == two


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (lambda kept: None, "not calibrated"),
        (lambda kept: "{", "truncated or no JSON"),
        (lambda kept: "[1, 2]", "damaged"),
        (lambda kept: json.dumps(kept | {"version": "0.0.1"}), "of version 0.0.1"),
        (lambda kept: json.dumps(kept | {"machine": "an abacus"}), "another machine (an abacus)"),
        (lambda kept: json.dumps(kept | {"format": "a recipe"}), "no calibration"),
        (lambda kept: json.dumps(kept).replace("1.5e-07", "-1.5e-07", 1), "damaged"),
        (lambda kept: json.dumps(kept).replace("1.5e-07", "NaN", 1), "damaged"),
        (lambda kept: json.dumps(kept).replace('"ray"', '"beam"'), "damaged"),
    ],
)
def test_what_does_not_fit_is_not_used(quick, spoil, why):
    vg.accuracy.calibrate()
    text = spoil(json.loads(quick.read_text()))
    quick.unlink() if text is None else quick.write_text(text)
    found = calibration()
    assert why in found.why_not
    assert (found.machine, found.speeds) == (MACHINE, BUILT_IN[2])
    assert "vgonio accuracy --calibrate" in str(found)
    vg.accuracy.calibrate()  # and a new one takes its place
    assert calibration().why_not == ""


def test_libraries_that_changed_are_told_and_the_figures_still_used(quick, monkeypatch):
    """Nearer than another machine's, but no longer quite true."""
    made = vg.accuracy.calibrate()
    assert {"numpy", "scipy", "embreex", "finufft"} <= set(made.libraries)
    older = json.loads(quick.read_text())
    older["threads"]["2"]["libraries"] |= {"numpy": "1.0"}
    del older["threads"]["2"]["libraries"]["finufft"]
    quick.write_text(json.dumps(older))
    found = calibration()
    assert found.speeds == made.speeds
    now = made.libraries
    assert found.why_not == f"numpy 1.0 has become {now['numpy']}, finufft (none) has become {now['finufft']}"
    assert str(found).startswith("calibrated on this machine")
    assert "vgonio accuracy --calibrate" in str(found)
    vg.accuracy.calibrate()
    assert calibration().why_not == ""


def test_a_driver_of_opencl_that_changed_is_told(quick, monkeypatch, tmp_path):
    """As its own files say it, so that OpenCL need not be loaded to know."""
    library = tmp_path / "libdriver.so.1"
    library.write_text("")
    (tmp_path / "vendor.icd").write_text(f"{library}\n")
    monkeypatch.setenv("OCL_ICD_VENDORS", str(tmp_path))
    vg.accuracy.calibrate()
    assert calibration().why_not == ""
    os.utime(library, (0, 0))
    assert calibration().why_not.startswith("OpenCL drivers vendor (libdriver.so.1, ")
    vg.accuracy.calibrate()
    monkeypatch.setenv("VGONIO_OPENCL_DEVICE", "another")
    assert calibration().why_not == "OpenCL device (none) has become another"


def test_where_it_lies(monkeypatch, tmp_path):
    monkeypatch.delenv("VGONIO_CALIBRATION", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert calibration_path() == tmp_path / "vgonio" / "calibration.json"
    monkeypatch.setenv("VGONIO_CALIBRATION", "off")
    assert calibration_path() is None
    assert "VGONIO_CALIBRATION is off" in calibration().why_not
    with pytest.raises(InputError, match="VGONIO_CALIBRATION is off"):
        vg.accuracy.calibrate()


def test_what_cannot_be_written_is_told_before_the_work(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("VGONIO_CALIBRATION", str(tmp_path / "file" / "calibration.json"))
    monkeypatch.setattr("vgonio.accuracy.trials.measured", lambda *a: pytest.fail("work was begun"))
    with pytest.raises(FileFormatError, match="cannot make the folder"):
        vg.accuracy.calibrate()


def test_the_command_keeps_it_and_plans_tell(quick, capsys, tmp_path):
    scene = tmp_path / "scene.toml"
    assert main(["init", str(scene)]) == 0
    assert main(["plan", str(scene)]) == 0
    assert "this one is not calibrated; `vgonio accuracy --calibrate`" in " ".join(capsys.readouterr().out.split())
    assert main(["accuracy", "--calibrate"]) == 0
    assert str(quick) in capsys.readouterr().out
    assert main(["plan", str(scene)]) == 0
    assert "calibrated on this machine" in capsys.readouterr().out
    assert main(["accuracy", "furnace", "--calibrate"]) == 2
    assert main(["accuracy", "--calibrate", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["threads"] == 2


def test_slower_speeds_make_longer_plans(quick, monkeypatch):
    scene = {
        "surface": {"generate": {"kind": "gaussian", "rms_um": 0.3, "correlation_um": 4, "shape": [64, 64]}},
        "material": {"name": "Al"},
        "light": {"wavelength_nm": [550], "theta_i_deg": [30], "coherence_um": 5},
        "detector": {"theta_o_deg": [-30, 0]},
        "geometric": {"rays": 1_000_000},
    }  # fmt: skip
    made = vg.accuracy.calibrate()
    slow = replace(made, speeds=replace(made.speeds, ray=10 * made.speeds.ray))
    monkeypatch.setattr("vgonio.planning.calibration", lambda: slow)
    later = vg.plan(scene).seconds
    monkeypatch.setattr("vgonio.planning.calibration", lambda: made)
    assert later - vg.plan(scene).seconds == pytest.approx(9 * 1e6 * made.speeds.ray, rel=1e-6)
