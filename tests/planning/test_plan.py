"""The plan: what is needed and left out, what is warned about, and that planning itself stays cheap."""

from __future__ import annotations

import json
import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio import validity
from vgonio.errors import InputError, MaterialError
from vgonio.planning import Plan, plan
from vgonio.planning.cautions import _measured_warnings
from vgonio.planning.ray_forecast import _facets
from vgonio.scene import load_scene
from vgonio.surface import Heightfield


def scene(**changes: Any) -> dict[str, Any]:
    tables: dict[str, Any] = {
        "surface": {"generate": {"kind": "flat", "shape": [64, 64], "pitch_um": 0.5}},
        "material": {"name": "Al"},
        "light": {"wavelength_nm": [500], "theta_i_deg": [0, 30], "coherence_um": 4},
        "detector": {"theta_o_deg": [-30, 0, 30]},
        "geometric": {"rays": 1000},
        "wave": {},
    }
    return {k: v for k, v in {**tables, **changes}.items() if v is not None}


def stages(made: Plan) -> dict[str, bool]:
    return {s.name: s.needed for s in made.stages}


def test_every_stage_has_a_reason():
    made = plan(scene())
    assert all(s.why for s in made.stages)
    assert all(s.library for s in made.stages if s.needed and s.name in ("trace", "transform", "compare", "report"))


@pytest.mark.parametrize(
    ("absent", "left_out", "kept"),
    [
        ("wave", {"interpolate", "transform", "compare", "colour"}, {"mesh", "trace"}),
        ("geometric", {"mesh", "trace", "compare", "colour"}, {"interpolate", "transform"}),
    ],
)
def test_an_absent_table_is_work_that_is_not_done(absent, left_out, kept):
    made = stages(plan(scene(**{absent: None})))
    assert {name for name in left_out | kept if made[name]} == kept


def test_rays_and_waves_are_compared():
    made = plan(scene())
    assert made.needs("compare")
    assert not made.needs("measured")
    assert not made.needs("no such stage")


def test_two_theories_are_compared_with_each_other():
    made = plan(scene(geometric=None, wave={"theory": ["kirchhoff", "harvey-shack"]}))
    assert made.needs("compare")


def test_rays_are_counted():
    trace = next(s for s in plan(scene(geometric={"rays": 4000})).stages if s.name == "trace")
    assert "8,000 rays" in trace.cost


def test_missing_points_decide_about_filling(tmp_path):
    z = np.zeros((32, 32))
    whole = tmp_path / "whole.npz"
    vg.surface.write(Heightfield(z, 0.5), whole)
    z[3, 4] = np.nan
    holes = tmp_path / "holes.npz"
    vg.surface.write(Heightfield(z, 0.5), holes)
    assert not plan(scene(surface={"file": str(whole), "fill": "interpolate"})).needs("fill")
    assert plan(scene(surface={"file": str(holes), "fill": "interpolate"})).needs("fill")
    with pytest.raises(InputError, match="missing points"):
        plan(scene(surface={"file": str(holes)}))


def test_a_plane_is_taken_off_measured_fields_only(tmp_path):
    tilted = 0.1 * np.arange(32.0) + np.zeros((32, 1))
    path = tmp_path / "tilted.npz"
    vg.surface.write(Heightfield(tilted, 0.5), path)
    assert plan(scene(surface={"file": str(path)})).needs("level")
    assert not plan(scene(surface={"file": str(path), "level": "none"})).needs("level")
    assert not plan(scene()).needs("level")


def test_wavelengths_outside_the_material_table_are_refused():
    with pytest.raises(MaterialError, match="tabulated"):
        plan(scene(light={"wavelength_nm": [50_000], "theta_i_deg": [0]}))


@pytest.mark.parametrize(
    ("output", "words"),
    [
        ({"file": "result.toml"}, "end in .nc"),
        ({"report": "page.nc"}, "end in .html"),
        ({"file": __file__ + "/result.nc"}, "not a writable folder"),
    ],
)
def test_outputs_are_checked_before_any_work(output, words):
    with pytest.raises(InputError, match=words):
        plan(scene(output=output))


