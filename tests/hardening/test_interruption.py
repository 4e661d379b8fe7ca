"""Ctrl-C and SIGTERM at any moment, and two runs that write the same file.

The processes are forked from one that has everything imported, so that many moments can be tried; each is a real run of
a command with a real signal. A delay is drawn (seeded) from the whole run, its end included. How long a run takes is
learnt from every run that ends by itself, so that one slow run does not send all later signals after the end. No limit
in seconds is more than a guard against hanging.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hardening_tools import SCENE

import vgonio as vg
from vgonio.cli import main

COMMANDS = {
    "simulate": ("simulate scene.toml -o r.nc --report r.html --set geometric.rays=30000", ("r.nc", "r.html")),
    "simulate to a file": ("simulate scene.toml -o r.nc", ("r.nc",)),
    "surface make": (
        "surface make gaussian --set rms_um=1 --set correlation_um=5 --set shape=[900,900] -o s.npz",
        ("s.npz",),
    ),
    "explore": ("explore kept/r.nc -o e.html", ("e.html",)),
}
MOMENTS = 10
HANGS = 400  # seconds; what is waited for takes a few on an idle machine


@pytest.fixture(scope="module")
def folder(tmp_path_factory, result) -> Path:
    """Inputs; the modules that the commands need are imported here, once."""
    path = tmp_path_factory.mktemp("interrupted")
    (path / "kept").mkdir()
    (path / "scene.toml").write_text(SCENE)
    vg.save(result, path / "kept/r.nc")
    return path


def child(arguments: list[str], folder: Path, ready: int | None = None) -> int:
    """The process id of a forked run of a command, its output in the files out and err."""
    pid = os.fork()
    if pid:
        return pid
    status = 99
    try:
        os.chdir(folder)
        os.dup2(os.open("kept/out", os.O_CREAT | os.O_WRONLY | os.O_TRUNC), 1)
        os.dup2(os.open("kept/err", os.O_CREAT | os.O_WRONLY | os.O_TRUNC), 2)
        sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if ready is not None:
            os.write(ready, b"x")
        status = main(arguments)
        sys.stdout.flush()
        sys.stderr.flush()
    except KeyboardInterrupt:
        status = 98  # before or after the command proper
    except BaseException as e:
        os.write(2, f"Traceback {type(e).__name__}: {e}".encode())
    finally:
        os._exit(status)


def wait(pid: int, seconds: float = HANGS) -> int:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.005)
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    raise AssertionError("the command did not end")


def clean(folder: Path) -> None:
    for path in folder.iterdir():
        if path.is_file() and path.name != "scene.toml":
            path.unlink()


def left(folder: Path) -> set[str]:
    return {p.name for p in folder.iterdir()} - {"scene.toml", "kept"}


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_signal_at_any_moment(folder, name, monkeypatch):
    """No temporary file, no half-written output, 130 and one line, or the command was done before the signal came."""
    text, outputs = COMMANDS[name]
    arguments = text.split()
    monkeypatch.chdir(folder)
    assert main(arguments) == 0  # imports what the children then have
    clean(folder)
    begin = time.monotonic()
    assert wait(child(arguments, folder)) == 0, (folder / "kept/err").read_text()
    lasted = time.monotonic() - begin
    whole = {o: (folder / o).stat().st_size for o in outputs}
    assert left(folder) == set(outputs)
    rng = np.random.default_rng([7, *name.encode()])
    interrupted = 0
    # the last moments, when files are written, get a third of the tries
    tries = 5 if "--report" in arguments else MOMENTS  # a page takes its time
    moments = [*rng.uniform(0, 1, tries - 3), *rng.uniform(0.75, 1, 3), *rng.uniform(0.05, 0.95, 50)]
    for k, moment in enumerate(moments):
        if k >= tries and interrupted >= 2:
            break
        clean(folder)
        delay = moment * lasted
        begin = time.monotonic()
        begun, ready = os.pipe()
        pid = child(arguments, folder, ready)
        os.read(begun, 1)
        os.close(ready)
        ended = select.select([begun], [], [], delay)[0]  # the child's end is closed when it ends
        if ended:
            lasted = min(lasted, time.monotonic() - begin)
        os.close(begun)
        try:
            os.kill(pid, signal.SIGTERM if k % 3 == 2 and delay > 0.05 else signal.SIGINT)
        except ProcessLookupError:
            pass
        status = wait(pid)
        err = (folder / "kept/err").read_text()
        assert "Traceback" not in err, err
        assert "Exception ignored" not in err, err
        assert left(folder) <= {*outputs, "r.partial.nc"}, (delay, err)
        if status == 0:
            assert left(folder) == set(outputs)
            continue
        interrupted += status == 130
        assert status in (130, 98, -signal.SIGTERM), (delay, status, err)
        if status == 130:
            assert err.splitlines()[-1].startswith("vgonio: interrupted")
        for output in set(outputs) & left(folder):
            assert abs((folder / output).stat().st_size / whole[output] - 1) < 0.05
        for result in {"r.nc", "r.partial.nc"} & left(folder):
            tree = vg.open(folder / result)
            assert set(tree.children) <= {"surface", "rays"}
            assert ("rays" in tree.children) or result == "r.nc"
            assert result in err or "r.nc" in left(folder)
    assert interrupted >= 2


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
@pytest.mark.parametrize("signals", [1, 2, 3])
def test_a_signal_during_the_save_keeps_what_was_finished(tmp_path, monkeypatch, signals):
    """The first one while the result is written, the others while the first one's rest is."""
    from vgonio.measure import storage

    (tmp_path / "kept").mkdir()
    (tmp_path / "scene.toml").write_text(SCENE)
    right = storage.written_whole
    coming = [1, signals - 1]

    @contextmanager
    def signalled(path):
        for _ in range(coming.pop(0)):
            os.kill(os.getpid(), signal.SIGINT)
        with right(path) as stream:
            yield stream

    monkeypatch.setattr(storage, "written_whole", signalled)
    status = wait(child("simulate scene.toml -o r.nc".split(), tmp_path))
    err = (tmp_path / "kept/err").read_text()
    assert status == 130, err
    assert left(tmp_path) == {"r.partial.nc"}, err
    assert {"surface", "rays"} <= set(vg.open(tmp_path / "r.partial.nc").children)
    assert "finished parts (rays) are kept in r.partial.nc" in err


