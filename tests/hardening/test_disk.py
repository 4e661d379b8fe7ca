"""A full disk, a read-only one, and one that fails at any moment: one line, exit status 2, the older files untouched.

A real file system where the tests may mount one (root only: a tmpfs of 256 KiB, filled up, then read-only), and
anywhere every write of `files.written_whole`, through which every command writes (tested too), made to fail in turn.
"""

from __future__ import annotations

import ast
import errno
import os
import shutil
import subprocess
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hardening_tools import SCENE

import vgonio as vg
from vgonio import files
from vgonio.cli import main

PACKAGE = Path(vg.__file__).parent
STUDY = 'scene = "scene.toml"\n[vary]\n"light.coherence_um" = [10.0, 20.0]\n'

# arguments of a command, {out} the folder it writes to and {in} the folder of its inputs; names of what it writes
COMMANDS: dict[str, tuple[str, tuple[str, ...]]] = {
    "simulate": ("simulate {in}/scene.toml -o {out}/r.nc --report {out}/r.html", ("r.nc", "r.html")),
    "surface make npz": ("surface make flat --set shape=[40,40] --set pitch_um=1 -o {out}/s.npz", ("s.npz",)),
    "surface make csv": ("surface make flat --set shape=[40,40] --set pitch_um=1 -o {out}/s.csv", ("s.csv",)),
    "surface make stl": ("surface make flat --set shape=[40,40] --set pitch_um=1 -o {out}/s.stl", ("s.stl",)),
    "surface convert": ("surface convert {in}/s.npz {out}/s.x3p", ("s.x3p",)),
    "init": ("init {out}/new.toml --schema --force", ("new.toml", "vgonio.schema.json")),
    "explore": ("explore {in}/r.nc -o {out}/e.html", ("e.html",)),
    "report": ("report {in}/r.nc -o {out}/p.html", ("p.html",)),
    "fit": (
        "fit {in}/m.json --model lambert-1760 --errors none -o {out}/f.nc --figures {out}",
        ("f.nc", "m_models.png"),
    ),
    "fit as json": ("fit {in}/m.json --model lambert-1760 --errors none -o {out}/f.json", ("f.json",)),
    "measured convert json": ("measured convert {in}/m.json {out}/m.json", ("m.json",)),
    "measured convert csv": ("measured convert {in}/m.json {out}/m.csv", ("m.csv",)),
    "measured convert rgl": (
        "measured convert {in}/m.json {out}/m.bsdf --fill half-angle --set resolution=4",
        ("m.bsdf",),
    ),
    "measured convert astm": ("measured convert {in}/m.json {out}/m.astm", ("m.astm",)),
    "measured convert nc": ("measured convert {in}/m.json {out}/m.nc", ("m.nc",)),
    "display characterise": (
        "display characterise --virtual wide-gamut --levels 5 --save {out}/read.csv --report {out}/d.html",
        ("read.csv", "d.html"),
    ),
    "display colours": ("display characterise --colours {out}/show.csv", ("show.csv",)),
    "display calibrate": (
        "display calibrate --virtual wide-gamut --levels 5 --size 5 -o {out}/calibration",
        ("calibration/display.icc",),
    ),
    "validate": ("validate --init {out}/normbox.toml", ()),
    "accuracy": (
        "accuracy sinusoid-nufft --quick -o {out}/accuracy",
        ("accuracy/accuracy.csv", "accuracy/accuracy.png"),
    ),
}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory, result) -> Path:
    """A scene, a study, a surface, a measurement and a result."""
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "scene.toml").write_text(SCENE)
    (folder / "study.toml").write_text(STUDY)
    vg.save(result, folder / "r.nc")
    rough = vg.surface.gaussian(rms_um=0.2, correlation_um=3.0, shape=(16, 16), pitch_um=1.0, seed=1)
    vg.surface.write(rough, folder / "s.npz")
    from vgonio.measure.isotropic import IsotropicBrdf, sampled

    nm = np.linspace(400, 700, 6)
    brdf = IsotropicBrdf(nm, lambda wi, wo: 0.2 * np.exp(-((wi + wo)[:, :1] ** 2)) * np.ones(6), "")
    vg.measure.write(sampled(brdf, [0, 30, 60], np.arange(-75, 76, 15)), folder / "m.json")
    return folder


