"""Arguments of the wrong kind are an InputError from every solver, never a bare TypeError or OverflowError."""

from __future__ import annotations

import math

import pytest

import vgonio as vg
from vgonio.errors import InputError

RAYS = [("rays", "a"), ("rays", None), ("rays", math.nan), ("rays", 1e23), ("max_bounces", math.inf), ("bounces", 1.5),
        ("tol", "a"), ("tol", 0), ("seed", None), ("seed", -1), ("threads", -1)]  # fmt: skip
WAVES = [("windows", 1.5), ("windows", "a"), ("tol", None), ("tol", "a"), ("seed", -1), ("seed", "a")]


@pytest.mark.parametrize(("name", "value"), RAYS)
def test_rays(name, value):
    with pytest.raises(InputError, match=name):
        vg.geometric.RayOptics(**{name: value})


@pytest.mark.parametrize(("name", "value"), WAVES)
def test_waves(name, value):
    with pytest.raises(InputError, match=name):
        vg.wave.Kirchhoff(**{name: value})


@pytest.mark.parametrize(("name", "value"), [*WAVES[:4], ("polarisation", "s"), ("wavelength_nm", "blue")])
def test_full_wave(name, value):
    with pytest.raises(InputError, match=name):
        vg.wave.FullWave(**{name: value})


ITERATED = [*WAVES, ("bounces", 0), ("bounces", "a"), ("window_um", "wide"), ("window_um", math.inf), ("beam", 3),
            ("points_per_wavelength", "a"), ("wavelength_nm", "blue")]  # fmt: skip


@pytest.mark.parametrize(("name", "value"), ITERATED)
def test_iterated_kirchhoff(name, value):
    with pytest.raises(InputError, match=name):
        vg.wave.IteratedKirchhoff(**{name: value})


def test_whole_numbers_may_be_floats():
    assert vg.geometric.RayOptics(rays=1e5).rays == 100_000
