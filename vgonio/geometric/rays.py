"""The ray solver: sample the beam over its projected area, trace, weigh with Fresnel, sort into the detector."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import brdf_dataset, versions
from ..directions import Detector, Incoming, frames, wavelength_list
from ..errors import InputError, nearest
from ..materials import Material, material
from ..surface.heightfield import Heightfield
from ..surface.mesh import Mesh, mesh, mirrored
from .fresnel_table import FresnelTable
from .tally import Tally, tally
from .trace import Embree, Paths, trace

Floats = NDArray[np.float64]
BATCH = 1 << 17  # rays of one batch: bounds the memory, whatever the number of rays
LOST_ENOUGH = 5e-4  # a finite sample that loses more of a trial through its sides is mirrored instead
TRACERS = {"embree": Embree}
EDGES = ("auto", "guard", "mirror")


@dataclass(frozen=True)
class RayOptics:
    """Geometric optics: every facet of the triangulated surface is a mirror (thesis 2.3).

    material : name, file or Material;  wavelength_nm : (w,) nm, all of them share one trace
    rays : number of rays per angle of incidence, a cap where `tol` is given
    tol : relative standard error wanted wherever brdf exceeds 10⁻³ of its largest value, per angle and wavelength
    max_bounces : a ray that goes on beyond is counted as lost;  bounces : entries kept apart, the last gathers the rest
    refinement : mesh cells per sample;  edges : what happens at the sides of a finite sample: "guard" starts rays only
    where what they can reach is real, "mirror" continues it by reflection, "auto" takes the guard band if it loses
    less than 5e-4. Periodic surfaces wrap.

    `scatter` raises InputError for missing points and MaterialError outside the material's table.
    """

    material: str | Material = "Al"
    wavelength_nm: Any = (550.0,)
    rays: int = 10**6
    seed: int = 0
    tol: float | None = None
    max_bounces: int = 100
    bounces: int = 4
    refinement: int = 1
    edges: str = "auto"
    tracer: str = "embree"
    threads: int | None = None
    progress: Callable[[float], None] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "wavelength_nm", tuple(wavelength_list(self.wavelength_nm)))
        for name, low in (("rays", 1), ("max_bounces", 1), ("bounces", 1), ("refinement", 1)):
            value = getattr(self, name)
            if int(value) != value or value < low:
                raise InputError(f"{name} = {value!r}: a whole number of at least {low} is needed")
            object.__setattr__(self, name, int(value))
        if self.tol is not None and not 0 < self.tol < 1:
            raise InputError(f"tol = {self.tol}: a relative error between 0 and 1 is needed")
        if int(self.seed) != self.seed or self.seed < 0:
            raise InputError(f"seed = {self.seed!r}: a whole number that is not negative is needed")
        if self.tracer not in TRACERS:
            raise InputError(f"tracer {self.tracer!r}: {nearest(self.tracer, TRACERS)}")
        if self.edges not in EDGES:
            raise InputError(f"edges {self.edges!r}: {nearest(self.edges, EDGES)}")
        object.__setattr__(self, "material", material(self.material))
        self.material.check(self.wavelength_nm)  # type: ignore[union-attr]

    def scatter(self, surface: Heightfield, incoming: Incoming, detector: Detector) -> xr.Dataset:
        """The BRDF and the energy tallies of `surface`, (theta_i, detector, wavelength), with standard errors."""
        start = time.perf_counter()
        scene, edges = self._scene(surface, incoming)
        table = FresnelTable(self.material, self.wavelength_nm)  # type: ignore[arg-type]
        seeds = np.random.SeedSequence(self.seed).spawn(len(incoming.theta_deg))
        tallies = []
        for i, seed in enumerate(seeds):
            tallies.append(self._one_angle(scene, incoming, i, detector, table, np.random.default_rng(seed)))
            if self.progress:
                self.progress((i + 1) / len(seeds))
        data = self._dataset(tallies, incoming, detector)
        data.attrs |= {
            "edges": edges,
            "seconds": time.perf_counter() - start,
            "facets": len(scene.mesh.faces),
            "surface": surface.name,
        }
        return data

    def _scene(self, surface: Heightfield, incoming: Incoming) -> tuple[Scene, str]:
        """Mesh and tracer; for a finite sample the guard band or, if that loses too much, the mirrored supercell."""
        if surface.periodic:
            return Scene.of(surface, self), "periodic"
        if self.edges != "mirror":
            scene = Scene.of(surface, self)
            if self.edges == "guard" or self._guard_loses(scene, incoming) < LOST_ENOUGH:
                return scene, "guard band"
        return Scene.of(mirrored(surface), self), "mirrored 2 × 2 supercell"

    def _guard_loses(self, scene: Scene, incoming: Incoming) -> float:
        """Largest share of a trial of rays that leaves through the sides."""
        worst = 0.0
        for i in np.argsort(-np.abs(incoming.theta_deg))[:1].tolist() + [int(np.argmin(np.abs(incoming.theta_deg)))]:
            rng = np.random.default_rng(0)
            if scene.start_area(incoming, i) is None:
                return 1.0
            paths = scene.paths(incoming, i, 20_000, rng, self.max_bounces)
            worst = max(worst, float(np.mean(~paths.escaped)))
        return worst

    def _one_angle(
        self,
        scene: Scene,
        incoming: Incoming,
        i: int,
        detector: Detector,
        table: FresnelTable,
        rng: np.random.Generator,
    ) -> Tally:
        total = Tally.empty(self.bounces, len(detector), len(self.wavelength_nm))
        workers = self.threads or os.cpu_count() or 1

        def batch(job: tuple[int, np.random.Generator]) -> Tally:
            paths = scene.paths(incoming, i, job[0], job[1], self.max_bounces)
            return tally(paths, table, detector, incoming.polarisation, self.bounces)

        with ThreadPoolExecutor(workers) as pool:
            for group in _groups(self.rays, workers, rng):
                # in the order of the batches, so that the sums do not depend on the threads
                for part in pool.map(batch, group):
                    total += part
                if self.tol is not None and relative_error(total) <= self.tol:
                    break
        return total

    def _dataset(self, tallies: list[Tally], incoming: Incoming, detector: Detector) -> xr.Dataset:
        n = np.array([t.rays for t in tallies], float)
        share = 1.0 / (n[:, None, None, None] * detector.projected_solid_angle[:, None])
        f = np.stack([t.caught for t in tallies]) * share
        variance = np.stack([t.caught_variance for t in tallies])

        def stderr(variance: Floats) -> Floats:
            count = n.reshape(-1, *[1] * (variance.ndim - 1))
            return np.sqrt(variance) / (count * detector.projected_solid_angle[:, None])

        over = ("theta_i", *detector.dims, "wavelength")
        return brdf_dataset(
            {
                "brdf": (over, f.sum(axis=1)),
                "brdf_stderr": (over, stderr(variance.sum(axis=1))),
                "brdf_by_bounce": (("bounce", *over), np.moveaxis(f, 1, 0)),
                "brdf_by_bounce_stderr": (("bounce", *over), np.moveaxis(stderr(variance), 1, 0)),
                "energy_by_bounce": (
                    ("theta_i", "bounce", "wavelength"),
                    np.stack([t.upward / t.rays for t in tallies]),
                ),
                "energy_absorbed": (("theta_i", "wavelength"), np.stack([t.absorbed / t.rays for t in tallies])),
                "energy_lost": (("theta_i", "wavelength"), np.stack([t.lost / t.rays for t in tallies])),
                "rays": (("theta_i",), n.astype(np.int64)),
            },
            incoming.theta_deg,
            self.wavelength_nm,
            detector,
            phi_i_deg=incoming.phi_deg,
            coords={"bounce": np.arange(1, self.bounces + 1)},
            attrs={
                "method": "rays: geometric optics, Stokes vectors from hit to hit",
                "solver": "RayOptics",
                "material": self.material.name,  # type: ignore[union-attr]
                "material_source": self.material.source,  # type: ignore[union-attr]
                "polarisation": incoming.polarisation,
                "backend": "embreex, robust mode",
                "device": "CPU",
                "seed": self.seed,
                "rays_asked": self.rays,
                "tolerance_asked": "none" if self.tol is None else self.tol,
                "error_achieved": float(max(relative_error(t) for t in tallies)),
                "error_estimate": "largest relative standard error where brdf exceeds 1e-3 of its largest value "
                "per theta_i and wavelength, from the variance over rays",
                "max_bounces": self.max_bounces,
                "bounce_last": f"{self.bounces} gathers {self.bounces} and more reflections",
                "versions": versions(),
            },
        )


@dataclass(frozen=True)
class Scene:
    """A mesh with its tracer, and the beam that falls on it."""

    mesh: Mesh
    tracer: Embree

    @staticmethod
    def of(surface: Heightfield, solver: RayOptics) -> Scene:
        m = mesh(surface, solver.refinement)
        return Scene(m, TRACERS[solver.tracer](m))

    def start_area(self, incoming: Incoming, i: int) -> tuple[float, float, float, float] | None:
        """(x0, x1, y0, y1) at the top of the mesh where rays start.

        Periodic: one period. Finite: so far inside that the first hit is real, and a margin for the way out, a
        quarter of what is left. None where nothing is left.
        """
        x0, x1, y0, y1 = self.mesh.box
        if self.mesh.period is not None:
            return x0, x1, y0, y1
        bottom, top = self.mesh.z_range
        w = incoming.vectors[i]
        reach = -(top - bottom) * w[:2] / w[2] * 1.001
        lo = np.array([x0, y0]) - np.minimum(reach, 0)
        hi = np.array([x1, y1]) - np.maximum(reach, 0)
        margin = 0.25 * (hi - lo)
        lo, hi = lo + margin, hi - margin
        return None if np.any(hi - lo < 0.05 * np.array([x1 - x0, y1 - y0])) else (lo[0], hi[0], lo[1], hi[1])

    def paths(self, incoming: Incoming, i: int, n: int, rng: np.random.Generator, max_bounces: int) -> Paths:
        """Trace n rays of incidence i: starts stratified over the area, directions over the source's cone."""
        area = self.start_area(incoming, i)
        if area is None:
            raise InputError(
                f"θ_i = {incoming.theta_deg[i]:g}°: the sample is too small for a guard band, "
                "use edges = 'auto' or 'mirror'"
            )
        position = np.empty((n, 3))
        position[:, :2] = stratified(area, n, rng)
        position[:, 2] = self.mesh.z_range[1]
        direction, s = beam(incoming, i, n, rng)
        return trace(self.mesh, self.tracer, position, direction, s, max_bounces)


