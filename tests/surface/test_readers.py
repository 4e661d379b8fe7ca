"""Readers: each against a file written here by hand from the layout of the format, not by our own writer."""

from __future__ import annotations

import json
import struct
import warnings
import zlib
from pathlib import Path

import numpy as np
import pytest

from vgonio import surface as sf
from vgonio.errors import FileFormatError, InputError, VgonioError, VgonioWarning

# the matrices below are small and steep on purpose
pytestmark = pytest.mark.filterwarnings("ignore::vgonio.errors.VgonioWarning")

Z = np.array([[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.5], [-1.0, 0.25, 0.5, 0.0]])


def vgms(z: np.ndarray, unit: int = 3, encoding: int = 0x21, compression: int = 0, du=0.5, dv=0.25, **changes) -> bytes:
    """A VGMS file from the byte offsets of the format; top row of z first."""
    body = z.astype("<f4").tobytes()
    if encoding == 0x23:
        body = "\n".join(" ".join(str(v) for v in r) for r in z).encode()
    if compression == 1:
        body = zlib.compress(body)
    if compression == 2:
        packer = zlib.compressobj(wbits=31)
        body = packer.compress(body) + packer.flush()
    head = bytearray(68)
    head[0:4] = b"VGMS"
    struct.pack_into("<II", head, 4, changes.get("version", 0x000100), changes.get("length", 68 + len(body)))
    head[12:44] = b"2022-11-01T12:00:00.000000+01:00"
    head[44:47] = bytes((changes.get("size", 4), encoding, compression))
    columns, lines = changes.get("columns", z.shape[1]), changes.get("rows", z.shape[0])
    struct.pack_into("<IIIff", head, 48, unit, columns, lines, du, dv)
    return bytes(head) + body


def file(folder: Path, name: str, content: bytes | str) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


# ---- µsurf text
def usurf(x: list[float], y: list[float], z: list[list[float | None]]) -> str:
    lines = ["DATA", "\t".join(map(str, x))]
    lines += [f"{v}\t" + "\t".join("" if h is None else str(h) for h in row) for v, row in zip(y, z)]
    return "\n".join(lines) + "\n"


def test_usurf_text(tmp_path):
    z = [[1, 2, 3], [4, None, 6]]
    f = sf.read(file(tmp_path, "a.txt", usurf([0, 0.5, 1.0], [0, 0.25], z)))
    assert f.pitch_um == (0.25, 0.5)
    np.testing.assert_array_equal(f.z, [[1, 2, 3], [4, np.nan, 6]])


def test_usurf_text_y_downwards_is_flipped(tmp_path):
    f = sf.read(file(tmp_path, "a.txt", usurf([0, 0.5, 1.0], [0.5, 0.25, 0], [[1, 2, 3], [4, 5, 6], [7, 8, None]])))
    np.testing.assert_array_equal(f.z, [[7, 8, np.nan], [4, 5, 6], [1, 2, 3]])


def test_usurf_text_missing_at_both_ends_and_blank_separated(tmp_path):
    f = sf.read(file(tmp_path, "a.txt", "DATA\r\n\t0 1 2\r\n0\t\t5\t\r\n1\t1\t2\t3\t\r\n"))
    np.testing.assert_array_equal(f.z, [[np.nan, 5, np.nan], [1, 2, 3]])


@pytest.mark.parametrize(
    "text",
    [
        "DATA\n0\t1\n0\t1\t2\n1\t3\n",  # last line truncated
        "DATA\n0\t1\t3\n0\t1\t2\t3\n1\t1\t2\t3\n",  # uneven x
        "DATA\n0\tone\n0\t1\t2\n",
        "DATA\n",
    ],
)
def test_usurf_text_broken(tmp_path, text):
    with pytest.raises(FileFormatError, match="a.txt"):
        sf.read(file(tmp_path, "a.txt", text))


# ---- AsciiMatrix
def test_ascii_matrix(tmp_path):
    f = sf.read(file(tmp_path, "a.txt", "AsciiMatrix 3 2 0.5 0.25\n1 2 3\n4 5 6\n"))
    assert f.pitch_um == (0.25, 0.5)
    np.testing.assert_array_equal(f.z, [[1, 2, 3], [4, 5, 6]])


