"""Three-dimensional patches of iterated Kirchhoff: error against seconds, all pairs of points and blocks of points.

    python benchmarks/patches.py [--quick] [-o results.json]

One reflection more of first fields (30°, 550 nm, λ/7) on Gaussian surfaces, slope 0.5, correlation lengths of 2 and
16 µm. Large patches are run on some strips of eight rows, and their seconds are those times all rows over these. The
seconds are the processors', all threads together; the error is the 2-norm of what differs from all pairs on a few rows.
"""

from __future__ import annotations

import argparse
import json
import resource
import time

import numpy as np

import vgonio as vg
from vgonio.accuracy import machine
from vgonio.materials import material
from vgonio.wave.coherence import Window
from vgonio.wave.iterated.blocks import Rules, levels
from vgonio.wave.iterated.pairs import _Work
from vgonio.wave.iterated.patch import Patch, first_fields

LAMBDA, SLOPE, STRIP = 0.55, 0.5, 8
STRIPS = (0.15, 0.5, 0.85)  # where on the patch
FEW = 300  # rows, up to which all are run


def case(side: float, correlation: float, name: str) -> tuple[Patch, _Work]:
    """The patch, and its work with the first fields as sources."""
    pitch = min(correlation / 8, 0.25)
    n = 2 * round(max(side, 3 * correlation) / pitch / 2)
    surface = vg.surface.gaussian(SLOPE * correlation / 2**0.5, correlation, (n, n), pitch, seed=1)
    middle = n * pitch / 2
    patch = Patch.of(surface, Window(side / 6, (side / 2, side / 2), (middle, middle)), LAMBDA / 7, 0.0)
    metal, k = material(name), 2 * np.pi / LAMBDA
    fields = first_fields(patch, np.array([0.5, 0.0, 0.75**0.5]), k, metal, 1e3 * LAMBDA, 0.0)
    return patch, _Work.of(patch.grid, fields, k, None if metal.perfect else complex(metal.index(1e3 * LAMBDA)))


def measured(work: _Work, rules: Rules | None) -> tuple[float, np.ndarray]:
    """Processor seconds of all rows, and what arrives at the rows that were run."""
    rows = work.shape[0]
    starts = range(0, rows, STRIP) if rows <= FEW else [int(c * rows) // STRIP * STRIP for c in STRIPS]
    counts = [min(STRIP, rows - a) for a in starts]
    work.reflect(0, STRIP, rules)  # builds the kernels
    start = time.process_time()
    for a, count in zip(starts, counts):
        work.reflect(a, count, rules)
    seconds = (time.process_time() - start) * rows / sum(counts)
    found = work.result()
    return seconds, np.concatenate([found[:, :, a : a + count] for a, count in zip(starts, counts)], axis=2)


def main(arguments: list[str] | None = None) -> dict:
    """Run everything, print it, and return it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="5 and 8 µm, perfect conductor, some seconds")
    parser.add_argument("-o", "--output", help="JSON file for the figures")
    asked = parser.parse_args(arguments)
    print(machine())
    rows = []
    for correlation in (2.0,) if asked.quick else (2.0, 16.0):
        for side in (5.0, 8.0) if asked.quick else (20.0, 40.0, 80.0):
            patch, work = case(side, correlation, "perfect" if asked.quick else "Al")
            seconds, exact = measured(work, None)
            of = {"T": correlation, "side": side, "points": patch.grid.z.size}
            found = [of | {"method": "pairs", "seconds": seconds, "error": 0.0}]
            for tol in (1e-2, 1e-3):
                seconds, got = measured(work, levels(tol, patch.grid.pitch)[0])
                error = float(np.linalg.norm(got - exact) / np.linalg.norm(exact))
                found.append(of | {"method": f"blocks {tol:g}", "seconds": seconds, "error": error})
            for r in found:
                r["gigabytes"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
                print(
                    ", ".join(f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in r.items()), flush=True
                )
            rows += found
    result = {"machine": machine(), "rows": rows}
    if asked.output:
        with open(asked.output, "w", encoding="utf-8") as file:
            json.dump(result, file, indent=1, default=float)
    return result


if __name__ == "__main__":
    main()
