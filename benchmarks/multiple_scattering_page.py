"""The page and the figure of `multiple_scattering.py`, from its results.

python benchmarks/multiple_scattering_page.py results.json … --figure figure.png --page table.md
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import multiple_scattering as bench
import numpy as np

COLOURS = dict(zip(bench.METHODS, ("#888888", "#5b8ff9", "#e8a33d", "#9270ca", "#d64550", "#1c6b3a")))
SHOWN = ("single", "shadowed", "rays", "iterated 2", "iterated 3", "diffraction", "noise")


def merged(paths: list[str]) -> dict:
    """Results of several parts, in the order of the ensembles."""
    parts = [json.loads(Path(p).read_text(encoding="utf-8")) for p in paths]
    result = {key: value for part in parts for key, value in part.items()}
    place = {(m, s, t): i for i, (s, t, m) in enumerate(bench.CASES)}
    rows = [r for part in parts for r in part["rows"]]
    result["rows"] = sorted(rows, key=lambda r: place.get((r["material"], r["sigma"], r["T"]), 0))
    result["seconds"] = [s for part in parts for s in part["seconds"]]
    result["retro"] = {name: v for part in parts for name, v in part["retro"].items()}
    return result


def steep(rows: list[dict]) -> list[dict]:
    """Those that the aim is about: perfect, θ_i ≤ 30°, where the single theory is wrong by 0.35 or more."""
    return [r for r in rows if r["material"] == "perfect" and r["theta_i"] <= 30 and r["single"] >= 0.35] or rows


def draw(path: str, result: dict) -> None:
    """Error against run time, and the mean lobes of the steepest ensemble."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.6), constrained_layout=True)
    _errors(left, result)
    _lobes(right, result["lobes"])
    grows = ", ".join(f"{m} {g['exponent']:.1f}" for m, g in result["growth"].items())
    figure.suptitle(f"{result['machine']}; exponents of time over length: {grows}", size=8)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _errors(axes, result: dict) -> None:
    from matplotlib.ticker import NullFormatter

    rows = steep(result["rows"])
    seconds = [s for s in result["seconds"] if s["material"] == "perfect"]
    for method in bench.METHODS:
        low, middle, high = np.percentile([r[method] for r in rows], [0, 50, 100])
        each = min(s[method] for s in seconds if method in s)
        axes.errorbar(each, middle, [[middle - low], [high - middle]], fmt="o", color=COLOURS[method], capsize=3)
        side = -1 if method in ("single", "iterated 2") else 1
        axes.annotate(method, (each, middle), xytext=(7 * side, 5), textcoords="offset points", color=COLOURS[method],
                      ha="right" if side < 0 else "left")  # fmt: skip
    axes.axhline(0.08, color="k", lw=0.8, ls=":")
    axes.annotate("aim", (0.02, 0.08), xycoords=("axes fraction", "data"), va="bottom", size=8)
    exact = min(s["full wave"] for s in seconds)
    axes.axvline(exact, color="k", lw=0.8)
    axes.annotate("full wave", (exact, 0.8), xycoords=("data", "axes fraction"), rotation=90, ha="right", size=9)
    axes.set_xlim(min(s["single"] for s in seconds) / 2.5, exact * 1.2)
    axes.set(xscale="log", yscale="log", xlabel="processor seconds, one profile of 60 λ, four θ_i",
             ylabel="error of the mean lobe, least, median, largest",
             title="Perfect, θ_i ≤ 30°, where single ≥ 0.35")  # fmt: skip
    axes.xaxis.set_minor_formatter(NullFormatter())


def _lobes(axes, curves: dict) -> None:
    centre = bench.FINE[np.abs(bench.FINE) < 80].reshape(-1, round(bench.BIN / 0.5)).mean(axis=1)
    for method in ("full wave", "diffraction", "iterated 3", "shadowed", "single"):
        colour, style = ("k", "-") if method == "full wave" else (COLOURS[method], "--")
        width = 2.4 if method == "full wave" else 1.4
        axes.plot(centre, bench.binned(np.array(curves[method])), style, color=colour, label=method, lw=width)
    axes.axvline(curves["theta_i"], color="k", lw=0.6, ls=":")
    axes.set(xlabel="θ_o in degrees (retro direction dotted)", ylabel="power per radian / incident power",
             title=curves["title"], ylim=(0, None))  # fmt: skip
    axes.legend(frameon=False)


