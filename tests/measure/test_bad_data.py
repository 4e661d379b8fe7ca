"""Measured data that are not as they should be: a clear error or a repair that is stated, for every reader alike."""

from __future__ import annotations

import json
import struct
import tracemalloc
import warnings

import numpy as np
import pytest
import xarray as xr

from vgonio import compare
from vgonio.errors import FileFormatError, InputError, VgonioError, VgonioWarning
from vgonio.measure import formats, tensor_file
from vgonio.measure.isotropic import sampled
from vgonio.measure.readers.checks import reflectance_bound

THETA_O = np.arange(-80, 81, 10)
NM = (450, 550, 650)


def rows(theta_i=(0, 40), theta_o=THETA_O, nm=NM, value=0.3):
    """(θ_i, θ_o, λ, f) of a grid."""
    return [(i, o, w, value) for i in theta_i for o in map(int, theta_o) for w in nm]


def csv(folder, table):
    text = "theta_i_deg,theta_o_deg,wavelength_nm,brdf_per_sr\n" + "".join(",".join(map(str, r)) + "\n" for r in table)
    return written(folder / "a.csv", text)


def gonio_json(folder, table):
    nm = sorted({r[2] for r in table})
    spectra: dict = {}
    for i, o, w, f in table:
        spectra.setdefault((i, o), []).append((w, f))
    content: list = [{"wavelengths": nm}]
    for (i, o), values in spectra.items():
        copies = max(sum(w == v[0] for v in values) for w in nm)
        for k in range(copies):
            one = [[v[1] for v in values if v[0] == w][k] if w in [v[0] for v in values] else None for w in nm]
            sides = {"thetaIn": abs(i), "phiIn": 0, "thetaOut": abs(o), "phiOut": 0 if o >= 0 else 180}
            content.append(sides | {"spectrum": one})
    return written(folder / "a.json", json.dumps(content))


def astm(folder, table):
    nm = sorted({r[2] for r in table})
    lines = [f"ANGLE_UNITS degrees\nVARS theta_i,phi_i,theta_s,phi_s,{','.join(f'{w}nm' for w in nm)}"]
    spectra: dict = {}
    for i, o, w, f in table:
        spectra.setdefault((i, o, sum(1 for r in spectra.get((i, o, 0), []) if r[0] == w)), []).append((w, f))
    for (i, o, _), values in spectra.items():
        given = dict(values)
        fields = [abs(i), 0, abs(o), 0 if o >= 0 else 180, *(given.get(w, "nan") for w in nm)]
        lines.append(",".join(map(str, fields)))
    return written(folder / "a.astm", "\n".join(lines) + "\n")


def nist(folder, table):
    lines = ["lambda,thetai,phii,thetar,phir,fr11"]
    lines += [f"{w / 1000},{-i},0,{abs(o)},{0 if o < 0 else 180},{f}" for i, o, w, f in table]
    return written(folder / "a.csv", "\n".join(lines) + "\n")


def written(path, text):
    path.write_text(text)
    return path


WRITERS = [csv, gonio_json, astm, nist]
every_table = pytest.mark.parametrize("write", WRITERS, ids=lambda w: w.__name__)


@every_table
def test_the_same_data_from_every_table(tmp_path, write):
    """Four formats, one dataset: NIST's has the light on the other side, so its plane of incidence lies at 180°."""
    data = formats.read(write(tmp_path, rows()))
    assert data.theta_i.values.tolist() == [0, 40]
    assert data.theta_o.values.tolist() == THETA_O.tolist()
    assert data.wavelength.values.tolist() == list(NM)
    assert (data.brdf == 0.3).all()
    assert data.attrs["pairs_measured"] == 2 * THETA_O.size


@every_table
def test_missing_angles_and_the_retro_direction(tmp_path, write):
    table = [r for r in rows(theta_i=(0, 40)) if r[:2] not in ((40, 40), (0, 0), (40, -20))]
    data = formats.read(write(tmp_path, table))
    assert np.isnan(data.brdf.sel(theta_i=40, theta_o=[40, -20])).all()
    assert np.isnan(data.brdf.sel(theta_i=0, theta_o=0)).all()
    assert int(np.isfinite(data.brdf).sum()) == len(table)
    assert data.attrs["pairs_missing"] == 1
    assert data.attrs["pairs_missing_retro"] == 2


@every_table
def test_unsorted(tmp_path, write):
    table = rows()
    for k, row in enumerate(table):
        table[k] = (*row[:3], 0.1 + 0.001 * k)
    shuffled = [table[k] for k in np.random.default_rng(0).permutation(len(table))]
    a, b = (formats.read(write(tmp_path, t)) for t in (table, shuffled))
    np.testing.assert_array_equal(a.brdf, b.brdf)
    assert np.all(np.diff(b.theta_o) > 0)


