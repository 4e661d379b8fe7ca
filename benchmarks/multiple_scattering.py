"""Multiple scattering: error and seconds of single, shadowed and iterated Kirchhoff and of rays against full-wave.

    python benchmarks/multiple_scattering.py [--quick] [-n REALISATIONS] [--part I/N] [-o results.json]
    python benchmarks/multiple_scattering_page.py results.json … --figure figure.png --page table.md

Ensembles of profiles with Gaussian heights and correlation exp(−x²/T²), 60 wavelengths long, under the same Gaussian
beam (ℓ = 7.5 λ on z = 0) for every wave method. The error is Σ|Δ|/Σ of the ensemble's mean power per radian over
−80 … 80°, in bins of 2°, against `full_wave.scatter_profile`. `noise` is what is left of it by chance: the same figure
between the two halves of the full-wave ensemble, over 2. Power is integrated over ±90°. `diffraction` is iterated
Kirchhoff of three reflections with diffraction, as `IteratedKirchhoff` does it where it is not told otherwise.
Seconds are processor seconds of one profile, four angles of incidence, one polarisation, one thread. Their growth is
fitted to lengths of 30 … 240 wavelengths.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings

import numpy as np

import vgonio as vg
from vgonio.accuracy import machine
from vgonio.materials import material
from vgonio.surface import Heightfield
from vgonio.wave.full_wave import scatter_profile
from vgonio.wave.iterated.beam import Beam
from vgonio.wave.iterated.diffraction import diffracted
from vgonio.wave.iterated.far_field import far_amplitudes
from vgonio.wave.iterated.profile import Light, Stretch, fields

LENGTH, PITCH, BIN = 60.0, 0.1, 2.0  # in wavelengths; λ = 1 µm; degrees
THETA_I = (0.0, 20.0, 50.0, 70.0)
# σ/λ, T/λ, material; slopes √2 σ/T of 0.1 … 1
CASES = (
    (0.3, 4.2, "perfect"), (0.3, 2.0, "perfect"), (0.3, 0.85, "perfect"), (0.3, 0.6, "perfect"),
    (0.6, 1.2, "perfect"), (1.0, 14.1, "perfect"), (1.0, 5.66, "perfect"), (1.0, 2.83, "perfect"),
    (1.0, 2.0, "perfect"), (1.0, 1.41, "perfect"), (1.5, 2.5, "perfect"), (2.0, 11.3, "perfect"),
    (2.0, 5.66, "perfect"), (2.0, 2.83, "perfect"),
    (1.0, 2.0, "Al"), (2.0, 5.66, "Al"), (1.0, 2.0, "SiO2"), (2.0, 5.66, "SiO2"),
)  # fmt: skip
STEEPEST = (2.0, 2.83, "perfect")  # of the figure
WAVELENGTH_NM = 550.0  # of the indices of the materials
FINE = np.arange(-89.75, 90.0, 0.5)  # degrees
KIRCHHOFF = {
    "single": {"bounces": 1, "shadowing": False}, "shadowed": {"bounces": 1}, "iterated 2": {"bounces": 2},
    "iterated 3": {"bounces": 3}, "diffraction": {"bounces": 3, "sweeps": 4},
}  # fmt: skip
METHODS = ("single", "shadowed", "rays", "iterated 2", "iterated 3", "diffraction")


def profile(sigma: float, correlation: float, seed: int, length: float = LENGTH) -> Heightfield:
    """One row of a Gaussian surface: its statistics along x are those of the surface."""
    pitch = min(PITCH, correlation / 10)
    n = round(length / pitch)
    shape = (12, n if n % 2 == 0 else n + 1)
    made = vg.surface.gaussian(sigma, correlation, shape, (correlation / 3, pitch), seed, exact=False)
    return Heightfield(made.z[:1], pitch, name="profile")


def kirchhoff(
    surface: Heightfield, polarisation: str, bounces: int, shadowing: bool = True, name: str = "perfect",
    sweeps: int = 0,
):  # fmt: skip
    """(t, m) power per radian over incident power of the coherent sum of so many reflections, then of sweeps."""
    k, theta, to = 2 * np.pi, np.deg2rad(THETA_I), np.deg2rad(FINE)
    middle, beam_length = surface.size_um[1] / 2, surface.size_um[1] / 8
    stretch = Stretch.of(surface, Beam("tapered", beam_length, middle, middle), 0.1)
    light = Light(k, theta, polarisation, material(name), WAVELENGTH_NM)
    u, v = (f.sum(axis=-1) for f in fields(stretch, light, bounces, 1e-3, shadowing))
    seen = stretch.sight.seen(stretch.curve, to) if shadowing else None
    far = far_amplitudes(stretch.curve, u, v, k, to, seen)
    if sweeps:
        far = diffracted(stretch, [light], (u[:, None], v[:, None]), far[:, None], to, sweeps, 1e-3)[0][:, 0]
    return np.abs(far.T) ** 2 / stretch.beam.power(k, theta)[:, None]


def full_wave(surface: Heightfield, polarisation: str, name: str = "perfect"):
    """(t, m) the same by the method of moments, and its energy balance (t,)."""
    index = None if name == "perfect" else complex(material(name).index(WAVELENGTH_NM))
    found = scatter_profile(surface.x, surface.z[0], 1.0, THETA_I, polarisation, index, surface.size_um[1] / 8, FINE)
    return found.density, found.balance


def rays(surface: Heightfield, count: int, name: str):
    """(t, m) the same by rays, without a beam: the whole profile, repeated."""
    gonio = vg.measure.Gonioreflectometer(THETA_I, FINE, aperture_deg=0.5)
    solver = vg.geometric.RayOptics(name, [WAVELENGTH_NM], rays=count, estimator="binning")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        data = gonio.measure(surface.replace(z=np.repeat(surface.z, 2, axis=0), periodic=True), solver)
    return data.brdf.values[..., 0] * gonio.detector.projected_solid_angle / np.deg2rad(0.5)


def timed(work):
    """What it returns and processor seconds, which other programs on the machine do not lengthen."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        start = time.process_time()
        return work(), time.process_time() - start