def test_a_signal_while_hdf5_writes_is_not_lost(tmp_path, result):
    """HDF5 calls Python back: an interruption raised there was lost or became another error."""
    sent = []

    class Slow(xr.DataTree):
        def to_netcdf(self, *arguments, **more):
            signal.raise_signal(signal.SIGINT)
            sent.append(1)
            return super().to_netcdf(*arguments, **more)

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        vg.save(Slow.from_dict({k: n.to_dataset() for k, n in result.children.items()}), tmp_path / "r.nc")
    assert sent == [1]  # the writing went on to its end, then the interruption came
    assert list(tmp_path.iterdir()) == []
    assert signal.getsignal(signal.SIGINT) is before


MAKE = "surface make flat --set shape=[4,4] --set pitch_um=1 -o s.npz".split()


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    "other", [ValueError("an open handle"), SystemError("an exception set"), vg.errors.InputError("x")]
)
def test_a_signal_that_a_library_makes_another_error_of(tmp_path, monkeypatch, capsys, sent, other):
    """As numpy does where a ZIP file cannot be closed, and h5py where a lock is let go: 130 all the same."""

    def spoiled(*_, **__):
        try:
            signal.raise_signal(sent)
        except KeyboardInterrupt:
            raise other from None

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(vg.surface, "write", spoiled)
    assert main(MAKE) == 130
    assert capsys.readouterr().err == "vgonio: interrupted\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_where_python_can_raise_nothing_comes_again(tmp_path, monkeypatch, capfd, sent):
    """While an object is deleted: Python would only write that an exception was ignored, and go on."""

    class Deleted:
        def __del__(self):
            signal.raise_signal(sent)

    def long_work(*_, **__):
        Deleted()
        end = time.monotonic() + HANGS
        while time.monotonic() < end:
            time.sleep(0.01)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(vg.surface, "write", long_work)
    hook = sys.unraisablehook
    assert main(MAKE) == 130
    assert sys.unraisablehook is hook
    assert capfd.readouterr().err == "vgonio: interrupted\n"


# ---- two at the same time
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_two_runs_that_write_the_same_file(folder, monkeypatch):
    """One of the two, whole, whichever came last; nothing else is left."""
    monkeypatch.chdir(folder)
    assert main("simulate scene.toml -o r.nc --report r.html".split()) == 0  # imports what the children then have
    for pair in (("simulate scene.toml -o r.nc --report r.html --set title=one", "title=two"),
                 ("surface make flat --set shape=[300,300] --set pitch_um=1 -o s.npz", "pitch_um=2")):  # fmt: skip
        first = pair[0].split()
        second = [pair[1] if a.startswith(pair[1].split("=")[0]) else a for a in first]
        for delay in (0.0,) if "--report" in first else (0.0, 0.05, 0.1):
            clean(folder)
            pids = [child(first, folder)]
            time.sleep(delay)
            pids.append(child(second, folder))
            assert [wait(pid) for pid in pids] == [0, 0]
            if first[0] == "simulate":
                assert left(folder) == {"r.nc", "r.html"}
                assert vg.open(folder / "r.nc").attrs["title"] in ("one", "two")
                page = (folder / "r.html").read_text()
                assert page.rstrip().endswith("</html>")
            else:
                assert left(folder) == {"s.npz"}
                assert vg.surface.read(folder / "s.npz").dx in (1.0, 2.0)


def test_many_writers_of_one_file(tmp_path):
    """Eight threads, a reader in between: never a mixture, never a missing file once there was one. They write until
    the reader has seen several of them."""
    from vgonio.files import written_whole

    path, stop, seen = tmp_path / "a", threading.Event(), []

    def write(k: int) -> None:
        with written_whole(path) as stream:
            for _ in range(20):
                stream.write(bytes([k]) * 500)

    def keep_writing(k: int) -> None:
        while not stop.is_set():
            write(k)

    threads = [threading.Thread(target=keep_writing, args=(k,)) for k in range(8)]
    write(0)
    end = time.monotonic() + HANGS
    try:
        for thread in threads:
            thread.start()
        while (len(seen) < 300 or len(set(seen)) < 3) and time.monotonic() < end:
            content = path.read_bytes()
            assert len(content) == 10_000
            assert len(set(content)) == 1
            seen.append(content[0])
    finally:
        stop.set()
        for thread in threads:
            thread.join()
    assert len(set(seen)) >= 3
    assert list(tmp_path.iterdir()) == [path]
