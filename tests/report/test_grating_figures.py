"""Figures of gratings: every order at its height, polarisations as a bar, errors of theories in per cent."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio.report.grating_figures import LEAST

ANGLES, WAVELENGTHS = [0, 40], [520, 700]
SURFACE = vg.surface.sinusoid(3.0, 0.1, shape=(1, 60), pitch_um=0.05)


@pytest.fixture(scope="module")
def found() -> dict[str, xr.Dataset]:
    return {
        "full-wave": vg.wave.FullWave("Al", WAVELENGTHS).orders(SURFACE, ANGLES),
        "kirchhoff": vg.wave.Kirchhoff("Al", WAVELENGTHS).orders(SURFACE, ANGLES),
    }


def test_orders_stand_at_their_efficiency(found):
    figure = vg.report.plot_orders(found, wavelength_nm=690)
    assert [ax.get_title(loc="left") for ax in figure.axes] == ["θᵢ = 0°", "θᵢ = 40°"]
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["full wave, TE and TM", "Kirchhoff"]
    for ax, angle in zip(figure.axes, ANGLES):
        dots = next(line for line in ax.lines if line.get_marker() == "o")
        expected = found["kirchhoff"].efficiency.sel(theta_i=angle, wavelength=700)
        np.testing.assert_array_equal(np.round(dots.get_xdata() - 0.2).astype(int), expected.order)
        np.testing.assert_array_equal(dots.get_ydata(), expected.where(expected >= LEAST))
        both = found["full-wave"].efficiency.sel(theta_i=angle, wavelength=700)
        both = both[(both.max("polarisation") >= LEAST).values].clip(LEAST)
        bars = np.array([path.vertices[:, 1] for path in ax.collections[0].get_paths()])
        np.testing.assert_array_equal(bars, np.sort(both.values, axis=1))


def test_one_result_by_itself_is_called_by_its_theory(found):
    figure = found["kirchhoff"].vgonio.plot_orders()
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["Kirchhoff"]


def test_errors_are_drawn_in_per_cent():
    x = xr.DataArray([0.1, 0.2, 0.4], dims="depth", attrs={"long_name": "depth of the grating", "units": "um"})
    values = np.array([[0.01, 0.02, 0.3], [0.02, 0.1, 0.6]])
    errors = xr.DataArray(values, {"theta_i": [0, 30], "depth": x}, ("theta_i", "depth"))
    figure = vg.report.figures.theory_errors({"kirchhoff": errors, "harvey-shack": 2 * errors})
    for ax, row in zip(figure.axes, values):
        np.testing.assert_allclose(ax.lines[0].get_ydata(), 100 * row)
        np.testing.assert_allclose(ax.lines[1].get_ydata(), 200 * row)
        np.testing.assert_allclose(ax.lines[2].get_ydata(), 5)  # the limit
    assert figure.get_supxlabel() == "depth of the grating (µm)"