@pytest.mark.parametrize("write", [csv, gonio_json, nist], ids=lambda w: w.__name__)
def test_duplicates(tmp_path, write):
    table = [*rows(), *((40, -40, w, 0.5) for w in NM)]
    path = write(tmp_path, table)
    with pytest.raises(FileFormatError, match="appears twice.*duplicates=mean"):
        formats.read(path)
    for how, expected in (("mean", 0.4), ("first", 0.3)):
        found = formats.read(path, duplicates=how).brdf.sel(theta_i=40, theta_o=-40)
        np.testing.assert_allclose(found, expected, rtol=1e-12)
    with pytest.raises(InputError, match="did you mean 'mean'"):
        formats.read(path, duplicates="means")


def test_the_error_of_merged_duplicates(tmp_path):
    """Two independent readings of error σ have a mean of error σ/√2."""
    text = "theta_i_deg,theta_o_deg,wavelength_nm,brdf_per_sr,brdf_stderr_per_sr\n"
    text += "30,0,550,0.3,0.02\n30,0,550,0.2,0.02\n30,10,550,0.2,0.01\n"
    data = formats.read(written(tmp_path / "a.csv", text), duplicates="mean")
    assert data.brdf.values.ravel() == pytest.approx([0.25, 0.2])
    assert data.brdf_stderr.values.ravel() == pytest.approx([0.02 / np.sqrt(2), 0.01])


@every_table
def test_negative_values(tmp_path, write):
    table = [(i, o, w, -0.01 if (i, o) == (40, 80) else f) for i, o, w, f in rows()]
    path = write(tmp_path, table)
    with pytest.warns(VgonioWarning, match="3 of 102 values are negative, the least -0.01"):
        data = formats.read(path)
    assert np.isnan(data.brdf.sel(theta_i=40, theta_o=80)).all()
    assert data.attrs["repairs"] == "3 negative values taken as missing"
    assert (formats.read(path, negative="zero").brdf.sel(theta_i=40, theta_o=80) == 0).all()
    assert (formats.read(path, negative="keep").brdf.sel(theta_i=40, theta_o=80) == -0.01).all()
    with pytest.raises(FileFormatError, match="3 of 102 values are negative"):
        formats.read(path, negative="error")


@pytest.mark.parametrize("write", [csv, gonio_json, astm], ids=lambda w: w.__name__)
def test_missing_and_infinite_values(tmp_path, write):
    table = [(i, o, w, "nan" if (i, o, w) == (40, 80, 550) else f) for i, o, w, f in rows()]
    if write is gonio_json:
        table = [(*r[:3], None if r[3] == "nan" else r[3]) for r in table]
    data = formats.read(write(tmp_path, table))
    assert int(np.isnan(data.brdf).sum()) == 1
    with pytest.raises(FileFormatError, match="no finite"):
        formats.read(write(tmp_path, [(*r[:3], None if write is gonio_json else "nan") for r in rows()]))
    if write is not gonio_json:
        with pytest.raises(FileFormatError, match="infinite"):
            formats.read(write(tmp_path, [*rows()[:-1], (40, 80, 650, "inf")]))


@every_table
def test_one_wavelength(tmp_path, write):
    """Read as it is; a shift of the spectrum, and a colour, cannot come of it and say so."""
    data = formats.read(write(tmp_path, rows(nm=(550,))))
    assert data.wavelength.values.tolist() == [550]
    with pytest.raises(InputError, match="wavelength"):
        compare.fit_local_shift(data, material=None)
    with pytest.raises(InputError):
        compare.xyz(data)


@every_table
def test_wavelengths_outside_the_eye(tmp_path, write):
    """Near infrared is a measurement like any other; its colour is refused."""
    data = formats.read(write(tmp_path, rows(nm=(1000, 1064, 1550))))
    assert data.wavelength.values.tolist() == [1000, 1064, 1550]
    with pytest.raises(InputError, match="1000"):
        compare.xyz(data)


@pytest.mark.parametrize("write", [csv, gonio_json, astm], ids=lambda w: w.__name__)
def test_micrometres_for_nanometres(tmp_path, write):
    path = write(tmp_path, rows(nm=(0.45, 0.55, 0.65)))
    with pytest.raises(FileFormatError, match="0.45 nm.*wavelength_unit=um"):
        formats.read(path)
    data = formats.read(path, wavelength_unit="um")
    assert data.wavelength.values.tolist() == [450, 550, 650]
    assert data.attrs["repairs"] == "wavelengths converted from um"
    with pytest.raises(FileFormatError, match="e\\+06 nm"):
        formats.read(write(tmp_path, rows(nm=(4.5e6,))))


