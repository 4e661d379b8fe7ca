"""Over a hemisphere every theory states the error of each value, and the page says what the cells add to it."""

from __future__ import annotations

import numpy as np
import pytest

import vgonio as vg
from vgonio.report.tables import errors_and_seconds

THEORIES = {
    "rays": lambda: vg.geometric.RayOptics("Al", wavelength_nm=[450, 600], rays=5000),
    "kirchhoff": lambda: vg.wave.Kirchhoff("Al", wavelength_nm=[450, 600], tol=1e-2),
    "generalised": lambda: vg.wave.GeneralizedHarveyShack("Al", wavelength_nm=[450, 600], tol=1e-2),
    "harvey-shack": lambda: vg.wave.HarveyShack("Al", wavelength_nm=[450, 600], tol=1e-2),
}


@pytest.mark.filterwarnings("ignore::vgonio.errors.VgonioWarning")
@pytest.mark.parametrize("theory", THEORIES)
def test_standard_errors_have_the_shape_of_the_brdf(theory) -> None:
    surface = vg.surface.gaussian(rms_um=0.2, correlation_um=3, shape=(64, 64), pitch_um=0.5, seed=1)
    gonio = vg.measure.Gonioreflectometer.hemisphere(theta_i_deg=[0, 40], resolution_deg=20, coherence_um=5)
    data = gonio.measure(surface, THEORIES[theory]())
    assert data["brdf"].dims == data["brdf_stderr"].dims == ("theta_i", "cell", "wavelength")
    error = data["brdf_stderr"].values
    assert np.isfinite(error).all()
    assert (error >= 0).all()
    lit = data["brdf"].values > 0.01 * data["brdf"].values.max()
    assert (error[lit] > 0).all()
    words = errors_and_seconds({theory: data}, {}).rows[0][5]
    assert (
        ("cell_error" in data.attrs) == ("cells as wide as these misjudge the brightest" in words) == (theory != "rays")
    )
