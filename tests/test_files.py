"""Files are written whole or not at all, whatever goes wrong in between."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

import pytest

import vgonio as vg
from vgonio.errors import FileFormatError
from vgonio.files import written_whole


def test_a_file_is_there_when_complete_and_not_before(tmp_path):
    path = tmp_path / "a.txt"
    with written_whole(path) as stream:
        stream.write(b"new")
        assert not path.exists()
    assert path.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError, MemoryError])
def test_an_older_file_survives_a_failure(tmp_path, error):
    path = tmp_path / "a.txt"
    path.write_bytes(b"old")
    with pytest.raises(error), written_whole(path) as stream:
        stream.write(b"half of the n")
        raise error
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_two_writers_of_one_file_do_not_mix(tmp_path):
    path = tmp_path / "a.txt"
    with written_whole(path) as first, written_whole(path) as second:
        first.write(b"1" * 9)
        second.write(b"2" * 5)
    assert path.read_bytes() == b"1" * 9  # renamed last


def test_a_name_as_long_as_the_file_system_allows(tmp_path):
    with written_whole(tmp_path / ("a" * 255)) as stream:
        stream.write(b"new")


@pytest.mark.parametrize("name", ["no/a.txt", "a" * 300])
def test_what_cannot_be_written_says_so(tmp_path, name):
    with pytest.raises(FileFormatError, match="cannot write"), written_whole(tmp_path / name):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_costs_one_line_and_nothing_else(tmp_path):
    """A limit on the size of files stands for the full disk; the process must live to say so."""
    surface = vg.surface.write(vg.surface.flat(shape=(24, 24), pitch_um=0.5), tmp_path / "sample.npz")
    scene = tmp_path / "scene.toml"
    scene.write_text(
        f"[surface]\nfile = '{surface}'\n[material]\nname = 'Al'\n[light]\nwavelength_nm = 500\ntheta_i_deg = 0\n"
        "[detector]\ntheta_o_deg = 0\n[geometric]\nrays = 10\n[output]\nfile = 'result.nc'\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "vgonio", "simulate", str(scene)],
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000)),
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("vgonio: error: cannot write")
    assert done.stderr.count("\n") == 1
    assert {p.name for p in Path(tmp_path).iterdir()} == {"scene.toml", "sample.npz"}
