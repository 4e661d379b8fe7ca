"""Measured BRDFs on disk: the thesis' JSON, NIST's table, our own NetCDF; round trips and bad data."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio import models
from vgonio.dataset import label
from vgonio.errors import FileFormatError, InputError
from vgonio.measure import formats

HEAD = {"wavelengths": [450.0, 550.0, 650.0]}


def element(theta_i=30, phi_i=0, theta_o=30, phi_o=180, spectrum=(0.1, 0.2, 0.3)):
    return {"thetaIn": theta_i, "phiIn": phi_i, "thetaOut": theta_o, "phiOut": phi_o, "spectrum": list(spectrum)}


def written(tmp_path, content, name="sample.json"):
    path = tmp_path / name
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


@pytest.fixture
def dataset() -> xr.Dataset:
    """Model values with the retro pairs, one more pair and one wavelength of a pair missing."""
    data = models.evaluate("clausen-2022", [0, 30, 60], np.arange(-60, 61, 15), [450, 550, 650], alpha=0.3, h=1e-3, w=3)
    data["brdf"] = data.brdf.where(data.theta_i != data.theta_o)
    data.brdf[1, 0, :] = np.nan
    data.brdf[2, 1, 1] = np.nan
    return data


def test_signed_angles_and_sorting(tmp_path):
    """Mirror direction θ_o = −θ_i, back-scattering side θ_o > 0; order of elements and of wavelengths is free."""
    head = {"wavelengths": [650, 450, 550], "comment": "hello", "instrument": {"name": "g"}}
    content = [
        head,
        element(30, 0, 40, 0, (3, 1, 2)),
        element(0, 0, 20, 180, (6, 4, 5)),
        element(30, 0, 30, 180, (9, 7, 8)),
    ]
    data = formats.read(written(tmp_path, content))
    assert data.theta_i.values.tolist() == [0, 30]
    assert data.theta_o.values.tolist() == [-30, -20, 40]
    assert data.wavelength.values.tolist() == [450, 550, 650]
    assert data.brdf.sel(theta_i=30, theta_o=40).values.tolist() == [1, 2, 3]
    assert data.brdf.sel(theta_i=30, theta_o=-30).values.tolist() == [7, 8, 9]
    assert data.brdf.sel(theta_i=0, theta_o=-20).values.tolist() == [4, 5, 6]
    assert int(np.isnan(data.brdf).sum()) == 9
    assert data.attrs["method"] == "measured"
    assert data.attrs["comment"] == "hello"
    assert json.loads(data.attrs["header"]) == {"instrument": {"name": "g"}}
    assert "brdf_stderr" not in data
    assert all("units" in data[v].attrs and "long_name" in data[v].attrs for v in data.variables)


def test_light_from_the_far_side_is_turned(tmp_path):
    content = [HEAD, element(30, 180, 30, 0, (1, 2, 3)), element(0, 0, 20, 180, (4, 5, 6))]
    data = formats.read(written(tmp_path, content))
    assert float(data.phi_i) == 180
    assert data.brdf.sel(theta_i=30, theta_o=-30).values.tolist() == [1, 2, 3]
    assert data.brdf.sel(theta_i=0, theta_o=20).values.tolist() == [4, 5, 6]


def test_retro_pair_is_absent_and_counted(tmp_path):
    angles = (-30, -10, 10, 30)
    content = [HEAD] + [
        element(abs(i), 0, abs(o), 0 if o > 0 else 180, (1, 1, 1)) for i in (10, 30) for o in angles if i != o
    ]
    data = formats.read(written(tmp_path, content[:5] + content[6:]))
    assert np.isnan(data.brdf.sel(theta_i=10, theta_o=10)).all()
    assert (data.attrs["pairs_measured"], data.attrs["pairs_missing_retro"], data.attrs["pairs_missing"]) == (5, 2, 1)


@pytest.mark.parametrize("plane", [0.0, 180.0])
@pytest.mark.parametrize("with_error", [False, True])
def test_round_trip_is_exact(tmp_path, dataset, plane, with_error):
    dataset = dataset.assign_coords(phi_i=plane)
    if with_error:
        dataset["brdf_stderr"] = 0.02 * dataset.brdf
    dataset = label(dataset)
    path = formats.write(dataset, tmp_path / "a.json", provenance="made by a test")
    back = formats.read(path)
    # the grid comes back whole because every angle has at least one pair
    for name in ("theta_i", "theta_o", "wavelength", "brdf", *(["brdf_stderr"] if with_error else [])):
        np.testing.assert_array_equal(back[name], dataset[name])
    assert float(back.phi_i) == plane
    assert back.attrs["provenance"] == "made by a test"
    assert ("brdf_stderr" in back) is with_error
    assert [p.name for p in tmp_path.iterdir()] == ["a.json"]


def test_rounding(tmp_path, dataset):
    back = formats.read(formats.write(dataset, tmp_path / "a.json", digits=3))
    # half a unit of the third digit is at most 5e-3 of the value
    np.testing.assert_allclose(back.brdf, dataset.brdf, rtol=5e-3)
    assert abs(back.brdf / dataset.brdf - 1).max() > 1e-6


def test_netcdf_round_trip(tmp_path, dataset):
    path = formats.write(dataset, tmp_path / "a.nc")
    xr.testing.assert_equal(formats.read(path), dataset)
    tree = xr.DataTree.from_dict({"rays": dataset, "measured": 2 * dataset})
    from vgonio.measure import storage

    storage.save(tree, tmp_path / "tree.nc")
    np.testing.assert_array_equal(formats.read(tmp_path / "tree.nc").brdf, 2 * dataset.brdf)
    storage.save(xr.DataTree.from_dict({"rays": dataset, "waves": dataset}), tmp_path / "two.nc")
    with pytest.raises(FileFormatError, match="several BRDFs"):
        formats.read(tmp_path / "two.nc")


@pytest.mark.parametrize("name", ["x.txt", "x", "x.json"])
def test_a_result_is_saved_under_the_endings_of_results(tmp_path, dataset, name):
    """As `vgonio simulate -o` has it: a file of another ending is not found again as a result."""
    with pytest.raises(InputError, match=r"has to end in \.nc or \.nc4 or \.h5"):
        vg.save(dataset, tmp_path / name)
    assert not list(tmp_path.iterdir())
    assert vg.save(dataset, tmp_path / "x.NC4").is_file()


@pytest.mark.parametrize("solver", ["kirchhoff", None, vg.wave.Kirchhoff])
def test_what_does_not_scatter_is_no_solver(solver):
    surface = vg.surface.Heightfield(np.zeros((8, 8)), pitch_um=1.0)
    with pytest.raises(InputError, match=r"^solver: .*vg\.wave\.Kirchhoff\("):
        vg.measure.Gonioreflectometer([0], [0]).measure(surface, solver)


def test_a_dataset_saved_by_itself_opens_again(tmp_path, dataset):
    """Its seconds are a number, as the gonioreflectometer leaves them; a scene's are JSON."""
    from vgonio.measure import storage

    tree = storage.open(storage.save(dataset.assign_attrs(seconds=1.5), tmp_path / "one.nc"))
    assert float(tree.attrs["seconds"]) == 1.5
    np.testing.assert_array_equal(tree.to_dataset().brdf, dataset.brdf)


