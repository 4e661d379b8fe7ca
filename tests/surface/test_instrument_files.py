"""The four real instrument files, against their published description and an independent reading of their bytes."""

from __future__ import annotations

import struct
import warnings

import numpy as np
import pytest

from vgonio import surface as sf
from vgonio.errors import FileFormatError, VgonioError, VgonioWarning


def test_al3d(shared, agreement):
    f = sf.read(shared / "data/heightfields/al3d-1.al3d")
    assert f.shape == (296, 200)  # 200 × 296 points, x first, as in the file's tags Cols and Rows
    np.testing.assert_allclose(f.pitch_um, 0.438, rtol=1e-3)
    # Sq about 0.26 µm once the mounting tilt and form are gone
    sq = sf.parameters(sf.level(f, "quadratic"))["Sq"]
    agreement("Sq of an Alicona file (al3d), levelled", "stated, 0.26 µm", sq - 0.26, 0.005, "µm")


def test_x3p(shared, agreement):
    f = sf.read(shared / "data/heightfields/x3p-2.x3p")
    assert f.shape == (650, 650)
    assert (f.dx, f.dy) == pytest.approx((0.128, 0.315), rel=5e-3)
    p = sf.parameters(f)
    agreement("Sq of an ISO 25178 file (x3p)", "stated, 0.077 µm", p["Sq"] - 0.077, 5e-4, "µm")
    # "near Gaussian" ground surface
    assert abs(p["Ssk"]) < 0.5
    assert abs(p["Sku"] - 3) < 0.5


def test_opd(shared, agreement):
    path = shared / "data/heightfields/opd-1.opd"
    f = sf.read(path)
    assert f.shape == (480, 640)
    assert (f.dx, f.dy) == pytest.approx((0.197, 0.197), rel=5e-3)
    # the block "Raw" by hand: float32 in waves of 577.295 nm, which the file calls its DataScale in nanometres
    data = path.read_bytes()
    entries = struct.unpack_from("<i", data, 20)[0] // 24
    at = 2 + 24 * entries
    for i in range(1, entries):
        name, _, length, _ = struct.unpack_from("<16shiH", data, 2 + 24 * i)
        if name.startswith(b"Raw"):
            break
        at += max(length, 0)
    columns, rows, _ = struct.unpack_from("<HHH", data, at)
    raw = np.frombuffer(data, "<f4", columns * rows, at + 6).reshape(columns, rows).T.astype(float)
    raw[np.abs(raw) > 1e30] = np.nan
    assert f.missing == np.isnan(raw).sum() > 0
    error = np.nanmax(np.abs(f.z / (raw[::-1] * 0.5772949829) - 1))
    agreement("heights of a Wyko file (opd)", "its bytes, read by hand", error, 1e-6)
    assert np.nanstd(f.z) == pytest.approx(0.00836, abs=1e-5)


def test_nms_is_a_million_times_too_wide_and_says_so(shared, agreement):
    path = shared / "data/heightfields/nms-1.nms"
    with pytest.warns(VgonioWarning, match="pitch_um"):
        f = sf.read(path)
    assert f.size_um[0] == pytest.approx(160e6, rel=1e-3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        f = sf.read(path, pitch_um=0.3125)
    assert f.shape == (512, 512)
    assert f.size_um == (160, 160)
    # Sq 0.03 µm with outliers: the robust spread is a third of it
    z = sf.level(f, "plane").z
    agreement("Sq of a NanoFocus file (nms), outliers included", "stated, 0.0335 µm", np.std(z) - 0.0335, 5e-4, "µm")
    assert 1.4826 * np.median(np.abs(z - np.median(z))) < 0.4 * np.std(z)


def test_orientation_rows_are_y(shared):
    """SurfaceTopography gives (nx, ny); a corner and a step along each axis identify ours."""
    from SurfaceTopography.IO import open_topography

    path = shared / "data/heightfields/al3d-1.al3d"
    theirs = np.asarray(open_topography(str(path)).topography().heights()) * 1e6
    ours = sf.read(path).z
    np.testing.assert_allclose(ours[3, 7], theirs[7, 3], rtol=1e-12)
    np.testing.assert_allclose(ours[-1, 0], theirs[0, -1], rtol=1e-12)


def test_the_table_of_suffixes_is_the_library_s():
    from SurfaceTopography.IO import readers

    from vgonio.surface.readers import instrument

    theirs = {"." + suffix for reader in readers for suffix in reader._file_extensions}
    # what is no surface measurement or ours: arrays without unit, terrain, office sheets, bare archives
    assert theirs - set(instrument.SUFFIXES) == {".npy", ".npz", ".hgt", ".zip", ".xlsx"}
    assert set(instrument.SUFFIXES) <= theirs


def test_which_of_several_channels_is_in_the_history(tmp_path):
    """A MATLAB file with two arrays has two channels."""
    from scipy.io import savemat

    rng = np.random.default_rng(0)
    savemat(tmp_path / "two.mat", {"first": rng.normal(size=(4, 5)), "second": rng.normal(size=(4, 5))})
    f = sf.read(tmp_path / "two.mat", pitch_um=10.0, height_unit="um")
    assert any("channel 'first' of 2" in step and "second" in step for step in f.history)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["al3d-1.al3d", "nms-1.nms", "opd-1.opd", "x3p-2.x3p"])
def test_damaged_instrument_files_give_one_line(shared, tmp_path, name, rng):
    whole = (shared / "data/heightfields" / name).read_bytes()
    path = tmp_path / name
    for cut in (10, 100, 1000, 3000, len(whole) // 2):
        path.write_bytes(whole[:cut])
        with pytest.raises(FileFormatError) as e:
            sf.read(path)
        assert "\n" not in str(e.value)
    for _ in range(8):
        bad = bytearray(whole)
        for at in rng.integers(0, 1500, 12):
            bad[at] = rng.integers(0, 256)
        path.write_bytes(bad)
        try:
            sf.read(path)
        except VgonioError as e:
            assert "\n" not in str(e)
