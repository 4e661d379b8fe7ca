"""Tracers against each other, and what is left out against what is not."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest

import vgonio.geometric.trace as trace_module
from vgonio.directions import Incoming
from vgonio.geometric import RayOptics
from vgonio.geometric.beam import ParallelBeam, Scene
from vgonio.geometric.tracers import TRACERS
from vgonio.measure import Gonioreflectometer
from vgonio.surface import Heightfield, flat, gaussian, lamellar
from vgonio.surface.mesh import mesh, profile_once

SKIPPED = {"warp": "Warp is not installed: pip install 'vgonio[gpu]'"}


def rough(samples=16, rms=0.6, interpolation="cubic"):
    field = gaussian(rms_um=rms, correlation_um=2.0, shape=(samples, samples), pitch_um=0.5, seed=3)
    return Heightfield(field.z, field.pitch_um, periodic=True, interpolation=interpolation)


def tracer(name, m):
    if name == "warp":
        pytest.importorskip("warp", reason=SKIPPED["warp"])
    return TRACERS[name](m)


@pytest.mark.parametrize("name", ["embree", "warp"])
@pytest.mark.parametrize("interpolation", ["cubic", "nearest"])
def test_same_facets_as_the_reference_on_random_rays(name, interpolation):
    """Single against double precision: only rays within a few 1e-6 of an edge may go to the neighbour."""
    m = mesh(rough(interpolation=interpolation))
    rng = np.random.default_rng(0)
    n = 3000
    x0, x1, y0, y1 = m.box
    bottom, top = m.z_range
    start = np.column_stack([rng.uniform(x0, x1, n), rng.uniform(y0, y1, n), rng.uniform(bottom, top, n)])
    along = rng.normal(size=(n, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    expected = tracer("reference", m).facet(start, along)
    assert np.mean(expected >= 0) > 0.3
    assert np.mean(tracer(name, m).facet(start, along) != expected) < 1e-3
    assert len(tracer(name, m).facet(start[:0], along[:0])) == 0


@pytest.mark.parametrize(("devices", "expected"), [(0, "cpu"), (2, "cuda:0")])
def test_warp_asks_one_device_for_everything(monkeypatch, devices, expected):
    """With a stand-in for the library that notes where arrays and kernels go: a CUDA device where there is one."""
    seen = []

    class Array(np.ndarray):
        def numpy(self):
            return np.asarray(self)

    def array(data, dtype=None, device=None):
        seen.append(device)
        return np.asarray(data).view(Array)

    def empty(n, dtype=None, device=None):
        return array(np.full(n, 7, np.int32), device=device)

    stand_in = SimpleNamespace(
        config=SimpleNamespace(),
        init=lambda: None,
        get_cuda_device_count=lambda: devices,
        array=array,
        empty=empty,
        launch=lambda kernel, dim, inputs, device: seen.append(device),
        Mesh=lambda points, indices: SimpleNamespace(id=1),
        vec3=None,
        int32=None,
    )
    monkeypatch.setitem(sys.modules, "warp", stand_in)
    monkeypatch.setitem(sys.modules, "vgonio.geometric.warp_kernel", SimpleNamespace(closest=None))
    made = TRACERS["warp"](mesh(rough()))
    assert made.device == expected
    assert made.facet(np.zeros((3, 3)), np.ones((3, 3))).tolist() == [7, 7, 7]
    assert seen == [expected] * 6  # points, faces, starts, directions, facets, the kernel itself


@pytest.mark.parametrize("name", ["reference", "warp"])
def test_same_results_as_embree(name):
    """The same rays: all but the few at edges go the same way, so results agree far within the standard error."""
    if name == "warp":
        pytest.importorskip("warp", reason=SKIPPED["warp"])
    gonio = Gonioreflectometer([40], range(-60, 61, 20), aperture_deg=20)
    a, b = (
        gonio.measure(rough(), RayOptics("Al", [550], rays=2000, tracer=t, estimator="binning"))
        for t in ("embree", name)
    )
    assert np.all(np.abs(a.brdf - b.brdf) <= 0.3 * a.brdf_stderr + 1e-12)
    assert np.allclose(a.energy_by_bounce, b.energy_by_bounce, atol=3 / 2000)
    assert name in b.attrs["backend"]


def test_skipped_casts_change_nothing_and_save_time(monkeypatch):
    """Rays steeper than the steepest facet are not cast: the same result, with far fewer casts."""
    casts = []

    class Counting(TRACERS["embree"]):
        def facet(self, position, direction):
            casts.append(len(position))
            return super().facet(position, direction)

    monkeypatch.setitem(TRACERS, "embree", Counting)
    gonio = Gonioreflectometer.hemisphere([20], resolution_deg=15)
    solver = RayOptics("Al", [550], rays=40_000, threads=1)
    surface = rough(64, rms=0.35)
    fast, few = gonio.measure(surface, solver), sum(casts)
    casts.clear()
    monkeypatch.setattr("vgonio.surface.mesh.Mesh.unstoppable", lambda self, d: np.zeros(len(d), bool))
    slow, many = gonio.measure(surface, solver), sum(casts)
    assert np.array_equal(fast.brdf, slow.brdf)
    assert np.array_equal(fast.energy_by_bounce, slow.energy_by_bounce)
    assert fast.energy_by_bounce.sel(bounce=2).item() > 0.002
    assert few < 0.8 * many


def test_nothing_stops_an_unstoppable_ray():
    """Random rays from the facets of a rough surface against the reference tracer; the bound is not idle either."""
    m = mesh(rough())
    rng = np.random.default_rng(1)
    facet = rng.integers(0, len(m.faces), 20_000)
    start = sum(m.corners(facet)) / 3 + m.lift * m.normals[facet]
    along = rng.normal(size=(len(facet), 3)) * (1, 1, 2)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    free = m.unstoppable(along)
    assert np.all(tracer("embree", m).facet(start[free], along[free]) == -1)
    assert 0.1 < free.mean() < 0.5
    # towards each azimuth the steepest slope itself is found
    gradient = -m.normals[:, :2] / m.normals[:, 2:]
    for azimuth in np.linspace(0, 2 * np.pi, 37):
        u = np.array([np.cos(azimuth), np.sin(azimuth)])
        steepest = (gradient @ u).max()
        # between two azimuths 22.5° apart the bound is too high by sin 11.25° of the steepest slope at most
        assert m.unstoppable(np.array([[*u, steepest + 0.2 * m.steepest.max()]]))[0]
        assert not m.unstoppable(np.array([[*u, 0.999 * steepest]]))[0]


@pytest.mark.parametrize("interpolation", ["linear", "nearest", "cubic"])
@pytest.mark.parametrize("periodic", [True, False])
def test_a_profile_is_traced_as_a_profile(interpolation, periodic):
    x = np.arange(60)
    z = np.tile(0.4 * np.sin(2 * np.pi * x / 12), (40, 1))
    surface = Heightfield(z, 0.5, periodic=periodic, interpolation=interpolation)
    once = profile_once(surface)
    assert len(mesh(once).faces) < len(mesh(surface).faces) / 5
    assert np.allclose(np.diff(np.reshape(mesh(once).box, (2, 2))), np.diff(np.reshape(mesh(surface).box, (2, 2))))
    gonio = Gonioreflectometer([35], range(-60, 61, 20), aperture_deg=20)
    short = gonio.measure(surface, RayOptics("Al", [550], rays=40_000, estimator="binning"))
    whole = Heightfield(z + 1e-13 * np.arange(40)[:, None], 0.5, periodic=periodic, interpolation=interpolation)
    assert profile_once(whole) is whole
    long = gonio.measure(whole, RayOptics("Al", [550], rays=40_000, estimator="binning"))
    assert short.attrs["facets"] < long.attrs["facets"] / 5
    error = np.hypot(short.brdf_stderr, long.brdf_stderr)
    assert np.all(np.abs(short.brdf - long.brdf) <= 4.5 * error + 1e-12)
    # shares of n rays differ by less than 4.5/√n · √2
    assert np.allclose(short.energy_by_bounce, long.energy_by_bounce, atol=4.5 * np.sqrt(2 * 0.25 / 40_000))


def test_memory_does_not_grow_with_the_rays():
    """numpy reports its allocations: the same peak for three times the rays, but for a second grid of starts where
    batches differ by a ray, and four batches to a job in place of one."""
    import tracemalloc

    surface, gonio = rough(64), Gonioreflectometer.hemisphere([30], resolution_deg=10)
    peaks = []
    gonio.measure(surface, RayOptics("Al", [450, 550], rays=1000))
    for rays in (1_100_000, 3_300_001):
        tracemalloc.start()
        gonio.measure(surface, RayOptics("Al", [450, 550], rays=rays, threads=1))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.4 * peaks[0]
    assert max(peaks) < 40e6


@pytest.mark.parametrize("divergence", [0.0, 1.0])
def test_memory_does_not_grow_with_the_reflections(monkeypatch, divergence):
    """Slits as deep as wide at grazing incidence, up to 60 reflections: paths are held as many at a time as fit into
    the memory set aside; the same rays, and the same result, in small pieces and in one."""
    import tracemalloc

    slits = Heightfield(np.tile([0.0, 2.0], (2, 8)), 2.0, periodic=True, interpolation="nearest")
    gonio = Gonioreflectometer([88], [0, 80], aperture_deg=8, divergence_deg=divergence)
    solver = RayOptics("Al", np.linspace(380, 780, 21), rays=4000, threads=1, max_bounces=1000)
    results, peaks = [], []
    gonio.measure(slits, RayOptics("Al", rays=100))
    for memory in (1 << 22, 1 << 34):
        monkeypatch.setattr("vgonio.geometric.sampling.PATHS_MEMORY", memory)
        tracemalloc.start()
        results.append(gonio.measure(slits, solver))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    small, whole = results
    assert float(small.energy_lost.max()) < 1e-3
    assert float(small.energy_absorbed.min()) > 0.4  # half of the light takes dozens of reflections
    assert np.allclose(small.brdf, whole.brdf, rtol=1e-9)
    assert np.allclose(small.energy_absorbed, whole.energy_absorbed, rtol=1e-9)
    assert peaks[0] < 0.6 * peaks[1]


def test_planes_of_big_meshes_are_worked_out_for_hits_only(monkeypatch):
    gonio = Gonioreflectometer([30, 70], range(-60, 61, 20), aperture_deg=20)
    solver = RayOptics("Al", [550], rays=20_000)
    kept = gonio.measure(rough(32), solver)
    for module in ("vgonio.surface.mesh", "vgonio.geometric.beam"):
        monkeypatch.setattr(f"{module}.KEPT_FACETS", 10)
    on_the_fly = gonio.measure(rough(32), solver)
    assert np.allclose(kept.brdf, on_the_fly.brdf, rtol=1e-9)
    scene = Scene.of(rough(32), 1, "embree")
    beam = ParallelBeam(scene, Incoming(np.array([30.0])), 0)
    with ThreadPoolExecutor(1) as pool:
        beam.prepare(pool)
    beam.fate(np.arange(5))
    assert "_all_planes" not in vars(scene.mesh)


def test_walls_are_infinitely_steep():
    m = mesh(lamellar(period_um=4, depth_um=1, shape=(8, 64), pitch_um=0.25))
    assert np.isinf(m.steepest[0])
    assert not m.unstoppable(np.array([[0.1, 0.0, 0.99]]))[0]
    assert m.unstoppable(np.array([[0.0, 0.1, 0.99]]))[0]  # along the grooves nothing stands in the way
    assert trace_module.MAX_WRAPS > 100


def test_a_facet_seen_from_below_is_no_hit():
    """Rays at facet 0 of a plane, from 2 µm above and below: met at z = 0 from above, lost from below."""
    plane = mesh(flat((4, 4), 1.0))
    position, direction = np.array([[1.0, 1.0, 2.0], [1.0, 1.0, -2.0]]), np.array([[0.6, 0.0, -0.8], [0.6, 0.0, 0.8]])
    front, at = trace_module.meet(plane, np.zeros(2, np.int64), position, direction)
    assert front.tolist() == [True, False]
    np.testing.assert_allclose(at[0], [2.5, 1.0, 0.0], atol=1e-12)
