"""Slopes that lean to one side: closed forms of ridges, and none where chance alone makes them."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio.surface import Heightfield, blazed, gaussian, sinusoid
from vgonio.surface.mesh import mirrored
from vgonio.surface.symmetry import DIRECTIONS, leaning


@pytest.mark.parametrize("share", [0.6, 0.8, 0.9])
def test_ridges_against_the_closed_form(share):
    """Flanks of shares a and 1 − a have slopes 1/a and −1/(1 − a): ⟨s|s|⟩/⟨s²⟩ = 1 − 2a."""
    phase = (np.arange(1001) / 100) % 1
    z = np.where(phase < share, phase / share, (1 - phase) / (1 - share))
    for field, name in ((np.tile(z, (40, 1)), "along x"), (np.tile(z[:, None], (1, 40)), "along y")):
        found = leaning(Heightfield(field, 0.1))
        assert list(found) == [name]
        assert found[name] == pytest.approx(1 - 2 * share, abs=1e-9)


def test_oblique_ridges_lean_across_the_axes():
    y, x = np.mgrid[:120, :120] * 0.1
    # both slopes are the same function; of falling ridges they are taken a cell apart, 0.3 of a radian
    for sign, expected in ((1, 1.0), (-1, -np.cos(0.3))):
        found = leaning(Heightfield(np.sin(3 * (x + sign * y)), 0.1))
        assert list(found) == [DIRECTIONS[2]]
        assert found[DIRECTIONS[2]] == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("length", [1.0, 3.0, 8.0])
def test_random_surfaces_lean_to_no_side(length):
    """By 10 seeds each of many and of few structures on a side of 45 µm: one by chance at most."""
    found = [leaning(gaussian(0.4, length, (150, 150), 0.3, seed=s).replace(periodic=False)) for s in range(10)]
    assert sum(bool(f) for f in found) <= 1


def test_mirror_images_lean_to_no_side():
    leaning_one = blazed(5.0, 10.0, shape=(20, 100), pitch_um=0.5)
    assert abs(leaning(leaning_one)["along x"]) > 0.5
    assert leaning(mirrored(leaning_one)) == {}


@pytest.mark.parametrize("shape", [(1, 60), (3, 60), (1, 2), (2, 2)])
def test_planes_and_small_fields(shape):
    assert leaning(Heightfield(np.zeros(shape), 0.5)) == {}
    profile = np.sin(2 * np.pi * np.arange(shape[1]) / 20)
    assert leaning(Heightfield(np.tile(profile, (shape[0], 1)), 0.5)) == {}


def test_a_sinusoid_leans_to_no_side_and_missing_points_do_not_matter():
    assert leaning(sinusoid(5.0, 0.5, shape=(20, 100), pitch_um=0.5)) == {}
    z = np.array(blazed(5.0, 10.0, shape=(20, 100), pitch_um=0.5).z)
    z[3, 7] = np.nan
    assert "along x" in leaning(Heightfield(z, 0.5))
