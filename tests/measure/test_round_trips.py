"""What is written is read back: plain CSV, ASTM, MERL, Zemax and RGL, in plane and over the hemisphere."""

from __future__ import annotations

import struct

import numpy as np
import pytest
import xarray as xr

from vgonio import models
from vgonio.dataset import label
from vgonio.directions import unit_vectors
from vgonio.errors import FileFormatError, InputError
from vgonio.measure import formats
from vgonio.measure.isotropic import isotropic, sampled
from vgonio.measure.readers import merl, rgl, zemax
from vgonio.measure.readers.out_of_plane import solid_angles


@pytest.fixture
def in_plane() -> xr.Dataset:
    """Model values with errors, the retro pairs, one more pair and one wavelength of a pair missing."""
    data = models.evaluate("clausen-2022", [0, 30, 60], np.arange(-60, 61, 15), [450, 550, 650], alpha=0.3, h=1e-3, w=3)
    data["brdf"] = data.brdf.where(data.theta_i != data.theta_o)
    data.brdf[1, 0, :] = np.nan
    data.brdf[2, 1, 1] = np.nan
    data["brdf_stderr"] = 0.02 * data.brdf
    return label(data)


# ---- plain CSV
@pytest.mark.parametrize("plane", [0.0, 40.0])
def test_csv_in_plane(tmp_path, in_plane, plane):
    data = in_plane.assign_coords(phi_i=plane)
    back = formats.read(formats.write(data, tmp_path / "a.csv", digits=17))
    for name in ("theta_i", "theta_o", "wavelength", "brdf", "brdf_stderr"):
        np.testing.assert_array_equal(back[name], data[name])
    assert float(back.phi_i) == plane
    assert back.attrs["pairs_missing"] == 1
    assert back.attrs["pairs_missing_retro"] == 3


@pytest.mark.parametrize("name", ["a.csv", "a.astm"])
def test_hemisphere_in_tables(tmp_path, name, facets):
    """Every cell comes back with its value; solid angles are those of nearest neighbours, 2π together."""
    data = sampled(facets(0.4, 0.2), [0, 40], resolution_deg=15)
    back = formats.read(formats.write(data, tmp_path / name, digits=17))
    assert back.brdf.dims == ("theta_i", "cell", "wavelength")
    order = np.lexsort((np.round(data.phi_o, 6), np.round(data.theta_o, 6)))
    np.testing.assert_allclose(back.theta_o, data.theta_o[order], atol=1e-6)
    np.testing.assert_allclose(back.brdf, data.brdf.values[:, order], rtol=1e-12)
    assert float(back.solid_angle.sum()) == pytest.approx(2 * np.pi, rel=1e-9)
    # cells of the instrument are bounded by circles, those of neighbours by straight sides: alike but not equal
    inner = data.theta_o.values[order] < 70
    np.testing.assert_allclose(back.solid_angle[inner], data.solid_angle[order][inner], rtol=0.35)