@pytest.mark.parametrize(
    "content, message",
    [
        ("", "empty"),
        ('[{"wavelengths": [450, 550', "truncated"),
        ({"wavelengths": [450]}, "another kind"),
        ([1, 2, 3], "another kind"),
        ([HEAD], "no spectra"),
        ([HEAD, 3], "no object"),
        ([{"wavelengths": "450"}, element()], "list of numbers"),
        ([{"wavelengths": []}, element(spectrum=())], "empty"),
        ([{"wavelengths": [-450, 550, 650]}, element()], "positive"),
        ([{"wavelengths": [450, None, 650]}, element()], "positive"),
        ([{"wavelengths": [450, 450, 650]}, element()], "twice"),
        ([HEAD, element(spectrum=(0.1, 0.2))], "2 values for 3 wavelengths"),
        ([HEAD, element(), element(theta_o=90)], "90° is not allowed"),
        ([HEAD, element(theta_i=-30)], "-30° is not allowed"),
        ([HEAD, element(theta_i="30")], "thetaIn"),
        ([HEAD, element(phi_o=90)], "outside the plane"),
        ([HEAD, element(phi_i=45, phi_o=225)], "outside the plane"),
        ([HEAD, element(), element()], "appears twice"),
        ([HEAD, element(spectrum=(None, None, None))], "no finite"),
        ([HEAD, element(spectrum=(0.1, "x", 0.3))], "list of numbers"),
        ('[{"wavelengths":[450]},' + json.dumps(element(spectrum=[0.5])).replace("0.5", "1e999") + "]", "infinite"),
        ('[{"wavelengths":[450]},' + json.dumps(element(spectrum=[0.5])).replace("0.5", "9" * 400) + "]", "too large"),
        ([HEAD, {k: v for k, v in element().items() if k != "phiOut"}], "phiOut"),
        ([HEAD, {k: v for k, v in element().items() if k != "spectrum"}], "no 'spectrum'"),
        ([HEAD, element() | {"standardError": [0.1, -0.1, 0.1]}], "negative"),
    ],
)
def test_bad_json_is_one_clear_error(tmp_path, content, message):
    with pytest.raises(FileFormatError, match=message) as caught:
        formats.read(written(tmp_path, content))
    assert "\n" not in str(caught.value)
    assert "sample.json" in str(caught.value)


