"""The short trials that tell what this machine can do, each of them a small job of a solver or of its dearest step."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import BackendError

if TYPE_CHECKING:
    from ..surface import Heightfield

Best = Callable[..., float]

# a scene of which each part takes as long as its libraries and the Python around them
SMALLEST: dict[str, Any] = {
    "surface": {"generate": {"kind": "gaussian", "rms_um": 0.1, "correlation_um": 2.0, "shape": [16, 16],
                             "pitch_um": 0.5}},
    "material": {"name": "Al"},
    "light": {"wavelength_nm": [450, 550, 650], "theta_i_deg": [0], "coherence_um": 1},
    "detector": {"theta_o_deg": [-30, 0, 30]},
    "geometric": {"rays": 100},
    "wave": {"tol": 1e-2},
}  # fmt: skip
# run in a process of its own: seconds and resident bytes at the start, then of each part, twice: the first time, when
# its libraries are loaded, and another time
CHILD = """
import os, sys, time
import json, tempfile
import vgonio.simulation
from vgonio.memory import resident
runs, open_ = [{"start": (time.process_time(), resident())}, {}], {}
def progress(part, share):
    if share == 0.0:
        open_[part] = time.perf_counter(), time.process_time(), resident()
    elif share == 1.0:
        wall, used, memory = open_[part]
        seconds = min(time.perf_counter() - wall, time.process_time() - used)
        parts[part] = seconds, max(resident() - memory, 0)
with tempfile.TemporaryDirectory() as folder:
    for parts in runs:
        vgonio.simulation.simulate(json.loads(sys.argv[1]), progress=progress,
                                   output=os.path.join(folder, "a.nc"), report=os.path.join(folder, "a.html"))
print(json.dumps(runs))
"""


def measured(processor_time: bool, threads: int) -> Iterator[dict[str, Any]]:
    """Speeds by name, a few at a time: each dictionary is one trial, so that progress shows."""

    def best(work: Callable[[], Any], repeats: int = 3, waits: bool = False) -> float:
        """Seconds of the quickest of some runs: by the clock, or of the processor where those are fewer, as they are
        where other programs run as well. waits : another device works, which the processor's seconds do not show."""
        times = []
        for _ in range(repeats):
            wall, used = time.perf_counter(), time.process_time()
            work()
            wall, used = time.perf_counter() - wall, time.process_time() - used
            times.append(used if processor_time else wall if waits else min(wall, used))
        return max(min(times), 1e-6)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield fixed_parts()
        yield _rays(best, threads)
        yield _mueller(best, threads)
        yield _heights_and_sums(best)
        yield _interpolation(best)
        yield _transforms(best)
        yield _direct_sums(best)
        yield _vectors_and_shadows(best)
        yield _full_wave(best)
        yield _iterated(best)


TRIALS = 10
SIDE = 200  # points of the surfaces that rays are tried on
WINDOWS = 4  # that share the interpolation of a row


