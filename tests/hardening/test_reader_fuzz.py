"""Every reader on damaged files: what it was given comes back, or an error of ours in one line that names the file.

Address space and time are bounded for each file. The readers of measured BRDFs are damaged in
tests/measure/test_bad_data.py; here they meet what is no file at all.
"""

from __future__ import annotations

import os
import struct
import warnings
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hardening_tools import SCENE, bounded, damaged, outcome

import vgonio as vg
from vgonio import compare, display, materials, measure
from vgonio.compare.fit_files import fit_parameters, open_fit, save_fit
from vgonio.errors import FileFormatError
from vgonio.measure.standards import read_reflectance
from vgonio.render.normbox import inputs, settings
from vgonio.scene import load_scene
from vgonio.studies import load_study
from vgonio.studies.stored import read_point

STUDY = 'scene = "scene.toml"\ntitle = "a study"\nzip = false\n[vary]\n"light.coherence_um" = [10.0, 20.0]\n'
NM = [380 + 40 * k for k in range(11)]
READINGS = "# unit: W/(sr m2 nm)\n# full scale: 255\neye,R,G,B," + ",".join(map(str, NM)) + "\n"
READINGS += "".join(f"left,{r},{g},{b}," + ",".join(f"{(r + g + b + 1) / 1e5:.3g}" for _ in NM) + "\n"
                    for r, g, b in ((0, 0, 0), (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)))  # fmt: skip
CGATS = (
    'CGATS.17\n\nORIGINATOR "x"\nKEYWORD "RGB_FULL_SCALE"\nRGB_FULL_SCALE "255"\nNUMBER_OF_FIELDS 6\n'
    "BEGIN_DATA_FORMAT\nSAMPLE_ID RGB_R RGB_G RGB_B SPEC_400 SPEC_700\nEND_DATA_FORMAT\nNUMBER_OF_SETS 2\nBEGIN_DATA\n"
    "1 0 0 0 0.1 0.2\n2 255 255 255 1.5 2.5\nEND_DATA\n"
)
PATCHES = "name,400,550,700\nred,0.1,0.1,0.6\nwhite,0.9,0.9,0.9\n"
PRIMARIES = "# nm, R, G, B\n400,0,0,1\n550,0,1,0\n700,1,0,0\n"
YAML = (
    'REFERENCES: "x"\nDATA:\n  - type: tabulated nk\n    data: |\n        0.4 0.5 4.8\n'
    "        0.5 0.8 6.0\n        0.7 1.8 8.3\n"
)
FORMULA = (
    "DATA:\n  - type: formula 2\n    wavelength_range: 0.35 2.0\n    coefficients: 0 1.03 0.006 0.23 0.02 1.01 103.5\n"
)
MATERIAL = "# lambda,n,k\n0.4,0.5,4.8\n0.5,0.8,6.0\n0.7,1.8,8.3\n"
NORMBOX = (
    'title = "x"\n[files]\nlight = "light.csv"\nreference = "reference.csv"\nwalls = "walls.json"\n'
    'patches = "patch_{number:02d}.json"\n[render]\npatches = [1, 2]\nangles_deg = [30, 60]\nsamples = 16\n'
    "[fit]\n[box]\n[errors]\npatches = [1]\n"
)
LIGHT = "# a note\nwavelength_nm,1\n400,0.5\n550,0.6\n700,0.7\n"
REFERENCE = "patch,angle_deg,400,550,700\n1,30,0.1,0.2,0.3\n1,60,0.1,0.2,0.3\n2,30,0.2,0.2,0.2\n2,60,0.2,0.2,0.3\n"
REFLECTANCE = "# nm, reflectance, U\n400 0.98 0.004\n550 0.99 0.004\n700 0.99 0.005\n"


@dataclass(frozen=True)
class Case:
    """A file of a kind and what reads it."""

    name: str
    read: Callable[[Path], object]
    content: bytes


def _scene_beside(read):
    def both(path):
        (path.parent / "scene.toml").write_text(SCENE)
        return read(path)

    return both


def _used(path: Path) -> object:
    """A material is a function: asking it for an index reads all of the file."""
    found = materials.material(path)
    return found.index(np.linspace(*found.range_nm, 5)) if np.isfinite(found.range_nm).all() else found


WANTED = settings.Render(patches=(1, 2), angles_deg=(30, 60))
TEXT = [
    Case("scene.toml", load_scene, SCENE.encode()),
    Case("study.toml", _scene_beside(load_study), STUDY.encode()),
    Case("normbox.toml", settings.load, NORMBOX.encode()),
    Case("readings.csv", display.read, READINGS.encode()),
    Case("readings.ti3", display.read, CGATS.encode()),
    Case("patches.csv", display.patches, PATCHES.encode()),
    Case("primaries.csv", display.primaries, PRIMARIES.encode()),
    Case("material.yml", _used, YAML.encode()),
    Case("formula.yml", _used, FORMULA.encode()),
    Case("material.csv", _used, MATERIAL.encode()),
    Case("light.csv", lambda path: inputs.read_light(path, 25), LIGHT.encode()),
    Case("reference.csv", lambda path: inputs.read_reference(path, WANTED), REFERENCE.encode()),
    Case("reflectance.txt", read_reflectance, REFLECTANCE.encode()),
]