def test_csv_units_are_stated_or_recognised(tmp_path):
    def rows(header, line, separator=","):
        path = tmp_path / "a.csv"
        path.write_text("# a comment\n" + separator.join(header) + "\n" + separator.join(map(str, line)) + "\n")
        return formats.read(path)

    plain = ("theta_i_deg", "theta_o_deg", "wavelength_nm", "brdf_per_sr")
    value = 0.25
    variants = [
        (plain, (30, -45, 550, value), ","),
        (("theta_i_rad", "theta_o_rad", "wavelength_um", "brdf_per_sr"), (np.pi / 6, -np.pi / 4, 0.55, value), ";"),
        (("Theta_i [rad]", "theta_r [rad]", "lambda [um]", "BRDF (1/sr)"), (np.pi / 6, -np.pi / 4, 0.55, value), "\t"),
        (("theta_i", "theta_o", "wavelength", "brdf"), (30, -45, 0.55, value), ","),
        (("theta_i", "theta_o", "wavelength", "brdf"), (np.pi / 6, -np.pi / 4, 550, value), ","),
        (("theta_i_deg", "theta_o_deg", "wavelength_nm", "brdf_percent"), (30, -45, 550, 25), ","),
        (("theta_i_deg", "theta_o_deg", "wavelength_nm", "brdf_reflectance_factor"), (30, -45, 550, 0.25 * np.pi), ","),
    ]
    for header, line, separator in variants:
        data = rows(header, line, separator)
        found = [data[k].item() for k in ("theta_i", "theta_o", "wavelength")] + [data.brdf.item()]
        assert found == pytest.approx([30, -45, 550, value], rel=1e-6)
        assert ("units_assumed" in data.attrs) is (header[0] == "theta_i")
    with pytest.raises(FileFormatError, match="unit 'mm'.*nm, um"):
        rows((*plain[:2], "wavelength [mm]", plain[3]), (30, -45, 550, 1))
    with pytest.raises(FileFormatError, match="two columns hold theta_i"):
        rows((*plain, "thetai"), (30, -45, 550, 1, 30))
    with pytest.raises(FileFormatError, match="line 3: 3 values for 4 columns"):
        rows(plain, (30, -45, 550))
    with pytest.raises(FileFormatError, match="line 3.*'x'"):
        rows(plain, (30, -45, 550, "x"))


def test_solid_angles_are_what_lies_nearer_than_to_any_other(rng):
    """Of scattered directions, against counting 40,000 directions of a spiral over the hemisphere."""
    theta, phi = np.degrees(np.arccos(rng.random(9))), 360 * rng.random(9)
    up, n = unit_vectors(np.radians(theta), np.radians(phi)), 40_000
    z, turn = (np.arange(n) + 0.5) / n, np.arange(n) * np.pi * (3 - np.sqrt(5))
    spiral = np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=1)
    expected = np.bincount(np.argmax(spiral @ up.T, axis=1), minlength=9) * 2 * np.pi / n
    np.testing.assert_allclose(solid_angles(theta, phi), expected, atol=2e-3)


def test_errors_are_in_the_unit_of_their_column(tmp_path):
    """A column of errors says its unit, or has that of the BRDF."""
    path = tmp_path / "a.csv"
    for head, values in (
        ("brdf_percent,brdf_stderr_percent", "25,1"),
        ("brdf_percent,brdf_stderr", "25,1"),
        ("brdf_percent,brdf_stderr_per_sr", "25,0.01"),
        ("brdf_per_sr,brdf_stderr_percent", "0.25,1"),
        ("brdf_reflectance_factor,brdf_stderr", f"{0.25 * np.pi},{0.01 * np.pi}"),
    ):
        path.write_text(f"theta_i_deg,theta_o_deg,wavelength_nm,{head}\n30,-45,550,{values}\n")
        data = formats.read(path)
        assert data.brdf.item() == pytest.approx(0.25, rel=1e-12), head
        assert data.brdf_stderr.item() == pytest.approx(0.01, rel=1e-12), head


# ---- ASTM
def test_astm_in_plane(tmp_path, in_plane):
    """Radians of ten decimals; a pair with a gap cannot be written."""
    back = formats.read(formats.write(in_plane, tmp_path / "a.astm", digits=17))
    expected = in_plane.brdf.where(np.isfinite(in_plane.brdf).all("wavelength"))
    np.testing.assert_allclose(back.theta_o, in_plane.theta_o, atol=1e-6)
    np.testing.assert_array_equal(back.brdf, expected)
    assert back.attrs["units_assumed"] == "angles in radians"


