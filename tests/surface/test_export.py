"""Export: round trips, and the bytes of X3P and STL against their standards."""

from __future__ import annotations

import hashlib
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest

from vgonio import surface as sf
from vgonio.errors import FileFormatError, InputError


@pytest.fixture
def field() -> sf.Heightfield:
    z = sf.gaussian(0.3, 3, (40, 30), 0.5, seed=1).z.copy()
    z[3, 4] = z[0, 0] = np.nan
    return sf.Heightfield(
        z, (0.5, 0.25), interpolation="linear", name="a name", history=("made",), meta={"k": [1, "b"]}
    )


def test_npz_keeps_everything(field, tmp_path):
    f = sf.read(sf.write(field, tmp_path / "a.npz"))
    np.testing.assert_array_equal(f.z, field.z)
    assert (f.pitch_um, f.periodic, f.interpolation, f.name) == ((0.5, 0.25), False, "linear", "a name")
    assert f.history[0] == "made"
    assert f.meta["k"] == [1, "b"]


def test_npz_int16(field, tmp_path):
    exact, small = (tmp_path / n for n in ("exact.npz", "small.npz"))
    sf.write(field, exact)
    f = sf.read(sf.write(field, small, int16=True))
    step = np.nanmax(field.z) - np.nanmin(field.z)
    assert np.nanmax(np.abs(f.z - field.z)) <= 0.5001 * step / 65_000
    np.testing.assert_array_equal(np.isnan(f.z), np.isnan(field.z))
    assert small.stat().st_size < 0.5 * exact.stat().st_size
    f = sf.read(sf.write(field, small, scale_um=0.01))
    assert np.nanmax(np.abs(f.z - field.z)) <= 0.005001
    with pytest.raises(InputError, match="16 bits"):
        sf.write(field, small, scale_um=1e-6)


def test_int16_of_a_flat_surface(tmp_path):
    f = sf.read(sf.write(sf.flat((4, 4)), tmp_path / "a.npz", int16=True))
    np.testing.assert_array_equal(f.z, 0)


@pytest.mark.parametrize(
    ("suffix", "options", "tolerance"),
    [
        (".csv", {}, 0.0),
        (".x3p", {}, 1e-15),
        (".vgms", {}, 1e-7),
        (".vgms", {"encoding": "ascii", "compression": "zlib", "unit": "nm"}, 1e-7),
        (".vgms", {"compression": "gzip", "unit": "mm"}, 1e-7),
    ],
)
def test_round_trips(field, tmp_path, suffix, options, tolerance):
    f = sf.read(sf.write(field, tmp_path / f"a{suffix}", **options))
    np.testing.assert_allclose(f.z, field.z, atol=tolerance)  # float32 of heights below 1 µm: 6e-8
    np.testing.assert_allclose(f.pitch_um, field.pitch_um, rtol=1e-7)


def test_csv_says_pitch_and_unit(field, tmp_path):
    text = sf.write(field.replace(periodic=True), tmp_path / "a.csv").read_text()
    header = [line for line in text.splitlines() if line.startswith("#")]
    assert any("pitch_x_um = 0.25" in line for line in header)
    assert any("heights in um" in line for line in header)
    f = sf.read(tmp_path / "a.csv")
    assert f.periodic
    assert f.interpolation == "linear"
    assert f.name == "a name"


def test_x3p_of_a_third_party_and_its_checksums(field, tmp_path):
    from SurfaceTopography.IO import open_topography

    path = sf.write(field, tmp_path / "a.x3p")
    theirs = open_topography(str(path), format="x3p").topography()
    assert theirs.unit == "m"
    assert theirs.physical_sizes == pytest.approx((30 * 0.25e-6, 40 * 0.5e-6))
    heights = np.ma.filled(theirs.heights(), np.nan)
    np.testing.assert_allclose(heights.T * 1e6, field.z, rtol=1e-14)
    with zipfile.ZipFile(path) as archive:
        main = archive.read("main.xml")
        assert archive.read("md5checksum.hex").split()[0].decode() == hashlib.md5(main).hexdigest()
        assert hashlib.md5(archive.read("bindata/data.bin")).hexdigest() in main.decode()


