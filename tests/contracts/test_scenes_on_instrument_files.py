"""The whole chain on real files of instruments: read, prepare, trace, integrate, compare, write."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest

import vgonio as vg

# file → what its scene has to say, and the pitch (dx, dy) in µm that shared/data/README.md states
FILES = {
    "al3d-1.al3d": ({}, (0.438, 0.438)),
    "x3p-2.x3p": ({}, (0.128, 0.315)),
    "opd-1.opd": ({"fill": "interpolate"}, (0.197, 0.197)),
    # this file's lateral unit is misread by the library: the scene overrides it
    "nms-1.nms": ({"pitch_um": 0.3125, "outliers": 6, "fill": "interpolate"}, (0.3125, 0.3125)),
}


def scene_of(path, settings):
    return {
        "surface": {"file": str(path), "crop_um": 24, **settings},
        "material": {"name": "Al"},
        "light": {"wavelength_nm": [500, 600, 700], "theta_i_deg": [0, 40], "coherence_um": 3},
        "detector": {"theta_o_deg": {"start": -60, "stop": 60, "step": 20}, "aperture_deg": 10},
        "geometric": {"rays": 20_000, "seed": 1},
        "wave": {"tol": 1e-2},
    }


@pytest.mark.parametrize("name", FILES)
def test_a_scene_on_an_instrument_file(shared, tmp_path, name):
    settings, pitch = FILES[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vg.errors.VgonioWarning)
        tree = vg.simulate(scene_of(shared / "data" / "heightfields" / name, settings), output=tmp_path / "result.nc")
    assert set(tree.children) == {"surface", "rays", "waves", "comparison"}
    read = next(s for s in json.loads(tree.attrs["plan"])["stages"] if s["name"] == "read surface")
    assert read["library"] == "SurfaceTopography"
    for group in ("rays", "waves"):
        brdf = tree[group].brdf
        assert np.isfinite(brdf).all()
        assert (brdf >= 0).all()
        # smooth metal: the mirror direction outshines a direction 40° away from it
        assert (brdf.sel(theta_i=0, theta_o=0) > 10 * brdf.sel(theta_i=0, theta_o=40)).all()
        assert (brdf.sel(theta_i=40, theta_o=-40) > 10 * brdf.sel(theta_i=40, theta_o=40)).all()
    rays = tree["rays"]
    tallied = rays.energy_by_bounce.sum("bounce") + rays.energy_absorbed + rays.energy_lost
    np.testing.assert_allclose(tallied, 1.0, atol=1e-6)
    surface = vg.surface.read(shared / "data" / "heightfields" / name, pitch_um=settings.get("pitch_um"))
    # the table there gives three digits
    assert (surface.dx, surface.dy) == pytest.approx(pitch, abs=6e-4)


def test_an_instrument_file_with_missing_points_needs_a_fill(shared):
    with pytest.raises(vg.errors.InputError, match="116 missing points"):
        vg.plan({"surface": {"file": str(shared / "data" / "heightfields" / "opd-1.opd")}})
