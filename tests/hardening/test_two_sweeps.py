"""Two sweeps on one store at the same time, and signals to a sweep at any moment."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hardening_tools import SCENE

import vgonio as vg
from vgonio.studies import Store

pytest.importorskip("distributed", reason="a sweep needs Dask: pip install 'vgonio[sweep]'")
STUDY = 'scene = "scene.toml"\n[vary]\n"geometric.seed" = { start = 1, stop = 6, step = 1 }\n'


HANGS = 400  # seconds: a guard, a sweep takes five on an idle machine
# as `python -m vgonio` does, and says when our own code begins: before that a signal ends Python in its own ways
PROGRAM = "import sys\nfrom vgonio.cli import main\nprint('begun', file=sys.stderr, flush=True)\nsys.exit(main())"


def begun(folder: Path, *more: str) -> subprocess.Popen:
    command = [sys.executable, "-c", PROGRAM, "sweep", "study.toml", "--workers", "1", *more]
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    assert process.stderr.readline() == "begun\n"
    return process


@pytest.fixture
def study(tmp_path) -> Path:
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path


def points(folder: Path) -> list[Path]:
    return sorted((folder / "study.sweep" / "points").rglob("*.nc"))


def temporary(folder: Path) -> list[Path]:
    return [p for p in folder.rglob("*") if p.name.endswith(".tmp")]


def test_two_sweeps_on_one_store(study):
    """Both end well and say the same; a point may be computed by both, but every file is whole."""
    two = [begun(study), begun(study)]
    done = [p.communicate(timeout=HANGS) for p in two]
    assert [p.returncode for p in two] == [0, 0], done
    assert len(points(study)) == 6
    assert temporary(study) == []
    tree = vg.open(study / "study.sweep" / "result.nc")
    assert (tree["state"] == 0).all()
    assert np.isfinite(tree["rays"].brdf).all()
    for path in points(study):
        vg.open(path)
    journal = list(Store(study / "study.sweep").journal())
    ended = [e["point"] for e in journal if e["event"] == "done"]
    assert len(set(ended)) == 6
    assert len(ended) <= 12


def events(folder: Path, kind: str) -> Counter:
    return Counter(e["point"] for e in Store(folder / "study.sweep").journal() if e["event"] == kind)


def test_a_signal_to_a_sweep_at_any_moment(study):
    """130, no temporary file, whole points; the same command, run again, goes on and computes none of them twice.

    While it starts; when a point has begun; when one more has ended; and some time after that, which may be the end.
    """
    rng = np.random.default_rng(2)
    moments = [(None, 0), ("begun", 1), ("done", 1), ("done", 1)]
    for (kind, more), sent, delay in zip(moments, 2 * [signal.SIGINT, signal.SIGTERM], rng.uniform(0, 1, 4)):
        count = events(study, kind).total() + more if kind else 0
        process = begun(study)
        end = time.monotonic() + HANGS
        while kind and events(study, kind).total() < count and process.poll() is None and time.monotonic() < end:
            time.sleep(0.01)
        time.sleep(delay)
        process.send_signal(sent)
        out, err = process.communicate(timeout=HANGS)
        assert process.returncode in (0, 130), err
        assert temporary(study) == [], err
        if process.returncode == 130:
            assert err.splitlines()[-1].startswith("vgonio: interrupted"), err
        for path in points(study):
            vg.open(path)
    kept, before = {p.stem for p in points(study)}, events(study, "begun")
    assert kept
    process = begun(study, "--json")
    out, err = process.communicate(timeout=HANGS)
    assert process.returncode == 0, err
    assert json.loads(out)["counts"]["done"] == 6
    again = events(study, "begun") - before
    assert again.total() == len(again) == 6 - len(kept)
    assert not kept & set(again)