def test_x3p_keeps_a_comment_in_the_record_of_the_standard(field, tmp_path):
    """Read by another program and as XML; the heights and the order of elements of ISO 25178-72 stay."""
    from SurfaceTopography.IO import open_topography

    path = sf.write(field, tmp_path / "a.x3p", comment="made, not <measured> & all")
    theirs = open_topography(str(path), format="x3p").topography()
    np.testing.assert_allclose(np.ma.filled(theirs.heights(), np.nan).T * 1e6, field.z, rtol=1e-14)
    assert sf.read(path).meta["instrument_name"] == "software (vgonio)"
    with zipfile.ZipFile(path) as archive:
        main = archive.read("main.xml")
        assert archive.read("md5checksum.hex").split()[0].decode() == hashlib.md5(main).hexdigest()
    root = ElementTree.fromstring(main)
    assert [e.tag for e in root] == ["Record1", "Record2", "Record3", "Record4"]
    about = ["Date", "Instrument", "CalibrationDate", "ProbingSystem", "Comment"]
    assert [e.tag for e in root.find("Record2")] == about
    assert root.findtext("Record2/Comment") == "made, not <measured> & all"
    with zipfile.ZipFile(sf.write(field, tmp_path / "b.x3p")) as archive:
        assert ElementTree.fromstring(archive.read("main.xml")).find("Record2") is None


def test_stl_is_the_surface_of_the_samples(tmp_path):
    f = sf.Heightfield(sf.gaussian(0.3, 3, (8, 8), 1.5).z, (1.5, 1.0))
    data = sf.write(f, tmp_path / "a.stl").read_bytes()
    count = int(np.frombuffer(data, "<u4", 1, 80)[0])
    assert count == 2 * 7 * 7
    assert len(data) == 84 + 50 * count
    triangles = np.frombuffer(data, [("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")], count, 84)
    v = triangles["v"].astype(float)
    corners = {tuple(c) for c in v.reshape(-1, 3).round(4)}
    samples = np.stack([*np.meshgrid(f.x, f.y), f.z], axis=-1).astype(np.float32).astype(float)
    assert corners == {tuple(c) for c in samples.reshape(-1, 3).round(4)}
    normal = np.cross(v[:, 1] - v[:, 0], v[:, 2] - v[:, 0])
    assert (normal[:, 2] > 0).all()
    np.testing.assert_allclose(triangles["n"], normal / np.linalg.norm(normal, axis=1, keepdims=True), atol=1e-5)
    assert normal[:, 2].sum() / 2 == pytest.approx(7 * 7 * 1.5, rel=1e-5)  # projected area, no overlap


def test_stl_leaves_out_what_is_missing(field, tmp_path):
    data = sf.write(field, tmp_path / "a.stl").read_bytes()
    count = int(np.frombuffer(data, "<u4", 1, 80)[0])
    # an inner point is a corner of 6 triangles, the first corner of the field of both triangles of its cell
    assert count == 2 * 39 * 29 - 6 - 2
    assert len(data) == 84 + 50 * count
    assert np.isfinite(np.frombuffer(data, [("f", "<f4", 12), ("a", "<u2")], count, 84)["f"]).all()
    with pytest.raises(InputError, match="2 × 2"):
        sf.write(sf.Heightfield(np.zeros((1, 5)), 1.0), tmp_path / "b.stl")


def test_bad_requests_leave_nothing_behind(field, tmp_path):
    with pytest.raises(InputError, match=r"did you mean '\.stl'"):
        sf.write(field, tmp_path / "a.st")
    with pytest.raises(InputError, match="int16"):
        sf.write(field, tmp_path / "a.npz", int61=True)
    with pytest.raises(InputError, match="brotli"):
        sf.write(field, tmp_path / "a.vgms", compression="brotli")
    with pytest.raises(FileFormatError, match="cannot write"):
        sf.write(field, tmp_path / "nowhere" / "a.npz")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_keeps_the_old_file(field, tmp_path, monkeypatch):
    path = sf.write(field, tmp_path / "a.npz")
    before = path.read_bytes()

    def full_disk(*args, **kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full_disk)
    with pytest.raises(FileFormatError, match="No space left"):
        sf.write(field, path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
