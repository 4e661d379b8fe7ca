"""Sides of finite samples: mirror images only where light is lost otherwise, and said where they change the surface."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from vgonio.directions import Incoming
from vgonio.errors import VgonioWarning
from vgonio.geometric import RayOptics
from vgonio.geometric.microfacet import masking
from vgonio.geometric.sides import MIRROR, mirrored_at
from vgonio.measure import Gonioreflectometer
from vgonio.surface import Heightfield, gaussian

OUT = range(-80, 81, 10)


def ridges(height: float, period: float, roughness: float, n: int = 150, pitch: float = 0.3) -> Heightfield:
    """Flanks of 20 % and 80 % of a period, with roughness on them."""
    phase = (np.arange(n) * pitch / period) % 1
    noise = gaussian_filter(np.random.default_rng(1).standard_normal((n, n)), 2, mode="wrap")
    profile = np.where(phase < 0.8, phase / 0.8, (1 - phase) / 0.2)
    return Heightfield(height * profile + roughness * noise / noise.std(), pitch)


def lopsided(brdf: np.ndarray) -> float:
    """Σ|f(θ) − f(−θ)| / Σ(f + f): 0 of a palindrome, 1 where one side is dark wherever the other is bright."""
    return float(np.abs(brdf - brdf[::-1]).sum() / (brdf + brdf[::-1]).sum())


def measured(surface, theta_i, rays=50_000, **options):
    gonio = Gonioreflectometer(theta_i, OUT, aperture_deg=8)
    return gonio.measure(surface, RayOptics("Al", [550], rays=rays, **options))


def test_a_small_asymmetric_sample_keeps_its_asymmetry(agreement):
    """Light lost through its sides was reason enough to mirror it, at 0° too; against the same ridges repeated."""
    sample = ridges(1.5, 9.0, 0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("error", VgonioWarning)
        data = measured(sample, [0, 60])
    assert data.attrs["edges"] == "guard band"
    assert "edges_caution" not in data.attrs
    assert float(data.energy_lost.max()) < 0.01
    repeated = measured(sample.replace(periodic=True), [0, 60])
    lean = [lopsided(d.brdf.isel(theta_i=0, wavelength=0).values) for d in (data, repeated)]
    assert lean[1] > 0.5
    # five periods, and of the roughness on them the middle half: of a like lean, not of the same values
    agreement("lean of the BRDF of five ridges, guard band", "the same repeated", lean[0] - lean[1], 0.1)


def test_mirror_images_are_taken_at_those_angles_only_that_need_them():
    rough = gaussian(0.6, 3.0, (100, 100), 0.3, seed=1).replace(periodic=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error", VgonioWarning)  # its slopes lean to no side: nothing to be told
        data = measured(rough, [0, 60], rays=5000, statistics=True)
        alone = measured(rough, [0], rays=5000)
    assert data.attrs["edges"] == f"{MIRROR} at θ_i = 60°, else guard band"
    assert alone.attrs["edges"] == "guard band"
    np.testing.assert_array_equal(data.brdf[0], alone.brdf[0])


def test_a_run_says_where_mirror_images_change_the_surface():
    sample = ridges(3.0, 4.0, 0.1)  # at 85° no ray can start inside
    with pytest.warns(VgonioWarning, match=r"θ_i = 85°.*lean to one side along x \(5\d %\).*periodic = true"):
        data = measured(sample, [0, 85], rays=5000)
    assert data.attrs["edges"] == f"{MIRROR} at θ_i = 85°, else guard band"
    assert "θ_i = 85°" in data.attrs["edges_caution"]
    assert lopsided(data.brdf[0, :, 0].values) > 0.5
    with pytest.warns(VgonioWarning, match="at 6 of 6 θ_i, 0° … 50°"):
        assert measured(sample, range(0, 60, 10), rays=1000, edges="mirror").attrs["edges"] == MIRROR


def test_the_limit_of_reflections_is_no_loss_through_the_sides():
    """Single reflections alone: what is reflected again is lost either way, and no reason for mirror images."""
    with pytest.warns(VgonioWarning, match="max_bounces = 1"):
        data = measured(ridges(3.0, 4.0, 0.1), [0], rays=5000, max_bounces=1)
    assert float(data.energy_lost.max()) > 0.05
    assert data.attrs["edges"] == "guard band"


@pytest.mark.parametrize("edges", ["auto", "guard", "mirror"])
@pytest.mark.parametrize("periodic", [True, False])
def test_what_is_foretold_is_done(edges, periodic):
    sample = ridges(3.0, 4.0, 0.1).replace(periodic=periodic)
    incoming = Incoming([0, 85])
    found = mirrored_at(RayOptics("Al", [550], edges=edges), sample, incoming)
    assert found.tolist() == [not periodic and edges == "mirror", not periodic and edges != "guard"]


def test_microfacets_say_so_as_well():
    sample = ridges(1.0, 9.0, 0.05, n=60)
    with pytest.warns(VgonioWarning, match=r"microfacets: .* lean to one side along x \(\d\d %\)"):
        found = masking(sample, [30], points=100)
    assert found.attrs["edges"] == MIRROR
    with warnings.catch_warnings():
        warnings.simplefilter("error", VgonioWarning)
        masking(sample.replace(periodic=True), [30], points=100)
        masking(gaussian(0.3, 3.0, (60, 60), 0.3, seed=1).replace(periodic=False), [30], points=100)
