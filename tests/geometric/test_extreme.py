"""Extreme cases: nothing hangs, crashes, returns NaN or negative power, and what is lost is said to be lost."""

from __future__ import annotations

import time
import warnings

import numpy as np
import pytest

from vgonio.errors import InputError, VgonioWarning
from vgonio.geometric import RayOptics
from vgonio.geometric.embree import Embree
from vgonio.materials import Material
from vgonio.measure import Gonioreflectometer
from vgonio.surface import Heightfield, gaussian
from vgonio.surface.mesh import mesh

ANGLES = range(-80, 81, 20)


def measured(surface, theta=(0, 50), material="Al", rays=4000, **options):
    start = time.process_time()
    data = Gonioreflectometer(list(theta), ANGLES, aperture_deg=10).measure(
        surface, RayOptics(material, [550], rays=rays, **options)
    )
    assert time.process_time() - start < 60  # nothing hangs: a tenth of a second is what most take
    for name in ("brdf", "brdf_stderr", "brdf_by_bounce", "energy_by_bounce", "energy_absorbed", "energy_lost"):
        assert np.all(np.isfinite(data[name])), name
        assert np.all(data[name] >= 0), name
    total = data.energy_by_bounce.sum("bounce") + data.energy_absorbed + data.energy_lost
    assert np.allclose(total, 1, atol=1e-6)
    return data


def rough(rms=1.0, pitch=0.5, shape=(48, 48), **options):
    field = gaussian(rms_um=1.0, correlation_um=3.0, shape=shape, pitch_um=0.5, seed=2)
    return Heightfield(field.z * rms, pitch, periodic=True, **options)


@pytest.mark.parametrize("estimator", ["binning", "facets"])
def test_grazing_incidence(estimator):
    data = measured(rough(0.3), (89.9, -89.9), "perfect", estimator=estimator)
    assert float(data.energy_lost.max()) < 1e-3


def test_grazing_incidence_on_a_plane_and_on_a_finite_sample():
    flat = measured(Heightfield(np.zeros((8, 8)), 1.0, periodic=True), (89.9,), "perfect")
    assert flat.energy_by_bounce.sel(bounce=1).item() == pytest.approx(1, abs=1e-9)
    finite = measured(Heightfield(rough(0.3).z, 0.5), (89.9,), "perfect")
    assert finite.attrs["edges"].startswith("mirrored")
    assert float(finite.energy_lost.max()) < 1e-3


@pytest.mark.parametrize("depth", [1.0, 30.0])
def test_vertical_walls(depth):
    grating = Heightfield(np.tile([0.0, 0, depth, depth], (4, 6)), 1.0, periodic=True, interpolation="nearest")
    data = measured(grating, (0, 30, 80), "perfect", max_bounces=1000)
    assert float(data.energy_lost.max()) < 1e-3


def test_a_hundred_bounces_in_a_slit():
    """A slit 200 times as deep as wide, 30° off its axis: (200 tan 30° = 115 reflections down and as many up).

    Loss-free and with a limit of 1000 everything comes out; with a limit of 100 what goes in is lost, and said to be.
    """
    width, depth = 1.0, 200.0
    slits = Heightfield(np.tile([0.0, depth], (2, 2)), width, periodic=True, interpolation="nearest")
    data = measured(slits, (30,), "perfect", rays=500, max_bounces=1000)
    assert float(data.energy_lost.max()) < 1e-3
    assert data.energy_by_bounce.sel(bounce=4).item() == pytest.approx(0.5, abs=0.1)  # "4 and more": half is slit
    with pytest.warns(VgonioWarning, match="max_bounces"):
        limited = measured(slits, (30,), "perfect", rays=500, max_bounces=100)
    assert limited.energy_lost.item() == pytest.approx(0.5, abs=0.1)
    metal = measured(slits, (30,), "Al", rays=500, max_bounces=1000)
    assert metal.energy_absorbed.item() > 0.49  # 0.9^230 comes out


@pytest.mark.parametrize("rms", [1e-9, 1e4])
def test_heights_of_a_femtometre_and_of_a_centimetre(rms):
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        data = measured(rough(rms), (0, 60), "perfect", rays=500, max_bounces=1000)
    unresolved = [w for w in seen if issubclass(w.category, VgonioWarning) and "single precision" in str(w.message)]
    assert len(unresolved) == (rms == 1e-9)
    # needles of a centimetre keep the light for more than 1000 reflections: lost, counted as such, and warned of
    lost = [w for w in seen if "lost" in str(w.message)]
    assert len(lost) == (float(data.energy_lost.max()) > 1e-2) == (rms == 1e4)
    if rms == 1e-9:
        assert np.allclose(data.energy_by_bounce.sel(bounce=1), 1, atol=1e-9)


