"""Errors of diffraction efficiencies: the table of `wave.trust`, what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio.errors import InputError
from vgonio.wave import trust


def orders(values, polarised: bool = False, first: int = -1, theta_i: float = 0.0) -> xr.Dataset:
    """(theta_i, order, wavelength[, polarisation]) with a single angle and wavelength."""
    values = np.asarray(values, float)[None, :, None]
    dims = ("theta_i", "order", "wavelength", "polarisation")[: values.ndim]
    assert polarised == (values.ndim == 4)
    coords = {"theta_i": [theta_i], "order": first + np.arange(values.shape[1]), "wavelength": [550.0]}
    return xr.Dataset({"efficiency": (dims, values)}, coords | ({"polarisation": ["TE", "TM"]} if polarised else {}))


def test_against_sums_by_hand():
    rigorous = orders([[0.1, 0.3], [0.4, 0.6], [0.2, 0.0]], polarised=True)  # means 0.2, 0.5, 0.1
    scalar = orders([0.05, 0.25, 0.45, 0.1], first=-2)  # an order more, where the rigorous one has nothing
    np.testing.assert_allclose(vg.compare.order_errors(rigorous, scalar), (0.05 + 0.05 + 0.05 + 0.0) / 0.8, rtol=1e-14)
    per_polarisation = vg.compare.order_errors(rigorous, 2 * rigorous)
    np.testing.assert_allclose(per_polarisation, 1.0, rtol=1e-14)
    assert per_polarisation.dims == ("theta_i", "wavelength", "polarisation")


def test_is_the_error_of_the_table_of_trust():
    """A line of the table is aluminium of McPeak; its rigorous values are Chandezon's, six digits."""
    case = next(c for c in trust.cases() if c.shape == "sinusoidal" and c.theta_i_deg == 31 and c.slope > 0.1)
    nm = 100 / case.depth  # all sinusoids of the table are 0.1 µm deep
    period = case.period * nm * 1e-3
    grating = vg.surface.sinusoid(period, 0.05, shape=(1, 200), pitch_um=period / 200)
    rigorous = vg.wave.FullWave("Al:McPeak", nm, tol=1e-5).orders(grating, [31.0])
    for theory, error in case.error.items():
        scalar = vg.wave.Kirchhoff("Al:McPeak", nm, theory=theory, tol=1e-6).orders(grating, [31.0])
        np.testing.assert_allclose(float(vg.compare.order_errors(rigorous, scalar).squeeze()), error, atol=1e-5)


def test_what_is_refused():
    with pytest.raises(InputError, match="predicted has no variable 'efficiency', but brdf"):
        vg.compare.order_errors(orders([1.0]), xr.Dataset({"brdf": 1}))
    with pytest.raises(InputError, match="same angles"):
        vg.compare.order_errors(orders([1.0]), orders([1.0], theta_i=10))