def binned(power):
    """(…, bins) means over bins of BIN degrees within ±80°."""
    inside = power[..., np.abs(FINE) < 80]
    return inside.reshape(*inside.shape[:-1], -1, round(BIN / 0.5)).mean(axis=-1)


def total(power):
    """(…,) power over ±90°."""
    return power.sum(axis=-1) * np.deg2rad(0.5)


def ensemble(sigma: float, correlation: float, name: str, polarisation: str, realisations: int, ray_count: int) -> dict:
    """Mean powers and seconds of all methods on one ensemble."""
    powers, seconds, balance = {m: [] for m in (*METHODS, "full wave")}, {}, []

    def keep(method, result, duration):
        powers[method].append(result)
        seconds[method] = seconds.get(method, 0.0) + duration / realisations

    for seed in range(realisations):
        surface = profile(sigma, correlation, 1000 + seed)
        (exact, energy), duration = timed(lambda s=surface: full_wave(s, polarisation, name))
        keep("full wave", exact, duration)
        balance.append(energy)
        for method, asked in KIRCHHOFF.items():
            keep(method, *timed(lambda s=surface, a=asked: kirchhoff(s, polarisation, name=name, **a)))
        if polarisation == "TE":  # rays are unpolarised
            keep("rays", *timed(lambda s=surface: rays(s, ray_count, name)))
    return {"powers": {m: np.array(p) for m, p in powers.items() if p}, "seconds": seconds, "balance": balance}


def judged(sigma: float, correlation: float, name: str, polarisation: str, found: dict, traced) -> list[dict]:
    """Rows of the table: one for each angle of incidence and method."""
    exact = found["powers"]["full wave"]
    half = len(exact) // 2
    rows = []
    for i, theta in enumerate(THETA_I):
        reference = binned(exact[:, i].mean(axis=0))
        noise = np.abs(binned(exact[:half, i].mean(axis=0)) - binned(exact[half:, i].mean(axis=0))).sum()
        row = {
            "material": name, "sigma": sigma, "T": correlation, "slope": np.sqrt(2) * sigma / correlation,
            "polarisation": polarisation, "theta_i": theta, "noise": float(noise / reference.sum() / 2),
            "balance": float(np.abs(np.array(found["balance"])[:, i] - 1).max()),
        }  # fmt: skip
        for method in METHODS:
            power = (traced if method == "rays" else found["powers"][method])[:, i].mean(axis=0)
            row[method] = float(np.abs(binned(power) - reference).sum() / reference.sum())
            row[f"power {method}"] = float(total(power))
        row["power full wave"] = float(total(exact[:, i].mean(axis=0)))
        rows.append(row)
    return rows


