"""Three-dimensional patches of iterated Kirchhoff: what points see of each other, errors of blocks, seconds, memory.

    python benchmarks/patches.py [--quick] [--only sight rules one whole] [--sides 20 40] [--choose Al] [-o file.json]

Gaussian surfaces, correlation exp(−r²/T²), slope 0.5 where no other is said, 550 nm from 30°, points λ/7 apart. The
parts: `sight`, which pairs see each other and from how far the light comes; `rules`, error of all fields of a second
reflection by blocks of points, against all pairs; `one`, one reflection of all points, each case in a process of its
own: processor seconds of all threads, seconds, the most memory, and the error of blocks on eight rows; `whole`, a
measurement by the solver: two reflections, one θ_i, 35 θ_o, the hemisphere's energies, the check of the spacing.
Results are added to those of the file, so that the parts can be run one after another; the growth is that of all
whole runs. `--strips 3` is a quick look at a patch for which there is no time.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

import vgonio as vg
from vgonio.accuracy import machine
from vgonio.materials import material
from vgonio.wave.coherence import Window
from vgonio.wave.iterated.blocks import Rules, levels
from vgonio.wave.iterated.pair_reference import seen_from
from vgonio.wave.iterated.pairs import _Work, reflect_blocks, reflect_opencl
from vgonio.wave.iterated.patch import Patch, first_fields

LAMBDA, SLOPE, THETA_I = 0.55, 0.5, 30.0
RINGS = (2.2, 8.8)  # µm, between which the light of a second reflection is counted
OBSERVERS = 30
SIGHT = ((2, 10), (2, 20), (2, 40), (2, 80), (5, 20), (5, 40), (16, 20), (16, 40), (16, 80))  # T, side
RULES = (
    (0.3, 5, 29, "perfect"), (0.8, 5, 29, "perfect"), (0.8, 5, 69, "Al"), (0.8, 16, 29, "Al"), (0.8, 2, 29, "Al"),
    (0.8, 5, 29, "SiO2"),
)  # fmt: skip
METHODS = ("pairs", "blocks 0.01", "blocks 0.001")
PARTS = ("sight", "rules", "one", "whole")


def surface_of(side: float, correlation: float, slope: float = SLOPE) -> vg.surface.Heightfield:
    pitch = min(correlation / 8, 0.25)
    n = 2 * round(max(side, 3 * correlation) / pitch / 2)
    return vg.surface.gaussian(slope * correlation / 2**0.5, correlation, (n, n), pitch, seed=1)


def patch_of(side: float, correlation: float, slope: float = SLOPE) -> Patch:
    surface = surface_of(side, correlation, slope)
    middle = surface.size_um[0] / 2
    return Patch.of(surface, Window(side / 6, (side / 2, side / 2), (middle, middle)), LAMBDA / 7, 0.0)


def lit(patch: Patch, theta_i: float, name: str) -> tuple[np.ndarray, float, complex | None]:
    """First fields, wavenumber, refractive index."""
    t, metal = np.deg2rad(theta_i), material(name)
    wi, k = np.array([np.sin(t), 0.0, np.cos(t)]), 2 * np.pi / LAMBDA
    fields = first_fields(patch, wi, k, metal, 1e3 * LAMBDA, 0.0)
    return fields, k, None if metal.perfect else complex(metal.index(1e3 * LAMBDA))


def sight(correlation: float, side: float) -> dict:
    """Share of pairs that see each other, and of Σ|field|² of the second reflection, each ring's field by itself."""
    patch = patch_of(side, correlation)
    grid, (fields, k, _) = patch.grid, lit(patch, THETA_I, "perfect")
    h = fields[:, 6::2] + 1j * fields[:, 7::2]
    x, y = np.meshgrid(patch.x, patch.y)
    seen, power = 0, np.zeros(len(RINGS) + 1)
    for iy, ix in np.random.default_rng(0).integers(0, len(grid.z), (OBSERVERS, 2)):
        r = np.stack([x[iy, ix] - x, y[iy, ix] - y, grid.z[iy, ix] - grid.z])
        own = grid.normal[:, iy, ix]
        pair = seen_from(grid, int(iy), int(ix)) & (np.sum(r * grid.normal, axis=0) > 0)
        pair &= np.einsum("iyx,i->yx", r, own) < 0
        seen += int(pair.sum())
        d = np.linalg.norm(r[:, pair], axis=0)
        across = np.cross(np.broadcast_to(r[:, pair] / d, (2, 3, len(d))), h[..., pair], axis=1)
        arrives = np.cross(own[None, :, None], across, axis=1) * (1j * k - 1 / d) * np.exp(1j * k * d) / d
        ring = np.searchsorted(RINGS, d)
        sums = [arrives[..., ring == i].sum(axis=-1) for i in range(len(power))]
        power += np.sum(np.abs(sums) ** 2, axis=(1, 2))
    return {
        "pairs": seen / OBSERVERS / grid.z.size, "points": seen / OBSERVERS, "power": list(power / power.sum()),
    }  # fmt: skip


