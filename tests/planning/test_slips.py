"""What looks like a slip: angles in radians, a pitch or a height in another unit, spikes, and what is not begun."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import vgonio as vg
from vgonio.cli import main
from vgonio.directions import like_radians
from vgonio.errors import InputError, ToleranceError, VgonioWarning

THETA_O = list(range(-80, 81, 20))


def scene(**surface):
    return {
        "surface": surface,
        "light": {"theta_i_deg": [0, 30], "wavelength_nm": [550], "coherence_um": 5},
        "detector": {"theta_o_deg": THETA_O},
        "material": {"name": "Al"},
        "wave": {"theory": "kirchhoff"},
    }


def rough(rms_um=0.3):
    return {"kind": "gaussian", "rms_um": rms_um, "correlation_um": 5, "shape": [64, 64], "pitch_um": 0.5, "seed": 0}


def npz(path, z, **more):
    np.savez(path, z=z, **{"pitch_um": 0.5, **more})
    return str(path)


def spiked(count=12):
    z = vg.surface.gaussian(0.05, 5, (64, 64), 0.5, seed=1).z.copy()
    z.ravel()[:: z.size // count] += 1.0
    return z


# ---- angles
@pytest.mark.parametrize(
    ("values", "name", "told"),
    [
        ([0, 0.5236, 1.047], "theta_i_deg", True),
        (np.deg2rad([0, 20, 85]), "theta_i_deg", True),
        ([0, 1], "theta_i_deg", False),
        ([0], "theta_i_deg", False),
        ([0, 0.01], "theta_i_deg", False),
        ([0.5, 2], "theta_i_deg", False),
        (np.deg2rad(np.arange(-85, 86, 5)), "theta_o_deg", True),
        (np.arange(-15, 16) / 10, "theta_o_deg", False),
    ],
)
def test_angles_that_look_like_radians(values, name, told):
    """A narrow scan about the normal is none; whole degrees are none."""
    assert bool(like_radians(values, name)) == told


def test_instrument_and_plan_ask_whether_angles_are_radians():
    with pytest.warns(VgonioWarning, match=r"theta_i_deg goes up to 1.047°: are these radians \(60°\)"):
        vg.measure.Gonioreflectometer(theta_i_deg=[0, 0.5236, 1.047], theta_o_deg=THETA_O)
    asked = scene(generate=rough())
    asked["light"]["theta_i_deg"] = [0, 0.5236, 1.047]
    with pytest.warns(VgonioWarning):
        made = vg.plan(asked)
    assert [w for w in made.warnings if "are these radians" in w]


def test_degrees_bring_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = vg.plan(scene(generate=rough()))
    assert not [w for w in made.warnings if "radians" in w or "unit" in w or "Sku" in w]
    assert made.refused == ""


# ---- units of lengths
def test_heights_in_another_unit_are_named_and_the_scene_is_not_begun(tmp_path, capsys, monkeypatch):
    """300 for 0.3: the plan ends well, its first line says that the run is refused; the run is, before any work."""
    made = vg.plan(scene(generate=rough(300)))
    assert "is the unit right? (300 nm is 0.3 µm)" in made.warnings[0]
    assert made.refused
    assert str(made).startswith("REFUSED: simulate will not begin this scene: gaussian has Sq of 300 µm")
    monkeypatch.setattr(vg.measure.Gonioreflectometer, "measure", lambda *a: pytest.fail("work was begun"))
    with pytest.raises(ToleranceError, match="is the unit right.*24 h are begun"):
        vg.simulate(scene(generate=rough(300)))
    path = tmp_path / "scene.toml"
    main(["init", str(path)])
    capsys.readouterr()
    assert main(["plan", str(path), "--set", "surface.generate.rms_um=300"]) == 0
    assert capsys.readouterr().out.startswith("REFUSED: simulate will not begin this scene")


def test_a_pitch_in_another_unit_is_the_cause_of_an_error(tmp_path):
    """Nanometres taken for micrometres: too many windows, of which a larger coherence length is no cure."""
    file = npz(tmp_path / "a.npz", vg.surface.gaussian(0.3, 5, (64, 64), 0.5).z, pitch_um=500.0)
    with pytest.warns(VgonioWarning), pytest.raises(ToleranceError, match=r"^a has a pitch of 500 µm.*give pitch_um"):
        vg.plan(scene(file=file))


@pytest.mark.parametrize("kind", ["lamellar", "blazed"])
def test_walls_of_gratings_are_no_slip(kind):
    from vgonio.surface.plausible import implausible_in_words

    assert implausible_in_words(getattr(vg.surface, kind)(period_um=2.0, **DEPTH[kind]), generated=True) == ""


DEPTH = {"lamellar": {"depth_um": 1.0}, "blazed": {"blaze_deg": 30.0}}


# ---- outliers
def test_the_plan_says_what_the_outlier_filter_removed(tmp_path, capsys):
    file = npz(tmp_path / "a.npz", spiked())
    made = vg.plan(scene(file=file, outliers=6, fill="interpolate"))
    (stage,) = [s for s in made.stages if s.name == "outliers"]
    removed = int(stage.why.split()[0])
    assert stage.needed
    assert removed >= 12
    assert [s.why for s in made.stages if s.name == "fill"] == [
        f"{removed} missing points ({removed / 4096:.3%}) by interpolate"
    ]
    assert not [w for w in made.warnings if "Sku" in w]
    (stage,) = [s for s in vg.plan(scene(file=file)).stages if s.name == "outliers"]
    assert not stage.needed


def test_the_plan_warns_of_a_few_points_that_make_the_roughness(tmp_path):
    file = npz(tmp_path / "a.npz", spiked())
    (said,) = [w for w in vg.plan(scene(file=file)).warnings if "Sku" in w]
    assert "surface.outliers is not set" in said
    kurtosis = vg.surface.parameters(vg.surface.level(vg.surface.read(file)))["Sku"]
    assert said.startswith(f"kurtosis Sku = {kurtosis:.3g} ")
    assert not [w for w in vg.plan(scene(generate=rough())).warnings if "Sku" in w]


def test_missing_points_that_the_outlier_filter_made_say_so(tmp_path):
    z = spiked()
    z[40, 40] = np.nan
    file = npz(tmp_path / "a.npz", z)
    said = r"surface.outliers = 6 marks \d+ of 4096 points of a as missing, beside 1 that the file lacks"
    with pytest.raises(InputError, match=said):
        vg.plan(scene(file=file, outliers=6))


def test_simulate_prints_what_was_removed_and_filled(tmp_path, capsys):
    file = npz(tmp_path / "a.npz", spiked())
    asked = scene(file=file, outliers=6, fill="interpolate")
    text = "\n".join(
        f"[{table}]\n" + "\n".join(f"{k} = {v!r}" for k, v in keys.items()) for table, keys in asked.items()
    )
    (tmp_path / "s.toml").write_text(text.replace("'", '"'))
    assert main(["simulate", str(tmp_path / "s.toml"), "-o", str(tmp_path / "r.nc")]) == 0
    said = capsys.readouterr().out
    assert "beyond 6 local deviations removed" in said
    assert "by interpolate" in said