def test_astm_as_others_write_it(tmp_path):
    """Degrees, channels, a single column with its wavelength in the header, mirror direction φ_s = φ_i + 180°."""
    path = tmp_path / "a.astm"
    path.write_text("ANGLE_UNITS degrees\nWAVELENGTH 0.633 um\nVARS theta_i,phi_i,theta_s,phi_s,BSDF\n1,0,1,180,0.5\n")
    data = formats.read(path)
    assert (data.theta_i.item(), data.theta_o.item(), data.wavelength.item(), data.brdf.item()) == (1, -1, 633, 0.5)
    path.write_text("NUM_POINTS 1\nVARS theta_i,phi_i,theta_r,phi_r,R,G,B\n0.5,0,0.5,3.14159265359,0.3,0.2,0.1\n")
    data = formats.read(path)
    assert data.theta_o.item() == pytest.approx(-np.degrees(0.5), abs=1e-6)
    assert data.brdf.values.ravel().tolist() == [0.1, 0.2, 0.3]  # sorted by wavelength: blue first
    assert "nominal" in data.attrs["channels"]
    path.write_text("ANGLE_UNITS degrees\nVARS theta_i,phi_i,theta_s,phi_s,0.55um,BSDF_633nm,0.7 µm\n1,0,1,180,3,2,1\n")
    data = formats.read(path, unit="sr-1")
    assert data.wavelength.values.tolist() == [550, 633, 700]
    assert data.brdf.values.ravel().tolist() == [3, 2, 1]
    path.write_text("VARS theta_i,phi_i,theta_r,phi_r,BSDF\n0.5,0,0.5,3.14159265359,0.3\n")
    with pytest.raises(FileFormatError, match="give wavelength_nm"):
        formats.read(path)
    assert formats.read(path, wavelength_nm=532).wavelength.item() == 532
    path.write_text("NUM_POINTS 2\nVARS theta_i,phi_i,theta_r,phi_r,550nm\n0.5,0,0.5,3.14159265359,0.3\n")
    with pytest.raises(FileFormatError, match="announces 2 points and holds 1"):
        formats.read(path)


# ---- MERL
def test_merl(tmp_path, facets):
    """Bins hold the BRDF at their middles to float64; between them the error is that of linear interpolation."""
    brdf = facets(0.4, 0.3, np.array([464.0, 549.0, 611.0]))
    path = formats.write(sampled(brdf), tmp_path / "a.binary", fill=brdf)
    assert path.stat().st_size == 12 + 8 * 3 * 90 * 90 * 180
    assert struct.unpack("<3i", path.read_bytes()[:12]) == (90, 90, 180)
    loaded, note = merl.load(path)
    from vgonio.measure.writers.merl import directions

    rng = np.random.default_rng(1)
    axes = merl.middles()
    place = [axes[k][rng.integers(0, limit, 500)] for k, limit in enumerate((40, 60, 180))]
    wi, wo = directions(*place)
    above = np.minimum(wi[:, 2], wo[:, 2]) > 0.05
    np.testing.assert_allclose(loaded(wi[above], wo[above])[:, ::-1], brdf(wi[above], wo[above]), rtol=1e-9)
    back = formats.read(path, theta_i_deg=[0, 30, 60], theta_o_deg=np.arange(-75, 76, 5))
    # bins of θ_d are 1° wide, the curvature of the BRDF is at most (1/0.1 rad)²: h²/8 · 100 = 0.4 %
    np.testing.assert_allclose(back.brdf, sampled(brdf, [0, 30, 60], np.arange(-75, 76, 5)).brdf, rtol=4e-3)
    assert back.wavelength.values.tolist() == [464, 549, 611]
    assert "nominal" in note


def test_merl_layout_against_its_definition(tmp_path, pairs):
    """A table whose value is its own bin: the bin that a direction pair falls into is found."""
    table = np.full((3, 90, 90, 180), -1.0)
    h, d, p = 30, 45, 90  # θ_h = 10 … 10.7°, θ_d = 45 … 46°, φ_d = 90 … 91°
    table[:, h : h + 2, d, p] = 1500.0
    path = tmp_path / "a.binary"
    path.write_bytes(struct.pack("<3i", 90, 90, 180) + table.tobytes())
    brdf, _ = merl.load(path)
    axes = merl.middles()
    assert np.degrees(axes[0][h]) == pytest.approx(90 * (30**2 + 31**2) / 2 / 90**2)
    from vgonio.measure.writers.merl import directions

    wi, wo = directions(*(np.array([axes[k][b]]) for k, b in enumerate((h, d, p))))
    np.testing.assert_allclose(brdf(wi, wo), [[1.0, 1.15, 1.66]], rtol=1e-12)
    np.testing.assert_allclose(brdf(wo, wi), [[1.0, 1.15, 1.66]], rtol=1e-12)  # reciprocal by construction
    assert np.isnan(brdf(*pairs(50, 0))).all()  # −1 is invalid


