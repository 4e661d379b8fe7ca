"""Result files of other versions: kept as this version writes them, older without a version, newer by one.

`data/result-v1.nc` was written by `python tests/hardening/test_versions.py` while format version 1 was the only one.
Where the format changes, the new version's file is added beside it, and all of them have to open for ever.
"""

from __future__ import annotations

import re
import shutil
import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest

import vgonio as vg
from vgonio.cli import main
from vgonio.errors import FileFormatError
from vgonio.measure.storage import FORMAT_VERSION
from vgonio.studies.stored import read_point

DATA = Path(__file__).parent / "data"
SCENE = {
    "title": "result of format version 1",
    "surface": {"generate": {"kind": "flat", "shape": [2, 2], "pitch_um": 1.0}, "periodic": True},
    "material": {"name": "Al"},
    "light": {"wavelength_nm": [550], "theta_i_deg": [0]},
    "detector": {"theta_o_deg": [-30, 0, 30]},
    "geometric": {"rays": 100, "seed": 1},
}


def write(path: Path) -> None:
    """The file of this version, without the summary of the surface, which is large."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        tree = vg.simulate(SCENE)
    del tree["surface"]
    vg.save(tree, path)


def copy_with(path: Path, **attrs: object) -> Path:
    shutil.copy(DATA / f"result-v{FORMAT_VERSION}.nc", path)
    with h5py.File(path, "a") as file:
        for key, value in attrs.items():
            del file.attrs[key]
            if value is not None:
                file.attrs[key] = value
    return path


def test_every_format_version_has_a_file_and_opens():
    versions = {int(re.findall(r"v(\d+)", p.stem)[0]): p for p in DATA.glob("result-v*.nc")}
    assert set(versions) == set(range(1, FORMAT_VERSION + 1))
    for version, path in versions.items():
        assert path.stat().st_size < 200_000
        tree = vg.open(path)
        assert int(tree.attrs["format_version"]) == version
        rays = tree["rays"].to_dataset()
        assert rays.brdf.dims == ("theta_i", "theta_o", "wavelength")
        # a flat mirror: everything into the mirror direction, R of aluminium at 550 nm over the cone's ∫ cos θ dω
        assert rays.brdf.sel(theta_o=[-30, 30]).max() == 0
        expected = float(vg.materials.material("Al").reflectance(1.0, 550.0)) / (np.pi * np.sin(np.radians(1)) ** 2)
        assert float(rays.brdf.sel(theta_o=0).squeeze()) == pytest.approx(expected, rel=1e-6)
        assert "brdf" in read_point(path)["rays"]


def test_the_commands_take_an_older_result(tmp_path):
    path = shutil.copy(DATA / "result-v1.nc", tmp_path / "old.nc")
    for arguments in (["explore", path], ["report", path]):
        assert main([*map(str, arguments)]) == 0


def test_a_newer_result_says_upgrade(tmp_path):
    path = copy_with(tmp_path / "new.nc", format_version=FORMAT_VERSION + 1)
    with pytest.raises(
        FileFormatError, match=f"format version {FORMAT_VERSION + 1}, .* up to {FORMAT_VERSION}: upgrade"
    ):
        vg.open(path)


@pytest.mark.parametrize(("attrs", "words"), [
    ({"format": None}, "result of another program"),
    ({"format": "other"}, "result of another program"),
    ({"format_version": None}, "format version none"),
    ({"format_version": 0}, "format version 0"),
    ({"format_version": -1}, "format version -1"),
    ({"format_version": "1.5"}, "format version 1.5"),
    ({"format_version": "9" * 5000}, "format version 999"),
])  # fmt: skip
def test_a_version_that_never_was(tmp_path, attrs, words):
    with pytest.raises(FileFormatError, match=words):
        vg.open(copy_with(tmp_path / "odd.nc", **attrs))


@pytest.mark.parametrize("name", ["scene", "plan", "provenance", "seconds", "memory_bytes", "title"])
def test_a_result_from_before_an_attribute_was_written(tmp_path, name):
    """An attribute that came later, or was never there, is no reason to refuse the numbers."""
    path = copy_with(tmp_path / "old.nc")
    with h5py.File(path, "a") as file:
        if name in file.attrs:
            del file.attrs[name]
    assert "brdf" in vg.open(path)["rays"]
    assert "brdf" in read_point(path)["rays"]
    vg.report.page(vg.open(path), tmp_path / "report.html")


if __name__ == "__main__":
    DATA.mkdir(exist_ok=True)
    write(DATA / f"result-v{FORMAT_VERSION}.nc")
