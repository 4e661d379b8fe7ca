"""Conversions of units, by their definitions."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio.errors import InputError
from vgonio.units import MICROMETRES, degrees, meant_nm, nm_to_um, radians, to_um, wavenumber


def test_lengths_by_their_definitions():
    """Prefixes of the metre; an inch is 25.4 mm, an ångström a tenth of a nanometre."""
    metre = to_um("m")
    assert metre == 1e6
    for unit, share in {"dm": 1e-1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "pm": 1e-12}.items():
        assert to_um(unit) == pytest.approx(share * metre, rel=1e-15)
    assert to_um("in") == pytest.approx(25.4 * to_um("mm"), rel=1e-15)
    assert to_um("Å") == to_um("A") == pytest.approx(0.1 * to_um("nm"), rel=1e-15)
    assert to_um("µm") == to_um("μm") == to_um("um")  # micro sign and Greek mu
    assert len(MICROMETRES) == 12
    with pytest.raises(InputError, match="did you mean 'mm'"):
        to_um("mmm")


def test_angles_and_wavelengths():
    assert np.allclose(radians([180.0, -90.0]), [np.pi, -np.pi / 2], rtol=1e-15)
    assert np.allclose(degrees(radians([12.5, 271.0])), [12.5, 271.0], rtol=1e-15)
    assert nm_to_um(550.0) == pytest.approx(0.55)
    assert wavenumber(500.0) == pytest.approx(4 * np.pi, rel=1e-15)  # rad/µm


@pytest.mark.parametrize(
    ("given", "low", "high", "meant"),
    [(0.55, 400, 700, "550"), (0.4, 400, 700, "400"), (0.7, 400, 700, "700"), (1.55, 400, 2000, "1550")],
)
def test_micrometres_for_nanometres(given, low, high, meant):
    assert meant_nm(given, low, high) == f": wavelengths are in nm, was {meant} meant?"


@pytest.mark.parametrize("given", [0.399, 0.701, 0.0, -0.55, 550.0, float("nan"), float("inf")])
def test_what_is_outside_in_micrometres_too_is_left_alone(given):
    assert meant_nm(given, 400, 700) == ""
