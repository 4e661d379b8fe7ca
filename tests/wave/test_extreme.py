"""Waves in extreme cases: no NaN, no negative power, no silent loss of accuracy; where they cannot, the reason."""

from __future__ import annotations

import warnings
from functools import lru_cache

import numpy as np
import pytest

import vgonio as vg
from vgonio.errors import InputError, ToleranceError
from vgonio.surface import Heightfield
from vgonio.wave.coherence import WindowPlan
from vgonio.wave.full_wave import windows as full_wave_windows
from vgonio.wave.iterated.place import Places

ANGLES = range(-80, 81, 20)


def surface(**changes) -> Heightfield:
    made = vg.surface.gaussian(rms_um=0.2, correlation_um=3.0, shape=(48, 48), pitch_um=0.5, seed=1)
    return made.replace(**changes)


def measure(field: Heightfield, wavelength=500.0, tol=1e-3, theta_i=(30,), theta_o=ANGLES, **light):
    light = {"coherence_um": 4} | light
    gonio = vg.measure.Gonioreflectometer(list(theta_i), theta_o, **light)
    with warnings.catch_warnings():
        warnings.simplefilter("error", vg.errors.VgonioWarning)
        data = gonio.measure(field, vg.wave.Kirchhoff("perfect", [wavelength], tol=tol))
    assert np.all(np.isfinite(data.brdf))
    assert float(data.brdf.min()) >= 0
    assert data.attrs["error_achieved"] <= tol
    return data


def test_grazing_pairs():
    data = measure(surface(), theta_i=(-89.9, 89.9), theta_o=[-89.9, 0, 89.9])
    assert data.brdf.sel(theta_i=89.9, theta_o=-89.9).item() > 100  # everything is a mirror at grazing incidence


@pytest.mark.parametrize("ratio", [1e-6, 1e-3, 1.0])
def test_roughness_over_wavelength(ratio):
    """From a mirror to rough; the smooth ones scatter as (σ/λ)² away from the mirror."""
    z = surface().z
    data = measure(surface(z=z / z.std() * ratio * 0.5), theta_o=[-30, 0])
    assert float(data.brdf.sel(theta_o=-30).item()) > float(data.brdf.sel(theta_o=0).item())


def test_smooth_surfaces_scatter_as_the_square_of_their_height():
    z = surface().z
    light = {"theta_o": [-24, -30], "tol": 1e-4}

    def both_signs(f: float) -> float:
        """Surface and its inverse: their interference with the tail of the mirror lobe cancels."""
        return sum(measure(surface(z=z * g), **light).brdf.sel(theta_o=-24).item() for g in (f, -f)) / 2

    none = measure(surface(z=0 * z), **light).brdf.sel(theta_o=-24).item()
    # σ = 2 and 4 nm: the next term is (q_z σ)² < 0.01
    assert np.isclose((both_signs(0.02) - none) / (both_signs(0.01) - none), 4, rtol=0.03)


def test_very_rough_in_wavelengths():
    data = measure(surface(z=surface().z * 25))  # σ/λ = 10, RMS slope 2
    assert float(data.brdf.max()) < 10


def test_a_millimetre_wave_sees_a_mirror():
    """λ = 1 mm over a window of 24 µm: a BRDF all but constant over angles, k²A/(4π²)·C²/(cos cos)."""
    data = measure(surface(), wavelength=1e6, theta_i=(0,), theta_o=[0, 60])
    k = 2 * np.pi / 1e3
    window = data.attrs["coherence_um"]
    # A_w of the separable window ended at 3 ℓ, by quadrature
    t = np.linspace(-3, 3, 20001) * window
    g = np.maximum(np.exp(-(t**2) / (2 * window**2)) - np.exp(-4.5), 0)
    area = np.trapezoid(g, t) ** 4 / np.trapezoid(g**2, t) ** 2
    assert np.isclose(data.brdf.sel(theta_o=0).item(), k**2 / (4 * np.pi**2) * area, rtol=2e-3)


def test_x_rays_need_too_many_points_and_say_so():
    with pytest.raises(ToleranceError, match="smaller coherence_um or surface"):
        measure(surface(), wavelength=1.0)


def test_x_rays_through_a_small_window():
    """λ = 1 nm, a facet tilted by 5.7° under a window of 0.1 µm: one lobe, in its mirror direction."""
    solver = vg.wave.Kirchhoff("perfect", [1.0], tol=1e-2, windows=1)
    tilted = surface(interpolation="linear")
    tilted = tilted.replace(z=0 * tilted.z + 0.1 * tilted.x, periodic=False)
    mirror = -30 + 2 * np.degrees(np.arctan(-0.1))
    gonio = vg.measure.Gonioreflectometer([30], [mirror - 1, mirror, mirror + 1], aperture_deg=1e-3, coherence_um=0.1)
    data = gonio.measure(tilted, solver)
    assert data.attrs["error_achieved"] <= 1e-2
    found = data.brdf.values.ravel()
    assert found[1] > 1e3 * max(found[0], found[2])


