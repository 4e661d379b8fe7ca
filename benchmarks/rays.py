"""Rays: error against run time for each estimator and tracer, the work as a ratio to bare embreex, scaling.

    python benchmarks/rays.py [--quick]

All ratios compare runs next to each other on the same machine; elsewhere seconds are processor time where other work
on the machine would spoil them. The bare call is embreex' own `EmbreeScene.run` on the very arrays that the run cast,
in the same order, in single precision already.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

import vgonio as vg
from vgonio.accuracy import machine
from vgonio.geometric.beam import ParallelBeam, Scene, Strip
from vgonio.geometric.embree import Embree
from vgonio.geometric.singles import Counts, count_batch
from vgonio.geometric.tracers import TRACERS

RMS, CORRELATION, PITCH = 1.0, 5.0, 0.625  # µm


def rough(samples: int = 256) -> vg.surface.Heightfield:
    return vg.surface.gaussian(rms_um=RMS, correlation_um=CORRELATION, shape=(samples, samples), pitch_um=PITCH, seed=0)


def timed(work: Callable[[], Any]) -> tuple[float, float, Any]:
    """Seconds of the clock and of the processor, and what came out."""
    wall, cpu = time.perf_counter(), time.process_time()
    out = work()
    return time.perf_counter() - wall, time.process_time() - cpu, out


class Recording(Embree):
    """Embree that keeps what it was asked, in double precision as the tracer gets it and in single as embreex does."""

    def __init__(self, mesh) -> None:
        super().__init__(mesh)
        self.asked: list[tuple[np.ndarray, np.ndarray]] = []
        self.single: list[tuple[np.ndarray, np.ndarray]] = []

    def facet(self, position, direction):
        self.asked.append((position.copy(), direction))
        self.single.append(((position - self.origin).astype(np.float32), np.array(direction, np.float32)))
        return super().facet(position, direction)


def casts_of_a_run(rays: int) -> Recording:
    """The tracer with all rays that a run of the issue's case casts, in the order of the run."""
    gonio = vg.measure.Gonioreflectometer.hemisphere(theta_i_deg=[30])
    kept: list[Recording] = []

    def remember(mesh):
        kept.append(Recording(mesh))
        return kept[-1]

    TRACERS["recording"] = remember
    gonio.measure(rough(), vg.geometric.RayOptics("Al", [550], rays=rays, threads=1, tracer="recording"))
    del TRACERS["recording"]
    return kept[0]


def case_of_the_issue(rays: int, wavelengths: int, threads: int) -> tuple[float, float]:
    """Seconds of the clock and of the processor, building and sorting included."""
    gonio = vg.measure.Gonioreflectometer.hemisphere(theta_i_deg=[30], resolution_deg=5)
    solver = vg.geometric.RayOptics("Al", np.linspace(400, 700, wavelengths), rays=rays, threads=threads)
    surface = rough()
    wall, cpu, _ = timed(lambda: gonio.measure(surface, solver))
    return wall, cpu


def against_embree(rays: int, repeat: int) -> None:
    """The intersection stage and the whole run over bare embreex on the same rays, one after the other, often.

    Seconds of the clock: with two threads that is what counts, and the ratio of neighbours in time bears a busy
    machine.
    """
    tracer = casts_of_a_run(rays)
    print(f"  {rays:,} rays, {sum(len(a) for a, _ in tracer.asked):,} casts; medians of {repeat} (least … largest)")
    for threads in (1, 2):
        seconds: dict[str, list[float]] = {"bare": [], "stage": [], "whole": [], "building": []}
        with ThreadPoolExecutor(threads) as pool:
            for _ in range(repeat):
                seconds["bare"].append(timed(lambda: list(pool.map(lambda a: tracer.scene.run(*a), tracer.single)))[0])
                seconds["stage"].append(
                    timed(lambda: list(pool.map(lambda a: Embree.facet(tracer, *a), tracer.asked)))[0]
                )
                seconds["whole"].append(case_of_the_issue(rays, 21, threads)[0])
                seconds["building"].append(timed(build)[0])
        bare = np.array(seconds["bare"])
        print(f"  threads: {threads}; bare embreex {np.median(bare):.3f} s")
        without = np.array(seconds["whole"]) - seconds["building"]
        for ratio, meaning in (
            (np.array(seconds["stage"]) / bare, "intersection stage"),
            (np.array(seconds["whole"]) / bare, "whole run, 21 wavelengths, mesh and hierarchy included"),
            (without / bare, "the same without these, which serve all angles and stay on one thread"),
        ):
            print(f"    {meaning} / bare embreex: {np.median(ratio):.2f} ({ratio.min():.2f} … {ratio.max():.2f})")


def build() -> None:
    """What a run does before its first ray: mesh, copy to Embree (embreex takes number by number), hierarchy."""
    tracer = Scene.of(rough(), 1, "embree").tracer
    tracer.facet(np.zeros((1, 3)), np.full((1, 3), -0.5))


def speed(rays: int, repeat: int) -> None:
    case_of_the_issue(min(rays, 20_000), 4, 1)  # libraries are loaded
    print("\nThe issue's case: 256 × 256 Gaussian surface, Al, 30°, hemisphere of 5°")
    for threads in (1, 2):
        for wavelengths in (4, 21, 31):
            wall, cpu = min(case_of_the_issue(rays, wavelengths, threads) for _ in range(2))
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            print(
                f"  {rays:,} rays, {wavelengths:2d} wavelengths, {threads} threads: {wall:.2f} s ({cpu:.2f} s of the "
                f"processor), peak {memory:.0f} MB"
            )
    print("\nAgainst bare embreex, the same case")
    against_embree(rays, repeat)


