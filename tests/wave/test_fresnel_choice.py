"""Fresnel at the half vector and at each facet."""

from __future__ import annotations

import numpy as np
import pytest

import vgonio as vg
from vgonio.errors import InputError
from vgonio.materials import material
from vgonio.surface import Heightfield
from vgonio.wave import Kirchhoff


def gaussian(sigma: float, correlation: float, side: float, pitch: float = 0.5) -> Heightfield:
    n = round(side / pitch)
    return vg.surface.gaussian(rms_um=sigma, correlation_um=correlation, shape=(n, n), pitch_um=pitch, seed=1)


def flat() -> Heightfield:
    return Heightfield(np.zeros((32, 32)), 2.5, periodic=True)


@pytest.mark.parametrize("polarisation", ["unpolarised", "s", "p"])
def test_flat_mirror(polarisation):
    """On a plane the facet's normal is the macroscopic one at every direction: the lobe has R(θ_i) throughout."""
    gonio = vg.measure.Gonioreflectometer([50], [-50], aperture_deg=4, coherence_um=20, polarisation=polarisation)
    data = gonio.measure(flat(), Kirchhoff("SiO2", [450, 650], fresnel="local"))
    expected = material("SiO2").reflectance(np.cos(np.deg2rad(50)), [450, 650], polarisation)
    power = data.brdf[0, 0].values * gonio.detector.projected_solid_angle[0]
    assert np.allclose(power, expected, rtol=2e-3)  # as the test of the half vector: the lobe's wings
    assert data.attrs["fresnel"] == "at each facet"


@pytest.mark.parametrize("profile", [False, True])
def test_gentle_slopes_agree_with_the_half_vector(profile):
    """Where the phase is stationary the normal is the half vector; glass at 60°, facets of 3° either side."""
    surface = gaussian(0.25, 8.0, side=64)
    if profile:
        surface = Heightfield(np.tile(surface.z[:1], (2, 1)), 0.5, periodic=True)
    gonio = vg.measure.Gonioreflectometer([60], range(-68, -51, 4), aperture_deg=8, coherence_um=10)
    half, local = (gonio.measure(surface, Kirchhoff("SiO2", [500], fresnel=f)).brdf[0, :, 0] for f in ("half", "local"))
    # R changes by 40 % over these directions, and the two ways must not differ by more than a tenth of that at the peak
    reflectance = material("SiO2").reflectance(np.cos(np.deg2rad([56, 64])), 500)
    assert reflectance[1] / reflectance[0] > 1.4
    assert float(abs(half - local).max() / half.max()) < 0.04


@pytest.mark.parametrize("phi", [0, 90])
def test_a_tilted_plane_reflects_by_its_own_angle(phi):
    """A plane tilted by 20° under 60°: mirror direction −20°, angle on the facet 40°, to 1 % (the lobe's width)."""
    z = np.tile(np.arange(96) * 0.5, (96, 1)) * -np.tan(np.deg2rad(20))
    tilted = Heightfield(z if phi == 0 else z.T, 0.5)
    expected = {p: material("SiO2").reflectance(np.cos(np.deg2rad(40)), 500, p) for p in "sp"}
    for polarisation in "sp":
        gonio = vg.measure.Gonioreflectometer(
            [60], [-20], aperture_deg=8, coherence_um=6, polarisation=polarisation, phi_i_deg=phi
        )
        perfect, local = (
            gonio.measure(tilted, Kirchhoff(name, [500], fresnel="local")).brdf.item() for name in ("perfect", "SiO2")
        )
        assert local / perfect == pytest.approx(float(expected[polarisation]), rel=1e-2)


def test_perfect_reflector_is_indifferent():
    surface = gaussian(0.4, 3.0, side=24)
    gonio = vg.measure.Gonioreflectometer([30], [-60, -30, 0, 30], aperture_deg=4, coherence_um=5)
    half, local = (gonio.measure(surface, Kirchhoff("perfect", [500], fresnel=f)).brdf for f in ("half", "local"))
    assert np.allclose(half, local, rtol=1e-6, atol=2e-3 * float(half.max()))


def test_bad_input():
    with pytest.raises(InputError, match="did you mean 'local'"):
        Kirchhoff(fresnel="locl")
    with pytest.raises(InputError, match="scatter"):
        Kirchhoff(fresnel="local").orders(flat(), [0])
