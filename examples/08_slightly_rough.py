"""Where theories of slightly rough surfaces part ways: three scalar ones, linearised, and Rayleigh–Rice for s and p.

    python examples/08_slightly_rough.py [-o docs/slightly_rough.png]

Each theory gives a factor times the spectral density of the surface at q, so that the surface itself does not matter.
The figure and the table show the factors, each divided by that of Rayleigh–Rice for s on a perfect conductor. The
theories are explained in docs/trust.md.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from vgonio.report.style import INK, new_figure, styled
from vgonio.wave import closed_forms

ANGLES = (0, 30, 60)
COLOURS = {
    "kirchhoff": "#0072b2",
    "generalized-harvey-shack": "#009e73",
    "harvey-shack": "#e69f00",
    "rayleigh-rice p": "#cc79a7",
}
NAMES = {
    "kirchhoff": "Kirchhoff",
    "generalized-harvey-shack": "generalised Harvey–Shack",
    "harvey-shack": "Harvey–Shack",
    "rayleigh-rice p": "Rayleigh–Rice p",
}


def table() -> list[tuple[str, int, float, dict[str, float]]]:
    """(direction, θ_i, θ_o, factors over Rayleigh–Rice s)."""
    rows = []
    for theta in (30, 45, 60, 75):
        for name, out in (("mirror", -theta), ("normal", 0.0), ("retro", theta)):
            rows.append((name, theta, out, {k: float(v[0]) for k, v in closed_forms.parting(theta, [out]).items()}))
    return rows


@styled
def figure():
    """Factors over the detector angle, one panel for each angle of incidence."""
    made = new_figure(9.5, 3.2)
    axes = made.subplots(1, len(ANGLES), sharey=True)
    theta_o = np.linspace(-80, 80, 321)
    for ax, theta in zip(axes, ANGLES):
        for name, values in closed_forms.parting(theta, theta_o).items():
            line = "--" if name.endswith(" p") else "-"
            ax.semilogy(theta_o, values, color=COLOURS[name], ls=line, label=NAMES[name])
        ax.axhline(1, color=INK, lw=1, ls=":", label="Rayleigh–Rice s")
        ax.set(title=f"θᵢ = {theta}°", xlabel="angle of reflection θₒ (°)", ylim=(0.5, 300), xticks=range(-80, 81, 40))
        for at, what in ((-theta, "mirror"), (theta, "retro")):
            if theta:
                ax.axvline(at, color="#b9c0ca", lw=0.8)
                ax.text(at, 220, what, ha="center", fontsize=7.5, backgroundcolor="white")
    axes[0].set_ylabel("BRDF over Rayleigh–Rice s")
    made.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncol=5)
    return made


def main(arguments: list[str] | None = None) -> None:
    """Print the table, draw the figure, check both against what is known."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("slightly_rough.png"))
    asked = parser.parse_args(arguments)
    rows = table()
    print("| direction | θ_i | " + " | ".join(rows[0][3]) + " |")
    print("|" + "---|" * (2 + len(rows[0][3])))
    for name, theta, _, factors in rows:
        print(f"| {name} | {theta}° | " + " | ".join(f"{v:.3g}" for v in factors.values()) + " |")
    figure().savefig(asked.output, dpi=130, facecolor="white")
    retro = next(f for name, theta, _, f in rows if (name, theta) == ("retro", 60))
    mirror = next(f for name, theta, _, f in rows if (name, theta) == ("mirror", 60))
    assert np.isclose(retro["kirchhoff"], 16), retro
    assert np.isclose(retro["rayleigh-rice p"], 49), retro
    assert all(np.isclose(mirror[name], 1) for name in mirror if name != "harvey-shack"), mirror
    print("check: at 60° retro Kirchhoff is 16 times Rayleigh–Rice s, in the mirror direction they are one")


if __name__ == "__main__":
    main()
