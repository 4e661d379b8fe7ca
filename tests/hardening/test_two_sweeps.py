"""Two sweeps on one store at the same time, and signals to a sweep at any moment."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hardening_tools import SCENE

import vgonio as vg
from vgonio.studies import Store

pytest.importorskip("distributed", reason="a sweep needs Dask: pip install 'vgonio[sweep]'")
STUDY = 'scene = "scene.toml"\n[vary]\n"geometric.seed" = { start = 1, stop = 6, step = 1 }\n'


def begun(folder: Path, *more: str) -> subprocess.Popen:
    command = [sys.executable, "-m", "vgonio", "sweep", "study.toml", "--workers", "1", *more]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


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
    done = [p.communicate(timeout=120) for p in two]
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


def test_a_signal_to_a_sweep_at_any_moment(study):
    """130, no temporary file, whole points; the same command, run again, goes on and computes none of them twice."""
    rng = np.random.default_rng(2)
    for sent, delay in zip((signal.SIGINT, signal.SIGTERM), rng.uniform(1, 5, 2)):
        process = begun(study)
        time.sleep(delay)
        process.send_signal(sent)
        out, err = process.communicate(timeout=60)
        # before Python has come to our own code a signal ends it in its own way
        assert process.returncode in (0, 130, -sent) or (process.returncode == 1 and delay < 1), err
        assert temporary(study) == [], err
        if process.returncode == 130:
            assert err.splitlines()[-1].startswith("vgonio: interrupted"), err
        for path in points(study):
            vg.open(path)
    kept = {p.stem for p in points(study)}
    process = begun(study, "--json")
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    assert json.loads(out)["counts"]["done"] == 6
    ended = [e["point"] for e in Store(study / "study.sweep").journal() if e["event"] == "done"]
    assert all(ended.count(point) == 1 for point in kept)
