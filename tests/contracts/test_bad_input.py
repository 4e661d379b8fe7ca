"""Bad input, as the command line answers it: one clear line, exit status 2, no traceback, no half-written file."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio.cli import main

SCENE = """
[surface]
file = "sample.npz"
[material]
name = "Al"
[light]
wavelength_nm = [500, 600]
theta_i_deg = [0, 30]
coherence_um = 2
[detector]
theta_o_deg = [-30, 0, 30]
[geometric]
rays = 100
[wave]
tol = 1e-2
[output]
file = "result.nc"
report = "result.html"
"""


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A folder with a good scene and a good surface."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE)
    vg.surface.write(vg.surface.flat(shape=(24, 24), pitch_um=0.5), tmp_path / "sample.npz")
    return tmp_path


@pytest.fixture
def refused(folder, capsys) -> Callable[..., str]:
    """Run a command that has to be refused; returns its one line."""

    def run(*arguments: str) -> str:
        before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}
        status = main(list(arguments))
        said = capsys.readouterr()
        assert status == 2, said
        assert said.out == ""
        assert said.err.startswith("vgonio: error: ")
        assert said.err.count("\n") == 1, said.err
        assert "Traceback" not in said.err
        assert {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()} == before
        return said.err

    return run


def setting(text: str) -> list[str]:
    return ["simulate", "scene.toml", "--set", text]


# ---- files
@pytest.mark.parametrize("command", ["simulate", "plan"])
def test_missing_scene(refused, command):
    assert "no such scene file: other.toml" in refused(command, "other.toml")


@pytest.mark.parametrize("name", ["none.npz", "none.al3d", "none.vgms", "none.txt", "none.x3p"])
def test_missing_surface_file(refused, name):
    assert name in refused(*setting(f"surface.file={name}"))
    assert name in refused("surface", "info", name)


def _npz(path: Path) -> None:
    vg.surface.write(vg.surface.flat(shape=(64, 64), pitch_um=0.5), path)


def _usurf(path: Path) -> None:
    path.write_text("DATA\n\t0\t1\t2\n0\t1.0\t2.0\t3.0\n1\t1.0\t2.0\t3.0\n")


def _vgms(path: Path) -> None:
    import struct

    heights = np.zeros((8, 8), "<f4").tobytes()
    head = b"VGMS" + struct.pack("<II", 0x000100, 68 + len(heights)) + b"2022-01-01T00:00:00Z".ljust(32, b"\0")
    head += struct.pack("<BBBB", 4, 0x21, 0, 0) + struct.pack("<IIIIf", 3, 8, 8, 0, 0.5)
    path.write_bytes(head[:60] + struct.pack("<ff", 0.5, 0.5) + heights)


@pytest.mark.parametrize(
    ("name", "write", "keep"), [("cut.npz", _npz, 300), ("cut.txt", _usurf, 18), ("cut.vgms", _vgms, 100)]
)
def test_truncated_surface_file(refused, folder, name, write, keep):
    path = folder / name
    write(path)
    vg.surface.read(path)  # whole, it is read
    path.write_bytes(path.read_bytes()[:keep])
    assert name in refused(*setting(f"surface.file={name}"))
    assert name in refused("surface", "convert", name, "out.npz")


@pytest.mark.parametrize("name", ["al3d-1.al3d", "x3p-2.x3p", "opd-1.opd", "nms-1.nms"])
@pytest.mark.parametrize("share", [0.0, 0.01, 0.5])
def test_truncated_instrument_file(refused, folder, shared, name, share):
    content = (shared / "data" / "heightfields" / name).read_bytes()
    (folder / name).write_bytes(content[: int(share * len(content))])
    assert name in refused(*setting(f"surface.file={name}"))


@pytest.mark.parametrize("name", ["sample.jpeg", "sample", "sample.mp3"])
def test_unknown_suffix(refused, folder, name):
    (folder / name).write_bytes(b"\x00\x01 nothing that anybody knows")
    assert name in refused(*setting(f"surface.file={name}"))
    assert name in refused("surface", "info", name)


def test_unknown_suffix_of_an_output(refused):
    assert ".nc" in refused("simulate", "scene.toml", "-o", "result.mat")
    assert ".html" in refused("simulate", "scene.toml", "--report", "page.pdf")
    assert ".obj" in refused("surface", "convert", "sample.npz", "out.obj")


@pytest.mark.parametrize(
    "content", ["", "[", "[]", "{}", '[{"wavelengths": [500]}]', '[{"wavelengths": [500]}, {"thetaIn": 0}]']
)
def test_broken_measurement(refused, folder, content):
    (folder / "broken.json").write_text(content)
    assert "broken.json" in refused(*setting("measured.file=broken.json"))
    assert "broken.json" in refused("compare", "broken.json", "broken.json")


# ---- surfaces
def _surface_with(folder: Path, z: np.ndarray) -> str:
    np.savez(folder / "odd.npz", z=z)
    _npz(folder / "good.npz")
    with np.load(folder / "good.npz", allow_pickle=False) as good:
        content = dict(good)
    key = next(k for k, v in content.items() if v.ndim == 2)
    np.savez(folder / "odd.npz", **(content | {key: z}))
    (folder / "good.npz").unlink()
    return "odd.npz"


def test_all_nan_surface(refused, folder):
    name = _surface_with(folder, np.full((24, 24), np.nan))
    assert "missing" in refused(*setting(f"surface.file={name}"))
    assert "missing" in refused("surface", "info", name)


def test_missing_points_without_a_fill(refused, folder):
    z = np.zeros((24, 24))
    z[5, 5:9] = np.nan
    name = _surface_with(folder, z)
    line = refused(*setting(f"surface.file={name}"))
    assert "4 missing points" in line
    assert 'fill = "interpolate"' in line


@pytest.mark.parametrize("pitch", ["0", "-0.5", "nan", "[0.5, 0]"])
def test_zero_or_negative_pitch(refused, pitch):
    assert "pitch_um" in refused(*setting(f"surface.pitch_um={pitch}"))


@pytest.mark.parametrize("pitch", ["0", "-0.5", "nan"])
def test_zero_or_negative_pitch_of_surface_commands(refused, pitch):
    assert "pitch" in refused("surface", "info", "sample.npz", f"--pitch-um={pitch}")
    assert "pitch" in refused("surface", "convert", "sample.npz", "out.npz", f"--pitch-um={pitch}")
    assert "pitch" in refused(
        "surface", "make", "flat", "--set", f"pitch_um={pitch}", "--set", "shape=[8, 8]", "-o", "o.npz"
    )


# ---- scenes
def test_unknown_scene_key_names_the_nearest(refused):
    assert "did you mean 'coherence_um'" in refused(*setting("light.coherence=20"))
    assert "did you mean 'detector'" in refused(*setting("detecter.aperture_deg=2"))


def test_material_outside_its_table(refused):
    line = refused(*setting("light.wavelength_nm=[50000]"))
    assert "'Al'" in line
    assert "50000 nm" in line


def test_unknown_material_and_material_file(refused, folder):
    assert "Unobtainium" in refused(*setting("material.name=Unobtainium"))
    assert "none.yml" in refused("simulate", "scene.toml", "--set", "material={file='none.yml'}")
    (folder / "odd.yml").write_text("DATA: nonsense")
    assert "odd.yml" in refused("simulate", "scene.toml", "--set", "material={file='odd.yml'}")


@pytest.mark.parametrize("angle", ["90", "-90", "120", "nan", "1e300"])
@pytest.mark.parametrize("key", ["light.theta_i_deg", "detector.theta_o_deg"])
def test_angles_of_90_degrees_and_beyond(refused, key, angle):
    assert key.split(".")[1] in refused(*setting(f"{key}=[0, {angle}]"))


@pytest.mark.parametrize("key", ["light.theta_i_deg", "detector.theta_o_deg", "light.wavelength_nm", "wave.theory"])
def test_empty_lists(refused, key):
    assert key.split(".")[1] in refused(*setting(f"{key}=[]"))


@pytest.mark.parametrize("name", ["aperture_deg", "coherence_um", "divergence_deg", "phi_i_deg", "resolution_deg"])
@pytest.mark.parametrize("value", ["a", [], [1, 2], {}, 1j, object()])
def test_an_instrument_takes_one_number(name, value):
    theta_o = None if name == "resolution_deg" else [0]
    with pytest.raises(vg.errors.InputError, match=name):
        vg.measure.Gonioreflectometer(theta_i_deg=[0], theta_o_deg=theta_o, **{name: value})


def test_the_narrowest_aperture_has_a_solid_angle(refused):
    """1 − cos a to 1e-3, and nothing narrower."""
    narrow = vg.directions.Detector.in_plane([0], 1e-4)
    np.testing.assert_allclose(narrow.solid_angle, np.pi * np.deg2rad(0.5e-4) ** 2, rtol=1e-3)
    assert "aperture_deg = 1e-05°" in refused(*setting("detector.aperture_deg=1e-5"))


def test_only_a_height_field_is_measured():
    gonio = vg.measure.Gonioreflectometer(theta_i_deg=[0], theta_o_deg=[0])
    with pytest.raises(vg.errors.InputError, match="Heightfield"):
        gonio.measure(np.zeros((4, 4)), vg.geometric.RayOptics())


def test_a_crop_that_is_no_length(refused):
    assert "crop_um = []" in refused(*setting("surface.crop_um=[]"))
    assert "crop_um = -1:" in refused(*setting("surface.crop_um=-1"))


def test_a_scene_nested_too_deeply(refused, folder):
    (folder / "deep.toml").write_text("a = " + "[" * 5000 + "]" * 5000)
    assert "nested too deeply" in refused("plan", "deep.toml")


def test_a_material_file_that_is_no_yaml(refused, folder):
    (folder / "odd.yml").write_text("a: [1\nb: }")
    assert "odd.yml" in refused(*setting("material={file='odd.yml'}"))


@pytest.mark.parametrize("row", ["nan,1", "1,-1", "-1,0", "0,0", "1,inf"])
def test_a_material_that_cannot_be(refused, folder, row):
    (folder / "odd.csv").write_text(f"wl,n,k\n0.3,{row}\n0.9,{row}\n")
    line = refused(*setting("material={file='odd.csv'}"))
    assert "odd.csv" in line
    assert "n + ik" in line


def test_an_unknown_name_does_not_list_hundreds_of_known_ones(refused):
    assert len(refused(*setting("material.name=x"))) < 300


def test_names_that_the_file_system_refuses(refused):
    assert "too long" in refused("simulate", "scene.toml", "-o", "a" * 300 + ".nc")
    assert "too long" in refused("surface", "convert", "sample.npz", "a" * 300 + ".npz")


def test_what_does_not_fit_into_memory(refused, monkeypatch):
    def too_large(*_, **__):
        raise MemoryError("Unable to allocate 548. TiB")

    monkeypatch.setattr("vgonio.planning.plan_of", too_large)
    assert "not enough memory" in refused("plan", "scene.toml")


# ---- odd, but allowed
@pytest.mark.parametrize(
    "text",
    ["title='<b>a/b</b> µ 日本'", "title=''", "geometric.seed=99999999999999999999999", "geometric.max_bounces=1e30"],
)
def test_odd_values_that_are_allowed(folder, text):
    assert main(["simulate", "scene.toml", "--quiet", "--set", text]) == 0
    tree = vg.open("result.nc")
    assert "rays" in tree.children
    page = (folder / "result.html").read_text(encoding="utf-8")
    assert "<b>a/b</b>" not in page


def test_a_scene_with_a_byte_order_mark(folder):
    (folder / "bom.toml").write_bytes(b"\xef\xbb\xbf" + SCENE.encode())
    assert main(["plan", "bom.toml", "--quiet"]) == 0


# ---- results
def _another_programs_netcdf(path: Path) -> None:
    xr.Dataset({"temperature": ("x", [1.0, 2.0])}).to_netcdf(path, engine="h5netcdf")


def _newer_result(path: Path) -> None:
    data = xr.Dataset(attrs={"format": "vgonio result", "format_version": 99})
    data.to_netcdf(path, engine="h5netcdf")


@pytest.mark.parametrize(
    ("write", "words"),
    [
        (_another_programs_netcdf, "another program"),
        (_newer_result, "upgrade it"),
        (lambda p: p.write_text("not NetCDF at all"), "not a NetCDF-4 file"),
        (lambda p: p.write_bytes(b""), "not a NetCDF-4 file"),
        (lambda p: None, "no such result file"),
    ],
    ids=["other program", "newer", "text", "empty", "missing"],
)
def test_a_result_file_of_another_program(refused, folder, write, words):
    write(folder / "other.nc")
    assert words in refused("report", "other.nc", "-o", "page.html")
    assert words in refused("compare", "other.nc", "other.nc")


@pytest.fixture
def result(folder) -> xr.DataTree:
    """A small result, in memory and as result.nc."""
    return vg.simulate("scene.toml")


def test_a_result_with_flipped_bytes(folder, result, capfd):
    """Either still readable, or one line: nothing of what the libraries complain about on their own."""
    content = (folder / "result.nc").read_bytes()
    random = np.random.default_rng(0)
    for _ in range(12):
        damaged = bytearray(content)
        for i in random.integers(0, 4000, 20):
            damaged[i] ^= 255
        (folder / "damaged.nc").write_bytes(damaged)
        assert main(["report", "damaged.nc", "-o", "damaged.html"]) in (0, 2)
        assert capfd.readouterr().err.count("\n") <= 1


_SPOILT: dict[str, Callable[[xr.Dataset], xr.Dataset]] = {
    "other dims": lambda d: d.rename(theta_o="detector"),
    "no detector": lambda d: d.isel(theta_o=0),
    "no coordinates": lambda d: d.drop_vars(["theta_i", "wavelength"]),
    "coordinates of nan": lambda d: d.assign_coords(theta_i=d["theta_i"] * np.nan),
    "an angle twice": lambda d: d.isel(theta_i=[0, 0]),
    "nothing": lambda d: d.isel(theta_i=[]),
    "text": lambda d: d.assign(brdf=(d["brdf"].dims, np.full(d["brdf"].shape, "a"))),
    "complex": lambda d: d.assign(brdf=d["brdf"] + 0j),
    "infinite": lambda d: d.assign(brdf=d["brdf"] + np.inf),
}


@pytest.mark.parametrize("spoil", _SPOILT.values(), ids=_SPOILT)
def test_a_spoilt_result(refused, folder, result, spoil):
    result["rays"] = xr.DataTree(spoil(result["rays"].to_dataset()))
    vg.save(result, folder / "spoilt.nc")
    for command in ("report", "spoilt.nc"), ("compare", "spoilt.nc", "spoilt.nc"):
        assert "spoilt.nc, group /rays" in refused(*command)


@pytest.mark.parametrize("version", ["x", [1, 2], -1, 1.5])
def test_a_format_version_that_is_none(refused, folder, version):
    attrs = {"format": "vgonio result", "format_version": version}
    xr.Dataset(attrs=attrs).to_netcdf(folder / "odd.nc", engine="h5netcdf")
    assert "format version" in refused("report", "odd.nc")


def test_a_scene_may_list_its_values_in_any_order(folder):
    shuffled = ["light.theta_i_deg=[30, 0, 10]", "detector.theta_o_deg=[9, -30, 0]"]
    shuffled += ["light.wavelength_nm=[500, 450, 600, 550]"]
    assert main(["simulate", "scene.toml", "--quiet", *(x for text in shuffled for x in ("--set", text))]) == 0
    tree = vg.open("result.nc")
    found = vg.compare.compare(tree, material="Al")
    ordered = {n: tree[n].to_dataset().sortby(["theta_i", "theta_o", "wavelength"]) for n in ("rays", "waves")}
    for name in ("nrmse_spectral", "slope"):
        np.testing.assert_array_equal(found[name], vg.compare.compare(ordered, material="Al")[name])
    assert np.isfinite(found["nrmse_spectral"]).all()


def test_a_folder_in_place_of_a_result(refused):
    assert "is a folder: a result file is needed" in refused("report", ".")


def test_a_truncated_result(refused, folder):
    rays = vg.geometric.RayOptics("perfect", [500], rays=100)
    gonio = vg.measure.Gonioreflectometer(theta_i_deg=[0], theta_o_deg=[-30, 0, 30])
    vg.save(gonio.measure(vg.surface.read("sample.npz"), rays), "whole.nc")
    vg.open("whole.nc")
    shutil.copy("whole.nc", "cut.nc")
    with open("cut.nc", "r+b") as file:
        file.truncate(2000)
    assert "cut.nc" in refused("report", "cut.nc")


# ---- the same through a real process
def test_a_real_process_answers_the_same(folder):
    command = [sys.executable, "-m", "vgonio", "simulate", "scene.toml", "--set", "light.theta_i_deg=[90]"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.splitlines() == [done.stderr.strip()]
    assert sorted(p.name for p in folder.iterdir()) == ["sample.npz", "scene.toml"]


def test_json_commands_print_no_json_when_they_fail(refused):
    line = refused("plan", "scene.toml", "--json", "--set", "light.theta_i_deg=[90]")
    with pytest.raises(json.JSONDecodeError):
        json.loads(line)