# ---- Zemax
def test_zemax(tmp_path, facets):
    """At the table's own directions, about the mirror direction, values come back to the six digits of the file."""
    brdf = facets(0.3, 0.1)
    path = formats.write(sampled(brdf, [0, 20, 45]), tmp_path / "a.bsdf", format="zemax", fill=brdf, wavelength_nm=550)
    loaded, theta_i, attrs = zemax.load(path)
    assert theta_i.tolist() == [0, 20, 45]
    assert loaded.wavelength.tolist() == [550]
    for theta in (0.0, 20.0, 45.0):
        radial, azimuth = (np.radians(a).ravel() for a in np.meshgrid([0, 1, 5, 20, 40], [0, 30, 90, 180]))
        wo = zemax.from_mirror(np.radians(theta), azimuth, radial)
        wi = np.tile(zemax.from_mirror(-np.radians(theta), np.zeros(1), np.zeros(1)), (len(wo), 1))
        above = wo[:, 2] > 0.01
        np.testing.assert_allclose(loaded(wi[above], wo[above])[:, 0], brdf(wi[above], wo[above])[:, 1], rtol=2e-6)
    # the file's own total: a hemisphere of cells, 1 %
    cells = sampled(brdf, [0, 20, 45], resolution_deg=2)
    total = (cells.brdf.sel(wavelength=550) * np.cos(np.radians(cells.theta_o)) * cells.solid_angle).sum("cell")
    np.testing.assert_allclose([float(t) for t in attrs["tis"].split(",")], total, rtol=0.015)
    back = formats.read(path)
    assert back.theta_i.values.tolist() == [0, 20, 45]
    # in plane, at the specular direction and 25° off to both sides
    assert back.brdf.sel(theta_i=20, theta_o=-20).item() == pytest.approx(
        sampled(brdf, [20], [-20]).brdf.sel(wavelength=550).item(), rel=1e-5
    )


def test_zemax_over_the_whole_circle(tmp_path):
    """Asymmetrical files with 0 … 360° or without the last: the circle closes either way."""
    found = []
    for azimuth, block in (
        ("0 90 180 270", "3 2 1\n3 4 0\n3 1 0\n3 2 0"),
        ("0 90 180 270 360", "3 2 1\n3 4 0\n3 1 0\n3 2 0\n3 2 1"),
    ):
        text = ZEMAX.format(symmetry="Asymmetrical", kind="BRDF", n=len(azimuth.split()), azimuth=azimuth, block=block)
        (tmp_path / "a.bsdf").write_text(text)
        found.append(
            formats.read(tmp_path / "a.bsdf", wavelength_nm=633, theta_i_deg=[30], resolution_deg=15, unit="sr-1")
        )
    assert np.isfinite(found[0].brdf).any()
    np.testing.assert_allclose(found[0].brdf, found[1].brdf, rtol=1e-9)


ZEMAX = """# Data of a test
Source  Measured
Symmetry  {symmetry}
SpectralContent  Monochrome
ScatterType  {kind}
SampleRotation  1
0
AngleOfIncidence  2
0 30
ScatterAzimuth  {n}
{azimuth}
ScatterRadial  3
0 30 90

Monochrome
DataBegin
TIS 0.5
{block}
TIS 0.4
{block}
DataEnd
"""


