"""What figures and tables of a report take from a result, on numbers that can be written down."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from vgonio import models
from vgonio.directions import Detector
from vgonio.report.quantities import bounce_shares, direction, incidence, multiple_share, relative_error, tallies


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
