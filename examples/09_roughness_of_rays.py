"""Roughness fitted to rays on the surrogates of the thesis' samples, beside what others fitted to the real ones.

    python examples/09_roughness_of_rays.py [--quick] [--rays 100000] [--samples 1 2 3 4 5 6]

For samples 1 to 6 (heightfields/, statistics-matched surrogates, no measurements): α of the slopes of the mesh (√2 ·
one-axis RMS slope), α of GGX (Walter 2007) and of Beckmann fitted to the in-plane BRDF that rays give on aluminium,
under the cost function of thesis 3.2. Beside them, where the folder of shared data is at hand (VGONIO_SHARED), stands
what the earlier Rust tool of the same name fitted to the thesis' own samples (its file
aluminium_fits/DERIVED_fitting_Latest.csv): to the normals of their height fields, to normalised simulations on these,
and to measured BRDFs, as they are and normalised.
"""

from __future__ import annotations

import argparse
import csv
import os
from pathlib import Path
from typing import Any

import numpy as np

import vgonio as vg
from vgonio.compare import fit_model
from vgonio.surface.statistics import beckmann_alpha

ROOT = Path(__file__).resolve().parents[1]
DERIVED = Path(os.environ.get("VGONIO_SHARED", "../shared")) / "data" / "aluminium_fits" / "DERIVED_fitting_Latest.csv"
NAMES = {1: "al65", 2: "al4", 3: "al3", 4: "al2", 5: "al1", 6: "al0"}
THETA_I = np.arange(0.0, 61, 10)
WAVELENGTH = (450.0, 550.0, 650.0)
# columns of the table that the Rust tool wrote
COLUMNS = {"normals": 1, "simulated": 3, "measured": 8, "normalised": 10}


def reference() -> dict[str, dict[str, dict[str, float]]]:
    """{"ggx" | "beckmann": {"al65": {"normals": …, "simulated": …, …}}}, empty without the file."""
    if not DERIVED.is_file():
        return {}
    found: dict[str, dict[str, dict[str, float]]] = {}
    kind = ""
    with DERIVED.open(newline="") as stream:
        for row in csv.reader(stream):
            if row and row[0] in ("TR", "BK"):
                kind = {"TR": "ggx", "BK": "beckmann"}[row[0]]
            elif row and row[0] in NAMES.values():
                found.setdefault(kind, {})[row[0]] = {k: float(row[c]) for k, c in COLUMNS.items()}
    return found


def fitted(sample: int, rays: int) -> dict[str, Any]:
    """α of the slopes, of GGX and of Beckmann, with standard errors and the NRMSE of both fits."""
    surface = vg.surface.read(ROOT / "heightfields" / f"sample{sample}.npz")
    slope = beckmann_alpha(surface)
    # cones and steps that resolve the lobe: its half width is about α
    step = float(np.clip(np.degrees(slope) / 4, 0.5, 5))
    theta_o = np.unique(np.concatenate([np.arange(-80.0, 81, 5), *(-t + step * np.arange(-8, 9) for t in THETA_I)]))
    theta_o = theta_o[np.abs(theta_o) <= 80]
    gonio = vg.measure.Gonioreflectometer(THETA_I, theta_o, aperture_deg=min(2.0, step))
    data = gonio.measure(surface, vg.geometric.RayOptics("Al", WAVELENGTH, rays=rays))
    found: dict[str, Any] = {"sample": sample, "slope": slope}
    for name, model in (("ggx", "cook-torrance-1982"), ("beckmann", "beckmann-1963")):
        fit = fit_model(data, model, material="Al", cluster="theta_i")
        found |= {name: float(fit.alpha), f"{name}_stderr": float(fit.alpha_stderr)}
        found[f"{name}_nrmse"] = float(vg.compare.nrmse(data, fit))
    return found


def main(arguments: list[str] | None = None) -> list[dict[str, Any]]:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("--rays", type=int, default=100_000)
    parser.add_argument("--samples", type=int, nargs="+", default=list(NAMES))
    parser.add_argument("--quick", action="store_true", help="samples 4 and 5 with 20,000 rays")
    options = parser.parse_args(arguments)
    if options.quick:
        options.rays, options.samples = 20_000, [4, 5]
    rows = [fitted(sample, options.rays) for sample in options.samples]
    others = reference()
    for kind in ("ggx", "beckmann"):
        head = ["sample", "slopes", "rays", "±", "NRMSE", *(f"real: {k}" for k in COLUMNS)]
        print(f"\nalpha, {kind}\n" + "".join(f"{h:>18}" if h.startswith("real") else f"{h:>8}" for h in head))
        for row in rows:
            print(text(row, kind, others))
    check(rows)
    return rows


def text(row: dict[str, Any], kind: str, others: dict[str, Any]) -> str:
    parts = [f"{row['sample']:8d}"]
    parts += [f"{row[k]:8.3f}" for k in ("slope", kind, f"{kind}_stderr", f"{kind}_nrmse")]
    other = others.get(kind, {}).get(NAMES[row["sample"]], {})
    return "".join(parts) + "".join(f"{other[k]:18.3f}" if k in other else f"{'–':>18}" for k in COLUMNS)


def check(rows: list[dict[str, Any]]) -> None:
    """Rougher surfaces get a larger α from either model, in the order of their slopes.

    Facets are what Beckmann's model is of: its α is theirs to 8 % (all but the polished sample 6, which has scratches).
    """
    order = np.argsort([r["slope"] for r in rows])
    for kind in ("ggx", "beckmann"):
        assert np.all(np.diff(np.array([r[kind] for r in rows])[order]) > 0)
    off = [abs(r["beckmann"] / r["slope"] - 1) for r in rows if r["sample"] != 6]
    assert max(off, default=0.0) < 0.08, off
    print(f"check: α grows with the slopes; Beckmann's is that of the facets to {max(off, default=0.0):.1%}")


if __name__ == "__main__":
    main()