def test_ascii_matrix_without_pitch_asks_for_it(tmp_path):
    path = file(tmp_path, "a.txt", "AsciiMatrix 3 2\n1 2 3\n4 5 6\n")
    with pytest.raises(FileFormatError, match="give pitch_um"):
        sf.read(path)
    assert sf.read(path, pitch_um=0.3).pitch_um == (0.3, 0.3)


@pytest.mark.parametrize("text", ["AsciiMatrix 3\n1 2 3\n", "AsciiMatrix 3 2 1 1\n1 2 3\n", "AsciiMatrix 3 -2 1 1\n"])
def test_ascii_matrix_broken(tmp_path, text):
    with pytest.raises(FileFormatError):
        sf.read(file(tmp_path, "a.txt", text))


# ---- VGMS
@pytest.mark.parametrize("encoding", [0x21, 0x23])
@pytest.mark.parametrize("compression", [0, 1, 2])
def test_vgms(tmp_path, encoding, compression):
    f = sf.read(file(tmp_path, "a.vgms", vgms(Z, encoding=encoding, compression=compression)))
    assert f.pitch_um == (0.25, 0.5)
    np.testing.assert_array_equal(f.z, Z[::-1])  # float32 holds these numbers exactly; top row first in the file


@pytest.mark.parametrize(("unit", "um"), [(0, 1e6), (1, 1e4), (2, 1e3), (3, 1.0), (4, 1e-3)])
def test_vgms_unit_holds_for_pitch_and_heights(tmp_path, unit, um):
    f = sf.read(file(tmp_path, "a.vgms", vgms(Z / um, unit, du=0.5 / um, dv=0.25 / um)))
    np.testing.assert_allclose(f.pitch_um, (0.25, 0.5), rtol=1e-7)  # float32 in the header
    np.testing.assert_allclose(f.z, Z[::-1], rtol=1e-7)


@pytest.mark.parametrize(
    "content",
    [
        vgms(Z)[:-1],
        vgms(Z)[:40],
        vgms(Z, compression=1)[:-5],
        vgms(Z, unit=9),
        vgms(Z, size=8),
        vgms(Z, encoding=0x23, columns=5),
        vgms(Z, columns=2**31, rows=2**31),
        vgms(Z, columns=20_000, rows=2_000),
        vgms(Z, compression=1, columns=9_000, rows=9_000),
        vgms(Z, columns=0),
        vgms(Z, du=0.0),
        vgms(Z, du=np.nan),
        vgms(Z, version=0x10000),
    ],
)
def test_vgms_broken(tmp_path, content):
    with pytest.raises(FileFormatError):
        sf.read(file(tmp_path, "a.vgms", content))


# ---- npz
def npz(path: Path, **arrays) -> Path:
    np.savez_compressed(path, **{k: np.asarray(v) for k, v in arrays.items()})
    return path


def test_npz_float_and_facts(tmp_path):
    f = sf.read(
        npz(
            tmp_path / "a.npz",
            z=Z,
            pitch_um=(0.25, 0.5),
            periodic=True,
            interpolation="nearest",
            name="ours",
            history=["one", "two"],
            meta=json.dumps({"seed": 3}),
        )
    )
    np.testing.assert_array_equal(f.z, Z)
    assert (f.pitch_um, f.periodic, f.interpolation, f.name) == ((0.25, 0.5), True, "nearest", "ours")
    assert f.history[:2] == ("one", "two")
    assert f.meta["seed"] == 3


def test_npz_int16(tmp_path):
    z = np.array([[1, -32768], [3, 4]], np.int16)
    f = sf.read(npz(tmp_path / "a.npz", z=z, scale_um=0.5, offset_um=2.0, pitch_um=1.0))
    np.testing.assert_array_equal(f.z, [[2.5, np.nan], [3.5, 4.0]])


def test_npz_fortran_order_and_float16(tmp_path):
    f = sf.read(npz(tmp_path / "a.npz", z=np.asfortranarray(Z.astype(np.float16)), pitch_um=1.0))
    np.testing.assert_array_equal(f.z, Z)


def test_npz_never_unpickles(tmp_path):
    class Bomb:
        def __reduce__(self):
            return (pytest.fail, ("unpickled",))

    np.savez(tmp_path / "a.npz", z=np.array([[Bomb(), 1.0]], dtype=object), pitch_um=1.0)
    with pytest.raises(FileFormatError):
        sf.read(tmp_path / "a.npz")
    np.savez(tmp_path / "b.npz", z=Z, pitch_um=1.0, meta=np.array(Bomb(), dtype=object))
    with pytest.raises(FileFormatError):
        sf.read(tmp_path / "b.npz")


