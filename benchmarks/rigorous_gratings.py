"""The scalar theories beside rigorous grating efficiencies: makes the table that `vgonio plan` warns with.

    python benchmarks/rigorous_gratings.py REFERENCE.json [-o vgonio/wave/rigorous_gratings.csv] [--page docs/trust.md]

REFERENCE.json holds efficiencies per order of aluminium gratings, TE and TM, by RCWA (two independent codes) and by the
coordinate method. One line of the table is one order; what a theory is off by on a grating follows from its lines.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np

import vgonio as vg
from vgonio.wave import trust
from vgonio.wave.theories import THEORIES

POINTS = 200  # samples of a period
COLUMNS = ("shape", "depth_um", "period_um", "wavelength_um", "theta_i_deg", "order", "TE", "TM", *THEORIES)


def scalar(case: dict) -> dict[str, dict[int, float]]:
    """Efficiencies per order of each theory for one grating of the reference."""
    size = {"period_um": case["period_um"], "shape": (4, POINTS), "pitch_um": case["period_um"] / POINTS}
    if case["shape"] == "lamellar":
        surface = vg.surface.lamellar(depth_um=case["depth_um"], duty=0.5, **size)
    else:
        surface = vg.surface.sinusoid(amplitude_um=case["depth_um"] / 2, **size)
    with tempfile.TemporaryDirectory() as folder:
        index = Path(folder) / "index.csv"
        index.write_text(f"wl,n,k\n0.1,{case['n']},{case['k']}\n10,{case['n']},{case['k']}\n")
        found = {}
        for theory in THEORIES:
            solver = vg.wave.Kirchhoff(index, [case["lambda_um"] * 1e3], theory=theory, tol=1e-6)
            one = solver.orders(surface, [case["theta_i_deg"]]).efficiency.isel(theta_i=0, wavelength=0)
            found[theory] = dict(zip(one.order.values.tolist(), one.values.tolist()))
    return found


def rows(case: dict) -> list[dict]:
    """The lines of one grating: every order that either polarisation has."""
    theories = scalar(case)
    keys = {"shape": case["shape"], "depth_um": case["depth_um"], "period_um": case["period_um"]}
    keys |= {"wavelength_um": case["lambda_um"], "theta_i_deg": case["theta_i_deg"]}
    orders = sorted({int(m) for m in (*case["TE"], *case["TM"])})
    return [
        keys
        | {"order": m, "TE": case["TE"].get(str(m), 0.0), "TM": case["TM"].get(str(m), 0.0)}
        | {t: theories[t].get(m, 0.0) for t in THEORIES}
        for m in orders
    ]


def table(reference: Path) -> str:
    """The table as CSV text."""
    cases = json.loads(reference.read_text(encoding="utf-8"))["cases"]
    lines = [",".join(COLUMNS)]
    for row in (row for case in cases for row in rows(case)):
        lines.append(",".join(f"{v:.6g}" if isinstance(v, float) else str(v) for v in (row[c] for c in COLUMNS)))
    return "\n".join(lines) + "\n"


def page() -> str:
    """The condensed table as Markdown: error of each theory per grating."""
    head = "| shape | depth/λ | period/λ | RMS slope | θ_i | Kirchhoff | GHS | OHS | TE against TM |"
    lines = [head, "|" + "---|" * 9]
    for c in sorted(trust.cases(), key=lambda c: (c.shape, c.period, c.theta_i_deg, c.depth)):
        slope = f"{c.slope:.2f}" if np.isfinite(c.slope) else "walls"
        errors = " | ".join(f"{c.error[t]:.1%}" for t in THEORIES)
        lines.append(
            f"| {c.shape} | {c.depth:.3f} | {c.period:.1f} | {slope} | {c.theta_i_deg:g}° | {errors} "
            f"| {c.polarisation:.1%} |"
        )
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None) -> None:
    """Write the table, and the page's part of it between its marks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("reference", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=trust.FILE)
    parser.add_argument("--page", type=Path, help="Markdown file with the marks <!-- table --> and <!-- end -->")
    asked = parser.parse_args(arguments)
    asked.output.write_text(table(asked.reference), encoding="utf-8")
    trust.cases.cache_clear()
    if asked.page is not None:
        text = asked.page.read_text(encoding="utf-8")
        before, rest = text.split("<!-- table -->")
        after = rest.split("<!-- end -->")[1]
        made = f"{before}<!-- table -->\n{page()}<!-- end -->{after}"
        asked.page.write_text(made, encoding="utf-8")


if __name__ == "__main__":
    main()
