"""Alignment and error figures against numbers worked out by hand."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

from vgonio.compare import align, nrmse, nse, rmse
from vgonio.dataset import label
from vgonio.errors import FileFormatError, InputError


def dataset(theta_i, theta_o, wavelength, values=None, **more) -> xr.Dataset:
    """A BRDF that is linear in every coordinate unless `values` are given."""
    theta_i, theta_o, wavelength = (np.asarray(v, float) for v in (theta_i, theta_o, wavelength))
    if values is None:
        values = 1 + 1e-2 * theta_i[:, None, None] + 1e-3 * theta_o[None, :, None] + 1e-3 * wavelength[None, None, :]
    dims = ("theta_i", "theta_o", "wavelength")
    coords = {"theta_i": theta_i, "theta_o": theta_o, "wavelength": wavelength}
    return label(xr.Dataset({"brdf": (dims, values), **more}, coords=coords))


def hemisphere(shift_deg: float = 0.0) -> xr.Dataset:
    theta, phi = np.array([0.0, 30, 30]), np.array([0.0, 0, 180])
    return xr.Dataset(
        {"brdf": (("theta_i", "cell", "wavelength"), np.ones((1, 3, 2)))},
        coords={
            "theta_i": [0.0],
            "wavelength": [500.0, 600.0],
            "cell": [0, 1, 2],
            "theta_o": ("cell", theta + shift_deg),
            "phi_o": ("cell", phi),
        },
    )


def test_common_angles_are_sorted_and_values_stay_with_them():
    a = dataset([60, 0, 30], [10, -10, 0, 20], [600, 500])
    b = dataset([30.0004, 45, 60], [0, 20, 40], [500, 600])
    x, y = align(a, b)
    assert x.theta_i.values.tolist() == y.theta_i.values.tolist() == [30, 60]
    assert x.theta_o.values.tolist() == y.theta_o.values.tolist() == [0, 20]
    assert x.wavelength.values.tolist() == y.wavelength.values.tolist() == [500, 600]
    # both hold the same linear function, b at an angle that is 0.0004° off
    np.testing.assert_allclose(x.brdf, y.brdf, atol=1e-5)


def test_the_denser_spectrum_is_interpolated_on_the_sparser():
    a = dataset([0], [0], np.arange(400, 701, 10))
    b = dataset([0], [0], [350, 455, 550, 655, 800])
    for x, y in (align(a, b), align(b, a)[::-1]):
        assert x.wavelength.values.tolist() == [455, 550, 655]
        np.testing.assert_allclose(x.brdf, y.brdf, rtol=1e-14)  # linear: interpolation is exact
        assert (x.attrs["wavelengths_interpolated"], y.attrs["wavelengths_interpolated"]) == (2, 0)


def test_a_single_wavelength_takes_its_value_from_the_spectrum():
    x, y = align(dataset([0], [0], [400, 500]), dataset([0], [0], [470]))
    assert x.wavelength.values.tolist() == [470]
    assert float(x.brdf.squeeze()) == pytest.approx(float(y.brdf.squeeze()), rel=1e-14)


def test_a_gap_beside_a_common_wavelength_does_not_spread():
    values = np.array([[[1.0, np.nan, 3.0, 4.0, 5.0]]])
    a = dataset([0], [0], [400, 450, 500, 550, 600], values)
    x, _ = align(a, dataset([0], [0], [400, 500, 575]))
    assert x.brdf.values.ravel().tolist() == [1.0, 3.0, 4.5]
    x, _ = align(a, dataset([0], [0], [425, 500]))
    assert np.isnan(x.brdf.values.ravel()).tolist() == [True, False]


def test_standard_errors_come_along_and_other_variables_do_not():
    sigma = (("theta_i", "theta_o", "wavelength"), np.full((1, 1, 2), 0.1))
    a = dataset([0], [0], [400, 500], brdf_stderr=sigma, extra=sigma)
    x, y = align(a, dataset([0], [0], [450]))
    assert set(x.data_vars) == {"brdf", "brdf_stderr"}
    assert set(y.data_vars) == {"brdf"}
    assert float(x.brdf_stderr.squeeze()) == pytest.approx(0.1)


@pytest.mark.parametrize(
    "other, message",
    [
        (dataset([10], [0, 20], [500, 600]), "no theta_i in common"),
        (dataset([0], [5], [500, 600]), "no theta_o in common"),
        (dataset([0], [0], [700, 800]), "no wavelengths in common"),
        (hemisphere(), "hemisphere"),
        (dataset([0], [0], [500]).expand_dims(theory=2), "select one entry"),
    ],
)
def test_nothing_in_common_is_a_clear_error(other, message):
    with pytest.raises(InputError, match=message):
        align(dataset([0], [0, 20], [500, 600]), other)


def test_hemispheres_need_the_same_cells():
    x, _ = align(hemisphere(), hemisphere())
    assert x.sizes == {"theta_i": 1, "cell": 3, "wavelength": 2}
    assert float(rmse(hemisphere(), hemisphere())) == 0
    with pytest.raises(InputError, match="different cells"):
        align(hemisphere(), hemisphere(1.0))


def test_no_brdf_is_a_clear_error():
    with pytest.raises(FileFormatError, match="brdf"):
        align(dataset([0], [0], [500]).rename(brdf="f"), dataset([0], [0], [500]))


def test_figures_by_hand():
    r = dataset([0], [0, 10], [500, 600], np.array([[[1.0, 2.0], [3.0, 4.0]]]))
    p = dataset([0], [0, 10], [500, 600], np.array([[[1.5, 2.0], [3.0, 2.0]]]))
    np.testing.assert_allclose(nse(r, p), [[[-0.5, 0], [0, 0.5]]])
    # differences 0.5, 0, 0, 2: mean square 4.25/4, mean of the reference 2.5
    assert float(rmse(r, p)) == pytest.approx(np.sqrt(4.25 / 4))
    assert float(nrmse(r, p)) == pytest.approx(np.sqrt(4.25 / 4) / 2.5)
    np.testing.assert_allclose(rmse(r, p, ("theta_i", "theta_o")), [np.sqrt(0.125), np.sqrt(2)])
    np.testing.assert_allclose(nrmse(r, p, ("theta_i", "theta_o")), [np.sqrt(0.125) / 2, np.sqrt(2) / 3])
    np.testing.assert_allclose(rmse(r, p, "wavelength"), [[np.sqrt(0.125), np.sqrt(2)]])
    assert rmse(r, p, "wavelength").dims == ("theta_i", "theta_o")
    for figure, unit in ((nse(r, p), "1"), (rmse(r, p), "sr-1"), (nrmse(r, p), "1")):
        assert figure.attrs["units"] == unit
        assert figure.attrs["long_name"]
        assert figure.attrs["values_left_out"] == 0
    with pytest.raises(InputError, match="bounce"):
        rmse(r, p, "bounce")


def test_gaps_are_left_out_of_both_and_counted():
    r = dataset([0], [0, 10], [500, 600], np.array([[[1.0, np.nan], [3.0, 0.0]]]))
    p = dataset([0], [0, 10], [500, 600], np.array([[[2.0, 2.0], [np.nan, 1.0]]]))
    assert float(rmse(r, p)) == pytest.approx(1.0)
    assert rmse(r, p).attrs["values_left_out"] == 2
    # the mean of the reference is that of 1 and 0 alone, not of the 3 that has no partner
    assert float(nrmse(r, p)) == pytest.approx(2.0)
    error = nse(r, p)
    assert float(error[0, 0, 0]) == -1
    assert error.attrs["values_left_out"] == 3  # two gaps and one division by zero
    empty = p.where(False)
    assert np.isnan(float(rmse(r, empty)))
    assert np.isnan(float(nrmse(0 * r, p)))


def test_importing_the_package_stays_light():
    code = "import vgonio.compare, sys; print([m for m in ('colour', 'lmfit', 'matplotlib') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