@pytest.mark.parametrize(
    "arrays",
    [
        {"pitch_um": 1.0},
        {"z": Z[0], "pitch_um": 1.0},
        {"z": Z, "pitch_um": -1.0},
        {"z": Z, "pitch_um": "abc"},
        {"z": Z, "pitch_um": 1.0, "meta": "not json"},
        {"z": Z, "pitch_um": 1.0, "interpolation": "quintic"},
        {"z": Z.astype(complex), "pitch_um": 1.0},
        {"z": np.full((2, 2), np.nan), "pitch_um": 1.0},
        {"z": Z},
    ],
)
def test_npz_broken(tmp_path, arrays):
    with pytest.raises(FileFormatError, match="a.npz"):
        sf.read(npz(tmp_path / "a.npz", **arrays))


# ---- overrides and plausibility
def test_height_unit_takes_the_numbers_as_they_stand(tmp_path):
    path = npz(tmp_path / "a.npz", z=Z, pitch_um=1.0)
    f = sf.read(path, height_unit="nm")
    np.testing.assert_allclose(f.z, Z * 1e-3, rtol=1e-15)
    assert any("nm" in step for step in f.history)
    # the file says mm: its numbers are heights in nm all the same
    f = sf.read(file(tmp_path, "a.vgms", vgms(Z, unit=2, du=1e-3, dv=1e-3)), height_unit="nm")
    np.testing.assert_allclose(f.z, Z[::-1] * 1e-3, rtol=1e-15)
    assert f.dx == pytest.approx(1.0)  # the pitch keeps the file's unit
    with pytest.raises(InputError, match="unknown length unit"):
        sf.read(path, height_unit="furlong")


def test_other_overrides(tmp_path):
    path = npz(tmp_path / "a.npz", z=Z, pitch_um=1.0)
    f = sf.read(path, pitch_um=(0.25, 0.5), interpolation="linear", periodic=True)
    assert (f.pitch_um, f.interpolation, f.periodic) == ((0.25, 0.5), "linear", True)
    assert any("pitch set" in step for step in f.history)
    with pytest.raises(InputError, match="pitch"):
        sf.read(path, pitch_um=0)
    with pytest.raises(InputError, match="interpolation"):
        sf.read(path, interpolation="bicubic")


@pytest.mark.parametrize(
    ("z", "pitch", "word"),
    [
        (Z, 2e-4, "pitch"),
        (Z, 500.0, "pitch"),
        (np.ones((3000, 2)) + np.arange(3000)[:, None] % 2, 50.0, "side"),
        (Z * 300, 90.0, "Sq"),
        (Z * 1e-9, 1.0, "Sq"),
        (Z, 0.5, "RMS slope"),
    ],
)
def test_implausible_files_are_warned_about(tmp_path, z, pitch, word):
    with pytest.warns(VgonioWarning, match=word):
        sf.read(npz(tmp_path / "a.npz", z=z, pitch_um=pitch))