def test_an_output_may_not_overwrite_an_input(tmp_path):
    path = tmp_path / "same.nc"
    path.write_bytes(b"measured data")
    checked = load_scene({"measured": {"file": str(path)}, "output": {"file": str(path)}})
    with pytest.raises(InputError, match="overwrite an input"):
        plan(checked)


def test_json_and_text_hold_the_same_stages():
    made = plan(scene())
    assert json.loads(made.to_json())["stages"] == made.rows()
    text = str(made)
    assert all(s.name in text for s in made.stages)
    assert text.splitlines()[0].startswith("Plan of")


def test_shadows_and_local_reflectances_state_their_cost():
    two = {"wavelength_nm": [500, 600], "theta_i_deg": [0, 30], "coherence_um": 4}
    cost = {s.name: s.cost for s in plan(scene(light=two, wave={"shadowing": True, "fresnel": "local"})).stages}
    elements = len(load_scene(scene()).detector.theta_o_deg)
    assert f"up to {2 * elements * 4:,} transforms" in cost["transform"]
    assert "times the points" in cost["transform"]
    plain = {s.name: s.cost for s in plan(scene(light=two)).stages}
    assert "transforms" not in plain["transform"]


def test_planning_loads_no_ray_or_wave_library():
    code = (
        "import sys, json, vgonio as vg\n"
        f"vg.plan(json.loads({json.dumps(json.dumps(scene()))}))\n"
        "print([m for m in ('embreex', 'finufft', 'pyopencl', 'matplotlib', 'colour', 'lmfit') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


# ---- warnings: each figure against its closed form on a surface made for it
def slope_surface(degrees: float, n: int = 64) -> Heightfield:
    """A roof of constant slope: every gradient is ±tan(degrees)."""
    x = np.arange(n)
    z = np.tan(np.deg2rad(degrees)) * np.abs(x - n // 2) * 0.5
    return Heightfield(np.broadcast_to(z, (n, n)), 0.5, interpolation="linear")


@pytest.mark.parametrize(("degrees", "share"), [(29.0, 0.0), (31.0, 1.0)])
def test_steepness_of_a_roof(degrees, share):
    assert validity.steep_share(slope_surface(degrees)) == share


def test_radius_of_curvature_of_a_parabola():
    """z = x²/2r has the second derivative 1/r everywhere, and second differences of a parabola are exact."""
    x = np.arange(64) * 0.5
    parabola = Heightfield(np.broadcast_to(x**2 / (2 * 7.0), (64, 64)), 0.5)
    assert validity.curvature_radius_um(parabola) == pytest.approx(7.0, rel=1e-9)
    assert validity.curvature_radius_um(Heightfield(np.zeros((8, 8)), 1.0)) == np.inf


def warnings_of(surface: Heightfield, theories: tuple[str, ...] = ("kirchhoff",), **light: Any) -> str:
    given = {"wavelength_nm": [500], "theta_i_deg": [0], "coherence_um": 1.0} | light
    checked = load_scene(scene(light=given)).light
    return "\n".join(validity.wave_warnings(surface, list(theories), checked, 30.0))


def test_a_flat_mirror_is_warned_about_nothing():
    assert warnings_of(Heightfield(np.zeros((64, 64)), 0.5)) == ""


def test_steep_and_grazing_are_warned_about():
    text = warnings_of(slope_surface(35.0), theta_i_deg=[80])
    assert "steeper than 30°" in text
    assert "shadowing" in text
    light = load_scene(scene(light={"wavelength_nm": [500], "theta_i_deg": [80], "coherence_um": 1.0})).light
    shadowed = validity.wave_warnings(slope_surface(35.0), ["kirchhoff"], light, 30.0, shadowing=True)
    assert "shadowing" not in "\n".join(shadowed)
    assert "steeper" not in warnings_of(slope_surface(10.0))


def test_a_coherence_window_larger_than_the_sample_is_warned_about():
    flat = Heightfield(np.zeros((64, 64)), 0.5)  # 32 µm
    assert "larger than the sample" in warnings_of(flat, coherence_um=6.0)
    assert "independent coherence windows" in warnings_of(flat, coherence_um=5.0)
    assert warnings_of(flat, coherence_um=2.0) == ""


def test_small_radii_of_curvature_are_warned_about():
    x = np.arange(64) * 0.5
    bumpy = Heightfield(np.broadcast_to(0.05 * np.sin(2 * np.pi * x / 2), (64, 64)), 0.5)
    # r = 1/(a (2π/P)²/√2) is about 2.9 µm, and 4π·2.9 µm·cos 80° is about ten wavelengths
    assert "curvature" in warnings_of(bumpy, theta_i_deg=[85])
    assert "curvature" not in warnings_of(bumpy, theta_i_deg=[0])


def test_scatter_beyond_the_resolved_frequencies_is_warned_about(rng):
    smooth = Heightfield(rng.normal(0, 0.005, (64, 64)), 0.5)
    assert "not in the samples" in warnings_of(smooth, theta_i_deg=[60])
    fine = Heightfield(rng.normal(0, 0.005, (256, 256)), 0.1)
    assert "not in the samples" not in warnings_of(fine, theta_i_deg=[60])


def test_what_an_instrument_did_not_resolve_is_warned_about_on_rough_surfaces_too(rng):
    """A measured map of 0.44 µm and an S-filter of 1.5 µm at 500 nm; generated surfaces have no more than they show."""
    rough = vg.surface.gaussian(rms_um=0.3, correlation_um=5, shape=(64, 64), pitch_um=0.44, seed=1)
    assert "not in this measured surface" not in warnings_of(rough, theta_i_deg=[60])
    seen = rough.replace(history=("read some.al3d",))
    (line,) = (w for w in warnings_of(seen, theta_i_deg=[60]).split("\n") if "measured surface" in w)
    assert line.startswith("roughness finer than 0.88 µm")
    assert "back-scattering and its colour" in line
    filtered = rough.replace(history=("read some.al3d", "ISO 16610-61 Gaussian S-filter 1.5 µm, L-filter 60 µm"))
    assert "roughness finer than 1.5 µm" in warnings_of(filtered, theta_i_deg=[60])
    fine = vg.surface.gaussian(rms_um=0.3, correlation_um=2, shape=(64, 64), pitch_um=0.1, seed=1)
    assert "measured surface" not in warnings_of(fine.replace(history=("read some.al3d",)), theta_i_deg=[60])


def test_harvey_shack_is_warned_about_far_from_the_normal():
    flat = Heightfield(np.zeros((64, 64)), 0.5)
    assert "q_z = 2k" in warnings_of(flat, ("harvey-shack",), theta_i_deg=[60])
    assert "q_z = 2k" not in warnings_of(flat, ("kirchhoff",), theta_i_deg=[60])


def test_what_a_measured_file_does_not_hold_is_said():
    """Values of the scene outside the file's range are counted, those at its ends are not."""
    data = xr.Dataset(coords={"theta_i": [0.0, 60.0], "wavelength": [400.0, 700.0]})
    inside = SimpleNamespace(theta_i_deg=[0, 30, 60], wavelength_nm=[400, 700])
    assert _measured_warnings(data, inside) == []
    beyond = SimpleNamespace(theta_i_deg=[0, 61, 70], wavelength_nm=[399, 550])
    angle, wavelength = _measured_warnings(data, beyond)
    assert "from 0 to 60°: 2 of 3 values" in angle
    assert "from 400 to 700 nm: 1 of 2 values" in wavelength


@pytest.mark.parametrize("options", [{"edges": "guard"}, {"edges": "mirror"}, {"edges": "guard", "refinement": 2}])
@pytest.mark.parametrize("periodic", [True, False])
def test_facets_are_expected_as_they_are_made(periodic, options):
    """Within 10 %: the overlap of a period and the seams of the mirror images are not counted."""
    surface = vg.surface.gaussian(0.1, 4.0, (40, 60), 0.5, seed=1).replace(periodic=periodic)
    gonio = vg.measure.Gonioreflectometer([30], [-30])
    solver = vg.geometric.RayOptics("perfect", rays=50, **options)
    expected, mirrored = _facets(solver, surface, gonio.incoming)
    assert mirrored == (not periodic and options["edges"] == "mirror")
    assert expected == pytest.approx(gonio.measure(surface, solver).attrs["facets"], rel=0.1)
