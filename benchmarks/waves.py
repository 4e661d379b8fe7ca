"""Waves: seconds, memory and error of the surface integral, as ratios in one run.

    python benchmarks/waves.py [--quick] [-o results.json] [--figure docs/work_precision.png]

1. work-precision: asked and achieved error against seconds, for nufft, opencl and reference
2. whole map as one window, no cone: 17 θ_i × 33 θ_o × 20 λ on 500 × 500 µm, tol 1e-4
3. everyday: Gaussian windows ℓ = 30 µm over 500 µm, 2° cone, the same angles and wavelengths, tol 1e-3
4. a scene's hemisphere: cells of 2°, 20 wavelengths, one window ℓ = 10 µm on 0.5 µm texels, tol 1e-3
5. hemisphere: 128 × 128 direction cosines, one wavelength, window σ = 10 µm, 0.5 µm texels, tol 1e-4
Each time stands beside the terms (points × directions × wavelengths) that a direct sum would have had, and the rate of
the OpenCL and numpy direct sums measured in the same run.
"""

from __future__ import annotations

import argparse
import json
import resource
import time

import numpy as np

import vgonio as vg
from vgonio.accuracy import machine
from vgonio.errors import BackendError
from vgonio.wave import nufft, opencl, reference
from vgonio.wave.fourier import evaluate
from vgonio.wave.quadrature import Points

ASKED = 1e9  # terms per second that the direct sum was to reach


def timed(work):
    """(result, seconds)"""
    start = time.perf_counter()
    result = work()
    return result, time.perf_counter() - start


