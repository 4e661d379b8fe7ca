"""White furnace: a loss-free surface gives back all that falls on it, whatever its slopes and the angle, by default.

Shares by number of reflections, absorbed and lost power are tallied each by itself; their sum is 1 to rounding.
"""

from __future__ import annotations

import numpy as np
import pytest

from vgonio.geometric import RayOptics
from vgonio.measure import Gonioreflectometer
from vgonio.surface import Heightfield, gaussian, lamellar, sandblasted

ANGLES = [0, 30, 60, 80, 89]
RAYS = 8000  # a loss of 1e-3 is 8 of them


def gaussian_of_slope(slope: float, periodic: bool) -> Heightfield:
    """One-axis RMS slope of the mesh, up to 56° and facets beyond 80°."""
    made = gaussian(rms_um=1.0, correlation_um=8.0, shape=(64, 64), pitch_um=1.0, seed=1)
    z = made.z * slope / np.sqrt(np.mean((np.roll(made.z, -1, axis=1) - made.z) ** 2))
    return Heightfield(z, 1.0, periodic=periodic)


def furnace(surface: Heightfield, agreement, **more):
    solver = RayOptics("perfect", rays=RAYS, seed=1, **more)
    data = Gonioreflectometer(ANGLES, range(-80, 81, 20)).measure(surface, solver)
    total = data.energy_by_bounce.sum("bounce") + data.energy_absorbed + data.energy_lost
    agreement(
        "energy of rays, loss-free, 0 … 89°, slopes 0 … 1.5, walls up to four times as deep as wide",
        "1",
        total - 1,
        1e-6,
    )
    agreement("the same, share of rays that get lost (of 8,000)", "0", data.energy_lost, 1e-3)
    assert abs(data.energy_absorbed).max() < 1e-9
    assert data.energy_by_bounce.min() >= 0
    return data


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("slope", [0.0, 0.05, 0.2, 0.5, 1.0, 1.5])
def test_gaussian_surfaces(slope, periodic, agreement):
    data = furnace(gaussian_of_slope(slope, periodic), agreement)
    expected = "periodic" if periodic else ("guard band" if slope == 0 else "mirrored")
    assert data.attrs["edges"].startswith(expected)


@pytest.mark.parametrize("periodic", [True, False])
def test_sandblasted_surfaces(periodic, agreement):
    made = sandblasted(shape=(96, 96), pitch_um=1.0, seed=1)
    furnace(made.replace(periodic=periodic), agreement)


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("depth", [0.5, 2.0, 8.0])
def test_lamellar_surfaces(depth, periodic, agreement):
    """Vertical walls, up to four times as deep as wide: at 89° light goes down and up again by 460 reflections."""
    made = lamellar(period_um=4.0, depth_um=depth, shape=(8, 64), pitch_um=0.25)
    furnace(made.replace(periodic=periodic), agreement)


def test_divergent_light_and_mueller_matrices_lose_nothing():
    gonio = Gonioreflectometer([60], [-60], divergence_deg=4)
    data = gonio.measure(gaussian_of_slope(1.0, True), RayOptics("perfect", rays=RAYS, polarised=True))
    total = data.energy_by_bounce.sum("bounce") + data.energy_absorbed + data.energy_lost
    assert abs(total - 1).max() < 1e-6
    assert data.energy_lost.max() < 1e-3


@pytest.mark.parametrize("name", ["Al", "SiO2", "Al2O3 4 nm on Al"])
def test_absorbing_surfaces_add_up_too(name):
    data = Gonioreflectometer(ANGLES, [0]).measure(gaussian_of_slope(1.0, True), RayOptics(name, [450, 650], rays=RAYS))
    total = data.energy_by_bounce.sum("bounce") + data.energy_absorbed + data.energy_lost
    assert abs(total - 1).max() < 1e-6
    assert data.energy_lost.max() < 1e-3
    assert data.energy_absorbed.min() > 0.01