def test_rows_that_are_all_equal_have_no_implausible_side(tmp_path):
    """Eight rows of a profile, 0.4 µm: the same heights with one changed row are a strip, and are warned about."""
    profile = np.repeat(0.05 * np.sin(np.arange(200) / 5)[None], 8, axis=0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sf.read(npz(tmp_path / "a.npz", z=profile, pitch_um=0.05))
    with pytest.warns(VgonioWarning, match="a side of 0.4 µm"):
        sf.read(npz(tmp_path / "b.npz", z=profile + 1e-3 * (np.arange(8) == 3)[:, None], pitch_um=0.05))
    with pytest.warns(VgonioWarning, match="a side of 0.8 µm"):  # the side along the profile still counts
        sf.read(npz(tmp_path / "c.npz", z=profile[:, :16], pitch_um=0.05))


def test_plausible_files_are_not(tmp_path):
    smooth = sf.gaussian(0.5, 5, (64, 64), 0.5).z
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        f = sf.read(npz(tmp_path / "a.npz", z=smooth, pitch_um=0.5))
    line = sf.describe_import(f)
    assert "\n" not in line
    for fact in ("64 × 64 points", "pitch 0.5 × 0.5 µm", "size 32 × 32 µm", "Sq 0.5 µm"):
        assert fact in line


# ---- files that are none
def test_files_that_are_none(tmp_path):
    cases = {
        "missing": tmp_path / "no.npz",
        "folder": tmp_path,
        "empty": file(tmp_path, "empty.npz", b""),
        "suffix": file(tmp_path, "a.xyzzy", b"hello"),
        "text": file(tmp_path, "b.npz", b"hello, I am a text"),
        "no suffix": file(tmp_path, "surface", b"hello"),
    }
    said = {}
    for name, path in cases.items():
        with pytest.raises(FileFormatError) as e:
            sf.read(path)
        said[name] = str(e.value)
        assert "\n" not in said[name]
        assert str(path) in said[name]
    assert ".al3d" in said["suffix"]
    assert ".vgms" in said["suffix"]


def test_wrong_suffix_of_our_formats_is_found_by_first_bytes(tmp_path):
    np.testing.assert_array_equal(sf.read(file(tmp_path, "a.sur", vgms(Z))).z, Z[::-1])


def test_plain_text_matrix_asks_for_what_it_lacks(tmp_path):
    path = file(tmp_path, "a.asc", "1 2 3\n4 5 6\n7 8 10\n")
    with pytest.raises(FileFormatError, match="pitch_um|height_unit"):
        sf.read(path)
    f = sf.read(path, pitch_um=1.0, height_unit="nm")
    assert sorted(f.z.ravel()) == pytest.approx([n * 1e-3 for n in (1, 2, 3, 4, 5, 6, 7, 8, 10)])


# ---- arrays of a user's own
def _written(folder: Path, z: np.ndarray) -> list[Path]:
    """The same array in all ways: savetxt with comments and separators, np.save in both orders and three types."""
    for name, options in {
        "a.csv": {"delimiter": ","},
        "b.txt": {},
        "c.dat": {"delimiter": "\t", "header": "heights"},
    }.items():
        np.savetxt(folder / name, z, **options)
    german = "\n".join(";".join(f"{v:.17g}".replace(".", ",") for v in row) for row in z)
    file(folder, "d.csv", german + "\n")
    for name, array in {"e.npy": z, "f.npy": np.asfortranarray(z), "g.npy": z.astype(">f8")}.items():
        np.save(folder / name, array)
    return sorted(p for p in folder.iterdir() if p.suffix in (".csv", ".txt", ".dat", ".npy"))


def test_a_matrix_of_ones_own_is_read_row_by_row(tmp_path):
    z = np.random.default_rng(2).normal(size=(5, 7))
    z[1, 2] = np.nan
    paths = _written(tmp_path, z)
    assert len(paths) == 7
    for path in paths:
        f = sf.read(path, pitch_um=(0.5, 0.25), height_unit="um")
        np.testing.assert_array_equal(f.z, z, err_msg=path.name)
        assert f.pitch_um == (0.5, 0.25)
    file(tmp_path, "gap.csv", "1,2,3,4\n5,,7,8\n")
    gap = sf.read(tmp_path / "gap.csv", pitch_um=1.0, height_unit="nm").z
    np.testing.assert_allclose(gap, [[1e-3, 2e-3, 3e-3, 4e-3], [5e-3, np.nan, 7e-3, 8e-3]], rtol=1e-15)
    np.save(tmp_path / "whole.npy", np.arange(6).reshape(2, 3))
    assert sf.read(tmp_path / "whole.npy", pitch_um=1.0, height_unit="mm").z.max() == pytest.approx(5000, rel=1e-15)


def test_a_matrix_of_ones_own_asks_for_pitch_and_unit_at_once(tmp_path):
    for path in _written(tmp_path, np.ones((4, 5)) + np.eye(4, 5)):
        with pytest.raises(FileFormatError, match=r"give height_unit \(um, nm, …\) and pitch_um \(µm\)"):
            sf.read(path)
        with pytest.raises(FileFormatError, match="no unit of heights: give height_unit"):
            sf.read(path, pitch_um=1.0)
        with pytest.raises(FileFormatError, match="no pitch: give pitch_um"):
            sf.read(path, height_unit="nm")


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [("a.csv", "1,2,3,4\n5,6,7\n", "not a matrix of numbers"), ("a.csv", "1,2,3,4\n5,x,7,8\n", "not a matrix"),
     ("a.csv", "a,b,c,d\n1,2,3,4\n", "every line holds numbers only"), ("a.npy", b"PK12", "begins with")],
)  # fmt: skip
def test_what_is_no_matrix_says_what_one_is(tmp_path, name, content, said):
    with pytest.raises(FileFormatError, match=said):
        sf.read(file(tmp_path, name, content), pitch_um=1.0, height_unit="um")


