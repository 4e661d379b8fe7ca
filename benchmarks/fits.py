"""Fits: are parameters recovered within their stated errors, and how long does it take?

    python benchmarks/fits.py [--quick] [--seeds 50] [--json] [--table benchmarks/fits.csv]

For each model synthetic in-plane data with 1 % multiplicative noise, over many seeds: RMS of the pulls (deviation from
the truth in stated standard errors, 1 is right) of every parameter and of all coefficients, χ² of all parameters with
their covariance neglected, decades that the spectra span. The noise is independent from value to value, and the errors
are estimated so (cluster="value"); three cases again with the default, whole spectra as observations. Then seconds of
the local shift fits and of full model fits of 297 spectra × 100 wavelengths.
"""

from __future__ import annotations

import argparse
import json
import time
from typing import Any

import numpy as np
import xarray as xr

from vgonio import models
from vgonio.accuracy import machine
from vgonio.compare import fit_global_shift, fit_local_shift, fit_model, fit_two_shifts

NOISE = 0.01
QUICK = ("facets, alpha 0.35", "dielectric 4.8", "lambert", "harvey")
SAFE = ("shift, alpha 0.35", "facets, alpha 0.1", "dielectric 4.8")
THETA_I = np.arange(0.0, 81, 20)
THETA_O = np.arange(-80.0, 81, 10)
FINE = np.unique(np.concatenate([THETA_O, *(-THETA_I + d for d in (-2.0, -1, 1, 2))]))
WAVELENGTH = np.arange(400.0, 781, 40)


def share() -> xr.DataArray:
    i, o = np.radians(THETA_I)[:, None], np.radians(THETA_O)
    values = np.clip(0.3 + 0.7 * np.cos((i + o) / 2) ** 8, 0, 1)
    return xr.DataArray(values, {"theta_i": THETA_I, "theta_o": THETA_O}, ("theta_i", "theta_o"))


def cases() -> dict[str, tuple[str, dict[str, Any], dict[str, Any]]]:
    """Name: model, truth, options of the fit."""
    found: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
        f"facets, alpha {a:g}": ("cook-torrance-1982", {"alpha": a}, {}) for a in (0.02, 0.1, 0.35, 0.8)
    }
    found |= {
        f"shift, alpha {a:g}": ("clausen-2022", {"alpha": a, "h": 1.8e-3, "w": w}, {})
        for a, w in ((0.02, 8.0), (0.1, 5.0), (0.35, 3.0), (0.8, 2.0))
    }
    return found | {
        "beckmann": ("beckmann-1963", {"alpha": 0.2}, {}),
        "offset 3.1": ("cook-torrance-1982", {"alpha": 0.3, "c": 0.02}, {"free": ["alpha", "c"]}),
        "dielectric 4.7": ("cook-torrance-1982", {"alpha": 0.2, "eta": 1.5, "k_d": 0.4}, {"material": None}),
        "k_s and k_d 2.23": (
            "cook-torrance-1982",
            {"alpha": 0.2, "eta": 1.5, "k_d": 0.4, "k_s": 0.8},
            {"eta": 1.5, "coefficients": ["k_d", "k_s"]},
        ),
        "dielectric 4.8": (
            "clausen-2022",
            {"alpha": 0.3, "h": 1.8e-3, "w": 3.0, "eta": 1.5, "k_d": 0.4},
            {"material": None},
        ),
        "two shifts": (
            "two-shifts",
            {"alpha": 0.35, "h1": 1.8e-3, "w1": 3.0, "h2": -3e-3, "w2": 1.5, "single_share": share()},
            {"single_share": share()},
        ),
        "lambert": ("lambert-1760", {"k_d": 0.5}, {}),
        "oren-nayar": ("oren-nayar-1994", {"sigma_deg": 25.0, "k_d": 0.5}, {}),
        "harvey": ("harvey-1976", {"l": 0.02, "s": -2.4, "k_s": 100.0}, {}),
        "krywonos": ("krywonos-2011", {"rms_um": 0.01, "b_um": 5.0, "c_psd": 3.0}, {}),
    }


def recovered(model: str, truth: dict[str, Any], options: dict[str, Any], seeds: int, cluster: str) -> dict[str, Any]:
    """RMS pulls over the seeds, χ² per degree of freedom, decades, seconds of a fit, seeds that said something."""
    fine = truth.get("alpha", truth.get("l", 1.0)) < 0.06
    data = models.evaluate(model, THETA_I, FINE if fine else THETA_O, WAVELENGTH, **truth)
    pulls: dict[str, list[float]] = {}
    inside: list[float] = []
    noted, began = 0, time.perf_counter()
    for seed in range(seeds):
        noise = np.random.default_rng(seed).standard_normal(data.brdf.shape)
        fit = fit_model(data.assign(brdf=data.brdf * (1 + NOISE * noise)), model, cluster=cluster, **options)
        for name in json.loads(fit.attrs["free"]):
            pulls.setdefault(name, []).append((float(fit[name]) - truth[name]) / float(fit[f"{name}_stderr"]))
        for name in json.loads(fit.attrs["coefficients"]):
            inside += ((fit[name] - truth[name]) / fit[f"{name}_stderr"]).values.tolist()
        noted += bool(json.loads(fit.attrs["notes"]))
    everything = np.array([*pulls.values()]).ravel() if pulls else np.array(inside)
    values = data.brdf.values[data.brdf.values > 0]
    return {
        "pulls": {k: float(np.sqrt(np.mean(np.square(v)))) for k, v in pulls.items()},
        "coefficients": float(np.sqrt(np.mean(np.square(inside)))) if inside else None,
        "chi2_per_dof": float(np.mean(everything**2)),
        "decades": float(np.log10(values.max() / values.min())),
        "seconds": (time.perf_counter() - began) / seeds,
        "noted": noted,
    }


