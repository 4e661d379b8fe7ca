"""Sweeps on a real Dask cluster: what is stored, what is computed again, what a lost worker costs."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio.errors import BackendError, FileFormatError, InputError
from vgonio.studies import Store, gather, load_study, sweep

pytest.importorskip("distributed", reason="Dask is not installed: pip install 'vgonio[sweep]'")

SCENE = """
[surface]
generate = { kind = "gaussian", rms_um = 0.5, correlation_um = 4.0, shape = [32, 32], pitch_um = 0.5, seed = 1 }
[material]
name = "perfect"
[light]
wavelength_nm = [450, 650]
theta_i_deg = [0, 40]
[detector]
theta_o_deg = { start = -80, stop = 80, step = 10 }
[geometric]
rays = RAYS
"""


@pytest.fixture
def study_file(tmp_path):
    def write(vary: str, rays: int = 1000):
        (tmp_path / "scene.toml").write_text(SCENE.replace("RAYS", str(rays)))
        (tmp_path / "study.toml").write_text(f'scene = "scene.toml"\n{vary}\n')
        return tmp_path / "study.toml"

    return write


def begun(store: Store) -> Counter:
    return Counter(e["point"] for e in store.journal() if e["event"] == "begun")


def ended(store: Store) -> set[str]:
    return {e["point"] for e in store.journal() if e["event"] == "done"}


# What is to be caught at work has to last: rays are added until it is, on however fast a machine, and however late the
# one who catches comes. A limit in seconds is a guard against hanging.
MORE_AND_MORE_RAYS = (400_000, 1_600_000, 6_400_000, 25_600_000)
HANGS = 400


def started(path: Path, folder: Path, **more: Any) -> subprocess.Popen:
    """The sweep as a command with two workers, a group of processes of its own."""
    command = [sys.executable, "-m", "vgonio", "sweep", path.name, "--workers", "2", "-o", str(folder)]
    return subprocess.Popen(
        command, cwd=path.parent, start_new_session=True, stdout=subprocess.DEVNULL, text=True, **more
    )


def wait_for(enough: Callable[[], bool], run: subprocess.Popen) -> None:
    """Until there is enough, or the run has ended."""
    end = time.monotonic() + HANGS
    while not enough() and run.poll() is None and time.monotonic() < end:
        time.sleep(0.02)


def test_a_sweep_equals_its_points_simulated_one_by_one(study_file):
    path = study_file('[vary]\n"surface.generate.rms_um" = [0.2, 0.8]\n"light.theta_i_deg" = [[0], [40]]')
    tree = sweep(path, workers=2)
    rays = tree["rays"].to_dataset()
    assert rays["brdf"].dims == ("rms_um", "theta_i_deg", "theta_i", "theta_o", "wavelength")
    made = load_study(path)
    for values in made.values():
        alone = vg.simulate(made.point(values))["rays"].to_dataset()
        angle = values["light.theta_i_deg"]
        swept = rays.sel(rms_um=values["surface.generate.rms_um"], theta_i_deg=json.dumps(angle), theta_i=angle)
        for name in ("brdf", "brdf_stderr", "energy_by_bounce", "energy_lost"):
            np.testing.assert_array_equal(swept[name], alone[name])
    # an angle that a point does not have is missing, not 0
    assert np.isnan(rays["brdf"].sel(theta_i_deg="[0]", theta_i=40)).all()
    np.testing.assert_allclose(tree["surfaces"]["Sq"].sel(rms_um=0.8), 0.8, rtol=1e-6)
    assert (tree["state"] == 0).all()
    assert (tree["seconds"] > 0).all()
    assert len(tree.vgonio.plot_sweep().axes) == 3
    # stored whole, as any other result
    again = vg.open(vg.save(tree, path.parent / "sweep.nc"))
    xr.testing.assert_equal(again["rays"].to_dataset(), rays)


def test_the_number_of_rays_may_vary(study_file):
    """Results have a variable `rays` too: the swept one goes by its table."""
    path = study_file('[vary]\n"geometric.rays" = [500, 2000]\n"surface.generate.rms_um" = [0.2]')
    tree = sweep(path, workers=1)
    rays = tree["rays"].to_dataset()
    assert rays["brdf"].dims[:2] == ("geometric_rays", "rms_um")
    np.testing.assert_array_equal(rays["rays"].isel(rms_um=0, theta_i=0), [500, 2000])
    assert "geometric_rays" in tree.vgonio.plot_sweep().axes[0].get_xlabel() + str(tree["state"].dims)


def test_a_script_without_a_guard_may_sweep(study_file, tmp_path):
    """Workers do not run the caller's script again, as multiprocessing would have them do."""
    path = study_file('[vary]\n"surface.generate.seed" = [1]')
    script = tmp_path / "script.py"
    script.write_text(
        f"import vgonio as vg\nprint(__name__)\ntree = vg.sweep({str(path)!r}, workers=1)\n"
        "print(int(tree['state'].sum()), __file__.endswith('script.py'))\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=HANGS, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["__main__", "0", "True"]


def test_finished_points_are_never_computed_again_and_new_ones_are_added(study_file):
    path = study_file('[vary]\n"surface.generate.seed" = [1, 2]')
    told: list[tuple[int, int]] = []
    sweep(path, workers=1, progress=lambda *p: told.append(p))
    assert told == [(1, 2), (2, 2)]
    store = Store.made(path.with_suffix(".sweep"))
    written = {p: p.stat().st_mtime_ns for p in store.folder.rglob("*.nc")}
    path = study_file('[vary]\n"surface.generate.seed" = [1, 2, 3]')
    tree = sweep(path, workers=1)
    assert tree["state"].values.tolist() == [0, 0, 0]
    assert sorted(begun(store).values()) == [1, 1, 1]
    assert all(p.stat().st_mtime_ns == t for p, t in written.items())


def test_a_point_that_fails_is_recorded_and_stops_nothing(study_file):
    path = study_file(
        'zip = true\n[vary]\n"surface.generate.rms_um" = [0.5, -1, 0.5]\n"material.name" = ["Al", "Al", "Xx"]'
    )
    tree = sweep(path, workers=1)
    assert tree["state"].values.tolist() == [0, 1, 1]
    assert "rms_um = -1" in str(tree["reason"].values[1])
    assert "Xx" in str(tree["reason"].values[2])
    assert np.isnan(tree["rays"]["brdf"].values[1:]).all()
    store = Store.made(path.with_suffix(".sweep"))
    before = sum(begun(store).values())
    sweep(path, workers=1)
    assert sum(begun(store).values()) == before  # what was refused is refused: not tried again
    sweep(path, workers=1, retry=True)
    assert sum(begun(store).values()) == before + 2


def kill_one_at_work(store: Store) -> str | None:
    """Kills a worker with a point begun and not ended, and returns that point. It is stopped first: a worker that runs
    would go on to another point meanwhile."""
    for file in (store.folder / "journal").glob("*.jsonl"):
        worker = int(file.stem.rpartition("-")[2])
        try:
            os.kill(worker, signal.SIGSTOP)
        except ProcessLookupError:
            continue
        lines = file.read_text().splitlines()
        last = json.loads(lines[-1]) if lines else {"event": ""}
        os.kill(worker, signal.SIGKILL if last["event"] == "begun" else signal.SIGCONT)
        if last["event"] == "begun":
            return str(last["point"])
    return None


def test_a_killed_worker_loses_only_what_was_in_flight(study_file):
    for rays in MORE_AND_MORE_RAYS:
        path = study_file('[vary]\n"surface.generate.seed" = { start = 1, stop = 10, step = 1 }', rays=rays)
        store = Store.made(path.parent / f"{rays}.sweep")
        killed: list[str] = []

        def kill_one(done: int, points: int, store: Store = store, killed: list[str] = killed) -> None:
            if done >= 3 and not killed:
                killed += filter(None, [kill_one_at_work(store)])

        tree = sweep(path, store.folder, workers=2, progress=kill_one)
        assert (tree["state"] == 0).all()
        counts = begun(store)
        assert len(counts) == 10
        # the point that died with its worker was begun twice, or it was stored already; a worker runs one at a time
        assert {k for k, n in counts.items() if n > 1} <= set(killed)
        assert sum(counts.values()) <= 11
        if killed:
            return
    pytest.fail("no worker could be caught at work")


def test_a_killed_run_goes_on_where_it_was(study_file):
    for rays in MORE_AND_MORE_RAYS:
        path = study_file('[vary]\n"surface.generate.seed" = { start = 1, stop = 8, step = 1 }', rays=rays)
        store = Store.made(path.parent / f"{rays}.sweep")
        run = started(path, folder=store.folder, stderr=subprocess.DEVNULL)
        wait_for(lambda store=store: len(ended(store)) >= 3, run)
        try:
            os.killpg(run.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass  # all of it had ended
        run.wait()
        finished = ended(store)
        assert len(finished) >= 3
        assert {p.stem for p in store.folder.rglob("*.nc")} >= finished
        before = begun(store)
        tree = sweep(path, store.folder, workers=2)
        assert (tree["state"] == 0).all()
        assert all(begun(store)[point] == before[point] == 1 for point in finished)
        if len(finished) < 8:
            return
    pytest.fail("no run could be killed before its end")


def test_ctrl_c_says_where_to_go_on(study_file):
    for rays in MORE_AND_MORE_RAYS:
        path = study_file('[vary]\n"surface.generate.seed" = { start = 1, stop = 8, step = 1 }', rays=rays)
        store = Store.made(path.parent / f"{rays}.sweep")
        run = started(path, folder=store.folder, stderr=subprocess.PIPE)
        wait_for(lambda store=store: bool(ended(store)), run)
        try:
            os.killpg(run.pid, signal.SIGINT)  # as a terminal does: to the workers too
        except ProcessLookupError:
            pass
        _, err = run.communicate(timeout=HANGS)
        assert "Traceback" not in err
        assert (gather(load_study(path), store)["state"] == 0).any()
        if len(ended(store)) < 8:
            break
    assert run.returncode == 130, err
    assert "the same command goes on" in err.splitlines()[-1]


def test_an_existing_scheduler_and_one_that_is_not_there(study_file, monkeypatch):
    import dask
    import distributed
    from distributed import LocalCluster, get_client

    path = study_file('[vary]\n"surface.generate.seed" = [1, 2]')
    with LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None) as cluster:
        tree = sweep(path, scheduler=cluster.scheduler_address)
    assert (tree["state"] == 0).all()
    path = study_file('[vary]\n"surface.generate.seed" = [5]')
    before = dask.config.get("scheduler", None)
    # a client that meets a bad address hangs for 20 s when it is dropped: none is made
    monkeypatch.setattr(distributed, "Client", lambda *_, **__: pytest.fail("a client was made"))
    for address in ("not-an-address://x", "foo"):
        with pytest.raises(BackendError, match="no Dask scheduler answers"):
            sweep(path, scheduler=address)
    assert dask.config.get("scheduler", None) == before  # else what is saved later asks the one that failed
    with pytest.raises(ValueError, match="client"):
        get_client(timeout=0)


def test_workers_that_do_not_end_in_time_cost_nothing(study_file, monkeypatch):
    """As they may on a busy machine: Dask's patience ends, and what they computed is stored."""
    import distributed

    class Impatient(distributed.LocalCluster):
        def close(self, timeout: float | None = None) -> None:
            super().close(timeout)
            raise TimeoutError

    monkeypatch.setattr(distributed, "LocalCluster", Impatient)
    tree = sweep(study_file('[vary]\n"surface.generate.seed" = [1]'), workers=1)
    assert (tree["state"] == 0).all()


def test_workers_that_cannot_be_started_are_one_line(study_file, monkeypatch, capsys):
    import distributed

    from vgonio.cli import main

    def refused(**_: Any) -> None:
        raise RuntimeError("Nanny failed\nto start worker process")

    monkeypatch.setattr(distributed, "LocalCluster", refused)
    path = study_file('[vary]\n"surface.generate.seed" = [1, 2]')
    assert main(["sweep", str(path), "--workers", "2"]) == 2
    said = "vgonio: error: 2 worker processes could not be started (RuntimeError: Nanny failed to start worker process)"
    assert capsys.readouterr().err == f"{said}: take fewer of them\n"


def test_a_cluster_of_our_own_is_patient(study_file, monkeypatch):
    """A worker that is silent, as while the machine sleeps, is not lost, nor one that was killed and takes its time to
    begin anew; a sweep whose workers never come back ends. Nothing of it stays in Dask's settings."""
    import dask
    import distributed
    from dask.utils import parse_timedelta

    found: list[Any] = []

    class Watched(distributed.LocalCluster):
        def __init__(self, **options: Any) -> None:
            super().__init__(**options)
            given_up = parse_timedelta(dask.config.get("distributed.deploy.lost-worker-timeout"))
            found.append((self.scheduler.worker_ttl, self.scheduler.allowed_failures, given_up >= 600))
            assert 60 < parse_timedelta(dask.config.get("distributed.scheduler.no-workers-timeout")) < given_up

    monkeypatch.setattr(distributed, "LocalCluster", Watched)
    before = dask.config.get("distributed.scheduler.worker-ttl")
    sweep(study_file('[vary]\n"surface.generate.seed" = [1]'), workers=1)
    assert found == [(None, 3, True)]
    assert dask.config.get("distributed.scheduler.worker-ttl") == before
    assert before is not None


def test_workers_of_another_version_are_refused(study_file):
    from vgonio.studies.worker import compute

    path = study_file('[vary]\n"surface.generate.seed" = [1]')
    store = Store.made(path.parent / "s")
    values = {"surface.generate.seed": 1}
    compute(load_study(path).point(values), "ab" * 16, values, store, "0.0.0")
    assert "0.0.0" in store.why_failed("ab" * 16)["reason"]


def test_a_result_too_large_for_memory_is_refused(study_file, monkeypatch):
    path = study_file('[vary]\n"surface.generate.seed" = [1, 2]')
    monkeypatch.setattr("vgonio.studies.gathering.LARGEST", 1000.0)
    with pytest.raises(InputError, match="one by one"):
        sweep(path, workers=1)


def test_the_command(study_file):
    path = study_file('[vary]\n"surface.generate.rms_um" = [0.2, -1, 0.8]')
    command = f"{shlex.quote(sys.executable)} -m vgonio sweep study.toml --workers 1 --json"
    done = subprocess.run(shlex.split(command), cwd=path.parent, capture_output=True, text=True, timeout=HANGS)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["counts"] == {"points": 3, "done": 2, "failed": 1, "not computed": 0}
    assert done.stderr.startswith("vgonio: warning: 1 point failed: rms_um = -1")
    assert (path.with_suffix(".sweep") / "overview.png").stat().st_size > 10_000
    assert "rays" in vg.open(path.with_suffix(".sweep") / "result.nc").children


def test_the_command_fails_where_every_point_fails(study_file, capsys):
    from vgonio.cli import main

    path = study_file('[vary]\n"surface.generate.rms_um" = [-1, -2]')
    assert main(["sweep", str(path), "--workers", "1", "--quiet"]) == 2
    assert "no point could be computed: rms_um = -1" in capsys.readouterr().err


def test_points_read_fast_are_those_of_xarray(study_file):
    from vgonio.studies.stored import read_point

    path = study_file('[vary]\n"surface.generate.seed" = [1]')
    sweep(path, workers=1)
    (file,) = Store.made(path.with_suffix(".sweep")).folder.rglob("*.nc")
    slow = vg.open(file)["rays"].to_dataset()
    xr.testing.assert_equal(read_point(file)["rays"], slow[[v for v in slow.data_vars if slow[v].dtype.kind in "fiu"]])
    file.write_bytes(file.read_bytes()[:1000])
    with pytest.raises(FileFormatError, match="computed again"):
        read_point(file)