def rules(slope: float, correlation: float, theta_i: float, name: str, side: float = 10.0) -> dict:
    """2-norm of the error of all fields, for each of the rules."""
    patch = patch_of(side, correlation, slope)
    fields, k, index = lit(patch, theta_i, name)
    exact = reflect_opencl(patch.grid, fields, k, index)
    found = {}
    for tol in (1e-2, 3e-3, 1e-3):
        got, _ = reflect_blocks(patch.grid, fields, k, index, levels(tol, patch.grid.pitch)[0])
        found[f"{tol:g}"] = float(np.linalg.norm(got - exact) / np.linalg.norm(exact))
    return found


def one(correlation: float, side: float, name: str, method: str, strips: int = 0) -> dict:
    """One reflection of all points, or of some strips of eight rows, with seconds times all rows over theirs: processor
    seconds, seconds, and the error by blocks on eight rows (NaN of strips)."""
    patch = patch_of(side, correlation)
    fields, k, index = lit(patch, THETA_I, name)
    work, chosen, rows = _Work.of(patch.grid, fields, k, index), rules_of(method, patch), len(patch.x)
    work.reflect(0, 1, chosen)  # builds the kernels
    before, used = time.perf_counter(), time.process_time()
    if not strips:
        error = reflect(patch, fields, k, index, method)
        return {"points": patch.grid.z.size, "error": error} | taken(before, used)
    for share in (np.arange(strips) + 0.5) / strips:
        work.reflect(int(share * rows) // 8 * 8, 8, chosen)
    found = taken(before, used)
    found |= {n: found[n] * rows / (8 * strips) for n in ("processor_s", "s")}
    return {"points": patch.grid.z.size, "error": float("nan"), "strips": strips} | found


def reflect(patch: Patch, fields: np.ndarray, k: float, index: complex | None, method: str) -> float:
    """The error of blocks, 0 of all pairs."""
    if (chosen := rules_of(method, patch)) is not None:
        return reflect_blocks(patch.grid, fields, k, index, chosen)[1]
    reflect_opencl(patch.grid, fields, k, index)
    return 0.0


def rules_of(method: str, patch: Patch) -> Rules | None:
    """Of "blocks 0.01" the rules for that error; None of "pairs"."""
    return None if method == "pairs" else levels(float(method.split()[1]), patch.grid.pitch)[0]


def whole(correlation: float, side: float, name: str, method: str) -> dict:
    """A measurement by the solver, its energy and what it says of its errors."""
    surface = surface_of(side, correlation)
    gonio = vg.measure.Gonioreflectometer([THETA_I], range(-85, 86, 5), coherence_um=None, aperture_deg=2)
    how, _, tol = method.partition(" ")
    solver = vg.wave.IteratedKirchhoff(
        name, [1e3 * LAMBDA], bounces=2, window_um=side, windows=1, method=how, tol=float(tol or 1e-3)
    )
    before, used = time.perf_counter(), time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vg.errors.VgonioWarning)  # of tol and of what leaves the patch
        data = gonio.measure(surface, solver)
    told = {n: float(data.attrs[n]) for n in ("error_achieved", "pairs_error", "sight_error")}
    told |= {"energy": data.energy_reflected.item(), "outside": (data.second_hits * data.second_hits_outside).item()}
    return {"backend": data.attrs["backend"], **told} | taken(before, used)