def narrow_detectors(rays: int) -> None:
    """Variance × work of both estimators for 2° cones in the plane of incidence; work are the rays and points cast, and
    one ray for every facet where starters of several reflections were looked for."""
    print(f"\nNarrow detectors (2° cones, −60 … 60°), {rays:,} rays: how many fewer rays for the same error")
    surfaces = {
        "sandblasted α = 0.3": vg.surface.sandblasted(seed=1),
        "Gaussian α = 0.4": rough(),
    }
    for theta in (30, 65):
        gonio = vg.measure.Gonioreflectometer([theta], range(-60, 61, 10), aperture_deg=2)
        for name, surface in surfaces.items():
            runs = {}
            for estimator in ("binning", "facets"):
                solver = vg.geometric.RayOptics("Al", [550], rays=rays, threads=1, estimator=estimator, edges="mirror")
                runs[estimator] = timed(lambda: gonio.measure(surface, solver))[1:]  # noqa: B023
            (slow, a), (fast, b) = runs["binning"], runs["facets"]
            keep = ((a.brdf > 1e-3 * a.brdf.max()) & (a.brdf_stderr > 0)).values
            work = (rays + int(b.attrs["facet_points"]) + b.attrs["facets"]) / rays
            gain = np.sort((a.brdf_stderr.values[keep] / np.maximum(b.brdf_stderr.values[keep], 1e-9)) ** 2 / work)
            shown = ["exact" if g > 1e9 else f"{g:.1f} ×" for g in (gain[0], gain[len(gain) // 2])]
            print(
                f"  θ_i = {theta}°, {name}: fewer rays by {shown[1]} (median), {shown[0]} (least); "
                f"processor time {fast:.2f} s against {slow:.2f} s"
            )


def tolerances(cap: int) -> None:
    print("\nTolerance asked, error stated, rays, points on facets, processor seconds (in plane, 2° cones)")
    gonio = vg.measure.Gonioreflectometer([30], range(-60, 61, 10), aperture_deg=2)
    for estimator in ("binning", "facets"):
        for tol in (0.1, 0.03, 0.01):
            solver = vg.geometric.RayOptics("Al", [550], rays=cap, tol=tol, threads=1, estimator=estimator)
            _, cpu, data = timed(lambda: gonio.measure(rough(), solver))  # noqa: B023
            print(
                f"  {estimator:8s} {tol:5.2f} {data.attrs['error_achieved']:8.4f} {int(data.rays[0]):12,} "
                f"{data.attrs['facet_points']:10,} {cpu:8.2f}"
            )


def scaling(rays: int, sizes: tuple[int, ...]) -> None:
    print("\nScaling with triangles (one thread): build and trace, processor seconds")
    for samples in sizes:
        surface = rough(samples)
        _, build, scene = timed(lambda: Scene.of(surface, 1, "embree"))  # noqa: B023
        beam = ParallelBeam(scene, vg.measure.Gonioreflectometer([30], [0]).incoming, 0)
        with ThreadPoolExecutor(1) as pool:
            _, look, _ = timed(lambda: beam.prepare(pool))  # noqa: B023
        counts = Counts(beam.facets, rays)
        strips = [Strip(rays // 8, k * (rays // 8), rays) for k in range(8)]
        _, cpu, _ = timed(lambda: list(count_batch(beam, counts, strips, np.random.default_rng(0), 100)))  # noqa: B023
        print(
            f"  {beam.facets:10,} triangles: build {build:.2f} s, facets' fates {look:.2f} s, "
            f"{rays / cpu / 1e6:.2f} M rays/s"
        )


def tracers(rays: int) -> None:
    print(
        "\nTracers on the same rays, M casts/s of the clock, how often the facet differs from embree's, and the error "
        f"of {rays:,} rays in cones of 10° with its processor seconds"
    )
    surface = rough(64)
    rng = np.random.default_rng(0)
    for name in TRACERS:
        try:
            scene = Scene.of(surface, 1, name)
        except vg.VgonioError as e:
            print(f"  {name}: left out, {e}")
            continue
        x0, x1, y0, y1 = scene.mesh.box
        position = np.column_stack(
            [rng.uniform(x0, x1, rays), rng.uniform(y0, y1, rays), np.full(rays, scene.mesh.z_range[1])]
        )
        direction = np.broadcast_to([0.5, 0.0, -np.sqrt(0.75)], position.shape)
        scene.tracer.facet(position[:10], direction[:10])
        reference = Embree(scene.mesh).facet(position, direction)
        wall, _, found = timed(lambda: scene.tracer.facet(position, direction))  # noqa: B023
        gonio = vg.measure.Gonioreflectometer([30], range(-60, 61, 20), aperture_deg=10)
        solver = vg.geometric.RayOptics("Al", [550], rays=rays, tracer=name, threads=1)
        _, cpu, data = timed(lambda: gonio.measure(surface, solver))  # noqa: B023
        print(
            f"  {name:10s} {rays / wall / 1e6:8.3f}   {np.mean(found != reference):.1e}   "
            f"{data.attrs['error_achieved']:.3f} in {cpu:.2f} s"
        )


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--speed", action="store_true", help="only the comparison with bare embreex")
    parser.add_argument("--quick", action="store_true", help="few rays: only shows that it runs")
    chosen = parser.parse_args(arguments)
    quick = chosen.quick
    print(machine())
    speed(30_000 if quick else 4_000_000, 2 if quick else 7)
    if chosen.speed:
        return
    for rays in (20_000,) if quick else (400_000, 2_000_000):
        narrow_detectors(rays)
    tolerances(30_000 if quick else 10_000_000)
    scaling(20_000 if quick else 500_000, (64,) if quick else (128, 256, 512, 1024))
    tracers(2_000 if quick else 20_000)


if __name__ == "__main__":
    main()