def run(name: str, inputs: Path, out: Path, monkeypatch, capsys) -> tuple[int, str]:
    """Exit status and standard error of a command."""
    monkeypatch.chdir(out)
    text, _ = COMMANDS[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        status = main([a.format(**{"in": inputs, "out": out}) for a in text.split()])
    return status, capsys.readouterr().err


def tree(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def older(name: str, out: Path) -> dict[str, bytes]:
    """Files of an earlier run under the names that the command writes."""
    for file in COMMANDS[name][1]:
        (out / file).parent.mkdir(parents=True, exist_ok=True)
        (out / file).write_bytes(b"older")
    return tree(out)


def refused(status: int, err: str, before: dict[str, bytes], out: Path, words: str) -> None:
    lines = [line for line in err.splitlines() if line.startswith("vgonio: error")]
    assert status == 2, err
    assert len(lines) == 1, err
    assert words in lines[0], err
    assert "Traceback" not in err
    assert tree(out) == before


# ---- a real file system
@pytest.fixture(scope="module")
def small(tmp_path_factory) -> Iterator[Path]:
    """A tmpfs of 256 KiB; skips where nobody may mount one."""
    folder = tmp_path_factory.mktemp("small")
    command = ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(folder)]
    if os.geteuid() != 0 or shutil.which("mount") is None or subprocess.run(command, capture_output=True).returncode:
        pytest.skip("a file system of its own needs root and mount: the failing writes below stand for it")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


def filled(folder: Path) -> None:
    """Not a page of the file system is free."""
    with open(folder / "filler", "wb", buffering=0) as stream:
        try:
            while True:
                stream.write(b"x" * 4096)
        except OSError as e:
            assert e.errno == errno.ENOSPC


@pytest.mark.parametrize("name", COMMANDS)
def test_a_full_and_a_read_only_disk(name, inputs, small, monkeypatch, capsys):
    for part in small.iterdir():
        shutil.rmtree(part) if part.is_dir() else part.unlink()
    before = older(name, small)
    filled(small)
    before = tree(small)
    refused(*run(name, inputs, small, monkeypatch, capsys), before, small, "No space left on device")
    subprocess.run(["mount", "-o", "remount,ro", str(small)], check=True)
    try:
        refused(*run(name, inputs, small, monkeypatch, capsys), before, small, "")
    finally:
        subprocess.run(["mount", "-o", "remount,rw", str(small)], check=True)


def test_a_sweep_on_a_full_disk(inputs, small, monkeypatch, capsys):
    """Its workers cannot store a point: the command fails, and a disk with room takes it up again."""
    pytest.importorskip("distributed")
    for part in small.iterdir():
        shutil.rmtree(part) if part.is_dir() else part.unlink()
    for file in ("scene.toml", "study.toml"):
        shutil.copy(inputs / file, small)
    (small / "study.sweep/points").mkdir(parents=True)
    (small / "study.sweep/result.nc").write_bytes(b"older")
    filled(small)
    before = tree(small)
    monkeypatch.chdir(small)
    status = main(["sweep", "study.toml", "--workers", "1"])
    err = capsys.readouterr().err
    left = {k: v for k, v in tree(small).items() if not k.startswith("study.sweep/journal")}
    assert left == before
    assert status == 2, err
    assert "No space left on device" in err
    assert "Traceback" not in err


# ---- every write in turn
SLOW = (
    "accuracy",
    "simulate",
    "report",
    "validate",
    "fit as json",
    "display characterise",
)  # and written as the others, or a file that must not be there


class Failing:
    """Stands for `open` in files.py: counts what is done to files, and fails at one of them."""

    def __init__(self, at: int | None = None) -> None:
        self.at, self.count = at, 0

    def step(self) -> None:
        self.count += 1
        if self.count - 1 == self.at:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def __call__(self, path, mode="r", **more):
        if "w" not in mode:
            return open(path, mode, **more)
        self.step()
        stream = open(path, mode, **more)
        right = stream.write
        outer = self

        class Stream:
            def write(self, data):
                outer.step()
                return right(data)

            def __enter__(self):
                return self

            def __exit__(self, *error):
                stream.close()
                if error[0] is None:
                    outer.step()

            def __getattr__(self, name):
                return getattr(stream, name)

        return Stream()


@pytest.mark.parametrize("name", [n for n in COMMANDS if n not in SLOW])
def test_a_disk_that_fails_at_any_moment(name, inputs, tmp_path, monkeypatch, capsys):
    counter = Failing()
    monkeypatch.setattr(files, "open", counter, raising=False)
    assert run(name, inputs, tmp_path, monkeypatch, capsys)[0] == 0
    assert counter.count >= 3  # opened, written to, closed
    names = set(tree(tmp_path))
    moments = sorted({0, 1, counter.count // 2, counter.count - 1})
    for at in moments:
        shutil.rmtree(tmp_path)
        tmp_path.mkdir()
        before = older(name, tmp_path)
        monkeypatch.setattr(files, "open", Failing(at), raising=False)
        status, err = run(name, inputs, tmp_path, monkeypatch, capsys)
        assert status == 2, (at, err)
        assert "No space left on device" in err
        after = tree(tmp_path)
        assert set(before) <= set(after) <= set(before) | names  # no temporary file
        # files written before the one that failed are new and whole, the others old; none is anything else
        assert all(content == b"older" or len(content) > 40 for content in after.values())
        assert at > 0 or after == before


ALLOWED = {  # opens for writing outside files.py, and why
    "studies/store.py": "the journal, a line at a time; nothing depends on it",
    "cli/outcome.py": "os.devnull, for closed streams",
    "wave/pocl_cpu.py": "memory of this process",
}


def test_every_file_is_written_whole():
    """No other way to write a file is used in the package."""
    found: dict[str, Callable] = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        place = path.relative_to(PACKAGE).as_posix()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call):
                continue
            name = ast.unparse(node.func)
            last = name.rpartition(".")[2]
            modes = [a.value for a in [*node.args, *(k.value for k in node.keywords)] if isinstance(a, ast.Constant)]
            first = ast.unparse(node.args[0]) if node.args else ""
            if last == "open" and any(isinstance(m, str) and set(m) & set("wax+") and len(m) < 4 for m in modes):
                found[place] = found.get(place, "") + name
            assert last not in ("write_text", "write_bytes", "tofile", "to_csv"), (place, node.lineno)
            if last in ("savefig", "savez", "savez_compressed", "save_npz", "to_netcdf", "imsave", "savetxt"):
                assert first in ("stream", "buffer", "file", "None"), (place, node.lineno, first)
    assert set(found) - {"files.py"} == set(ALLOWED)