def growth(quick: bool) -> dict:
    """Seconds against the length of the profile, and the exponent of a fit to the longer half."""
    lengths = (15, 30) if quick else (30, 60, 120, 240)
    work = {
        "single": lambda s: kirchhoff(s, "TE", 1, shadowing=False),
        "iterated 3": lambda s: kirchhoff(s, "TE", 3),
        "diffraction": lambda s: kirchhoff(s, "TE", 3, sweeps=4),
        "full wave": lambda s: full_wave(s, "TE"),
    }
    found = {}
    for method, run in work.items():
        seconds = [min(timed(lambda n=n, run=run: run(profile(1.0, 2.0, 1, n)))[1] for _ in range(2)) for n in lengths]
        late = slice(-3, None)
        exponent = np.polyfit(np.log(lengths[late]), np.log(seconds[late]), 1)[0]
        found[method] = {"lengths": lengths, "seconds": seconds, "exponent": float(exponent)}
    return found


def retro(found: dict, order_two) -> dict:
    """Backscatter of the steepest ensemble: power within 2° of the retro direction over that 8 … 16° beside it."""
    out = {}
    for method in ("full wave", "diffraction", "iterated 3", "single"):
        power = found["powers"][method][:, order_two].mean(axis=0)
        away = np.abs(FINE - THETA_I[order_two])
        out[method] = float(power[away < 2].mean() / power[(away > 8) & (away < 16)].mean())
    return out


def lobes(sigma: float, correlation: float, polarisation: str, found: dict) -> dict:
    """Mean lobes at the second angle of incidence, for the figure."""
    curves = {m: found["powers"][m][:, 1].mean(axis=0).tolist() for m in (*KIRCHHOFF, "full wave")}
    return curves | {
        "theta_i": THETA_I[1],
        "title": f"σ = {sigma:g} λ, T = {correlation:g} λ, {polarisation}, {len(found['balance'])} profiles",
    }


def main(arguments: list[str] | None = None) -> dict:
    """Run everything, print it, and return it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one ensemble of four profiles, some seconds")
    parser.add_argument("-n", "--realisations", type=int, default=20, help="profiles of each ensemble")
    parser.add_argument("--part", default="1/1", help="I/N: the I-th of N shares of the ensembles")
    parser.add_argument("--ensembles", action="store_true", help="no run times of growing profiles")
    parser.add_argument("--growth", action="store_true", help="these alone")
    parser.add_argument("-o", "--output", help="JSON file for the figures")
    asked = parser.parse_args(arguments)
    first, step = (int(n) for n in asked.part.split("/"))
    cases = ((1.0, 2.0, "perfect"),) if asked.quick else () if asked.growth else CASES[first - 1 :: step]
    realisations = 4 if asked.quick else asked.realisations
    here = machine()
    named = f"{here['processor']}, {here['processors']} processors, {here['system']}, load {here['load']}"
    print(named)
    result: dict = {"machine": named, "realisations": realisations, "rows": [], "seconds": [], "retro": {}}
    header = ("of", "σ/λ", "T/λ", "slope", "pol", "θ_i", *METHODS, "noise", "power 1", "power 3", "power s2", "oracle")
    print("  ".join(f"{h:>8s}" for h in header))
    for sigma, correlation, name in cases:
        traced = None
        for polarisation in ("TE", "TM"):
            found = ensemble(sigma, correlation, name, polarisation, realisations, 4000 if asked.quick else 40_000)
            traced = found["powers"]["rays"] if traced is None else traced
            new = judged(sigma, correlation, name, polarisation, found, traced)
            for r in new:
                cells = [name, r["sigma"], r["T"], round(r["slope"], 2), r["polarisation"], r["theta_i"]]
                powers = ("power single", "power iterated 3", "power diffraction")
                cells += [f"{r[m]:.3f}" for m in (*METHODS, "noise", *powers, "balance")]
                print("  ".join(f"{c!s:>8s}" for c in cells), flush=True)
            result["rows"] += new
            result["seconds"].append({"material": name, **found["seconds"]})
            where = f"{name}, σ {sigma:g} λ, T {correlation:g} λ, {polarisation}, {THETA_I[1]:g}°"
            result["retro"][where] = retro(found, 1)
            if (sigma, correlation, name) == STEEPEST or asked.quick:
                result["lobes"] = lobes(sigma, correlation, polarisation, found)
        keep(asked.output, result)
    if first == 1 and not asked.ensembles:
        result["growth"] = growth(asked.quick)
        for method, g in result["growth"].items():
            spent = ", ".join(f"{n:g} λ {s:.3f} s" for n, s in zip(g["lengths"], g["seconds"]))
            print(f"{method:10s} {spent}; time grows as length^{g['exponent']:.2f}")
    keep(asked.output, result)
    return result


def keep(path: str | None, result: dict) -> None:
    """Write what is known so far."""
    if path:
        with open(path, "w", encoding="utf-8") as file:
            json.dump(result, file, indent=1, default=float)


if __name__ == "__main__":
    main()