@every_table
@pytest.mark.parametrize("theta_i", [(0,), (10, 40), (60,)])
def test_percent_for_a_fraction(tmp_path, write, theta_i):
    """A white standard in percent (π f = 99 %), and as a reflectance factor: more light than falls in is refused."""
    path = write(tmp_path, rows(theta_i=theta_i, value=99.0))
    with pytest.raises(FileFormatError, match="times the light that falls in.*unit=percent"):
        formats.read(path)
    assert float(formats.read(path, unit="percent").brdf.max()) == pytest.approx(0.99)
    factor = formats.read(path, unit="reflectance-factor-percent")
    assert float(factor.brdf.max()) == pytest.approx(0.99 / np.pi)
    assert "converted from reflectance-factor-percent" in factor.attrs["repairs"]
    assert float(formats.read(path, unit="sr-1").brdf.max()) == 99.0
    with pytest.raises(InputError, match="did you mean 'percent'"):
        formats.read(path, unit="percents")


def test_the_bound_of_the_reflectance(facets):
    """Never above the truth by more than a coarse grid can be; a mirror's narrow peak does not count as percent."""
    for theta_i in (0, 30, 60):
        lambert = sampled(facets(1.0), [theta_i], THETA_O)
        lambert["brdf"] = lambert.brdf * 0 + 1 / np.pi
        assert 0.75 < reflectance_bound(lambert) < 1.4
        cells = sampled(facets(1.0), [theta_i], resolution_deg=5)
        cells["brdf"] = cells.brdf * 0 + 1 / np.pi
        assert reflectance_bound(cells) == pytest.approx(1, rel=0.01)
    mirror = lambert * 0
    mirror["brdf"] = mirror.brdf + xr.where(mirror.theta_o == -60, 1000.0, 0.0)
    assert reflectance_bound(mirror) == 0.0


def test_signed_polar_angles_and_the_horizon(tmp_path):
    """−30° at φ is 30° at φ + 180°; rows at 90° and below the horizon (transmitted light) are left out and counted."""
    text = "ANGLE_UNITS degrees\nVARS theta_i,phi_i,theta_s,phi_s,550nm\n"
    rows = [(30, 0, -30, 0, 0.3), (30, 0, 10, 0, 0.2), (30, 0, 90, 0, 0.1), (30, 0, 150, 180, 0.1)]
    text += "".join(",".join(map(str, r)) + "\n" for r in rows)
    data = formats.read(written(tmp_path / "a.astm", text))
    assert data.theta_o.values.tolist() == [-30, 10]
    assert data.brdf.values.ravel().tolist() == [0.3, 0.2]
    assert data.attrs["repairs"] == "2 rows at the horizon or below left out"
    with pytest.raises(FileFormatError, match="90° is not allowed"):
        formats.read(written(tmp_path / "b.astm", "\n".join(text.splitlines()[:2] + ["30,0,90,0,0.1"]) + "\n"))
    with pytest.raises(FileFormatError, match="polar angle 95° is not allowed"):
        formats.read(written(tmp_path / "c.astm", text + "95,0,10,0,0.3\n"))


def test_normal_incidence_alone_keeps_its_sides(tmp_path):
    """Light along the normal has no azimuth: +θ_o stays at φ = 0."""
    data = formats.read(csv(tmp_path, [(0, -80, 550, 0.1), (0, 20, 550, 0.2)]))
    assert data.theta_o.values.tolist() == [-80, 20]
    assert float(data.phi_i) == 0


def test_a_text_of_no_known_content_goes_to_the_text_format(tmp_path):
    with pytest.raises(FileFormatError, match="no Zemax BSDF"):
        formats.read(written(tmp_path / "a.bsdf", "hello\n"))
    (tmp_path / "b.bsdf").write_bytes(b"hello\0\1")
    with pytest.raises(FileFormatError, match="no tensor file"):
        formats.read(tmp_path / "b.bsdf")


def test_options_of_other_formats(tmp_path):
    with pytest.raises(InputError, match="reading csv knows no option 'wavelength_nm'"):
        formats.read(csv(tmp_path, rows()), wavelength_nm=550)
    with pytest.raises(InputError, match="negative = 'drop'"):
        formats.read(csv(tmp_path, rows()), negative="drop")


def test_azimuths_of_several_planes_of_incidence(tmp_path):
    text = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,wavelength_nm,brdf_per_sr\n"
    text += "30,0,20,90,550,0.3\n30,45,20,90,550,0.3\n"
    with pytest.raises(FileFormatError, match="light from 2 azimuths"):
        formats.read(written(tmp_path / "a.csv", text))