def table(rows: list[dict]) -> list[str]:
    """Markdown rows."""
    powers = ("full wave", "single", "iterated 3", "diffraction")
    head = ["material", "σ/λ", "T/λ", "slope", "", "θ_i", *SHOWN, *(f"power {p}" for p in powers)]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for r in rows:
        mark = " (T < λ)" if r["T"] < 1 else ""
        cells = [r["material"], f"{r['sigma']:g}", f"{r['T']:g}{mark}", f"{r['slope']:.2f}", r["polarisation"]]
        cells += [f"{r['theta_i']:g}°", *(f"{r[m]:.3f}" for m in SHOWN), *(f"{r[f'power {m}']:.3f}" for m in powers)]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def summary(rows: list[dict]) -> list[str]:
    """Ranges over the rows, by where they lie."""
    parts = {
        "perfect, θ_i ≤ 30°, single ≥ 0.35": steep(rows),
        "perfect, θ_i = 50° and 70°, T > λ": [r for r in rows if _is(r, "perfect", True) and r["T"] > 1],
        "perfect, all angles, T < λ": [r for r in rows if r["material"] == "perfect" and r["T"] < 1],
        "aluminium, all": [r for r in rows if r["material"] == "Al"],
        "glass, all": [r for r in rows if r["material"] == "SiO2"],
    }
    methods = ("single", "shadowed", "iterated 3", "diffraction")
    lines = [
        "| error (power over that of the full wave) | " + " | ".join(methods) + " |",
        "|" + "---|" * (1 + len(methods)),
    ]
    for name, some in parts.items():
        if not some:
            continue
        cells = []
        for m in methods:
            error, power = [r[m] for r in some], [r[f"power {m}"] / r["power full wave"] for r in some]
            cells.append(f"{min(error):.3f} … {max(error):.3f} ({min(power):.2f} … {max(power):.2f})")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return lines


def _is(r: dict, material: str, oblique: bool) -> bool:
    return r["material"] == material and (r["theta_i"] > 30) == oblique


def page(result: dict, remarks: str) -> str:
    """Markdown: what was compared, the table, run times and retro peaks."""
    grows = [
        f"- {m}: " + ", ".join(f"{n:g} λ {s:.3f} s" for n, s in zip(g["lengths"], g["seconds"]))
        + f"; grows as length^{g['exponent']:.1f}"
        for m, g in result["growth"].items()
    ]  # fmt: skip
    retro_lines = [f"- {n}: " + ", ".join(f"{m} {p:.2f}" for m, p in v.items()) for n, v in result["retro"].items()]
    doc = (bench.__doc__ or "").splitlines()
    start = next(i for i, line in enumerate(doc) if line.startswith("Ensembles"))
    return "\n".join([
        "# Multiple scattering: five theories against the full-wave solver", "",
        f"Made by `python benchmarks/multiple_scattering.py -n {result['realisations']}` and "
        "`multiple_scattering_page.py`.",
        f"{result['machine']}.", "", *doc[start:], "",
        *summary(result["rows"]), "",
        "![Error against run time, and the mean lobe of steep profiles](multiple_scattering.png)", "",
        remarks.strip(), "", "## All figures", "", *table(result["rows"]), "",
        "## Run time, one polarisation, four angles", *grows, "",
        "## Power within 2° of the retro direction over that 8 … 16° beside it", *retro_lines, "",
    ])  # fmt: skip


def main(arguments: list[str] | None = None) -> None:
    """Read results, write what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", nargs="+", help="JSON files of multiple_scattering.py, the parts of one run")
    parser.add_argument("--figure", help="PNG file")
    parser.add_argument("--page", help="Markdown file")
    asked = parser.parse_args(arguments)
    result = merged(asked.results)
    if asked.figure:
        draw(asked.figure, result)
    if asked.page:
        remarks = Path(__file__).with_name("multiple_scattering_remarks.md").read_text(encoding="utf-8")
        Path(asked.page).write_text(page(result, remarks), encoding="utf-8")


if __name__ == "__main__":
    main()
