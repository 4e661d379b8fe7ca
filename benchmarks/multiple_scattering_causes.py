"""What carries the error of iterated Kirchhoff: its equation with one thing at a time left out or put back.

    python benchmarks/multiple_scattering_causes.py [-n REALISATIONS] [--figure causes.png] [--table causes.md]

The field of iterated Kirchhoff (all orders) solves x = b·[lit] + (A·[seen]) x, and the detector sees it through a mask;
the exact field solves x = b + A x and needs no mask. b is the tangent plane's field of the light, A the kernel between
pairs of points. Here masks are exchanged between the two: the error of each is Σ|Δ|/Σ of the mean lobe in 2° bins
against the exact one (`multiple_scattering.py` for the profiles and the beam), and its power.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import multiple_scattering as bench
import numpy as np
from multiple_scattering import FINE, THETA_I, Beam, Stretch, binned, far_amplitudes, material, profile, total

from vgonio.wave.iterated.equation import Equation

CASES = ((1.0, 2.0), (2.0, 2.83))
NEAR = 1.0  # wavelengths
K = 2 * np.pi


def variants(stretch: Stretch, polarisation: str) -> dict[str, tuple[np.ndarray, bool]]:
    """Surface fields (n, t) of each variant, and whether the detector's mask is put on them."""
    curve, theta = stretch.curve, np.deg2rad(THETA_I)
    n, sight = len(curve), stretch.sight
    equation = Equation.of(curve, K, material("perfect"), 1000.0, polarisation, "perfect")
    a, b = equation.rows(0, n), equation.right(*stretch.incident(K, theta))
    lit = b * sight.seen(curve, theta).T
    seen = np.zeros((n, n), bool)
    seen[sight.row, sight.source] = True
    dx, dz = curve.x - curve.x[:, None], curve.z - curve.z[:, None]
    above = curve.nx[:, None] * dx + curve.nz[:, None] * dz > 0
    facing, near = above & above.T, np.hypot(dx, dz) < NEAR

    def solved(pairs: np.ndarray, right: np.ndarray) -> np.ndarray:
        return np.linalg.solve(np.eye(n) - a * pairs, right)

    every = np.ones((n, n), bool)
    return {
        "exact": (solved(every, b), False),
        "iterated, all orders": (solved(seen, lit), True),
        "its detector sees every point": (solved(seen, lit), False),
        "and pairs nearer than λ count": (solved(seen | near, lit), False),
        "exact, seen through the detector's mask": (solved(every, b), True),
        "exact, light on lit points alone": (solved(every, lit), False),
        "exact, without pairs that a crest hides": (solved(~(facing & ~seen), b), False),
        "exact, without pairs behind tangent planes": (solved(facing, b), False),
        "exact, without near pairs behind tangent planes": (solved(facing | ~near, b), False),
    }


def errors(sigma: float, correlation: float, polarisation: str, count: int) -> dict[str, tuple]:
    """Error and power (t,) of every variant on one ensemble."""
    to, powers = np.deg2rad(FINE), {}
    for seed in range(count):
        surface = profile(sigma, correlation, 1000 + seed)
        middle = surface.size_um[1] / 2
        stretch = Stretch.of(surface, Beam("tapered", surface.size_um[1] / 8, middle, middle), 0.1)
        mask = stretch.sight.seen(stretch.curve, to)
        norm = stretch.beam.power(K, np.deg2rad(THETA_I))[:, None]
        for name, (x, masked) in variants(stretch, polarisation).items():
            u, v = (0 * x, x) if polarisation == "TE" else (x, 0 * x)
            far = far_amplitudes(stretch.curve, u, v, K, to, mask if masked else None)
            powers.setdefault(name, []).append(np.abs(far.T) ** 2 / norm)
    means = {name: np.mean(p, axis=0) for name, p in powers.items()}
    exact = binned(means["exact"])
    return {n: (np.abs(binned(p) - exact).sum(1) / exact.sum(1), total(p)) for n, p in means.items()}


def table(found: dict) -> list[str]:
    """Markdown: error (power) of every variant, mean of the ensembles."""
    names = [n for n in next(iter(found.values())) if n != "exact"]
    columns = [(p, i) for p in ("TE", "TM") for i in (0, 1, 3)]
    lines = ["| error (power) | " + " | ".join(f"{p}, {THETA_I[i]:g}°" for p, i in columns) + " |", "|---" * 7 + "|"]
    for name in names:
        cells = []
        for p, i in columns:
            some = [one[name] for (_, _, q), one in found.items() if q == p]
            cells.append(f"{np.mean([e[i] for e, _ in some]):.3f} ({np.mean([w[i] for _, w in some]):.2f})")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return lines


def draw(path: str, found: dict) -> None:
    """Bars of the errors at normal incidence and at 70°."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    names = [n for n in next(iter(found.values())) if n != "exact"]
    figure, panels = plt.subplots(1, 2, figsize=(11, 4.2), sharey=True, constrained_layout=True)
    for axes, i in zip(panels, (0, 3)):
        for shift, p, colour in ((-0.18, "TE", "#5b8ff9"), (0.18, "TM", "#d64550")):
            mean = [np.mean([one[n][0][i] for (_, _, q), one in found.items() if q == p]) for n in names]
            axes.barh(np.arange(len(names)) + shift, np.minimum(mean, 1.0), 0.34, color=colour, label=p)
            for y, value in enumerate(mean):
                axes.text(min(value, 1.0) + 0.01, y + shift, f"{value:.2f}", va="center", size=8)
        axes.set(xlim=(0, 1.12), xlabel="error of the mean lobe", title=f"θ_i = {THETA_I[i]:g}°")
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_yticks(np.arange(len(names)), names)
    panels[0].invert_yaxis()
    panels[1].legend(frameon=False, loc="lower right")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def main(arguments: list[str] | None = None) -> dict:
    """Run everything, print the table, and return what was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-n", "--realisations", type=int, default=12, help="profiles of each ensemble")
    parser.add_argument("--quick", action="store_true", help="two profiles of one ensemble")
    parser.add_argument("--figure", help="PNG file")
    parser.add_argument("--table", help="Markdown file")
    asked = parser.parse_args(arguments)
    count, cases = (2, CASES[:1]) if asked.quick else (asked.realisations, CASES)
    print(bench.machine())
    found = {(s, t, p): errors(s, t, p, count) for s, t in cases for p in ("TE", "TM")}
    print("\n".join(table(found)))
    if asked.table:
        Path(asked.table).write_text("\n".join(table(found)) + "\n", encoding="utf-8")
    if asked.figure:
        draw(asked.figure, found)
    return found


if __name__ == "__main__":
    main()