def stratified(area: tuple[float, float, float, float], n: int, rng: np.random.Generator) -> Floats:
    """(n, 2) points: one in each cell of a grid over (x0, x1, y0, y1), row by row; the remainder anywhere."""
    x0, x1, y0, y1 = area
    nx = int(np.clip(np.ceil(np.sqrt(n * (x1 - x0) / (y1 - y0))), 1, n))
    ny = n // nx
    cell = np.stack(np.meshgrid(np.arange(nx), np.arange(ny)), axis=-1).reshape(-1, 2)
    unit = (cell + rng.random((nx * ny, 2))) / (nx, ny)
    unit = np.concatenate([unit, rng.random((n - nx * ny, 2))])
    return np.array([x0, y0]) + unit * np.array([x1 - x0, y1 - y0])


def beam(incoming: Incoming, i: int, n: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """(n, 3) directions of travel and s axes of the light that comes from direction i, within the source's cone."""
    w = np.broadcast_to(incoming.vectors[i], (n, 3)).copy()
    if incoming.divergence_deg > 0:
        half = np.deg2rad(incoming.divergence_deg / 2)
        cos = 1 - rng.random(n) * (1 - np.cos(half))
        psi = 2 * np.pi * rng.random(n)
        sin = np.sqrt(1 - cos**2)
        w = np.stack([sin * np.cos(psi), sin * np.sin(psi), cos], axis=1) @ frames(incoming.vectors[i : i + 1])[0].T
        w[:, 2] = np.maximum(w[:, 2], 1e-6)  # a source cone that dips below the horizon is cut there
        w /= np.linalg.norm(w, axis=1, keepdims=True)
    phi = np.deg2rad(incoming.phi_deg)
    s = np.cross([0.0, 0.0, 1.0], w)
    length = np.linalg.norm(s, axis=1, keepdims=True)
    across = np.array([-np.sin(phi), np.cos(phi), 0.0])  # ŷ at normal incidence
    return -w, np.where(length > 1e-9, s / np.maximum(length, 1e-300), across)


def relative_error(t: Tally) -> float:
    """Largest relative standard error of the caught power where it exceeds 10⁻³ of its largest value."""
    power, variance = t.caught.sum(axis=0), t.caught_variance.sum(axis=0)
    counts = (power > 0) & (power >= 1e-3 * power.max(axis=0, keepdims=True))
    if not counts.any():
        return float("inf")
    return float(np.max(np.sqrt(variance[counts]) / power[counts]))


def _groups(rays: int, workers: int, rng: np.random.Generator) -> Iterator[list[tuple[int, np.random.Generator]]]:
    """Batches of rays, each with its own generator, in groups after which the error is looked at."""
    per_group = max(4, workers)
    sizes = [BATCH] * (rays // BATCH) + ([rays % BATCH] if rays % BATCH else [])
    for start in range(0, len(sizes), per_group):
        part = sizes[start : start + per_group]
        yield list(zip(part, rng.spawn(len(part))))