def test_zemax_as_others_write_it(tmp_path):
    """Azimuth 0 points from the mirror direction to the normal; a file without wavelength has to be told."""
    path = tmp_path / "a.bsdf"
    given = {"symmetry": "PlaneSymmetrical", "kind": "BRDF", "n": 2, "azimuth": "0 180", "block": "3 2 1\n3 1 0"}
    path.write_text(ZEMAX.format(**given))
    with pytest.raises(FileFormatError, match="wavelength_nm"):
        formats.read(path)
    data = formats.read(path, wavelength_nm=633, theta_i_deg=[30], theta_o_deg=[-60, -30, 0, 30], unit="sr-1")
    # −30° is the mirror direction; 0° and 30° lie towards the normal and beyond, −60° away from it
    assert data.brdf.values.ravel() == pytest.approx([1.0, 3.0, 2.0, 1.5])
    path.write_text(ZEMAX.format(**given | {"symmetry": "ASymmetrical", "azimuth": "0 270", "block": "3 2 1\n3 1 0"}))
    data = formats.read(path, wavelength_nm=633, theta_i_deg=[30], resolution_deg=20, unit="sr-1")
    assert np.isfinite(data.brdf).any()
    path.write_text(ZEMAX.format(**given | {"kind": "BTDF"}))
    with pytest.raises(FileFormatError, match="transmitted"):
        formats.read(path, wavelength_nm=633)
    path.write_text(ZEMAX.format(**given | {"block": "3 2 1"}))
    with pytest.raises(FileFormatError, match="truncated"):
        formats.read(path, wavelength_nm=633)


# ---- RGL
@pytest.mark.parametrize("alpha, diffuse, tolerance", [(0.4, 0.3, 0.005), (0.15, 0.05, 0.05)])
def test_rgl(tmp_path, alpha, diffuse, tolerance, facets, pairs, agreement):
    """A known BRDF through the file: median error below 0.3 %, 95 % of the directions within the tolerance.

    Linear interpolation in θ_i every 5° and in 64 × 64 samples; the tails of the narrow lobe are the worst.
    """
    brdf = facets(alpha, diffuse)
    path = formats.write(sampled(brdf), tmp_path / "a.bsdf", fill=brdf)
    loaded, attrs = rgl.load(path)
    wi, wo = pairs(4000, 2)
    error = np.abs(loaded(wi, wo) / brdf(wi, wo) - 1)
    agreement("a known BRDF written as RGL, all directions to 80°, median", "closed form", np.median(error), 3e-3)
    agreement(
        "a known BRDF written as RGL, 95 % of the directions, α = 0.4 and 0.15",
        "closed form",
        np.quantile(error, 0.95),
        tolerance,
    )
    assert "closed form" in attrs["description"]
    data = formats.read(path, theta_i_deg=[0, 30], theta_o_deg=[-60, -30, 10])
    np.testing.assert_allclose(data.brdf, sampled(brdf, [0, 30], [-60, -30, 10]).brdf, rtol=0.01)
    assert data.wavelength.values.tolist() == [450, 550, 650]


def mitsuba_brdf(mi, path, wi, wo, wavelength):
    bsdf = mi.load_dict({"type": "measured", "filename": str(path)})
    found = []
    for a, b in zip(wi, wo):
        si = mi.SurfaceInteraction3f()
        si.wi, si.wavelengths = mi.Vector3f(*a), [wavelength] * 4
        found.append(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(*b))[0] / b[2])
    return np.array(found)


def test_mitsuba_renders_what_is_written(tmp_path, mitsuba, facets, pairs, agreement):
    """Mitsuba's own evaluation of the file against ours, in its single precision, and against the BRDF written."""
    brdf = facets(0.3, 0.2)
    path = formats.write(sampled(brdf), tmp_path / "a.bsdf", fill=brdf)
    wi, wo = pairs(300, 3)
    theirs = mitsuba_brdf(mitsuba, path, wi, wo, 550.0)
    error = rgl.load(path)[0](wi, wo)[:, 1] / theirs - 1
    agreement("RGL `.bsdf`, random tables and written BRDFs", "Mitsuba's `measured`, single precision", error, 1e-4)
    assert np.quantile(np.abs(theirs / brdf(wi, wo)[:, 1] - 1), 0.95) < 0.01
    # its sampling is a probability density of the same table: the mean of the weights is the albedo
    bsdf = mitsuba.load_dict({"type": "measured", "filename": str(path)})
    si = mitsuba.SurfaceInteraction3f()
    si.wi, si.wavelengths = mitsuba.Vector3f(np.sin(0.5), 0, np.cos(0.5)), [550.0] * 4
    rng = np.random.default_rng(0)
    draws = [bsdf.sample(mitsuba.BSDFContext(), si, u[0], mitsuba.Point2f(*u[1:]))[1][0] for u in rng.random((2000, 3))]
    cells = sampled(brdf, [np.degrees(0.5)], resolution_deg=2).sel(wavelength=550)
    albedo = float((cells.brdf * np.cos(np.radians(cells.theta_o)) * cells.solid_angle).sum())
    assert np.mean(draws) == pytest.approx(albedo, abs=5 * np.std(draws) / np.sqrt(2000) + 0.003)


