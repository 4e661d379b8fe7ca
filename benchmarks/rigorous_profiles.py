"""The scalar theories on Gaussian profiles against the full-wave solver: a table that plan and verdict judge by.

    python benchmarks/rigorous_profiles.py [-n REALISATIONS] [--part I/N] [--again] [--page docs/trust.md]

Ensembles of profiles with Gaussian heights and correlation exp(−x²/T²), 60 wavelengths long, under the Gaussian beam
(ℓ = 7.5 λ) of `multiple_scattering.py`. Kirchhoff is its `single`, under the same beam; generalized Harvey–Shack has
the same phase and another factor C of the direction, so that it is the same times the ratio of C². Harvey–Shack has
another phase: its integral is done here, with a Gaussian window in place of the beam (1 to 7 % at 20 … 70°, where it is
off by more). Lines of the table that are there already are kept. They are held against the mean of TE and TM, ensemble
means of power per radian in bins of 2° over −80 … 80°. Errors are Σ|theory − full wave| / Σ full wave:

- over all bins, and for Kirchhoff against TE and TM alone as well;
- back: over bins on the side of the source (θ_o θ_i > 0; at θ_i = 0 beyond 30°), with the share of the light there;
- reach: over how many decades below the peak every bin of Kirchhoff stays within a factor 1.25 of the full wave.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import multiple_scattering as bench
import numpy as np
from multiple_scattering import FINE, WAVELENGTH_NM, binned, profile

from vgonio.materials import material
from vgonio.wave.theories import THEORIES, amplitude, scattering_vector

TABLE = Path(__file__).resolve().parents[1] / "vgonio" / "wave" / "rigorous_profiles.csv"
THETA_I = (0.0, 20.0, 30.0, 50.0, 60.0, 70.0)
# σ/λ: T/λ; slopes √2 σ/T of 0.01 … 1, the gentle ones first
PERFECT = {
    0.02: (0.5, 1.0, 3.0), 0.05: (0.7, 1.41, 3.0), 0.1: (0.57, 1.41, 2.83), 0.2: (1.13, 2.83, 5.66), 0.3: (4.2, 2.0),
    0.6: (8.5, 3.4), 1.0: (14.1, 5.66, 2.83), 2.0: (28.3, 11.3, 5.66),
}  # fmt: skip
CASES = (
    *(("perfect", s, t) for s, lengths in PERFECT.items() for t in lengths),
    *(("SiO2", *c) for c in ((0.3, 4.2), (1.0, 14.1), (1.0, 5.66), (2.0, 11.3), (0.05, 1.41))),
    *(("Al", *c) for c in ((0.3, 4.2), (1.0, 5.66), (2.0, 5.66), (0.05, 1.41))),
    *(("perfect", *c) for c in ((0.3, 8.5), (0.3, 0.85), (0.6, 1.2), (1.0, 2.0), (1.0, 1.41), (2.0, 2.83))),
)
HEAD = (
    "material,sigma,correlation,theta_i_deg,kirchhoff,generalized-harvey-shack,harvey-shack,kirchhoff_te,kirchhoff_tm,"
    "back_share,back_kirchhoff,back_generalized-harvey-shack,back_harvey-shack,reach,noise"
)
BEGIN, END = "<!-- profiles -->", "<!-- end of profiles -->"
NAMES, SHORT, WHERE = ("perfect", "Al", "SiO2"), ("Kirchhoff", "GHS"), ("θ_i ≤ 30°", "50 … 70°")
FACTOR = 1.25  # of the reach
DARK = 1e-9  # of the peak: below, the full wave is its own rounding


def scalar(surface, theory: str, name: str):
    """(t, m) power per radian over incident power: k/2π C² R |∫ w exp(−iq·r) dx|² / (cos θ_i ∫ w² dx), λ = 1."""
    k, to = 2 * np.pi, np.deg2rad(FINE)
    n = 8 * surface.shape[1]
    x = (np.arange(n) + 0.5) * surface.size_um[1] / n
    z = surface.interpolant.grid(np.zeros(1), x)[0]
    along = x - surface.size_um[1] / 2
    w = np.exp(-(along**2) / 2 / (surface.size_um[1] / 8) ** 2)
    wo = np.stack([np.sin(to), 0 * to, np.cos(to)], axis=-1)
    out = []
    for ti in np.deg2rad(THETA_I):
        wi = np.broadcast_to([np.sin(ti), 0.0, np.cos(ti)], wo.shape)
        q = scattering_vector(theory, np.full(len(wo), k), wi, wo)
        S = np.array([np.sum(w * np.exp(-1j * (qx * along + qz * z))) for qx, _, qz in q]) * (x[1] - x[0])
        half = np.sqrt(np.maximum(1 + np.sum(wi * wo, axis=-1), 0) / 2)  # cosine at the half vector
        R = material(name).reflectance(half, WAVELENGTH_NM)
        norm = np.cos(ti) * np.sum(w**2) * (x[1] - x[0])
        out.append(k / (2 * np.pi) * amplitude(theory, wi, wo) ** 2 * R * np.abs(S) ** 2 / norm)
    return np.array(out)


def ratio():
    """(t, m) C² of generalized Harvey–Shack over that of Kirchhoff."""
    to = np.deg2rad(FINE)
    wo = np.stack([np.sin(to), 0 * to, np.cos(to)], axis=-1)
    wi = [np.broadcast_to([np.sin(t), 0.0, np.cos(t)], wo.shape) for t in np.deg2rad(THETA_I)]
    factors = [[amplitude(t, w, wo) ** 2 for w in wi] for t in ("generalized-harvey-shack", "kirchhoff")]
    return np.array(factors[0]) / np.array(factors[1])


def means(name: str, sigma: float, correlation: float, count: int) -> dict[str, np.ndarray]:
    """(t, bins) ensemble means of every theory and of the full wave in TE and TM, and of its halves."""
    found: dict[str, list] = {}
    for seed in range(count):
        surface = profile(sigma, correlation, 1000 + seed)
        one = {p: bench.full_wave(surface, p, name)[0] for p in ("TE", "TM")}
        for p in ("TE", "TM"):
            one[f"single {p}"] = bench.kirchhoff(surface, p, 1, shadowing=False, name=name)
        one["kirchhoff"] = (one["single TE"] + one["single TM"]) / 2
        one["generalized-harvey-shack"] = one["kirchhoff"] * ratio()
        one["harvey-shack"] = scalar(surface, "harvey-shack", name)
        for key, power in one.items():
            found.setdefault(key, []).append(binned(power))
    return {key: np.array(powers) for key, powers in found.items()}


def judged(name: str, sigma: float, correlation: float, found: dict[str, np.ndarray]) -> list[str]:
    """Lines of the table, one for each angle of incidence."""
    centres = binned(FINE)
    exact = (found["TE"] + found["TM"]) / 2
    lines = []
    for i, theta in enumerate(THETA_I):
        one = {key: p[:, i].mean(axis=0) for key, p in found.items()}
        full = exact[:, i].mean(axis=0)
        back = centres > 0 if theta else np.abs(centres) > 30
        half = len(exact) // 2
        noise = np.abs(exact[:half, i].mean(axis=0) - exact[half:, i].mean(axis=0)).sum() / full.sum() / 2
        row = [error(one[t], full) for t in THEORIES]
        row += [error(one[f"single {p}"], one[p]) for p in ("TE", "TM")]
        row += [full[back].sum() / full.sum(), *(error(one[t][back], full[back]) for t in THEORIES)]
        row += [reach(one["kirchhoff"], full), noise]
        lines.append(f"{name},{sigma:g},{correlation:g},{theta:g}," + ",".join(f"{v:.3g}" for v in row))
    return lines


def error(found, reference) -> float:
    return float(np.abs(found - reference).sum() / reference.sum())


def reach(found, reference) -> float:
    """Decades below the peak down to which every bin is within FACTOR."""
    bright = reference > DARK * reference.max()
    wrong = bright & (np.abs(np.log(np.maximum(found, 1e-300) / reference)) > np.log(FACTOR))
    lowest = reference[wrong].max() if wrong.any() else reference[bright].min()
    return float(np.log10(reference.max() / lowest))


def page(file: Path = TABLE) -> str:
    """The table of docs/trust.md: least and most error over the angles up to 30° and beyond, and the reach."""
    import csv

    with file.open(encoding="utf-8", newline="") as stream:
        lines = list(csv.DictReader(stream))
    keys = list(dict.fromkeys((ln["material"], ln["sigma"], ln["correlation"]) for ln in lines))
    keys.sort(key=lambda k: (NAMES.index(k[0]), round(slope(k), 2), float(k[1])))
    head = ("material", "slope", "Sq/λ", "T/λ", *(f"{t}, {w}" for t in SHORT for w in WHERE), "Kirchhoff's reach")
    rows = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for key in keys:
        own = [ln for ln in lines if (ln["material"], ln["sigma"], ln["correlation"]) == key]
        sides = [[ln for ln in own if (float(ln["theta_i_deg"]) <= 30) == gentle] for gentle in (True, False)]
        cells = [f"{max(100 * float(ln[t]) for ln in side):.1f}%" for t in THEORIES[:2] for side in sides]
        decades = min(float(ln["reach"]) for ln in own)
        rows.append(f"| {key[0]} | {slope(key):.2g} | {key[1]} | {key[2]} | {' | '.join(cells)} | {decades:.1f} |")
    return "\n".join(rows)


def slope(key: tuple[str, str, str]) -> float:
    return float(np.sqrt(2)) * float(key[1]) / float(key[2])


def main(arguments: list[str] | None = None) -> list[str]:
    """Make the table and write it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-n", "--realisations", type=int, default=4, help="profiles of each ensemble")
    parser.add_argument("--part", default="1/1", help="I/N: the I-th of N shares of the ensembles")
    parser.add_argument("--again", action="store_true", help="also the ensembles that the table has already")
    parser.add_argument("-o", "--output", default=str(TABLE), help="CSV file of the table")
    parser.add_argument("--page", type=Path, help="Markdown page whose table is made again, docs/trust.md")
    asked = parser.parse_args(arguments)
    bench.THETA_I = THETA_I  # the full wave at the angles of this table
    path = Path(asked.output)
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() and not asked.again else [HEAD]
    first, step = (int(n) for n in asked.part.split("/"))
    for name, sigma, correlation in CASES[first - 1 :: step]:
        if any(line.startswith(f"{name},{sigma:g},{correlation:g},") for line in lines):
            continue
        lines += judged(name, sigma, correlation, means(name, sigma, correlation, asked.realisations))
        print("\n".join(lines[-len(THETA_I) :]), flush=True)
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    if asked.page:
        text = asked.page.read_text(encoding="utf-8")
        before, rest = text.split(BEGIN)
        asked.page.write_text(f"{before}{BEGIN}\n{page(path)}\n{END}{rest.split(END)[1]}", encoding="utf-8")
    return lines


if __name__ == "__main__":
    main()
