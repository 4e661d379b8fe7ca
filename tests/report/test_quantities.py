"""What figures and tables of a report take from a result, on numbers that can be written down."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio import models
from vgonio.directions import Detector
from vgonio.geometric import RayOptics
from vgonio.measure import Gonioreflectometer
from vgonio.report.quantities import (
    bounce_shares,
    direction,
    incidence,
    multiple_share,
    relative_error,
    tallies,
    without_chance,
)
from vgonio.report.verdict import cautions, largest_error, mirrored_sides


@pytest.mark.parametrize("phi_i", [0.0, 90.0, 250.0])
def test_the_cell_of_an_angle_in_plane(phi_i):
    """Signed angles go with the plane of incidence: −40° lies at φ_i + 180°, where the mirror direction of 40° is."""
    data = models.evaluate("lambert-1760", [40.0], Detector.hemisphere(5), [500.0], k_d=0.5)
    one = data.assign_coords(phi_i=phi_i).isel(theta_i=0)
    for theta, side in ((40.0, 0.0), (-40.0, 180.0)):
        found = direction(one, theta)
        assert float(found.theta_o) == pytest.approx(40, abs=2.6)
        assert abs((float(found.phi_o) - phi_i - side + 180) % 360 - 180) < 6
    assert direction(one.isel(cell=one.theta_o.values < 20), -40.0) is None
    assert incidence(data, 41.0) is None
    assert float(incidence(data, 40.4).theta_i) == 40


def traced(n: float, share: float) -> xr.Dataset:
    """n rays of equal power in a cone, of which a share was reflected more than once."""
    parts = xr.DataArray([[n * (1 - share)], [n * share]], {"bounce": [1, 2]}, ("bounce", "theta_o"))
    data = xr.Dataset({"brdf_by_bounce": parts, "brdf": parts.sum("bounce")})
    return data.assign(brdf_stderr=np.sqrt(data["brdf"]), brdf_by_bounce_stderr=np.sqrt(parts))


@pytest.mark.parametrize("by_bounce", [True, False])
def test_error_of_the_share_of_multiple_reflections_is_that_of_a_count(by_bounce):
    """Binomial: √(s(1 − s)/n), from the errors of the parts or from that of their sum."""
    data = traced(400.0, 0.2)
    if not by_bounce:
        data = data.drop_vars("brdf_by_bounce_stderr")
    share, error = multiple_share(data)
    assert share.item() == pytest.approx(0.2, rel=1e-12)
    assert error.item() == pytest.approx(np.sqrt(0.2 * 0.8 / 400), rel=1e-12)
    assert bounce_shares(data)[0].values.ravel() == pytest.approx([0.8, 0.2])
    few, _ = multiple_share(traced(2.0, 0.5))
    assert np.isnan(few).all()  # an error of 70 % tells nothing


def test_energies_and_errors_of_a_result():
    energy = xr.DataArray([[0.5, 0.2]], dims=("theta_i", "bounce"))
    rest = xr.DataArray([0.25], dims="theta_i")
    found = tallies(xr.Dataset({"energy_by_bounce": energy, "energy_absorbed": rest, "energy_lost": 0.2 * rest}))
    assert found["sum"].item() == pytest.approx(1.0)
    assert found["lost"].item() == pytest.approx(0.05)
    brdf = xr.DataArray([1.0, 0.5, 1e-4], dims="theta_o")
    data = xr.Dataset({"brdf": brdf, "brdf_stderr": brdf * xr.DataArray([0.02, 0.04, 5.0], dims="theta_o")})
    assert relative_error(data) == pytest.approx(0.03)  # the dark one does not count


def bright_rays(error, **attrs) -> xr.Dataset:
    """Rays in four directions, of which the last is dark and the one before catches nothing."""
    brdf = xr.DataArray([[[1.0], [0.5], [0.0], [1e-4]]], dims=("theta_i", "theta_o", "wavelength"))
    return xr.Dataset({"brdf": brdf, "brdf_stderr": brdf * np.reshape([*error, 0, 5.0], (1, 4, 1))}, attrs=attrs)


def test_no_chance_error_is_no_error_of_nought():
    """Directions in which chosen facets leave nothing to chance are told apart, never averaged in as 0 %."""
    both, one, none = (bright_rays(e) for e in ((0.02, 0.04), (0.0, 0.04), (0.0, 0.0)))
    assert [relative_error(d) for d in (both, one)] == pytest.approx([0.03, 0.04])
    assert np.isnan(relative_error(none))
    assert [without_chance(d) for d in (both, one, none)] == [0, 0.5, 1]
    said = [largest_error({"rays": d}) for d in (both, one, none)]
    assert said[0] == (
        "The largest known error is the noise of the rays, median standard error 3.0 % of the BRDF where it is bright. "
        "What the theories leave out is not counted here."
    )
    assert "median standard error 4.0 % of the BRDF" in said[1]
    assert "In 50 % of its bright directions the BRDF of the rays has no chance error" in said[1]
    assert said[2].startswith("In all of its bright directions the BRDF of the rays has no chance error")
    assert said[2].endswith("refinement_check = true tells how much.")
    assert not any(" 0 %" in s for s in said)
    change = "0.031, the RMS relative change of brdf on twice the refinement"
    assert f"on finer facets it changes by {change}." in largest_error(
        {"rays": bright_rays((0, 0), refinement_change=change)}
    )
    assert largest_error({"rays": none.drop_vars("brdf_stderr")}) is None


def test_chosen_facets_say_what_their_error_leaves_out():
    surface = vg.surface.gaussian(0.1, 5.0, (32, 32), 1.0, seed=1)  # so gentle that no light is stopped
    gonio = Gonioreflectometer([0], range(-20, 21, 5), aperture_deg=3)
    data = gonio.measure(surface, RayOptics("Al", [550], rays=2000))
    assert data.attrs["estimator"] == "facets"
    assert without_chance(data) == 1
    assert "exactly 0 where all light comes from known facets" in data["brdf_stderr"].attrs["comment"]


def test_mirror_images_are_named_in_the_verdict():
    edges = "mirrored 2 × 2 supercell at θ_i = 60°, else guard band"
    assert edges in mirrored_sides(bright_rays((0.1, 0.1), edges=edges))
    assert mirrored_sides(bright_rays((0.1, 0.1), edges="guard band")) is None
    turned = bright_rays((0.1, 0.1), edges=edges, edges_caution="rays at θ_i = 60°: slopes lean to one side")
    assert mirrored_sides(turned) is None
    for plan in ({}, {"warnings": ["rays at θ_i = 60°: slopes lean to one side"]}):
        found = cautions(SimpleNamespace(results={"rays": turned}, plan=plan))
        assert found == ["Rays at θ_i = 60°: slopes lean to one side."]
