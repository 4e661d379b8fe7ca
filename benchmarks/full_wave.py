"""Full wave: error and seconds of the rigorous solver, and how both grow.

    python benchmarks/full_wave.py [--quick] [-o results.json]

1. work-precision: error of a grating's efficiencies against unknowns and seconds, on smooth panels of 10 nodes and
   among corners; the error is against a far finer solution
2. growth: seconds of a rough profile (RMS slope 0.35) under a beam, 20 to 160 λ long; exponent over unknowns, fitted
3. angles: what a further angle of incidence costs, with one factorisation for all (finite) and one each (grating)
"""

from __future__ import annotations

import argparse
import json
import time

import numpy as np
from threadpoolctl import threadpool_limits

import vgonio as vg
from vgonio.accuracy import machine
from vgonio.wave.full_wave import periodic, profile, tapered

INDEX = 0.79 + 5.85j  # aluminium at 550 nm


def timed(work):
    """(result, processor seconds of one thread): other programs on the machine do not count"""
    with threadpool_limits(1):
        start = time.process_time()
        result = work()
    return result, time.process_time() - start


def efficiency(surface, how: profile.Resolution) -> tuple[np.ndarray, int]:
    """TM efficiencies at 20° of one aluminium grating, and its unknowns."""
    curve = profile.one_period(surface, 0.55, how)
    found = periodic.Grating.of(curve, 2.0, 0.55, INDEX, ("TM",)).diffract(np.deg2rad(20), ("TM",))[0]
    return found.efficiency, found.unknowns


def work_precision(quick: bool) -> list[dict]:
    size = {"shape": (1, 200), "pitch_um": 0.01}
    gratings = {
        "sinusoid, 0.4 µm deep": (vg.surface.sinusoid(2.0, 0.2, **size), [(10, s, 0) for s in (1.6, 1.1, 0.7, 0.5)]),
        "walls, 0.2 µm deep": (vg.surface.lamellar(2.0, 0.2, **size), [(p, 0.16 * p, p // 3) for p in (4, 6, 8, 10)]),
    }
    rows = []
    for name, (surface, settings) in gratings.items():
        exact, _ = efficiency(surface, profile.Resolution(0.25, 1e-9, 13, 2))
        for order, longest, deeper in settings[:2] if quick else settings:
            how = profile.Resolution(longest * 0.55, 1e-8, order, deeper)
            (found, unknowns), seconds = timed(lambda s=surface, h=how: efficiency(s, h))
            error = float(np.abs(found - exact).max() / exact.max())
            rows.append({"grating": name, "nodes": order, "unknowns": unknowns, "error": error, "seconds": seconds})
    return rows


def rough(length: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """x, z of a Gaussian profile, σ = 0.35 λ, T = 1.4 λ, λ = 1."""
    h, t = 0.05, np.arange(-4.2, 4.21, 0.05)
    kernel = np.exp(-2 * (t / 1.4) ** 2)
    n = round(length / h)
    noise = np.random.default_rng(seed).normal(size=n + len(t) - 1)
    return (np.arange(n) + 0.5) * h, 0.35 * np.convolve(noise, kernel, "valid") / np.sqrt(np.sum(kernel**2))


def growth(quick: bool) -> list[dict]:
    rows = []
    tapered.scatter_profile(*rough(15), 1.0, [20.0], "TM", INDEX)  # what is loaded and planned once
    for name, index, polarisation in (("perfect, TE", None, "TE"), ("Al, TM", INDEX, "TM"), ("glass, TE", 1.5, "TE")):
        for length in (15, 30) if quick else (20, 40, 80, 160) if index != 1.5 else (20, 40, 80):
            x, z = rough(length)
            found, seconds = timed(
                lambda x=x, z=z, p=polarisation, i=index: tapered.scatter_profile(x, z, 1.0, [20.0], p, i)
            )
            rows.append(
                {
                    "case": name,
                    "length": length,
                    "unknowns": found.fields.unknowns,
                    "seconds": seconds,
                    "balance": float(found.balance[0]),
                    "condition": found.fields.condition,
                }
            )
    return rows


def exponents(rows: list[dict]) -> dict[str, float]:
    """Of the seconds over the unknowns, from the larger half of the sizes."""
    out = {}
    for name in dict.fromkeys(r["case"] for r in rows):
        some = [r for r in rows if r["case"] == name][-3:]
        out[name] = float(np.polyfit(np.log([r["unknowns"] for r in some]), np.log([r["seconds"] for r in some]), 1)[0])
    return out


def angles(quick: bool) -> dict[str, float]:
    """Seconds of eight angles over those of one."""
    x, z = rough(15 if quick else 40)
    many = list(np.linspace(0, 56, 8))
    surface = vg.surface.sinusoid(2.0, 0.2, (1, 200), 0.01)
    solver = vg.wave.FullWave("Al", [550.0])
    out = {}
    for name, run in {
        "finite": lambda t: tapered.scatter_profile(x, z, 1.0, t, "TE", INDEX),
        "grating": lambda t: solver.orders(surface, t),
    }.items():
        run([0.0])
        out[name] = timed(lambda r=run: r(many))[1] / timed(lambda r=run: r([0.0]))[1]
    return out


def main(arguments: list[str] | None = None) -> dict:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="small sizes, a few seconds")
    parser.add_argument("-o", "--output", help="results as JSON")
    asked = parser.parse_args(arguments)
    print(machine())
    precision = work_precision(asked.quick)
    for r in precision:
        print(
            f"{r['grating']:24s} {r['nodes']:3d} nodes {r['unknowns']:6d} unknowns  error {r['error']:.1e}  "
            f"{r['seconds']:.3f} s"
        )
    rows = growth(asked.quick)
    for r in rows:
        print(
            f"{r['case']:12s} {r['length']:4d} λ {r['unknowns']:6d} unknowns  {r['seconds']:7.2f} s  "
            f"1 − balance {1 - r['balance']:+.1e}  condition {r['condition']:.0e}"
        )
    found = {"machine": machine(), "work_precision": precision, "growth": rows, "exponents": exponents(rows)}
    for name, value in found["exponents"].items():
        print(f"{name}: seconds grow as unknowns^{value:.2f}")
    found["angles"] = angles(asked.quick)
    for name, value in found["angles"].items():
        print(f"{name}: eight angles of incidence take {value:.1f} times as long as one")
    if asked.output:
        with open(asked.output, "w") as file:
            json.dump(found, file, indent=1)
    return found


if __name__ == "__main__":
    main()