def test_a_relief_that_single_precision_cannot_resolve_is_warned_of():
    steep_but_small = Heightfield(np.tile([0.0, 2e-4], (2, 2048)), (500.0, 1e-3), periodic=True, interpolation="linear")
    with pytest.warns(VgonioWarning, match="single precision"):
        measured(steep_but_small, (0,), "perfect", rays=500)


def test_coordinates_of_a_decimetre():
    """A surface of 10⁵ µm: as the same one of 10² µm, since geometric optics has no scale."""
    small, big = rough(0.5, 2.0), Heightfield(rough(0.5).z * 1000, 2000.0, periodic=True)
    a, b = (measured(s, (40,), "perfect", rays=20_000) for s in (small, big))
    assert np.allclose(a.energy_by_bounce, b.energy_by_bounce, atol=5e-4)
    assert np.allclose(a.brdf, b.brdf, atol=4 * float(a.brdf_stderr.max()) + 1e-3)


@pytest.mark.parametrize("pitch", [(0.05, 5.0), (5.0, 0.05)])
def test_pitches_of_one_to_a_hundred(pitch):
    data = measured(Heightfield(rough(0.02).z, pitch, periodic=True), (0, 60), "perfect")
    assert float(data.energy_lost.max()) < 1e-3


@pytest.mark.parametrize("interpolation", ["cubic", "linear", "nearest"])
@pytest.mark.parametrize("height", [20.0, -20.0])
def test_spikes_of_one_pixel(interpolation, height):
    z = np.zeros((16, 16))
    z[5, 9] = height
    spike = Heightfield(z, 0.5, periodic=True, interpolation=interpolation)
    data = measured(spike, (0, 45, 80), "perfect", max_bounces=1000)
    assert float(data.energy_lost.max()) < 2e-3


def test_missing_points_are_refused():
    z = np.zeros((8, 8))
    z[2, 2] = np.nan
    with pytest.raises(InputError, match="missing"):
        measured(Heightfield(z, 1.0, periodic=True))


@pytest.mark.parametrize("n", [1e-6, 1e-3, 1.0, 1e3])
@pytest.mark.parametrize("k", [0.0, 1e-6, 1.0, 1e3])
def test_extreme_refractive_indices(n, k):
    index = complex(n, k)
    data = measured(rough(0.6), (0, 85), constant(index), rays=1000, polarised=True)
    assert np.all(np.isfinite(data.mueller))
    assert float(data.energy_by_bounce.sum("bounce").max()) <= 1 + 1e-9


def constant(index: complex) -> Material:
    return Material(f"n + ik = {index}", "made up", lambda um: np.full(np.shape(um), index), (300.0, 1000.0))


@pytest.mark.parametrize("slope", [1e-4, 0.1, 0.4])
def test_reflected_rays_do_not_meet_their_own_facet(slope):
    """Flanks of 100 µm: vertical light, reflected by 2 atan(slope) < 45°, leaves such a groove at once."""
    flank = np.abs(np.arange(-100, 100.0)) * slope
    data = measured(
        Heightfield(np.tile(flank, (100, 1)), 1.0, periodic=True, interpolation="linear"), (0,), "perfect", rays=50_000
    )
    # exact: the other flank reaches up at atan(slope) only, far below the ray's elevation of 90° − 2 atan(slope)
    assert data.energy_by_bounce.sel(bounce=1).item() == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_single_precision_does_not_find_the_facet_it_starts_from(scale):
    """Rays that leave facets as low as 1 in 1000, cast without the short cut for steep rays."""
    m = mesh(Heightfield(rough().z * scale, 0.5 * scale, periodic=True))
    rng = np.random.default_rng(0)
    facet = rng.integers(0, len(m.faces), 20_000)
    weight = rng.dirichlet((1, 1, 1), len(facet))[..., None]
    first, second, third = m.corners(facet)
    point = weight[:, 0] * first + weight[:, 1] * second + weight[:, 2] * third
    along = np.cross(m.normals[facet], rng.normal(size=(len(facet), 3)))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    along = along + 10 ** rng.uniform(-3, 0, (len(facet), 1)) * m.normals[facet]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    found = Embree(m).facet(point + m.lift * m.normals[facet], along)
    assert np.mean(found >= 0) > 0.2
    assert np.all(found != facet)