def taken(before: float, used: float) -> dict:
    return {
        "processor_s": time.process_time() - used,
        "s": time.perf_counter() - before,
        "GB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
    }


def alone(part: str, case: tuple) -> dict:
    """In a process of its own, whose memory is that of the case."""
    command = [sys.executable, __file__, "--case", json.dumps([part, *case])]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def cases(part: str, quick: bool, sides: list[float]) -> list[tuple]:
    if part == "sight":
        return [(2, 5)] if quick else [c for c in SIGHT if c[1] <= max(sides)]
    if part == "rules":
        return [(0.8, 5, 29, "Al", 5.0)] if quick else list(RULES)
    if quick:
        return [(2, side, "perfect", m) for side in (5, 8) for m in METHODS[: 1 if part == "whole" else 3]]
    return [
        (t, side, name, m)
        for side in sides for t in (2, 16) for name in ("perfect", "Al") for m in METHODS
        if t == 16 or m == "pairs"
    ]  # fmt: skip


def growth(rows: list[dict]) -> dict:
    """Exponents of points in processor seconds between neighbouring sides, of whole runs."""
    found: dict[str, float] = {}
    kept: dict[tuple, dict] = {}
    for r in sorted((r for r in rows if r["part"] == "one" and not r.get("strips")), key=lambda r: r["case"][1]):
        t, side, name, method = r["case"]
        if (last := kept.get((t, name, method))) is not None:
            p = np.log(r["processor_s"] / last["processor_s"]) / np.log(r["points"] / last["points"])
            found[f"T = {t}, {name}, {method}, {last['case'][1]:g} to {side:g} µm"] = float(p)
        kept[t, name, method] = r
    return found


def main(arguments: list[str] | None = None) -> dict:
    """Run the parts, print them, and return all results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="patches of 5 and 8 µm, some seconds")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, help="these parts")
    parser.add_argument("--sides", nargs="+", type=float, default=[20.0, 40.0, 80.0], help="µm, of one and whole")
    parser.add_argument("--strips", type=int, default=0, help="of one: so many strips of eight rows instead of all")
    parser.add_argument("--choose", default="", help="cases whose text holds these characters, such as 'Al blocks'")
    parser.add_argument("--case", help=argparse.SUPPRESS)
    parser.add_argument("-o", "--output", help="JSON file for the figures, which adds to what is there")
    asked = parser.parse_args(arguments)
    if asked.case:
        part, *case = json.loads(asked.case)
        print(json.dumps({"one": one, "whole": whole}[part](*case)))
        return {}
    file = Path(asked.output) if asked.output else None
    rows = json.loads(file.read_text(encoding="utf-8"))["rows"] if file and file.exists() else []
    print(machine())
    here: dict[str, Callable[..., dict]] = {"sight": sight, "rules": rules}
    for part in asked.only:
        for case in cases(part, asked.quick, asked.sides):
            if asked.choose not in " ".join(str(c) for c in case):
                continue
            if part == "one" and asked.strips:
                case = (*case, asked.strips)
            found = here[part](*case) if part in here else alone(part, case)
            row = {"part": part, "case": list(case), **found, "at": time.strftime("%F %R")}
            rows = [r for r in rows if (r["part"], r["case"]) != (part, row["case"])] + [row]
            print(part, *case, {n: _short(v) for n, v in found.items()}, flush=True)
            if file:
                file.write_text(json.dumps({"machine": machine(), "rows": rows}, indent=1), encoding="utf-8")
    print("exponents of the points:", {n: round(p, 2) for n, p in growth(rows).items()})
    return {"machine": machine(), "rows": rows, "growth": growth(rows)}


def _short(value: object) -> object:
    if isinstance(value, list):
        return [_short(v) for v in value]
    return float(f"{value:.3g}") if isinstance(value, float) else value


if __name__ == "__main__":
    main()