@pytest.mark.parametrize(
    "array", [np.array([[{}, {}]], object), np.ones((2, 2), complex), np.ones(5), np.ones((2, 2, 2))]
)
def test_npy_takes_two_dimensional_real_numbers_only(tmp_path, array):
    np.save(tmp_path / "a.npy", array, allow_pickle=True)
    with pytest.raises(FileFormatError, match="two-dimensional real numbers are read"):
        sf.read(tmp_path / "a.npy", pitch_um=1.0, height_unit="um")


# ---- fuzz
def _samples(folder: Path) -> dict[str, bytes]:
    f = sf.Heightfield(np.random.default_rng(1).normal(size=(12, 9)), 5.0)
    out = {".vgms": vgms(Z), ".txt": usurf([0, 1, 2], [0, 1], [[1, 2, 3], [4, 5, 6]]).encode()}
    out["m.txt"] = b"AsciiMatrix 3 2 1 1\n1 2 3\n4 5 6\n"
    for suffix in (".npz", ".x3p", ".csv"):
        out[suffix] = sf.write(f, folder / f"fuzz{suffix}").read_bytes()
    return out


def _read_or_refuse(path: Path) -> None:
    """Either a height field or a VgonioError of one line: anything else fails the test."""
    try:
        sf.read(path)
    except VgonioError as e:
        assert "\n" not in str(e)


@pytest.mark.filterwarnings("ignore")
def test_truncated_and_corrupted_files_never_raise_anything_else(tmp_path, rng):
    for name, whole in _samples(tmp_path).items():
        for cut in np.unique(np.linspace(0, len(whole) - 1, 25).astype(int)):
            _read_or_refuse(file(tmp_path, f"cut{name}", whole[:cut]))
        for _ in range(40):
            bad = bytearray(whole)
            for at in rng.integers(0, len(bad), rng.integers(1, 6)):
                bad[at] = rng.integers(0, 256)
            _read_or_refuse(file(tmp_path, f"bad{name}", bytes(bad)))


@pytest.mark.filterwarnings("ignore")
def test_random_bytes_under_every_suffix_are_refused(tmp_path, rng):
    from vgonio.surface.readers import formats

    for suffix in formats():
        path = file(tmp_path, f"noise{suffix}", rng.bytes(600))
        with pytest.raises(FileFormatError) as e:
            sf.read(path)
        assert "\n" not in str(e.value)


@pytest.mark.filterwarnings("ignore")
def test_a_header_does_not_allocate(tmp_path):
    """A file of some hundred bytes that declares up to 10⁸ points costs less than 50 MB."""
    import tracemalloc

    header = b"\x93NUMPY\x01\x00" + struct.pack("<H", 118)
    header += b"{'descr': '<f8', 'fortran_order': False, 'shape': (9000, 9000), }".ljust(117) + b"\n"
    import zipfile

    with zipfile.ZipFile(tmp_path / "lie.npz", "w") as archive:
        archive.writestr("z.npy", header + b"12345678")
    sdf = "aBCR-1.0\nManufacID=x\nCreateDate=0\nModDate=0\nNumPoints=9000\nNumProfiles=9000\n"
    sdf += "Xscale=1e-6\nYscale=1e-6\nZscale=1e-6\nZresolution=0\nCompression=0\nDataType=7\nCheckType=0\n*\n1 2 3\n*\n"
    nms = bytearray(3600)
    struct.pack_into("<IIdd", nms, 1368, 9000, 9000, 0.001, 0.001)
    paths = [
        tmp_path / "lie.npz",
        file(tmp_path, "lie.vgms", vgms(Z, columns=9000, rows=9000)),
        file(tmp_path, "lie2.vgms", vgms(Z, compression=1, columns=9000, rows=9000)),
        file(tmp_path, "lie.txt", "AsciiMatrix 9000 9000 1 1\n1 2 3\n"),
        file(tmp_path, "lie.sdf", sdf),
        file(tmp_path, "lie.nms", bytes(nms)),
    ]
    with pytest.raises(FileFormatError):
        sf.read(paths[-1])  # imports the library outside the measurement
    for path in paths:
        tracemalloc.start()
        with pytest.raises(FileFormatError):
            sf.read(path)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 50e6, f"{path.name}: {peak / 1e6:.0f} MB"