@pytest.fixture(scope="module")
def fit(result):
    return compare.fit_model(result["rays"].to_dataset(), "lambert-1760")


@pytest.fixture(scope="module")
def binary(result, fit, tmp_path_factory):
    """Files that the program writes and reads again."""
    folder = tmp_path_factory.mktemp("binary")
    vg.save(result, folder / "result.nc")
    save_fit(fit, folder / "fit.nc")
    save_fit(fit, folder / "fit.json")
    use = [("result.nc", vg.open), ("fit.nc", _fit), ("fit.json", _fit), ("result.nc", read_point)]
    return [Case(f"{i}{name}", read, (folder / name).read_bytes()) for i, (name, read) in enumerate(use)]


def _fit(path: Path) -> object:
    found = open_fit(path)
    return fit_parameters(found)


def _fuzz(case: Case, folder: Path, count: int, seed: int = 11) -> int:
    """How many of `count` damages were refused."""
    rng = np.random.default_rng([seed, *case.name.encode()])
    path = folder / case.name
    refused = 0
    for _ in range(count):
        path.write_bytes(damaged(case.content, rng))
        refused += outcome(case.read, path) != ""
    return refused


@pytest.mark.parametrize("case", TEXT, ids=lambda c: c.name)
def test_damaged_text(case, tmp_path):
    (tmp_path / case.name).write_bytes(case.content)
    assert outcome(case.read, tmp_path / case.name) == ""
    assert _fuzz(case, tmp_path, 120) > 10


def test_damaged_files_of_our_own(binary, tmp_path):
    for case in binary:
        (tmp_path / case.name).write_bytes(case.content)
        assert outcome(case.read, tmp_path / case.name) == "", case.name
        assert _fuzz(case, tmp_path, 80 if case.name.endswith("json") else 15) > 3, case.name


def test_damaged_surfaces(surface_files, tmp_path):
    for name, content in surface_files.items():
        case = Case(f"a{name}", lambda path: vg.surface.read(path, pitch_um=1.0, height_unit="um"), content)
        (tmp_path / case.name).write_bytes(case.content)
        assert outcome(case.read, tmp_path / case.name) == "", case.name
        assert _fuzz(case, tmp_path, 40) > 5, case.name


# ---- instruments whose files cannot be made here: a right beginning and noise
def _beginnings() -> list[tuple[str, bytes]]:
    """(suffix, first bytes) of every format of the library that reads instrument files."""
    from SurfaceTopography.IO import readers

    known = vg.surface.readers.formats()
    found = [
        (".x3p", b"PK\x03\x04"),
        (".gwy", b"GWYP"),
        (".plu", b""),
        (".tif", b"II*\0\x08\0\0\0"),
        (".nc", b"CDF\x01"),
    ]
    for reader in readers:
        for offset, magic in getattr(reader, "_magic", None) or [(0, b"")]:
            suffix = f".{reader._file_extensions[0]}"
            if suffix in known:
                found.append((suffix, b"\x01" * offset + magic))
    return found


def test_a_right_beginning_and_noise_after_it(tmp_path):
    rng = np.random.default_rng(3)
    for suffix, start in _beginnings():
        path = tmp_path / f"noise{suffix}"
        for kind in range(8):
            noise = rng.bytes(3000) if kind % 3 else bytes(rng.choice([0, 0, 0, 1, 2, 255], 3000).astype(np.uint8))
            text = kind % 4 == 3
            path.write_bytes(start + (bytes(b % 94 + 32 for b in noise) if text else noise))
            said = outcome(lambda path: vg.surface.read(path, pitch_um=1.0, height_unit="um"), path)
            assert said or suffix in (".mat", ".nc", ".txt", ".asc", ".dat"), (suffix, kind)


@pytest.mark.parametrize("name", ["al3d-1.al3d", "nms-1.nms", "opd-1.opd", "x3p-2.x3p"])
def test_damaged_files_of_instruments(shared, tmp_path, name):
    content = (shared / "data" / "heightfields" / name).read_bytes()
    rng = np.random.default_rng(4)
    path = tmp_path / name
    refused = 0
    for _ in range(15):
        path.write_bytes(damaged(content, rng))
        refused += outcome(vg.surface.read, path) != ""
    assert refused > 1


