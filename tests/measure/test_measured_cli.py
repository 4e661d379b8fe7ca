"""`vgonio measured` and the table [measured] of a scene."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio import scene
from vgonio.assembly import measured
from vgonio.cli import main
from vgonio.measure import formats
from vgonio.measure.calibration import calibration_factor
from vgonio.measure.instrument import Instrument
from vgonio.measure.isotropic import sampled
from vgonio.measure.standards import lambertian_standard


@pytest.fixture
def plane(tmp_path, facets):
    return formats.write(sampled(facets(0.4, 0.3), [0, 30, 60]), tmp_path / "sample.json")


def test_convert_and_back(tmp_path, plane, capsys):
    """JSON to every other format and back: in plane within what each keeps."""
    data = formats.read(plane)
    for name, options, tolerance in (
        ("a.csv", [], 1e-8),
        ("a.astm", [], 1e-8),
        ("a.nc", [], 0),
        ("a.bsdf", ["--fill", "half-angle"], 0.03),
    ):
        assert main(["measured", "convert", str(plane), str(tmp_path / name), *options]) == 0
        asked = {} if name != "a.bsdf" else {"theta_i_deg": [0, 30, 60], "theta_o_deg": np.arange(-75, 76, 5)}
        back = formats.read(tmp_path / name, **asked)
        expected = data.brdf.sel(theta_o=asked.get("theta_o_deg", data.theta_o))
        np.testing.assert_allclose(back.brdf, expected, rtol=tolerance, err_msg=name)
    assert "in plane" in capsys.readouterr().out


def test_options_go_where_they_are_known(tmp_path, plane, capsys):
    target = tmp_path / "z.bsdf"
    command = ["measured", "convert", str(plane), str(target), "--to", "zemax", "--fill", "azimuth"]
    assert main([*command, "--set", "wavelength_nm=550", "--set", "negative=error"]) == 0
    assert formats.recognise(target) == "zemax"
    assert main(["measured", "info", str(target), "--json", "--set", "theta_o_deg=[-30, 0, 30]"]) == 0
    out = capsys.readouterr().out
    facts = json.loads(out[out.index("{") :])
    assert facts["wavelength_nm"] == "1: 550 … 550"
    assert facts["directions"] == "3 in plane, θ_o -30 … 30°"


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["convert", "FILE", "out.bsdf"], "in-plane data do not say"),
        (["convert", "FILE", "out.xyz"], "suffix"),
        (["convert", "FILE", "FILE"], "overwrite"),
        (["convert", "FILE", "out.csv", "--set", "digit=3"], "did you mean 'digits'"),
        (["convert", "FILE", "out.csv", "--set", "a.b=3"], "no dots"),
        (["convert", "FILE", "out.bsdf"], "(--fill) how they are filled. half-angle: "),
        (["convert", ".", "out.csv"], "is a folder"),
        (["info", "absent.json"], "no such file"),
        (["info", "FILE", "--format", "merl"], "no MERL file"),
        (["cross-validate", "FILE"], "two and more"),
    ],
)
def test_bad_requests_are_one_line(tmp_path, plane, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    assert main(["measured", *(str(plane) if a == "FILE" else a for a in arguments)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == before


def test_one_group_of_a_result(tmp_path, plane, capsys):
    """FILE:GROUP where a result holds several BRDFs; without it the error says so."""
    data = formats.read(plane)
    result = tmp_path / "result.nc"
    vg.save(xr.DataTree.from_dict({"rays": data, "waves": data.map(lambda v: v * 2)}), result)
    assert main(["measured", "convert", f"{result}:waves", str(tmp_path / "w.csv"), "--set", "digits=12"]) == 0
    np.testing.assert_allclose(formats.read(tmp_path / "w.csv").brdf, 2 * data.brdf, rtol=1e-10)
    assert main(["measured", "info", str(result)]) == 2
    assert "FILE:GROUP" in capsys.readouterr().err
    assert main(["measured", "info", f"{result}:wave"]) == 2
    assert "did you mean 'waves'" in capsys.readouterr().err


def test_cross_validate(tmp_path, plane, capsys):
    other = formats.write(formats.read(plane).map(lambda v: v * 1.02), tmp_path / "other.csv", digits=17)
    assert main(["measured", "cross-validate", str(plane), str(other), "--reference", "sample.json", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [r["theta_i_deg"] for r in rows] == [0, 30, 60, None]
    assert rows[-1]["bias"] == pytest.approx(0.02)
    assert rows[-1]["name"] == "other.csv"
    assert main(["measured", "cross-validate", str(plane), str(other)]) == 0
    assert "mean of all" in capsys.readouterr().out


def counts_csv(path, data):
    """A CSV of counts: θ_i, θ_o, λ, counts, standard error."""
    lines = ["theta_i_deg,theta_o_deg,wavelength_nm,counts,counts_stderr"]
    for i in data.theta_i.values:
        for o in data.theta_o.values:
            for w in data.wavelength.values:
                here = data.sel(theta_i=i, theta_o=o, wavelength=w)
                lines.append(f"{i},{o},{w},{here.counts.item():.17g},{here.counts_stderr.item():.17g}")
    path.write_text("\n".join(lines) + "\n")
    return path


def test_calibrate(tmp_path, facets, capsys):
    """Counts of sample and standard in files, the standard's BRDF in a third: the sample's BRDF within its errors."""
    instrument = Instrument(aperture_deg=0, divergence_deg=0, bandwidth_nm=0)
    lamp, angles, nm = np.array([1e5, 2e5, 3e5]), np.arange(-80, 81, 10), np.array([450.0, 550.0, 650.0])
    paper = lambertian_standard(nm, [0.9, 0.95, 0.97], [0.002] * 3)
    white = instrument.seen(paper.drop_vars("brdf_stderr"), [10], angles, fill="azimuth")
    sample = sampled(facets(0.4, 0.3), [0, 30, 60], angles)
    files = {
        "white.csv": instrument.counts(white, lamp, 1),
        "sample.csv": instrument.counts(sample, lamp / 10, 2).map(lambda v: v * 10),
    }
    for name, data in files.items():
        counts_csv(tmp_path / name, data)
    standard = formats.write(paper, tmp_path / "standard.json")
    out = tmp_path / "out.json"
    command = ["measured", "calibrate", str(tmp_path / "sample.csv"), "--white", str(tmp_path / "white.csv")]
    command += ["--standard", str(standard), "-o", str(out)]
    assert main([*command, "--standard-nm", "all"]) == 0
    assert "17 angles" in capsys.readouterr().out
    found = formats.read(out)
    pull = (found.brdf - sample.brdf) / found.brdf_stderr
    assert float((pull**2).mean()) < 2  # the standard is exact here, its stated 0.2 % only widens the errors
    assert float(np.abs(pull).max()) < 4.5
    assert float(np.abs(found.brdf / sample.brdf - 1).median()) < 0.01
    # the standard at 550 nm for all: the spectrum tilts by that of the standard
    assert main([*command, "--standard-nm", "550"]) == 0
    ratio = (formats.read(out).brdf / found.brdf).mean(["theta_i", "theta_o"])
    np.testing.assert_allclose(ratio, [0.95 / 0.9, 1, 0.95 / 0.97], rtol=1e-6)
    assert main([*command, "--standard-nm", "green"]) == 2
    assert "a wavelength in nm or all" in capsys.readouterr().err
    assert main(["measured", "calibrate", str(standard), *command[3:]]) == 2


def test_formats_are_listed(capsys):
    assert main(["measured", "formats", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert {r["format"] for r in rows} == set(formats.FORMATS)
    assert [r["format"] for r in rows if r["can"] == "read"] == ["nist-csv"]


# ---- in a scene
def loaded(**measured_table):
    tables = {
        "light": {"wavelength_nm": [450, 550], "theta_i_deg": [0, 20]},
        "detector": {"theta_o_deg": [-40, -20, 10]},
        "measured": measured_table,
    }
    return scene.load_scene(tables)


def test_a_scene_reads_at_its_own_angles(tmp_path, facets):
    """MERL and RGL are functions of two directions: in a scene they are read at the angles of light and detector."""
    brdf = facets(0.4, 0.3)
    formats.write(sampled(brdf), tmp_path / "a.bsdf", fill=brdf)
    data = measured(loaded(file=str(tmp_path / "a.bsdf")))
    assert data.theta_i.values.tolist() == [0, 20]
    assert data.theta_o.values.tolist() == [-40, -20, 10]
    own = loaded(file=str(tmp_path / "a.bsdf"), theta_i_deg=[5], resolution_deg=20)
    assert measured(own).brdf.dims == ("theta_i", "cell", "wavelength")


def test_a_scene_names_the_unit(tmp_path, plane):
    data = formats.read(plane)
    percent = formats.write(data.map(lambda v: v * 100), tmp_path / "percent.json")
    found = measured(loaded(file=str(percent), unit="percent"))
    np.testing.assert_allclose(found.brdf, data.brdf, rtol=1e-12)


@pytest.mark.parametrize(
    "changed, options, message",
    [
        ({"sample": -1.0}, [], "no count on the sample is positive"),
        ({"sample": 0.0}, [], "no count on the sample is positive"),
        ({"standard": 0.0}, [], "BRDF of the standard has to be positive"),
        ({"white": 0.0}, [], "counts of the standard have to be positive"),
        ({"standard": "one angle"}, [], "known at θ_o = 0° only"),
        ({}, ["--standard-uncertainty", "-1"], "--standard-uncertainty"),
        ({}, ["--standard-error", "nan"], "--standard-uncertainty"),
        ({}, ["--standard-nm", "nan"], "--standard-nm"),
        ({}, ["--standard-nm", "-533"], "--standard-nm"),
        ({}, ["--theta-i", "nan"], "θ_i"),
    ],
)
def test_impossible_calibrations_write_nothing(tmp_path, capsys, changed, options, message):
    """Each is one line and status 2, and leaves no file; the same counts unchanged are calibrated."""
    nm, angles = np.array([450.0, 550.0, 650.0]), np.arange(-80.0, 81, 10)
    paper = lambertian_standard(nm, [0.9, 0.95, 0.97])
    axes = {"theta_i": [10.0], "theta_o": angles, "wavelength": nm}
    counts = xr.Dataset({"counts": (("theta_i", "theta_o", "wavelength"), np.full((1, 17, 3), 1000.0))}, coords=axes)
    rows = lambda d: d.assign(counts_stderr=d["counts"] * 0 + 10)  # noqa: E731
    counts_csv(tmp_path / "sample.csv", rows(counts * changed.get("sample", 1.0)))
    counts_csv(tmp_path / "white.csv", rows(counts * changed.get("white", 1.0)))
    standard = changed.get("standard", 1.0)
    one = paper.isel(theta_o=[0]).assign_coords(theta_o=[0.0])
    formats.write(one if standard == "one angle" else paper * standard, tmp_path / "standard.csv")
    out = tmp_path / "out.json"
    command = ["measured", "calibrate", str(tmp_path / "sample.csv"), "--white", str(tmp_path / "white.csv")]
    command += ["--standard", str(tmp_path / "standard.csv"), "-o", str(out), *options]
    assert main(command) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert "\n" not in error
    assert not out.exists()
    if options:
        assert main(command[: -len(options)]) == 0


def test_angles_beyond_those_of_the_standard_are_left_out():
    """A standard known to 45° calibrates with the 9 angles up to 40°, and says so."""
    nm, angles = np.array([533.0]), np.arange(-80.0, 81, 10)
    axes = {"theta_i": [10.0], "theta_o": angles, "wavelength": nm}
    counts = xr.Dataset({"counts": (("theta_i", "theta_o", "wavelength"), np.full((1, 17, 1), 1000.0))}, coords=axes)
    paper = lambertian_standard(nm, [0.99]).assign_coords(theta_o=[-45.0, 45.0])
    factor = calibration_factor(counts, paper)
    assert factor.attrs["angles"] == 9
    assert factor.factor.item() == pytest.approx(1000 * np.pi / (0.99 * np.cos(np.radians(10))))
