"""The surface's summary: what it says equals what can be worked out from the heights, and it fits into a file."""

from __future__ import annotations

import numpy as np
import pytest

import vgonio as vg
from vgonio.measure.surface_summary import surface_dataset


@pytest.fixture(scope="module")
def rough():
    return vg.surface.gaussian(rms_um=0.5, correlation_um=4.0, shape=(300, 520), pitch_um=0.5, seed=4)


def test_picture_is_small_and_its_coordinates_belong_to_it(rough):
    data = surface_dataset(rough)
    assert max(data["z"].shape) <= 256
    for y, x in ((0, 0), (40, 100), (-1, -1)):
        iy = np.flatnonzero(np.isclose(rough.y, data["y"][y]))[0]
        ix = np.flatnonzero(np.isclose(rough.x, data["x"][x]))[0]
        assert float(data["z"][y, x]) == pytest.approx(rough.z[iy, ix], abs=1e-6)  # float32
    detail = data["z_detail"]
    assert float(detail["x_detail"].diff("x_detail").max()) == pytest.approx(rough.dx)
    iy, ix = (np.flatnonzero(np.isclose(c, detail[n][0]))[0] for c, n in ((rough.y, "y_detail"), (rough.x, "x_detail")))
    np.testing.assert_allclose(detail, rough.z[iy : iy + detail.shape[0], ix : ix + detail.shape[1]], atol=1e-6)


def test_a_small_field_is_kept_whole():
    small = vg.surface.gaussian(rms_um=0.5, correlation_um=4.0, shape=(64, 80), pitch_um=0.5, seed=4)
    data = surface_dataset(small)
    assert "z_detail" not in data
    np.testing.assert_allclose(data["z"], small.z, atol=1e-6)


def test_densities_have_integral_one_and_the_right_spread(rough):
    """Variances of binned samples exceed the samples' own by width²/12 (Sheppard); for 101 bins below 0.2 %."""
    data = surface_dataset(rough)
    for density, coordinate, variance in (
        ("height_density", "height", data.attrs["Sq"] ** 2),
        ("slope_density", "slope", data.attrs["alpha"] ** 2 / 2),
    ):
        x, p = data[coordinate].values, data[density].values
        step = x[1] - x[0]
        assert np.sum(p) * step == pytest.approx(1.0, abs=1e-12)
        assert np.sum(p * x**2) * step == pytest.approx(variance, rel=3e-3)


def test_psd_of_a_sinusoid_peaks_at_its_frequency_and_holds_its_power():
    """∫ PSD df over positive f is half of Sq² = a²/2, for a periodic field to rounding."""
    grating = vg.surface.sinusoid(period_um=2, amplitude_um=0.1, shape=(8, 400), pitch_um=0.05)
    data = surface_dataset(grating)
    f, p = data["frequency"].values, data["psd"].values
    assert f[p.argmax()] == pytest.approx(0.5)
    assert np.sum(p) * (f[1] - f[0]) == pytest.approx(0.1**2 / 4, rel=1e-9)
    assert data["psd"].attrs["units"] == "um3"


def test_everything_has_units_and_the_summary_survives_a_file(rough, tmp_path):
    import xarray as xr

    data = surface_dataset(rough)
    assert all("units" in data[name].attrs for name in data.variables)
    path = vg.save(xr.DataTree.from_dict({"surface": data}), tmp_path / "result.nc")
    assert path.stat().st_size < 1_000_000
    again = vg.open(path)["surface"].to_dataset()
    xr.testing.assert_allclose(again, data)
    assert again.attrs["Sq"] == data.attrs["Sq"]


def test_missing_points_leave_out_the_spectrum(rough):
    z = rough.z.copy()
    z[10:20, 30:40] = np.nan
    data = surface_dataset(vg.surface.Heightfield(z, 0.5))
    assert "psd" not in data
    assert data.attrs["missing"] == 100
    assert np.isfinite(data["height_density"]).all()


def test_a_flat_surface_has_a_summary():
    data = surface_dataset(vg.surface.flat((32, 32), 1.0))
    assert data.attrs["Sq"] == 0.0