# ---- damaged files
def samples(folder, facets):
    """One small file of each format, by name."""
    brdf = facets(0.4, 0.2)
    cells, plane = sampled(brdf, [0, 40], resolution_deg=30), sampled(brdf, [0, 40], THETA_O)
    return {
        "nist-csv": nist(folder, rows()).rename(folder / "nist.csv"),
        "csv": formats.write(plane, folder / "a.csv"),
        "gonio-json": formats.write(plane, folder / "a.json", digits=4),
        "astm": formats.write(cells, folder / "a.astm", digits=4),
        "zemax": formats.write(
            cells, folder / "z.bsdf", format="zemax", wavelength_nm=550, radial_deg=[0, 20, 90], azimuth_deg=[0, 180]
        ),
        "rgl": formats.write(cells, folder / "r.bsdf", resolution=4, theta_i_deg=[0, 60]),
        "netcdf": formats.write(plane, folder / "a.nc"),
    }


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """The content cut, with bytes changed, with a part repeated, or replaced by noise."""
    data = bytearray(content)
    kind = rng.integers(4)
    if kind == 0:
        return bytes(data[: rng.integers(1, len(data))])
    if kind == 1:
        for k in rng.integers(0, min(len(data), 400), rng.integers(1, 12)):
            data[k] = rng.integers(256)
        return bytes(data)
    if kind == 2:
        a, b = sorted(rng.integers(0, len(data), 2))
        return bytes(data[:b] + data[a:])
    return bytes(data[:40]) + rng.integers(0, 256, 200, dtype=np.uint8).tobytes()


@pytest.mark.parametrize("name", ["csv", "gonio-json", "astm", "zemax", "rgl", "netcdf", "nist-csv"])
def test_damaged_files_are_refused_or_read(tmp_path, facets, name):
    """A hundred damages: an error of ours in one line, or a dataset; nothing else, and no memory beyond the file's."""
    content = samples(tmp_path, facets)[name].read_bytes()
    rng = np.random.default_rng(7)
    path = tmp_path / "damaged"
    refused = 0
    tracemalloc.start()
    for _ in range(100 if name != "netcdf" else 12):
        path.write_bytes(damaged(content, rng))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                data = formats.read(path, format=name)
                assert {"theta_i", "wavelength"} <= set(data.brdf.dims)
            except VgonioError as e:
                refused += 1
                assert "\n" not in str(e)
                assert len(str(e)) < 1000
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert refused > 5
    assert peak < 200e6


def test_huge_announcements_allocate_nothing(tmp_path):
    head = tensor_file.MAGIC + struct.pack("<BBI", 1, 0, 1)
    field = struct.pack("<H", 4) + b"vndf"
    cases = {
        "fields.bsdf": tensor_file.MAGIC + struct.pack("<BBI", 1, 0, 2**32 - 1),
        "dims.bsdf": head + field + struct.pack("<HBQ", 65535, 10, 0),
        "size.bsdf": head + field + struct.pack("<HBQ2Q", 2, 10, 60, 2**40, 2**40),
        "overflow.bsdf": head + field + struct.pack("<HBQ2Q", 2, 10, 60, 2**63, 2),
        "offset.bsdf": head + field + struct.pack("<HBQ1Q", 1, 10, 2**64 - 8, 4),
        "huge.binary": struct.pack("<3i", 90, 90, 180) + b"\0" * 100,
        "other.binary": struct.pack("<3i", 2**30, 2**30, 2**30) + b"\0" * 100,
        "zemax.bsdf": b"SpectralContent Monochrome\nScatterType BRDF\nAngleOfIncidence 999999999\n0 10\n",
        "astm.astm": b"NUM_POINTS 99999999999\nVARS theta_i,phi_i,theta_s,phi_s,550nm\n0,0,0,0,1\n",
    }
    tracemalloc.start()
    for name, content in cases.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(FileFormatError):
            formats.read(tmp_path / name)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20e6


def test_scattered_angles_do_not_fill_memory(tmp_path):
    """15,000 rows, each with angles of its own, would be a grid of 2·10⁸ values."""
    rng = np.random.default_rng(0)
    angles = np.round(rng.uniform(0, 89, (15_000, 2)), 5)
    text = "theta_i_deg,theta_o_deg,wavelength_nm,brdf_per_sr\n" + "".join(f"{i},{o},550,0.3\n" for i, o in angles)
    tracemalloc.start()
    with pytest.raises(FileFormatError, match="grid of"):
        formats.read(written(tmp_path / "a.csv", text))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 200e6


@pytest.mark.parametrize("noise", range(6))
def test_noise_of_any_name_is_an_error(tmp_path, noise):
    rng = np.random.default_rng(noise)
    for suffix in (".json", ".csv", ".binary", ".bsdf", ".astm", ".nc", ".tsv", ""):
        path = tmp_path / f"a{suffix}"
        path.write_bytes(rng.integers(0, 256, rng.integers(1, 3000), dtype=np.uint8).tobytes())
        with pytest.raises(FileFormatError):
            formats.read(path)
