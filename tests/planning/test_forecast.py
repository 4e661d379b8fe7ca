"""What plans expect beside what runs take: the benchmark's scenes, a few of them, calibrated in the same run."""

from __future__ import annotations

import importlib.util
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import vgonio as vg

ROOT = Path(__file__).resolve().parents[2]


def _benchmark():
    spec = importlib.util.spec_from_file_location("forecast_benchmark", ROOT / "benchmarks" / "forecast.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


benchmark = _benchmark()


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory) -> Callable[[int], str]:
    """calibrated(n): the n-th calibration of one thread in the processor's seconds: others change these little.

    Where what is forecast by one of them is not met, another is made: on a shared machine the speed itself may change
    between a calibration and a run, and what disagrees with three of them is wrong."""
    made: dict[int, str] = {}

    def calibration(n: int) -> str:
        if n not in made:
            made[n] = str(tmp_path_factory.mktemp("calibration") / "calibration.json")
            benchmark.calibrated(made[n], processor_time=True)
        return made[n]

    return calibration


@pytest.mark.parametrize("name", ["init", "hemisphere"])
def test_seconds_and_memory_are_expected_within_a_factor_of_2(calibrated, name):
    """A factor of 2 is what is promised: a plan counts the work but not how caches and threads share it, and the
    spacing of points is found by trial. All scenes and programs: docs/howto/accuracy.md."""
    for n in range(3):
        rows = {r["part"]: r["ratio"] for r in benchmark.measured(name, calibrated(n))}
        if 0.5 < rows["all parts"] < 2:
            break
    assert 0.5 < rows["all parts"] < 2
    assert 0.5 < rows["memory"] < 2


def test_a_run_meets_its_time(calibrated, monkeypatch):
    """Seconds of the processor, of all threads together, so that other programs do not count; within 2 of what is
    asked, as forecasts are. A slow machine is asked for more, so that there is something to choose."""
    for n in range(3):
        monkeypatch.setenv("VGONIO_CALIBRATION", calibrated(n))
        given = scene(geometric={"rays": 1000}, wave={})
        seconds = max(15.0, 3 * vg.plan(given, tol=0.3).seconds)
        begin = time.process_time()
        vg.simulate(given, max_seconds=seconds)
        took = time.process_time() - begin
        if took < 2 * seconds:
            break
    assert took < 2 * seconds


def scene(**changes) -> dict:
    return {
        "surface": {"generate": {"kind": "gaussian", "rms_um": 0.3, "correlation_um": 4, "shape": [64, 64],
                                 "pitch_um": 1.0}},
        "material": {"name": "Al"},
        "light": {"wavelength_nm": [450, 550, 650], "theta_i_deg": [0, 40], "coherence_um": 5},
        "detector": {"theta_o_deg": [-60, -40, -20, 0, 20]},
        **changes,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("less", "more", "at_least"),
    [
        ({"geometric": {"rays": 10**6}}, {"geometric": {"rays": 10**7}}, 3),
        (
            {"geometric": {"tol": 0.3, "rays": 10**9, "estimator": "binning"}},
            {"geometric": {"tol": 0.03, "rays": 10**9, "estimator": "binning"}},
            3,
        ),
        ({"wave": {}}, {"wave": {"tol": 1e-6}}, 1.2),
        ({"wave": {}}, {"wave": {"theory": ["kirchhoff", "harvey-shack"]}}, 1.0),
        ({"wave": {}}, {"wave": {"polarised": True}}, 3),
        ({"wave": {}}, {"wave": {"shadowing": True}}, 1.1),
        ({"wave": {"windows": 1}}, {"wave": {}}, 1.0),
    ],
)
def test_more_work_is_expected_to_take_longer(monkeypatch, less, more, at_least):
    monkeypatch.setenv("VGONIO_CALIBRATION", "off")
    little, much = vg.plan(scene(**less)), vg.plan(scene(**more))
    fixed = vg.plan(scene(geometric={"rays": 1})).seconds if "geometric" in less else 0.0
    assert much.seconds - fixed > at_least * (little.seconds - fixed)


def test_errors_are_those_that_solvers_state(monkeypatch):
    """Waves: the tolerance. Rays in cones: from their number; four times as many make half the error."""
    monkeypatch.setenv("VGONIO_CALIBRATION", "off")
    assert vg.plan(scene(wave={"tol": 1e-4})).error == 1e-4
    rays = [vg.plan(scene(geometric={"rays": n, "estimator": "binning"})).error for n in (10**6, 4 * 10**6)]
    assert rays[0] == pytest.approx(2 * rays[1])
    tree = vg.simulate(scene(geometric={"rays": 10**6, "estimator": "binning"}))
    assert rays[0] / 3 < tree["rays"].attrs["error_achieved"] < 3 * rays[0]  # that of the faintest cone, of few rays