# ---- what a header only declares
def _x3p(nx: int, ny: int, body: bytes) -> dict[str, bytes]:
    from vgonio.surface.x3p import _MAIN

    main = _MAIN.format(dx=1e-6, dy=1e-6, nx=nx, ny=ny, data_sum="0", valid="", about="")
    return {"main.xml": main.encode(), "bindata/data.bin": body, "md5checksum.hex": b"0 *main.xml\n"}


def _zip(path: Path, members: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def _npy(shape: tuple[int, ...], dtype: str, body: bytes = b"") -> bytes:
    head = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", 118) + head.encode() + body


BLANKS = b" " * 320_000_000


def _announcements(folder: Path) -> list[Path]:
    """Small files that declare gigabytes, or unpack to them."""
    files = [
        _zip(folder / "lie.npz", {"z.npy": _npy((10**5, 10**5), "<f8", b"12345678")}),
        _zip(folder / "negative.npz", {"z.npy": _npy((-3, 3), "<f8", b"12345678" * 9)}),
        _zip(folder / "overflow.npz", {"z.npy": _npy((2**33, 2**33), "<f8", b"12345678")}),
        _zip(folder / "name.npz", {"z.npy": _npy((2, 2), "<f8", b"12345678" * 4), "name.npy": _npy((), "<U900000000")}),
        _zip(folder / "lie.x3p", _x3p(10**6, 10**6, b"12345678")),
        _zip(folder / "negative.x3p", _x3p(-4, 4, b"12345678" * 16)),
    ]
    laughs = "<!DOCTYPE x [<!ENTITY a0 'ha'>" + "".join(f"<!ENTITY a{i} '{f'&a{i - 1};' * 10}'>" for i in range(1, 12))
    bomb = f'<?xml version="1.0"?>{laughs}]><x>&a11;</x>'.encode()
    files += [
        _zip(folder / "laughs.x3p", {"main.xml": bomb}),
        _zip(folder / "laughs.plux", {"index.xml": bomb, "recipe.txt": b""}),
        _zip(folder / "entity.x3p", {"main.xml": b'<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]><x>&a;</x>'}),
    ]
    for name, member in (("bomb.x3p", "main.xml"), ("bomb.plux", "index.xml")):
        files.append(_zip(folder / name, {member: b"<x>" + BLANKS + b"</x>"}))
    pitch = _npy((40_000_000,), "<f8") + BLANKS
    files.append(_zip(folder / "bomb.npz", {"z.npy": _npy((2, 2), "<f8", b"12345678" * 4), "pitch_um.npy": pitch}))
    for name, shape in (("lie.npy", (10**5, 10**5)), ("negative.npy", (-3, 3)), ("overflow.npy", (2**33, 2**33))):
        (folder / name).write_bytes(_npy(shape, "<f8", b"12345678"))
        files.append(folder / name)
    texts = {"lie.txt": "AsciiMatrix 99999 99999 1 1\n1 2 3\n", "negative.txt": "AsciiMatrix -2 -2 1 1\n1 2 3 4\n"}
    texts["word.txt"] = "DATA\n" + "1" * 3_000_000 + "\n1\t2\n"
    for name, text in texts.items():
        (folder / name).write_text(text)
        files.append(folder / name)
    return files


def test_announcements_allocate_nothing(tmp_path):
    """150 MB above what the process had, for files of at most four; the deflated ones unpack to 320 MB."""
    vg.surface.read(vg.surface.write(vg.surface.flat(shape=(4, 4), pitch_um=5.0), tmp_path / "ok.x3p"))
    paths = _announcements(tmp_path)
    for path in paths:
        assert path.stat().st_size < 4e6, path
        with warnings.catch_warnings(), bounded(megabytes=150), pytest.raises(FileFormatError) as caught:
            warnings.simplefilter("ignore")
            vg.surface.read(path)
        assert path.name in str(caught.value)


def test_hdf5_announcements_allocate_nothing(result, tmp_path):
    """Results, and surfaces in HDF5, whose arrays have a shape and no bytes, or a chunk larger than the array."""
    import h5py

    vg.save(result, tmp_path / "r.nc")
    for name, chunks in (("shape", (1000, 1000)), ("chunk", (100_000, 100_000))):
        path = tmp_path / f"{name}.h5"
        shape = (10**6, 10**6) if name == "shape" else (3, 3)
        for start in (None, (tmp_path / "r.nc").read_bytes()):
            if start is not None:
                path.write_bytes(start)
            with h5py.File(path, "a" if start is not None else "w") as file:
                file.create_dataset("huge", shape, "f8", chunks=chunks, maxshape=(None, None), compression="gzip")
            for read in (vg.open, lambda path: vg.surface.read(path, pitch_um=1.0), read_point):
                with (
                    bounded(megabytes=150),
                    pytest.raises(FileFormatError, match="huge declares|is a result, and a height field"),
                ):
                    read(path)


# ---- what is no file, and files that other systems wrote
def _all_readers() -> list[tuple[str, Callable[[Path], object], bytes]]:
    """(name of a file, reader, a good content or none) of everything that reads a file."""
    rows: list[tuple[str, Callable[[Path], object], bytes]] = [(c.name, c.read, c.content) for c in TEXT]
    rows += [
        (f"a{s}", vg.surface.read, b"")
        for s in (".npz", ".npy", ".x3p", ".vgms", ".txt", ".csv", ".mat", ".h5", ".al3d")
    ]
    rows += [(f"a{s}", measure.read, b"") for s in (".json", ".nc", ".csv", ".bsdf", ".astm", ".binary")]
    return [*rows, ("a.nc", vg.open, b""), ("a.json", open_fit, b""), ("b.nc", open_fit, b"")]


READERS = _all_readers()
ids = [f"{name}-{i}" for i, (name, *_) in enumerate(READERS)]


@pytest.mark.parametrize(("name", "read", "content"), READERS, ids=ids)
def test_what_is_no_file(tmp_path, name, read, content):
    """A folder, a pipe that nobody writes to, a device without end, a link to itself, nothing at all, an empty file."""
    places = {kind: tmp_path / kind / name for kind in ("folder", "pipe", "device", "loop", "missing", "empty")}
    for path in places.values():
        path.parent.mkdir()
    places["folder"].mkdir()
    os.mkfifo(places["pipe"])
    places["device"].symlink_to("/dev/zero")
    places["loop"].symlink_to(places["loop"])
    places["empty"].write_bytes(b"")
    for kind, path in places.items():
        said = outcome(read, path)
        assert said or (kind == "empty" and name == "normbox.toml"), kind
    assert outcome(read, tmp_path / f"a\0b{Path(name).suffix}")
    assert outcome(read, tmp_path / f"{'n' * 300}{Path(name).suffix}")


@pytest.mark.parametrize("case", TEXT, ids=lambda c: c.name)
def test_text_of_other_systems(case, tmp_path):
    """A byte order mark, lines ended as Windows and old Macs do, names with blanks, quotes and letters of all kinds."""
    suffix = Path(case.name).suffix
    for name in ("with blank and 'quotes'", "Größe µ θ", "表面 😀", "-dash", "a\nb", "100%{x}"):
        (tmp_path / f"{name}{suffix}").write_bytes(case.content)
        assert outcome(case.read, tmp_path / f"{name}{suffix}") == "", name
    for change in (
        lambda text: b"\xef\xbb\xbf" + text,
        lambda text: text.replace(b"\n", b"\r\n"),
        lambda text: text.replace(b"\n", b"\r"),
        lambda text: text.rstrip(b"\n"),
    ):
        (tmp_path / case.name).write_bytes(change(case.content))
        assert outcome(case.read, tmp_path / case.name) == ""
    for bad in (
        case.content.decode().encode("utf-16"),
        case.content[:20] + b"\xff\xfe\x80" + case.content[20:],
        b"\0" * 99,
    ):
        (tmp_path / case.name).write_bytes(bad)
        said = outcome(case.read, tmp_path / case.name)
        assert said or b"\xff\xfe\x80" in bad


# ---- a machine's calibration, which nobody asked to read
def test_a_damaged_calibration_never_stops_a_plan(tmp_path, monkeypatch):
    """Whatever lies in the user's cache, a plan is made: with the built-in figures, and the reason why."""
    import json

    from vgonio import __version__
    from vgonio.accuracy import calibrating
    from vgonio.accuracy.built_in import BUILT_IN

    path = tmp_path / "calibration.json"
    monkeypatch.setenv("VGONIO_CALIBRATION", str(path))
    speeds = next(iter(BUILT_IN.values()))
    monkeypatch.setattr(calibrating, "_name", lambda: "a machine")
    calibrating._write(calibrating.Calibration("a machine", 1, "2022-11-22", speeds, ""), path)
    content = path.read_bytes()
    assert json.loads(content)["version"] == __version__
    assert calibrating.calibration(1).machine == "a machine"
    rng = np.random.default_rng(8)
    fallen_back = 0
    for k in range(150):
        bad = damaged(content, rng) if k > 3 else (b"[" * 10**5, b"", b"null", content.replace(b'"1"', b'"-1"'))[k]
        path.write_bytes(bad)
        with bounded():
            found = calibrating.calibration(1)
        assert isinstance(found.speeds, type(speeds))
        fallen_back += found.machine != "a machine"
    assert fallen_back > 20
    path.unlink()
    for make in (lambda: os.mkfifo(path), lambda: path.symlink_to("/dev/zero"), lambda: path.symlink_to(path)):
        make()
        with bounded():
            assert calibrating.calibration(1).machine != "a machine"
        path.unlink()