def peak_gb() -> float:
    """Largest resident memory so far, GB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def direct_rates(points: int = 40_000, vectors: int = 400) -> dict[str, float]:
    """Terms per second of the direct sums, and of the in-plane transform on the same points and vectors."""
    rng = np.random.default_rng(0)
    side = int(np.sqrt(points))
    x = np.arange(side) * 0.1
    p = Points(x, x, rng.normal(size=(side, side)), np.full((side, side), 0.01))
    q = np.stack([rng.uniform(-30, 30, vectors), np.zeros(vectors), rng.uniform(2, 33, vectors)], axis=1)
    rates = {}
    _, seconds = timed(lambda: reference.transform(p, q[:20]))
    rates["numpy"] = p.size * 20 / seconds
    try:
        opencl.transform(p, q)
        many = np.repeat(q, 20, axis=0)
        _, seconds = timed(lambda: opencl.transform(p, many))
        rates["opencl"] = p.size * len(many) / seconds
    except BackendError as e:
        print(f"opencl left out: {e}")
    nufft.transform(p, q, 1e-4)
    many = np.repeat(q, 40, axis=0) * (1 - 1e-9 * np.arange(40 * vectors))[:, None]
    many[:, 1] = 0
    _, seconds = timed(lambda: nufft.transform(p, many, 1e-4))
    rates["nufft"] = p.size * len(many) / seconds
    # as many points and targets in one call as the whole map has in one of its strips
    side, targets = round(10 * np.sqrt(points)), 11_000
    x = np.arange(side) * 0.1
    large = Points(x, x, rng.normal(size=(side, side)), np.full((side, side), 0.01))
    q = np.stack([rng.uniform(-30, 30, targets), np.zeros(targets), rng.uniform(2, 33, targets)], axis=1)
    _, seconds = timed(lambda: nufft.transform(large, q, 1e-4))
    rates["nufft, map"] = large.size * targets / seconds
    return rates


def work_precision(quick: bool) -> list[dict]:
    """Asked and achieved error (against a reference of 1e-11) and seconds over the decades of the tolerance."""
    surface = vg.surface.gaussian(rms_um=0.3, correlation_um=3, shape=(64, 64), pitch_um=0.4, seed=1)
    window = np.hanning(64)[:, None] * np.hanning(64)
    rng = np.random.default_rng(1)
    q = np.stack([rng.uniform(-15, 15, 64), np.zeros(64), rng.uniform(5, 20, 64)], axis=1)
    exact = evaluate(surface, q, window, "reference", 1e-8 if quick else 1e-11).S
    rows = []
    for tol in (1e-2, 1e-4) if quick else 10.0 ** np.arange(-2, -9, -1):
        for method in ("nufft", "opencl", "reference"):
            if method == "opencl" and tol < 1e-4:
                continue
            try:
                result, seconds = timed(lambda m=method, t=tol: evaluate(surface, q, window, m, t))
            except BackendError as e:
                print(f"{method} left out: {e}")
                continue
            error = float(np.linalg.norm(result.S - exact) / np.linalg.norm(exact))
            rows.append({"method": method, "asked": tol, "achieved": error, "stated": result.error, "seconds": seconds})
    return rows


def scene(case: str, quick: bool) -> dict:
    """One of the large cases: seconds, memory, error, terms a second of the direct sum that it stands for."""
    side = 64.0 if quick else 500.0
    n = round(side / 0.5)
    surface = vg.surface.gaussian(rms_um=1.0, correlation_um=10, shape=(n, n), pitch_um=0.5, seed=1)
    angles = {"theta_i_deg": np.arange(0, 85, 5), "theta_o_deg": np.arange(-80, 81, 5)}
    if quick:
        angles = {"theta_i_deg": [0, 40], "theta_o_deg": np.arange(-80, 81, 20)}
    wavelengths = np.linspace(400, 780, 3 if quick else 20)
    if case == "whole map":
        gonio = vg.measure.Gonioreflectometer(**angles, aperture_deg=1e-4, coherence_um=None)
        solver = vg.wave.Kirchhoff("Al", wavelengths, tol=1e-4)
    else:
        gonio = vg.measure.Gonioreflectometer(**angles, aperture_deg=2.0, coherence_um=5 if quick else 30)
        solver = vg.wave.Kirchhoff("Al", wavelengths, tol=1e-3)
    data, seconds = timed(lambda: gonio.measure(surface, solver))
    a = data.attrs
    rate = float(a["points_per_window"]) * a["scattering_vectors"] * a.get("windows_used", 1) / seconds
    return {"case": case, "seconds": seconds, "error": a["error_achieved"], "terms_per_s": rate, "GB": peak_gb()}


def cells(quick: bool) -> dict:
    """The BRDF over the hemisphere in cells of 2°, spectrum and all, from one coherence window."""
    n = 64 if quick else 160
    surface = vg.surface.power_law(rms_um=0.15, shape=(n, n), pitch_um=0.5, seed=1, long_cutoff_um=n / 4)
    gonio = vg.measure.Gonioreflectometer.hemisphere([0], resolution_deg=15 if quick else 2, coherence_um=n / 16)
    solver = vg.wave.Kirchhoff("Al", np.linspace(400, 780, 3 if quick else 20), tol=1e-3, windows=1)
    data, seconds = timed(lambda: gonio.measure(surface, solver))
    a = data.attrs
    rate = float(a["points_per_window"]) * a["scattering_vectors"] / seconds
    what = f"hemisphere in cells, {data.sizes['cell']} × {data.sizes['wavelength']} λ"
    return {"case": what, "seconds": seconds, "error": a["error_achieved"], "terms_per_s": rate, "GB": peak_gb()}


def draw(rows: list[dict], path: str) -> None:
    """Work-precision: error asked and achieved against seconds."""
    from vgonio.report.style import MUTED, new_figure, styled

    @styled
    def figure():
        made = new_figure(7.5, 3.4)
        left, right = made.subplots(1, 2)
        for method, colour in (("nufft", "#0072b2"), ("opencl", "#d55e00"), ("reference", "#009e73")):
            own = [r for r in rows if r["method"] == method]
            achieved, seconds, asked = ([r[k] for r in own] for k in ("achieved", "seconds", "asked"))
            left.loglog(achieved, seconds, "o-", color=colour, label=method, ms=4)
            right.loglog(asked, achieved, "o-", color=colour, ms=4)
        ends = [min(r["asked"] for r in rows), max(r["asked"] for r in rows)]
        right.loglog(ends, ends, ":", color=MUTED, label="as asked")
        left.set(title="work against precision", xlabel="error achieved", ylabel="seconds")
        right.set(title="achieved and asked", xlabel="error asked", ylabel="error achieved")
        left.legend()
        right.legend()
        return made

    figure().savefig(path, dpi=130, facecolor="white")


def hemisphere(quick: bool) -> dict:
    """Direction cosines over the hemisphere through one window of a scratched-like surface."""
    n, cosines = (48, 24) if quick else (160, 128)
    surface = vg.surface.power_law(rms_um=0.15, shape=(n, n), pitch_um=0.5, seed=1, long_cutoff_um=n / 4)
    c = (np.arange(n) + 0.5) * 0.5 - n / 4
    window = np.exp(-(c[:, None] ** 2 + c**2) / (2 * (n / 16) ** 2))
    u = (np.arange(cosines) + 0.5) * 2 / cosines - 1
    sx, sy = (a.ravel() for a in np.meshgrid(u, u))
    up = sx**2 + sy**2 < 1
    q = 2 * np.pi / 0.55 * np.stack([sx[up], sy[up], 1 + np.sqrt(1 - sx[up] ** 2 - sy[up] ** 2)], axis=1)
    result, seconds = timed(lambda: evaluate(surface, q, window, "auto", 1e-4))
    terms = result.points * len(q) / seconds
    return {"case": f"hemisphere, {len(q)} directions, {result.method}", "seconds": seconds, "error": result.error,
            "terms_per_s": terms, "GB": peak_gb()}  # fmt: skip


def main(arguments: list[str] | None = None) -> dict:
    """Run everything, print it, and return it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="small cases, a few seconds")
    parser.add_argument("-o", "--output", help="JSON file for the figures")
    parser.add_argument("--figure", help="picture of the work-precision diagram")
    asked = parser.parse_args(arguments)
    print(machine())
    rates = direct_rates()
    for name, rate in rates.items():
        print(f"{name:10s} {rate:10.3g} terms/s   {rate / rates['numpy']:8.1f} × numpy {rate / ASKED:8.2f} × 1e9")
    cases = [hemisphere(asked.quick), cells(asked.quick)]
    cases += [scene("everyday windows", asked.quick), scene("whole map", asked.quick)]
    for c in cases:
        print(
            f"{c['case']:40s} {c['seconds']:7.2f} s  error {c['error']:.1e}  {c['terms_per_s']:.2g} terms/s "
            f"({c['terms_per_s'] / rates['numpy']:.0f} × numpy)  {c['GB']:.2f} GB so far"
        )
    precision = work_precision(asked.quick)
    for r in precision:
        print(f"{r['method']:10s} asked {r['asked']:.0e}  achieved {r['achieved']:.1e}  {r['seconds']:.3f} s")
    if asked.figure:
        draw(precision, asked.figure)
    found = {"machine": machine(), "rates": rates, "cases": cases, "work_precision": precision}
    if asked.output:
        with open(asked.output, "w", encoding="utf-8") as file:
            json.dump(found, file, indent=1)
    return found


if __name__ == "__main__":
    main()
