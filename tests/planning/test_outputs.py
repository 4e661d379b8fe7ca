"""Where results may go: said before any work."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from vgonio.cli import main
from vgonio.errors import InputError
from vgonio.planning import check_output

PROC = pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="no /proc")


@PROC
@pytest.mark.parametrize("command", ["simulate", "explore"])
def test_a_folder_that_takes_no_files_is_refused_before_any_work(monkeypatch, tmp_path, capsys, command):
    """/proc says that root may write, and refuses."""
    from vgonio import assembly, measure

    for module, name in ((assembly, "gather"), (measure, "open")):
        monkeypatch.setattr(module, name, lambda *a: pytest.fail("work was begun"))
    path = tmp_path / "scene.toml"
    main(["init", str(path)])
    ending = {"simulate": "nc", "explore": "html"}[command]
    capsys.readouterr()
    assert main([command, str(path), "-o", f"/proc/x.{ending}"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "/proc" in said


def test_one_folder_may_be_missing_but_not_two(tmp_path):
    check_output(tmp_path / "new" / "a.nc", (".nc",))
    with pytest.raises(InputError, match="one new folder is made, not several"):
        check_output(tmp_path / "no" / "such" / "a.nc", (".nc",))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["simulate", "sweep", "accuracy"])
def test_no_folder_is_made_at_the_root_of_the_file_system(command, tmp_path, capsys):
    """A slip such as /nonexistent/result.nc made that folder where the user may write everywhere."""
    slip = Path(tmp_path.anchor) / "vgonio-no-such-folder"
    assert not slip.exists()
    scene, study = tmp_path / "scene.toml", tmp_path / "study.toml"
    main(["init", str(scene)])
    study.write_text('scene = "scene.toml"\n[vary]\n"light.theta_i_deg" = [[0], [10]]\n')
    capsys.readouterr()
    words = {"simulate": [str(scene), "-o", str(slip / "a.nc")], "sweep": [str(study), "-o", str(slip)]}
    assert main([command, *words.get(command, ["-o", str(slip)])]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert not slip.exists()
    if command != "accuracy" and os.access(tmp_path.anchor, os.W_OK):
        assert "no folder is made at the root of the file system" in said