def test_rgb_variants_of_mitsuba(tmp_path, mitsuba, facets, pairs):
    """Three channels in place of the spectrum, as RGB variants need them; read back at their nominal wavelengths."""
    brdf = facets(0.3, 0.2)
    path = formats.write(sampled(brdf), tmp_path / "a.bsdf", fill=brdf, rgb_nm=(611, 549, 464))
    wi, wo = pairs(50, 3)
    loaded, attrs = rgl.load(path)
    assert loaded.wavelength.tolist() == [611, 549, 464]
    assert "nominal" in attrs["channels"]
    mitsuba.set_variant("scalar_rgb")
    try:
        bsdf = mitsuba.load_dict({"type": "measured", "filename": str(path)})
        theirs = []
        for a, b in zip(wi, wo):
            si = mitsuba.SurfaceInteraction3f()
            si.wi = mitsuba.Vector3f(*a)
            theirs.append(np.array(bsdf.eval(mitsuba.BSDFContext(), si, mitsuba.Vector3f(*b))) / b[2])
    finally:
        mitsuba.set_variant("scalar_spectral")
    np.testing.assert_allclose(loaded(wi, wo), theirs, rtol=1e-4)
    with pytest.raises(InputError, match="three wavelengths within 450 … 650"):
        formats.write(sampled(brdf), tmp_path / "b.bsdf", fill=brdf, rgb_nm=(700, 549, 464))


@pytest.mark.parametrize("azimuths", [1, 2, 5])
@pytest.mark.parametrize("jacobian", [0, 1])
def test_rgl_evaluation_is_mitsubas(tmp_path, mitsuba, azimuths, jacobian, pairs, agreement):
    """Random tables, isotropic and anisotropic (a quarter of the circle), against Mitsuba in single precision."""
    from vgonio.measure import tensor_file

    rng = np.random.default_rng(azimuths)
    n, angles, nm = 8, 5, 3

    def table(*shape):
        return rng.uniform(0.2, 1.0, shape).astype(np.float32)

    fields = {
        "description": np.frombuffer(b"random", np.uint8),
        "phi_i": np.linspace(-np.pi, -np.pi / 2, azimuths).astype(np.float32),
        "theta_i": np.linspace(0, 1.5, angles).astype(np.float32),
        "ndf": table(4, 9),
        "sigma": table(4, 9),
        "vndf": table(azimuths, angles, 12, 7),
        "luminance": table(azimuths, angles, n, n),
        "wavelengths": np.array([400, 500, 600], np.float32),
        "spectra": table(azimuths, angles, nm, n, n),
        "jacobian": np.array([jacobian], np.uint8),
    }
    path = tensor_file.write(tmp_path / "a.bsdf", fields)
    brdf, _ = rgl.load(path)
    wi, wo = pairs(200, 4)
    if azimuths < 3:
        # Mitsuba 3.9 leaves unset into how many azimuths it folds isotropic files: here all foldings agree
        wi[:, :2] = -np.abs(wi[:, :2])
    theirs = mitsuba_brdf(mitsuba, path, wi, wo, 500.0)
    # positions in the tables are single precision there: a few 10⁻⁷ of slopes of order 1, more beside edges
    error = brdf(wi, wo)[:, 1] / theirs - 1
    agreement("RGL `.bsdf`, random tables and written BRDFs", "Mitsuba's `measured`, single precision", error, 1e-4)
    assert theirs.std() > 0.1