def timings(quick: bool) -> list[tuple[str, float]]:
    """Seconds of fits to 297 spectra × 100 wavelengths (quick: 10)."""
    grid = np.arange(0.0, 81, 10), np.arange(-80.0, 81, 5), np.linspace(380, 780, 10 if quick else 100)
    rng = np.random.default_rng(0)
    metal = models.evaluate("clausen-2022", *grid, alpha=0.35, h=1.8e-3, w=3.0)
    white = models.evaluate("clausen-2022", *grid, alpha=0.3, h=1.8e-3, w=3.0, eta=1.5, k_d=0.4)
    metal, white = (d.assign(brdf=d.brdf * (1 + NOISE * rng.standard_normal(d.brdf.shape))) for d in (metal, white))
    jobs = {
        "local shift fits, p fixed": lambda: fit_local_shift(metal, p=1.0),
        "local shift fits, p fitted": lambda: fit_local_shift(metal),
        "global shift h, w, t_y, p": lambda: fit_global_shift(metal),
        "two shifts h1, w1, h2, w2, p": lambda: fit_two_shifts(metal, 0.8),
        "model 4.6 (alpha)": lambda: fit_model(metal, "cook-torrance-1982"),
        "model 4.8 (alpha, h, w)": lambda: fit_model(metal),
        "model 4.8 (alpha, eta, h, w, 100 k_d)": lambda: fit_model(white, material=None),
        "the same, 50 bootstrap samples": lambda: fit_model(white, material=None, errors="bootstrap"),
        "two shifts (alpha, h1, w1, h2, w2)": lambda: fit_model(metal, "two-shifts", single_share=0.8),
    }
    found = []
    for name, job in list(jobs.items())[: -2 if quick else None]:
        began = time.perf_counter()
        job()
        found.append((name, time.perf_counter() - began))
    return found


def write_table(path: str, seeds: int, rows: dict[str, dict[str, Any]]) -> None:
    """One line a case: seeds, χ² per degree of freedom, decades of the spectra."""
    with open(path, "w", encoding="utf-8") as stream:
        stream.write("case,seeds,chi2_per_dof,decades\n")
        for name, row in rows.items():
            stream.write(f'"{name}",{seeds},{row["chi2_per_dof"]:.4g},{row["decades"]:.2g}\n')


def main(arguments: list[str] | None = None) -> dict[str, Any]:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("--quick", action="store_true", help="few seeds, few wavelengths")
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--table", help="CSV file for the cases, which tests/test_benchmarks.py reads")
    options = parser.parse_args(arguments)
    seeds = 2 if options.quick else options.seeds
    import lmfit  # noqa: F401  its import is not a fit's time

    chosen = {k: v for k, v in cases().items() if k in QUICK or not options.quick}
    rows = {name: recovered(*case, seeds, "value") for name, case in chosen.items()}
    # the default is on the safe side of what an instrument does, but where one peak decides it has one observation
    cautious = {name: recovered(*cases()[name], seeds, "spectrum") for name in SAFE[: 1 if options.quick else None]}
    result = {"seeds": seeds, "cases": rows, "by_spectrum": cautious, "timings": timings(options.quick)}
    if options.table:
        write_table(options.table, seeds, rows)
    if options.json:
        print(json.dumps(result, indent=1))
        return result
    print(machine())
    print(f"\n{seeds} seeds of {NOISE:.0%} noise; RMS of the pulls")
    for name, row in (*rows.items(), *((f"{k}, by spectrum", r) for k, r in cautious.items())):
        text = ", ".join(f"{k} {v:.2f}" for k, v in row["pulls"].items())
        inside = "" if row["coefficients"] is None else f", coefficients {row['coefficients']:.2f}"
        print(
            f"{name:32} chi2/dof {row['chi2_per_dof']:5.2f}  {row['decades']:4.1f} decades  {row['seconds']:5.2f} s  "
            f"{text}{inside}" + (f"  ({row['noted']} with notes)" if row["noted"] else "")
        )
    print("\nseconds, 297 spectra × " + ("10" if options.quick else "100") + " wavelengths")
    for name, seconds in result["timings"]:
        print(f"{name:40} {seconds:6.2f}")
    return result


if __name__ == "__main__":
    main()