def test_missing_foreign_and_unknown_files(tmp_path):
    with pytest.raises(FileFormatError, match="no such file"):
        formats.read(tmp_path / "absent.json")
    with pytest.raises(FileFormatError, match="is a folder"):
        formats.read(tmp_path)
    with pytest.raises(FileFormatError, match="no known format.*gonio-json"):
        formats.read(written(tmp_path, "hello", "a.xyz"))
    (tmp_path / "binary.json").write_bytes(b"\x93\xff\x00\x01" * 10)
    with pytest.raises(FileFormatError, match="no text in UTF-8"):
        formats.read(tmp_path / "binary.json")
    with pytest.raises(FileFormatError, match="NIST"):
        formats.read(written(tmp_path, "a,b,c\n1,2,3\n", "a.csv"), format="nist-csv")
    with pytest.raises(FileFormatError, match="no column theta_i"):
        formats.read(written(tmp_path, "a,b,c\n1,2,3\n", "a.csv"))
    with pytest.raises(FileFormatError, match="truncated"):
        formats.read(written(tmp_path, "lambda,thetai,phi,thetar,phir,f_r11\n0.5,0\n", "b.csv"))
    (tmp_path / "a.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + b"\0" * 20)
    with pytest.raises(FileFormatError, match="damaged HDF5"):
        formats.read(tmp_path / "a.nc")
    with pytest.raises(InputError, match="did you mean 'gonio-json'"):
        formats.read(written(tmp_path, [HEAD, element()]), format="gonio-jsn")


def test_content_decides_where_the_suffix_is_another(tmp_path):
    path = written(tmp_path, [HEAD, element()], "sample.txt")
    assert formats.read(path).brdf.size == 3


def test_what_cannot_be_written(tmp_path, dataset):
    path = tmp_path / "a.json"
    with pytest.raises(InputError, match="phi_i"):
        formats.write(dataset.assign_coords(phi_i=45.0), path)
    with pytest.raises(InputError, match="suffix"):
        formats.write(dataset, tmp_path / "a.xyz")
    with pytest.raises(InputError, match="nist-csv"):
        formats.write(dataset, path, format="nist-csv")
    with pytest.raises(InputError, match="in-plane"):
        formats.write(dataset.rename(theta_o="cell"), path)
    with pytest.raises(InputError, match="no finite"):
        formats.write(dataset.where(False), path)
    with pytest.raises(FileFormatError, match="brdf"):
        formats.write(dataset.rename(brdf="f"), path)
    with pytest.raises(FileFormatError, match="cannot write"):
        formats.write(dataset, tmp_path / "no" / "a.json")
    assert list(tmp_path.iterdir()) == []


def test_nist_on_the_hemisphere(shared, agreement):
    """All 305 directions; the in-plane ones are those of the in-plane reading, and the total is that of PTFE.

    Sintered PTFE reflects 0.98 to 0.99 in the visible; so does the sum over the cells at all six angles of incidence
    (0.981 … 0.986), although the table ends at 80° and the nearest values are taken beyond.
    """
    path = shared / "data" / "nist_ptfe" / "PTFE.data.csv"
    whole, plane = formats.read(path, hemisphere=True), formats.read(path)
    assert whole.brdf.dims == ("theta_i", "cell", "wavelength")
    assert whole.sizes["cell"] == 305
    assert float(whole.phi_i) == 180
    weight = whole.solid_angle * np.cos(np.radians(whole.theta_o))
    assert float(whole.solid_angle.sum()) == pytest.approx(2 * np.pi, rel=1e-9)
    # the retro direction is absent: its cell counts as the mean of the others
    total = (whole.brdf * weight).sum("cell") / weight.where(np.isfinite(whole.brdf)).sum("cell") * np.pi
    agreement(
        "NIST's PTFE, sum over the hemisphere, 532 and 633 nm, 0 … 75°",
        "reflectance of PTFE, 0.98 … 0.99",
        total.sel(wavelength=[532, 633]),
        (0.975, 0.99),
    )
    mirror = (np.abs(whole.theta_o - 64.1581) < 1e-3) & (np.abs(whole.phi_o) < 1e-3)
    np.testing.assert_array_equal(
        whole.brdf.isel(cell=np.flatnonzero(mirror)).sel(theta_i=75).values[0],
        plane.brdf.sel(theta_i=75).sel(theta_o=-64.1581, method="nearest"),
    )


def test_nist_in_plane_table(shared):
    """108 in-plane geometries per wavelength; PTFE at grazing incidence scatters forward: more on the mirror side."""
    data = formats.read(shared / "data" / "nist_ptfe" / "PTFE.data.csv")
    assert data.wavelength.values.tolist() == [351, 532, 633, 1064]
    assert np.isfinite(data.brdf).sum("theta_i").sum("theta_o").values.tolist() == [108] * 4
    # the row 0.532,-75,0,64.1581,180 → 2.89E-01 of the file, and its counterpart at φ_r = 0
    assert float(data.brdf.sel(theta_i=75, wavelength=532).sel(theta_o=64.1581, method="nearest")) == 0.289
    side = data.brdf.sel(theta_i=75, wavelength=532).dropna("theta_o")
    assert float(side.sel(theta_o=-64.1581, method="nearest")) > 1.5 * float(
        side.sel(theta_o=64.1581, method="nearest")
    )
    # reciprocity of the sample, measured: f(0 → 30) against f(30 → 0) within the 2 % of the instrument
    a = data.brdf.sel(theta_i=0, theta_o=30, wavelength=532)
    assert float(a) == pytest.approx(float(data.brdf.sel(theta_i=30, theta_o=0, wavelength=532)), rel=0.02)
