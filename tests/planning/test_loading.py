"""Libraries are loaded once in a process: plans count them where they are loaded, and nowhere else."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

import vgonio as vg
from vgonio.accuracy.built_in import BUILT_IN
from vgonio.planning import loading
from vgonio.scene import load_scene


@pytest.fixture(autouse=True)
def known_machine(monkeypatch):
    monkeypatch.setenv("VGONIO_CALIBRATION", "off")


def scene(**changes) -> dict:
    return {
        "surface": {"generate": {"kind": "gaussian", "rms_um": 0.1, "correlation_um": 2, "shape": [24, 24]}},
        "material": {"name": "Al"},
        "light": {"wavelength_nm": [450, 550, 650], "theta_i_deg": [0, 30], "coherence_um": 4},
        "detector": {"theta_o_deg": [-30, 0, 30]},
        "geometric": {"rays": 100},
        "wave": {"tol": 1e-2},
        "output": {"file": "a.nc", "report": "a.html"},
        **changes,
    }


def with_libraries(monkeypatch, names) -> None:
    monkeypatch.setattr(loading, "already", lambda: set(names))


def test_a_second_plan_in_a_process_counts_the_work_alone(monkeypatch):
    """The difference is what loading takes, and nothing else changes."""
    with_libraries(monkeypatch, {"Python", "generators"})
    first = vg.plan(scene())
    with_libraries(monkeypatch, loading.LIBRARIES)
    again = vg.plan(scene())
    assert again.loading == 0
    assert first.loading > 0.3
    assert first.seconds - again.seconds == pytest.approx(first.loading, rel=1e-9)
    alone = vg.plan(scene(), new_process=True)
    start = BUILT_IN[1].loading["start"][0]
    assert alone.loading > first.loading + 0.9 * start
    assert alone.needs("start")
    assert not again.needs("start")
    assert alone.seconds - alone.loading == pytest.approx(again.seconds, rel=1e-9)


def test_what_is_loaded_stands_in_the_stages(monkeypatch):
    with_libraries(monkeypatch, {"Python", "generators"})
    made = vg.plan(scene())
    by_part = {s.part: s.loading for s in made.stages if s.seconds is not None}
    assert by_part["comparison"] > 0.1
    assert "of it to load libraries" in next(s.why for s in made.stages if s.name == "shift")
    assert sum(by_part.values()) == pytest.approx(made.loading) == json.loads(made.to_json())["loading"]
    assert "to load Python and libraries, once in a process" in made.table()[1][-1][5]


def test_two_parts_that_need_a_library_load_it_once():
    """Colours are drawn in the comparison and on the page; a page without the comparison has to load them itself."""
    speeds = BUILT_IN[1]

    def costs(given) -> dict[str, float]:
        parts = ["start", "rays", "waves", "comparison", "report"]
        parts = [p for p in parts if p != "waves" or "wave" in given]
        return {p: s for p, (s, _) in loading.costs(load_scene(given), None, parts, speeds, True).items()}

    both, rays = costs(scene()), costs({k: v for k, v in scene().items() if k != "wave"})
    assert both["comparison"] > speeds.loading["comparison"][0]
    assert both["report"] == pytest.approx(speeds.loading["report"][0])
    assert rays["report"] == pytest.approx(speeds.loading["comparison"][0] + speeds.loading["report"][0])
    assert rays["comparison"] < both["comparison"]


RUN = """
import json, sys
import vgonio as vg
from vgonio.planning import loading
from vgonio.scene import load_scene
scene = json.loads(sys.argv[1])
before, alone = vg.plan(scene), vg.plan(scene, new_process=True)
vg.simulate(scene)
after, alone_after = vg.plan(scene), vg.plan(scene, new_process=True)
from vgonio.assembly import gather
checked = load_scene(scene)
groups = [p for p in alone.parts()]
needed = set().union(*(loading.needed(checked, gather(checked).surface, p) for p in groups))
print(json.dumps({"loading": [p.loading for p in (before, alone, after, alone_after)],
                  "memory": [before.memory_bytes, after.memory_bytes, vg.memory.resident()],
                  "needed": sorted(needed), "already": sorted(loading.already()),
                  "own": "finufft" in sys.modules}))
"""


RIGOROUS = {
    "geometric": None,
    "wave": {"theory": "full-wave"},
    "light": {"wavelength_nm": [500], "theta_i_deg": [0], "coherence_um": 1},
    "output": {"file": "a.nc"},
}


@pytest.mark.parametrize("changes", [{}, RIGOROUS], ids=["rays and waves", "rigorous"])
def test_the_libraries_of_a_plan_are_those_that_a_run_loads(tmp_path, changes):
    """In a process of its own: what was said to be needed is there afterwards, and is not counted again."""
    given = scene(**changes)
    if "light" in changes:
        given["surface"]["generate"] |= {"shape": [1, 60], "pitch_um": 0.1}
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", RUN, json.dumps(given)],
        capture_output=True, text=True, check=True, cwd=tmp_path, timeout=600,
    )  # fmt: skip
    found = json.loads(done.stdout.splitlines()[-1])
    before, alone, after, alone_after = found["loading"]
    assert set(found["needed"]) <= set(found["already"])
    assert after == 0 < before < alone == alone_after
    assert found["own"] == ("finufft" in found["needed"])
    # of a run in this process: what it holds already and what comes to it
    assert found["memory"][1] > 0.9 * found["memory"][2]