def test_tensor_files_are_mitsubas(tmp_path, mitsuba):
    from vgonio.measure import tensor_file

    fields = {"a": np.arange(6, dtype=np.float32).reshape(2, 3), "b": np.array([7], np.uint8), "c": np.arange(3.0)}
    mitsuba.tensor_io.write(str(tmp_path / "theirs"), **fields)
    for name, array in tensor_file.read(tmp_path / "theirs").items():
        np.testing.assert_array_equal(array, fields[name])
    back = tensor_file.read(tensor_file.write(tmp_path / "ours", fields))
    assert all(back[k].dtype == v.dtype and np.array_equal(back[k], v) for k, v in fields.items())


def test_measured_ptfe_renders(tmp_path, shared):
    """NIST's PTFE over the hemisphere as RGL: the file reflects as much as the measurement, within 0.5 %."""
    data = formats.read(shared / "data" / "nist_ptfe" / "PTFE.data.csv", hemisphere=True)
    path = formats.write(data, tmp_path / "ptfe.bsdf")
    back = formats.read(path, theta_i_deg=[0, 30, 60], resolution_deg=5)
    total = (back.brdf * np.cos(np.radians(back.theta_o)) * back.solid_angle).sum("cell")
    weight = data.solid_angle * np.cos(np.radians(data.theta_o))
    share = np.isfinite(data.brdf)
    expected = (data.brdf * weight).sum("cell") / (weight * share).sum("cell") * np.pi
    np.testing.assert_allclose(total, expected.sel(theta_i=[0, 30, 60]), rtol=5e-3)
    # and at a measured direction far from the gaps: 30° to 30° forward, 532 nm
    point = formats.read(path, theta_i_deg=[30], theta_o_deg=[-30.0]).brdf.sel(wavelength=532).item()
    plane = formats.read(shared / "data" / "nist_ptfe" / "PTFE.data.csv").brdf.sel(
        theta_i=30, theta_o=-30, wavelength=532
    )
    assert point == pytest.approx(float(plane), rel=0.01)


# ---- in plane to everywhere
def test_in_plane_data_need_a_stated_fill(tmp_path, in_plane):
    for name, options in (("a.bsdf", {}), ("a.binary", {}), ("a.bsdf", {"format": "zemax", "wavelength_nm": 550})):
        with pytest.raises(InputError, match="half-angle.*azimuth"):
            formats.write(in_plane, tmp_path / name, **options)
    with pytest.raises(InputError, match="did you mean 'azimuth'"):
        formats.write(in_plane, tmp_path / "a.bsdf", fill="azimut")
    with pytest.raises(InputError, match="knows no option 'fil': did you mean 'fill'"):
        formats.write(in_plane, tmp_path / "a.bsdf", fil="azimuth")
    assert list(tmp_path.iterdir()) == []
    path = formats.write(in_plane, tmp_path / "a.bsdf", fill="half-angle")
    assert "half-angle" in rgl.load(path)[1]["description"]


@pytest.mark.parametrize(
    "fill, alpha, diffuse, median, most",
    [
        ("half-angle", 0.3, 0.0, 0.015, 0.2),
        ("half-angle", 0.1, 0.0, 0.025, 0.45),
        ("half-angle", 0.5, 0.3, 0.008, 0.08),
        ("azimuth", 1.0, 5.0, 0.01, 0.1),
    ],
)
def test_fills_against_the_whole_brdf(fill, alpha, diffuse, median, most, facets, pairs, agreement):
    """In-plane data every 5° of a BRDF that is known everywhere, filled: median and 95 % of the error out of plane.

    What is left is mostly Fresnel at grazing angles that the plane does not hold; in plane the data come back.
    """
    brdf = facets(alpha, diffuse)
    data = sampled(brdf, np.arange(0, 81, 5), np.arange(-85, 86, 2.5))
    filled = isotropic(data, fill)
    wi, wo = pairs(2000, 5)
    error = np.abs(filled(wi, wo) / brdf(wi, wo) - 1)
    agreement(
        "in-plane data filled to all azimuths, α = 0.1 … 0.5, median",
        "closed form",
        100 * np.median(error),
        100 * median,
        "%",
    )
    agreement(
        "in-plane data filled to all azimuths, α = 0.1 … 0.5, 95 % of the directions",
        "closed form",
        100 * np.quantile(error, 0.95),
        100 * most,
        "%",
    )
    again = sampled(filled, data.theta_i, data.theta_o)
    np.testing.assert_allclose(again.brdf, data.brdf, rtol=2e-3 if fill == "half-angle" else 1e-9)


