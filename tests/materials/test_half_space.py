"""Fresnel's equations at the ends of their range."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio.errors import MaterialError
from vgonio.materials import fresnel, material


@pytest.mark.parametrize("index", [1e-6 + 1e3j, 1e3, 1e-6, 1.0, 1.0 + 1e-12j, 0.9, 1.5])
def test_fresnel_stays_within_one_up_to_grazing(index):
    """A passive half-space reflects between nothing and all: the slack is the rounding of a few operations."""
    cos = np.array([0.0, 1e-300, 1e-12, 1e-3, 0.5, 1.0])
    for r in fresnel(cos, index):
        assert np.all(np.isfinite(r))
        assert np.all(np.abs(r) <= 1 + 1e-9)


def test_an_interface_that_is_none_reflects_nothing():
    for r in fresnel(np.array([0.0, 0.3, 1.0]), 1.0):
        np.testing.assert_allclose(r, 0, atol=1e-12)  # rounding of a root


def test_what_people_call_a_material_leads_to_its_symbol():
    with pytest.raises(MaterialError, match="did you mean 'Al'"):
        material("Aluminium")
    with pytest.raises(MaterialError, match="was 550 meant"):
        material("Al").check([0.55])