def fixed_parts() -> dict[str, Any]:
    """`fixed` and `loading` of `Speeds`: the smallest scene in a new process, which loads all libraries, and again."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", CHILD, json.dumps(SMALLEST)],
        capture_output=True, text=True, check=False, env={**os.environ, "VGONIO_CALIBRATION": "off"},
    )  # fmt: skip
    if done.returncode:
        reason = (done.stderr.strip() or "no reason given").splitlines()[-1]
        raise BackendError(f"a scene that is simulated to learn what each part takes at least failed: {reason}")
    first, again = json.loads(done.stdout.splitlines()[-1])
    fixed = {part: float(seconds) for part, (seconds, _) in again.items()}
    loading = {part: (max(s - fixed.get(part, 0.0), 0.0), float(size)) for part, (s, size) in first.items()}
    return {"fixed": fixed, "loading": loading}


def _rough(points: int, rms_um: float = 0.75, pitch_um: float = 0.5) -> Heightfield:
    from ..surface import gaussian

    return gaussian(rms_um=rms_um, correlation_um=5.0, shape=(points, points), pitch_um=pitch_um, seed=0)


def _rays(best: Best, threads: int) -> dict[str, float]:
    from ..geometric import RayOptics
    from ..measure import Gonioreflectometer

    gonio = Gonioreflectometer([30], range(-85, 86, 10), aperture_deg=2.0)
    mild, steep = _rough(SIDE), _rough(SIDE, 2.0)

    def run(surface: Heightfield, rays: int, estimator: str = "binning") -> Any:
        return gonio.measure(surface, RayOptics("Al", [550.0], rays=rays, estimator=estimator, threads=threads))

    few, many = 2_000, 202_000
    run(_rough(32), few)
    base, small = best(lambda: run(mild, few), 2), best(lambda: run(_rough(32), few), 2)
    cast, deep = best(lambda: run(mild, many), 2), best(lambda: run(steep, many), 2)
    again = float(np.sum(run(steep, few)["energy_by_bounce"].values[0, 1:, 0]))
    tried = run(steep, many, "facets").attrs["facet_points"]
    points = best(lambda: run(steep, many, "facets"), 1)
    of_ray = max(cast - base, 1e-4) / (many - few)
    return {
        "facet": max(base - small, 1e-4) / (2 * (SIDE**2 - 32**2)),
        "ray": of_ray,
        # so much light leaves after two and more reflections; each such path has about 1.4 of them beside the first
        "hit": max(deep - cast, 1e-4) / (many - few) / (1.4 * max(again, 0.05)),
        "point": max(points - deep, 1e-4) / max(tried, 1),
    }


def _mueller(best: Best, threads: int) -> dict[str, float]:
    from ..geometric import RayOptics
    from ..measure import Gonioreflectometer

    surface, rays = _rough(64), 40_000
    gonio = Gonioreflectometer.hemisphere([30], resolution_deg=15)
    wavelengths = np.linspace(400, 700, 10)

    def run(polarised: bool) -> None:
        gonio.measure(surface, RayOptics("Al", wavelengths, rays=rays, polarised=polarised, threads=threads))

    plain = best(lambda: run(False), 2)
    return {"mueller": max(best(lambda: run(True), 2) - plain, 1e-4) / (rays * len(wavelengths))}


def _heights_and_sums(best: Best) -> dict[str, float]:
    from ..wave import windowed
    from ..wave.spreading import Band

    surface = _rough(128, 0.5)
    side = surface.size_um[0]
    n = 700
    x = (np.arange(n) + 0.5) * side / n
    grid = surface.interpolant
    z = grid.grid(x, x)
    z = z - (z.min() + z.max()) / 2
    taken = {}
    for rows, top in ((2, 20.0), (2, 60.0), (34, 60.0)):
        band = Band.of(np.array([15.0, top]), float(np.abs(z).max()), 1e-4)
        along = np.exp(-1j * np.outer(np.linspace(-1, 1, rows), x))
        given = (z, along, [slice(0, band.count)] * rows, band)
        taken[rows, top] = best(lambda given=given: windowed._sum_over_y(*given)) / n**2, band.count
    (narrow, few), (wide, many), (shared, _) = taken.values()
    product = max(shared - wide, 1e-12) / (32 * many)
    both = max(wide - narrow, 1e-12) / (many - few)
    return {
        "height": best(lambda: grid.grid(x, x)) / n**2,
        "product": product,
        "line": max(both - 2 * product, 1e-10),
        "phase": max(narrow - few * both, 1e-9),
    }


def _interpolation(best: Best) -> dict[str, float]:
    import scipy.fft

    from ..wave import windowed
    from ..wave.spreading import Band, Kernel

    rng = np.random.default_rng(0)
    size, count, m = 2048, 40, 20_000
    data = rng.normal(size=(count, size // 2)) + 0j
    fft = best(lambda: scipy.fft.fft(data, size, axis=1, workers=-1)) / (count * size * np.log2(size))
    q = np.stack([rng.uniform(-10, 10, m), np.zeros(m), rng.uniform(15, 30, m)], axis=1)
    band = Band.of(np.array([15.0, 30.0]), 3.0, 1e-4)
    kernel = Kernel.of(1e-4, windowed.OVERSAMPLING_X)
    spectra = [np.zeros((band.count, size), np.complex128)] * WINDOWS
    taps = best(lambda: windowed._interpolate(spectra, q, [0.0] * WINDOWS, 0.1, size, kernel, band, 0))
    return {"fft": fft, "tap": taps / (m * WINDOWS * kernel.width * band.kernel.width)}


def _points(side: int, pitch: float = 0.1) -> Any:
    from ..wave.quadrature import Points

    rng = np.random.default_rng(0)
    x: Any = (np.arange(side) - side / 2) * pitch
    return Points(x, x, rng.normal(0, 0.5, (side, side)), np.full((side, side), pitch**2))


def _vectors(m: int, spread: float = 0.0) -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.stack([rng.uniform(-10, 10, m), rng.uniform(-spread, spread, m), rng.uniform(15, 30, m)], axis=1)


def _transforms(best: Best) -> dict[str, float]:
    from ..wave import nufft, planes

    large, small, q = _points(500), _points(20), _vectors(1000)
    nufft.transform(small, q, 1e-4, 0.0)
    row = best(lambda: nufft.transform(small, q, 1e-4, 0.0))
    spread = max(best(lambda: nufft.transform(large, q, 1e-4, 0.0)) - row, 1e-4) / large.size
    space, everywhere = _points(200), _vectors(4000, 10.0)
    found = best(lambda: planes.transform(space, everywhere, 1e-4), 2) / planes.seconds(space, everywhere, 1e-4)
    return {"row": row, "spread": spread, "space": found}


def _direct_sums(best: Best) -> dict[str, float]:
    from ..wave import opencl, reference

    points, q = _points(300), _vectors(800)
    found = {"plain_term": best(lambda: reference.transform(points, q[:4]), 2) / (points.size * 4)}
    try:
        opencl.transform(points, q[:8])
        found["term"] = best(lambda: opencl.transform(points, q), waits=_elsewhere()) / (points.size * len(q))
    except BackendError:
        found["term"] = found["plain_term"]  # the checks go to numpy then
    return found


def _elsewhere() -> bool:
    """Does OpenCL run on another device than the processor?"""
    import pyopencl as cl

    from ..wave import opencl

    return not any(d.type & cl.device_type.CPU for d in opencl.device().context.devices)


def _vectors_and_shadows(best: Best) -> dict[str, float]:
    from ..directions import Detector, Incoming
    from ..materials import material
    from ..surface import visible
    from ..wave.amplitudes import HalfVector
    from ..wave.job import detector_job

    fine, wavelengths = _rough(200), [450.0, 550.0, 650.0]
    light = np.array([np.sin(1.0), 0.0, np.cos(1.0)])
    shadow = best(lambda: visible(fine, light, 2), 2) / (4 * fine.z.size)
    incoming, detector = (
        Incoming(np.array([0.0, 30.0])),
        Detector.in_plane(np.arange(-60.0, 61.0, 20.0), aperture_deg=4.0),
    )
    job = detector_job(incoming, detector, 2e3 * np.pi / np.array(wavelengths), 1 / 20, "kirchhoff", 0)
    model = HalfVector("kirchhoff", material("Al"), wavelengths, "unpolarised")
    sums = np.ones((1, len(job.q)), np.complex128)

    def run() -> None:
        values = model.intensity(sums, job) * job.prefactor
        for power in (1, 2, 2):
            job.gather(job.weight * values**power)

    return {"shadow": shadow, "vector": best(run) / len(job.q)}


def _full_wave(best: Best) -> dict[str, float]:
    import scipy.linalg

    from ..directions import Detector, Incoming
    from ..surface import sinusoid
    from ..wave import FullWave
    from ..wave.full_wave import forecast

    surface = sinusoid(period_um=12.0, amplitude_um=0.3, shape=(1, 480), pitch_um=0.05)
    incoming, detector = Incoming(np.array([0.0, 30.0])), Detector.in_plane(np.array([0.0, 30.0]), aperture_deg=2.0)
    solver = FullWave("Al", [550.0])
    expected = forecast(solver, surface, incoming).seconds
    n = 1000
    a = np.random.default_rng(0).normal(size=(n, n)) + 1j * np.eye(n)
    flop = best(lambda: scipy.linalg.lu_factor(a, check_finite=False), 2) / (8 / 3 * n**3)
    return {"kernel": best(lambda: solver.scatter(surface, incoming, detector), 2) / expected, "flop": flop}


def _iterated(best: Best) -> dict[str, float]:
    from ..directions import Detector, Incoming
    from ..surface import gaussian
    from ..wave import IteratedKirchhoff
    from ..wave.iterated.forecast import counts

    detector = Detector.in_plane(np.arange(-60.0, 61.0, 20.0), aperture_deg=2.0)
    incoming = Incoming(np.array([30.0]), coherence_um=6.0)
    profile = gaussian(rms_um=0.6, correlation_um=2.0, shape=(1, 480), pitch_um=0.1, seed=0)
    solver = IteratedKirchhoff("Al", [550.0])
    of_profile = best(lambda: solver.scatter(profile, incoming, detector), 2)
    found = {"profile_pair": of_profile / counts(solver, profile, incoming).pairs}
    try:
        surface = gaussian(rms_um=0.6, correlation_um=2.0, shape=(64, 64), pitch_um=0.15, seed=0)
        taken = []
        for side in (3.0, 8.0):  # what is done once for a patch takes longer than the pairs of a small one
            solver = IteratedKirchhoff("Al", [550.0], window_um=side, windows=1, energy=False, bounces=2)
            solver.scatter(surface, incoming, detector)
            run = best(lambda solver=solver: solver.scatter(surface, incoming, detector), 2, waits=_elsewhere())
            taken.append((run, counts(solver, surface, incoming).pairs))
        (small, few), (large, many) = taken
        found["patch_pair"] = max(large - small, 1e-3) / (many - few)
    except BackendError:
        pass  # patches need OpenCL: there is nothing to forecast
    return found