def test_lambert_stays_lambert(facets, pairs):
    """Constant data are constant everywhere under the azimuth fill and on hemispheres, gaps and horizon included."""
    flat = facets(1.0, 0.0)
    flat = type(flat)(flat.wavelength, lambda wi, wo: np.full((len(wi), 3), 0.3), "")
    plane = sampled(flat, [0, 30, 70], np.arange(-70, 71, 10))
    plane["brdf"] = plane.brdf.where(plane.theta_i != plane.theta_o)
    wi, wo = pairs(500, 6, 89.0)
    np.testing.assert_allclose(isotropic(plane, "azimuth")(wi, wo), 0.3, rtol=1e-12)
    cells = sampled(flat, [0, 30, 70], resolution_deg=15)
    np.testing.assert_allclose(isotropic(cells)(wi, wo), 0.3, rtol=1e-12)


def test_directions_that_are_no_rings(facets, pairs):
    """Scattered directions, as of a random plan: triangles between them; exact at the directions themselves."""
    brdf = facets(0.6, 0.3)
    _, wo = pairs(300, 8, 88.0)
    data = sampled(brdf, [0, 40], resolution_deg=15).isel(cell=np.zeros(300, int)).assign_coords(cell=np.arange(300))
    theta, phi = np.degrees(np.arccos(wo[:, 2])), np.degrees(np.arctan2(wo[:, 1], wo[:, 0]))
    data = data.assign_coords(theta_o=("cell", theta), phi_o=("cell", phi))
    wi = np.tile(unit_vectors(np.radians(40.0)), (300, 1))
    data.brdf[1] = brdf(wi, wo)
    data.brdf[0] = brdf(np.tile([0.0, 0.0, 1.0], (300, 1)), wo)
    found = isotropic(data)
    np.testing.assert_allclose(found(wi, wo), brdf(wi, wo), rtol=1e-9)
    between = pairs(200, 9, 70.0)[1]
    np.testing.assert_allclose(found(wi[:200], between), brdf(wi[:200], between), rtol=0.05)


def test_light_from_the_negative_side_is_turned(facets):
    """A hemisphere at θ_i = −40° is that at 40° turned by 180°: the same isotropic BRDF, to the cells' size (0.5 %)."""
    brdf = facets(0.4, 0.2)
    wo = unit_vectors(*np.radians(np.meshgrid(np.arange(5, 70, 10.0), np.arange(0, 360, 24.0)))).reshape(-1, 3)
    wi = np.tile(unit_vectors(np.radians(40)), (len(wo), 1))
    for theta_i in (40, -40):
        found = isotropic(sampled(brdf, [theta_i], resolution_deg=5))(wi, wo)
        np.testing.assert_allclose(found, brdf(wi, wo), rtol=0.01)


def test_hemispheres_keep_lobes_that_move(facets, pairs):
    """Angles of incidence 10° apart, lobe 11° wide: interpolated at the same half vector, 95 % within 25 %."""
    brdf = facets(0.15)
    data = sampled(brdf, np.arange(0, 81, 10), resolution_deg=3)
    wi, wo = pairs(2000, 7, 75.0)
    error = np.abs(isotropic(data)(wi, wo) / brdf(wi, wo) - 1)
    assert np.median(error) < 0.02
    assert np.quantile(error, 0.95) < 0.1