def test_speckle_is_that_of_the_windows(monkeypatch):
    """Expected from independent windows and speckles to a cone, beside the standard error of bright cones."""
    monkeypatch.setenv("VGONIO_CALIBRATION", "off")
    from vgonio.assembly import gather
    from vgonio.planning.parts import wave_part
    from vgonio.scene import load_scene

    given = load_scene(scene(wave={}))
    expected = wave_part(given, gather(given).surface, "kirchhoff", vg.accuracy.calibration().speeds).speckle
    data = vg.simulate(given)["waves"]
    bright = (data.brdf_stderr / data.brdf).where(data.brdf > 0.3 * data.brdf.max()).median().item()
    assert 0.5 < expected / bright < 2


def test_results_keep_what_was_expected_and_what_it_took(tmp_path):
    import json

    vg.simulate(scene(geometric={"rays": 1000}), output=tmp_path / "a.nc")
    tree = vg.open(tmp_path / "a.nc")
    took, memory = (json.loads(tree.attrs[name]) for name in ("seconds", "memory_bytes"))
    expected = {s["part"] for s in json.loads(tree.attrs["plan"])["stages"] if s["seconds"] is not None}
    assert {"surface", "rays", "comparison"} <= set(took) & expected
    assert all(m > 1e7 for m in memory.values())


@pytest.mark.parametrize(("rms_um", "theta_i_deg"), [(0.3, 70), (0.6, 40), (1.2, 0), (1.5, 70)])
def test_the_error_by_chosen_facets_lies_in_the_range_that_is_printed(monkeypatch, rms_um, theta_i_deg):
    """The estimate from slopes alone is wrong by 50 in the second of them: a first look at a few rays is taken."""
    monkeypatch.setenv("VGONIO_CALIBRATION", "off")
    given = scene(
        geometric={"rays": 100_000, "estimator": "facets"}, detector={"theta_o_deg": list(range(-75, 76, 15))}
    )
    given["surface"]["generate"] |= {"rms_um": rms_um, "shape": [128, 128], "pitch_um": 0.5}
    given["light"] = {"wavelength_nm": [550], "theta_i_deg": [theta_i_deg]}
    cells = {row[1]: row[4] for row in vg.plan(given).table()[1]}
    assert cells["in all"] == cells["trace"]
    least, most = (float(x) / 100 for x in cells["trace"].removesuffix(" %").split(" … "))
    assert most < 100 * least
    assert least <= vg.simulate(given)["rays"].attrs["error_achieved"] <= most


def first_looks(monkeypatch) -> list[int]:
    """Rays of each run of the ray solver from now on."""
    from vgonio.geometric import RayOptics

    taken, scatter = [], RayOptics.scatter
    monkeypatch.setattr(RayOptics, "scatter", lambda self, *a: taken.append(self.rays) or scatter(self, *a))
    return taken


FEW_CONES = {
    "geometric": {"rays": 100_000, "estimator": "facets"},
    "light": {"wavelength_nm": [550], "theta_i_deg": [60]},
}


def test_a_first_look_is_taken_by_plan_and_told_and_not_by_simulate(monkeypatch):
    monkeypatch.setenv("VGONIO_CALIBRATION", "off")
    taken = first_looks(monkeypatch)
    made = vg.plan(scene(**FEW_CONES))
    assert taken == [8192]
    assert "first look at 8,192 rays from 1 angle" in next(s.why for s in made.stages if s.name == "trace")
    vg.simulate(scene(**FEW_CONES))
    assert taken == [8192, 100_000]


def test_slopes_that_tell_no_error_are_looked_at_as_well(monkeypatch):
    """Where they say that nothing needs sampling they were wrong by 4 % for a measured surface's surrogate."""
    monkeypatch.setenv("VGONIO_CALIBRATION", "off")
    monkeypatch.setattr("vgonio.planning.ray_forecast._error", lambda *given: 0.0)
    taken = first_looks(monkeypatch)
    given = scene(**FEW_CONES)
    given["surface"]["generate"]["rms_um"] = 1.2
    made = vg.plan(given)
    assert taken == [8192]
    assert made.error > 1e-4


def test_no_first_look_where_the_error_is_known_or_a_look_takes_too_long(monkeypatch):
    """By cones alone the number of rays tells the error; of a mesh a thousand times dearer only a range is told."""
    from dataclasses import replace

    from vgonio import planning

    monkeypatch.setenv("VGONIO_CALIBRATION", "off")
    taken = first_looks(monkeypatch)
    vg.plan(scene(**{**FEW_CONES, "geometric": {"rays": 100_000, "estimator": "binning"}}))
    found = vg.accuracy.calibration()
    slow = replace(found, speeds=replace(found.speeds, facet=1000 * found.speeds.facet))
    monkeypatch.setattr(planning, "calibration", lambda: slow)
    made = vg.plan(scene(**FEW_CONES))
    assert taken == []
    trace = next(s for s in made.stages if s.name == "trace")
    assert "no first look at its error: that would take" in trace.why
    assert trace.rough == (0.3, 100.0)


def test_a_known_error_bounds_a_rough_one_from_below():
    from vgonio.planning import Plan, Stage

    rays, waves = Stage("trace", True, "", error=1e-4, rough=(0.3, 100.0)), Stage("transform", True, "", error=1e-3)
    assert Plan("", (rays, waves)).error_words == "0.1 … 1 %"
    assert Plan("", (waves,)).error_words == "0.1 %"
    assert Plan("", ()).error_words == ""