def test_a_thousand_wavelengths_of_roughness():
    """σ/λ = 1000 on a profile: finite, not negative, to the tolerance."""
    z = np.tile(surface().z[:1], (2, 1))
    field = Heightfield(z / z.std() * 0.2, 0.5, periodic=True)
    gonio = vg.measure.Gonioreflectometer([30], [-50, -40, -30, -20, -10], aperture_deg=1e-3, coherence_um=0.3)
    data = gonio.measure(field, vg.wave.Kirchhoff("perfect", [0.2], tol=1e-2, windows=2))
    assert np.all(np.isfinite(data.brdf))
    assert float(data.brdf.min()) >= 0
    assert float(data.brdf.max()) > 0
    assert data.attrs["error_achieved"] <= 1e-2


def test_windows_smaller_than_the_wavelength_and_larger_than_the_sample():
    small = vg.surface.gaussian(rms_um=0.1, correlation_um=1, shape=(12, 12), pitch_um=0.25, seed=1)
    measure(small, coherence_um=0.2)
    data = measure(surface(periodic=False), coherence_um=1e4)
    assert "ends at ±12 µm" in data.attrs["window_note"]


@lru_cache(maxsize=1)
def at_1e_10():
    return measure(surface(), tol=1e-10, theta_o=[-60, -30, 0, 40], coherence_um=3).brdf


@pytest.mark.parametrize("tol", [1e-1, 1e-2, 1e-4, 1e-6, 1e-9])
def test_tolerances(tol):
    exact = at_1e_10()
    found = measure(surface(), tol=tol, theta_o=[-60, -30, 0, 40], coherence_um=3).brdf
    error = float((abs(found - exact) / exact.max()).max())
    assert error <= tol


def test_a_tolerance_below_rounding_is_said():
    """1e-12 at 60 rad of phase is at the end of double precision: met, or the figure that was reached is given."""
    small = vg.surface.gaussian(rms_um=2.0, correlation_um=4.0, shape=(24, 24), pitch_um=0.5, seed=1)
    gonio = vg.measure.Gonioreflectometer([30], [-30], aperture_deg=1e-3, coherence_um=1.5)
    solver = vg.wave.Kirchhoff("perfect", [2000], tol=1e-14, windows=1)
    with pytest.warns(vg.errors.VgonioWarning, match=r"error .* instead of 1.0e-14"):
        data = gonio.measure(small, solver)
    assert 1e-14 < data.attrs["error_achieved"] < 1e-10
    loose = gonio.measure(small, vg.wave.Kirchhoff("perfect", [2000], tol=1e-12, windows=1))
    assert float(abs(loose.brdf / data.brdf - 1).max()) < 1e-10


@pytest.mark.parametrize("kind", ["nearest", "linear"])
def test_steps_and_facets(kind):
    measure(surface(interpolation=kind))


def test_steep_tilt():
    """A plane tilted by 60°, lit from 30° on the other side: its mirror direction is the normal of the sample."""
    x = (np.arange(96) + 0.5) * 0.25
    plane = Heightfield(np.tile(np.tan(np.deg2rad(60)) * x, (96, 1)), 0.25)
    data = measure(plane, theta_i=(-75,), theta_o=[-45, -20, 0, 20])
    # facet normal at −60°: −75° goes to −45°
    assert data.brdf.argmax("theta_o").item() == 0


def test_tiny_and_thin_fields():
    measure(Heightfield(np.array([[0, 0.1], [0.2, 0.0]]), 0.5))
    x = (np.arange(64) + 0.5) * 0.5
    measure(Heightfield(np.sin(2 * np.pi * x / 8)[None] * 0.2, 0.5, periodic=True))


def test_missing_points_are_refused():
    z = surface().z.copy()
    z[3, 4] = np.nan
    with pytest.raises(InputError, match="fill"):
        measure(surface(z=z))


def test_windows_out_of_all_proportion_are_refused():
    with pytest.raises(ToleranceError, match="larger coherence_um"):
        measure(surface(), coherence_um=0.01)
    with pytest.raises(ToleranceError, match="smaller coherence_um"):
        measure(surface(), coherence_um=1e5, aperture_deg=10)


@pytest.mark.parametrize("most", [1, 2, 3, 5, None])
def test_all_solvers_look_at_the_same_windows(most):
    """Fewer windows than tile a profile: the middle one, or both ends and evenly between, for every solver."""
    rows = vg.surface.Heightfield(np.sin(np.arange(2000))[None], 0.1)
    scalar = [w.centre[1] for w in WindowPlan.of(rows, 5.0, most).gaussian]
    rigorous, _ = full_wave_windows.centres(rows, 5.0, most)
    iterated = [w.centre[1] for w in Places.of(rows, None, 5.0, most).windows]
    assert len(scalar) == (most or 18)
    assert rigorous == pytest.approx(scalar)
    assert iterated == pytest.approx(scalar)
    assert abs(np.mean(scalar) - 100) <= 5.01  # half the distance of two windows: 18 of them have no middle one
    if most and most > 1:
        assert (scalar[0], scalar[-1]) == pytest.approx((15, 185))
