"""After a run: what is said where it took much more or less than was expected."""

from __future__ import annotations

import json

import pytest

import vgonio as vg
from vgonio.cli import main
from vgonio.planning.record import disagreement


def plan(rays: float, waves: float = 1.0) -> dict:
    stages = [("rays", "trace", rays), ("rays", "tally", None), ("waves", "transform", waves), ("report", "page", None)]
    rows = [{"part": p, "name": n, "seconds": s, "needed": True} for p, n, s in stages]
    return {"stages": [*rows, {"part": "save", "name": "save", "seconds": None, "needed": False}], "machine": "here"}


@pytest.mark.parametrize(
    ("expected", "took", "worked", "words"),
    [
        (9, 19.9, 19.9, ""),
        (9, 5.1, 5.1, ""),
        (9, 21, 21, "expected were 10 s, it took 21 s (here): `vgonio accuracy --calibrate` measures this machine"),
        (9, 4.9, 4.9, "expected were 10 s, it took 4.9 s (here): `vgonio accuracy --calibrate` measures this machine"),
        (9, 30, 12, "expected were 10 s, it took 30 s, 12 s of them the processor's: other programs, files or a device "
                    "were in the way"),
        (0.1 - 1, 1.9, 1.9, ""),  # too short to be worth a line
    ],
)  # fmt: skip
def test_more_than_twice_and_less_than_half_are_told(expected, took, worked, words):
    half = {"rays": took - 0.5, "waves": 0.5, "surface": 100.0}  # what was not forecast does not count
    assert disagreement(plan(expected), half, {"rays": worked - 0.5, "waves": 0.5}) == words


def test_a_result_says_what_it_took_of_the_processor():
    """Never much more than elapsed seconds times processors."""
    tree = vg.simulate({"surface": {"generate": {"kind": "flat", "shape": [8, 8]}}})
    assert set(json.loads(tree.attrs["processor_seconds"])) == set(json.loads(tree.attrs["seconds"]))


def test_the_command_says_it_in_one_line(monkeypatch, tmp_path, capsys):
    """A machine a thousand times slower than this one is expected to take so much longer."""
    from dataclasses import replace

    from vgonio import planning
    from vgonio.accuracy import calibration

    monkeypatch.setenv("VGONIO_CALIBRATION", "off")
    found = calibration()
    slow = replace(found, speeds=replace(found.speeds, ray=1000 * found.speeds.ray))
    monkeypatch.setattr(planning, "calibration", lambda: slow)
    path = tmp_path / "scene.toml"
    main(["init", str(path)])
    small = ["--set", "surface.generate.shape=[32, 32]", "--set", "light.theta_i_deg=[0]", "--set", "output={}"]
    run = ["simulate", str(path), "-o", str(tmp_path / "a.nc"), *small, "--set", "geometric.rays=200000"]
    capsys.readouterr()
    assert main(run) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if "expected were" in line]
    assert len(lines) == 1
    assert "vgonio accuracy --calibrate" in lines[0]
    assert main([*run, "--quiet"]) == 0
    assert "expected were" not in capsys.readouterr().out
