"""Multiple scattering: error and seconds of single, shadowed and iterated Kirchhoff and of rays against full-wave.

    python benchmarks/multiple_scattering.py [--quick] [-n REALISATIONS] [-o results.json] [--figure figure.png]
        [--page table.md]

Ensembles of perfectly conducting profiles with Gaussian heights and correlation exp(−x²/T²), 60 wavelengths long, under
the same Gaussian beam (ℓ = 7.5 λ on z = 0) for every wave method. The error is Σ|Δ|/Σ of the ensemble's mean power per
radian over −80 … 80°, in bins of 2°, against `full_wave.scatter_profile`. `noise` is what is left of it by chance: the
same figure between the two halves of the full-wave ensemble, over 2. Power is integrated over ±90°.
Seconds are those of one profile, four angles of incidence, one polarisation. Their growth is fitted to lengths of
30 … 240 wavelengths.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings

import numpy as np
from waves import machine

import vgonio as vg
from vgonio.materials import material
from vgonio.surface import Heightfield
from vgonio.wave.full_wave import scatter_profile
from vgonio.wave.iterated.beam import Beam
from vgonio.wave.iterated.far_field import far_amplitudes
from vgonio.wave.iterated.profile import Light, Stretch, fields

LENGTH, PITCH, BIN = 60.0, 0.1, 2.0  # in wavelengths; λ = 1 µm; degrees
THETA_I = (0.0, 20.0, 50.0, 70.0)
CASES = ((0.3, 4.2), (0.3, 2.0), (0.3, 0.85), (1.0, 5.66), (1.0, 2.0), (1.5, 2.5), (2.0, 2.83))  # σ/λ, T/λ
FINE = np.arange(-89.75, 90.0, 0.5)  # degrees
REMARKS = """The waves see the same profiles under the same beam as the full wave, so that chance hardly enters their
errors; rays light the whole profile and miss its speckle. What is left of iterated Kirchhoff's error is mostly the
sharp edge of its shadows: it grows towards grazing and where T falls below a wavelength, and TE and TM miss the power
on opposite sides (TE too bright at normal incidence)."""
LABELS = {"single": (-7, 5), "shadowed": (7, -12), "rays": (7, 5), "iterated 2": (7, 5), "iterated 3": (-7, 5),
          "iterated 6": (7, -12)}  # fmt: skip
METHODS = ("single", "shadowed", "rays", "iterated 2", "iterated 3", "iterated 6")


def profile(sigma: float, correlation: float, seed: int, length: float = LENGTH) -> Heightfield:
    """One row of a Gaussian surface: its statistics along x are those of the surface."""
    pitch = min(PITCH, correlation / 10)
    n = round(length / pitch)
    shape = (12, n if n % 2 == 0 else n + 1)
    made = vg.surface.gaussian(sigma, correlation, shape, (correlation / 3, pitch), seed, exact=False)
    return Heightfield(made.z[:1], pitch, name="profile")


def kirchhoff(surface: Heightfield, polarisation: str, bounces: int, shadowing: bool = True):
    """(orders, t, m) power per radian over incident power of the coherent sums of the first 1, 2, … reflections."""
    k, theta = 2 * np.pi, np.deg2rad(THETA_I)
    middle, beam_length = surface.size_um[1] / 2, surface.size_um[1] / 8
    stretch = Stretch.of(surface, Beam("tapered", beam_length, middle, middle), 0.1)
    light = Light(k, theta, polarisation, material("perfect"), 1000.0)
    u, v = fields(stretch, light, bounces, 1e-9, shadowing)
    seen = stretch.sight.seen(stretch.curve, np.deg2rad(FINE)) if shadowing else None
    far = far_amplitudes(stretch.curve, u, v, k, np.deg2rad(FINE), seen)
    power = np.abs(np.cumsum(far, axis=-1)) ** 2
    return np.moveaxis(power, (2, 1, 0), (0, 1, 2)) / stretch.beam.power(k, theta)[:, None]


def full_wave(surface: Heightfield, polarisation: str, panels: float = 0.8):
    """(t, m) the same by the method of moments, and its energy balance (t,)."""
    found = scatter_profile(
        surface.x, surface.z[0], 1.0, THETA_I, polarisation, None, surface.size_um[1] / 8, FINE, panels
    )
    return found.density, found.balance


def rays(surface: Heightfield, count: int):
    """(t, m) the same by rays, without a beam: the whole profile, repeated."""
    gonio = vg.measure.Gonioreflectometer(THETA_I, FINE, aperture_deg=0.5)
    solver = vg.geometric.RayOptics("perfect", [1000.0], rays=count, estimator="binning")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        data = gonio.measure(surface.replace(z=np.repeat(surface.z, 2, axis=0), periodic=True), solver)
    return data.brdf.values[..., 0] * gonio.detector.projected_solid_angle / np.deg2rad(0.5)


def timed(work):
    start = time.perf_counter()
    return work(), time.perf_counter() - start


def binned(power):
    """(…, bins) means over bins of BIN degrees within ±80°."""
    inside = power[..., np.abs(FINE) < 80]
    return inside.reshape(*inside.shape[:-1], -1, round(BIN / 0.5)).mean(axis=-1)


def total(power):
    """(…,) power over ±90°."""
    return power.sum(axis=-1) * np.deg2rad(0.5)


def ensemble(sigma: float, correlation: float, polarisation: str, realisations: int, ray_count: int) -> dict:
    """Mean powers and seconds of all methods on one ensemble."""
    powers, seconds, balance = {m: [] for m in (*METHODS, "full wave")}, {}, []

    def keep(method, result, duration):
        powers[method].append(result)
        seconds[method] = seconds.get(method, 0.0) + duration / realisations

    for seed in range(realisations):
        surface = profile(sigma, correlation, 1000 + seed)
        (exact, energy), duration = timed(lambda s=surface: full_wave(s, polarisation))
        keep("full wave", exact, duration)
        balance.append(energy)
        single, duration = timed(lambda s=surface: kirchhoff(s, polarisation, 1, shadowing=False))
        keep("single", single[0], duration)
        shadowed, duration = timed(lambda s=surface: kirchhoff(s, polarisation, 1))
        keep("shadowed", shadowed[0], duration)
        for bounces in (2, 3, 6):
            found, duration = timed(lambda s=surface, b=bounces: kirchhoff(s, polarisation, b))
            keep(f"iterated {bounces}", found[-1], duration)
        if polarisation == "TE":
            traced, duration = timed(lambda s=surface: rays(s, ray_count))
            keep("rays", traced, duration)
    return {"powers": {m: np.array(p) for m, p in powers.items() if p}, "seconds": seconds, "balance": balance}


def judged(sigma: float, correlation: float, polarisation: str, found: dict, traced) -> list[dict]:
    """Rows of the table: one for each angle of incidence and method."""
    exact = found["powers"]["full wave"]
    half = len(exact) // 2
    rows = []
    for i, theta in enumerate(THETA_I):
        reference = binned(exact[:, i].mean(axis=0))
        noise = np.abs(binned(exact[:half, i].mean(axis=0)) - binned(exact[half:, i].mean(axis=0))).sum()
        row = {
            "sigma": sigma, "T": correlation, "slope": np.sqrt(2) * sigma / correlation, "polarisation": polarisation,
            "theta_i": theta, "noise": float(noise / reference.sum() / 2),
            "balance": float(np.abs(np.array(found["balance"])[:, i] - 1).max()),
        }  # fmt: skip
        for method in METHODS:
            power = (traced if method == "rays" else found["powers"][method])[:, i].mean(axis=0)
            row[method] = float(np.abs(binned(power) - reference).sum() / reference.sum())
            row[f"power {method}"] = float(total(power))
        rows.append(row)
    return rows


def together(rows: list[dict]) -> dict[str, float]:
    """Power of three reflections for unpolarised light, by case and angle: TE and TM miss it on opposite sides."""
    found: dict[str, list[float]] = {}
    for r in rows:
        found.setdefault(f"{r['sigma']:g} {r['T']:g} {r['theta_i']:g}", []).append(r["power iterated 3"])
    return {name: float(np.mean(values)) for name, values in found.items()}


def growth(quick: bool) -> dict:
    """Seconds against the length of the profile, and the exponent of a fit to the longer half."""
    lengths = (15, 30) if quick else (30, 60, 120, 240)
    work = {
        "single": lambda s: kirchhoff(s, "TE", 1, shadowing=False),
        "iterated 3": lambda s: kirchhoff(s, "TE", 3),
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
    for method in ("full wave", "iterated 3", "single"):
        power = found["powers"][method][:, order_two].mean(axis=0)
        away = np.abs(FINE - THETA_I[order_two])
        out[method] = float(power[away < 2].mean() / power[(away > 8) & (away < 16)].mean())
    return out


def draw(path: str, rows: list[dict], seconds: dict, growths: dict, curves: dict, where: str) -> None:
    """Error against run time, and the mean lobes of the steepest ensemble."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullFormatter

    every = [np.mean([s[m] for s in seconds if m in s]) for m in (*METHODS, "full wave")]
    time_range = min(every), max(every)
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.6), constrained_layout=True)
    colours = dict(zip(METHODS, ("#888888", "#5b8ff9", "#e8a33d", "#9270ca", "#d64550", "#7a1f2b")))
    for method in METHODS:
        errors = [r[method] for r in rows if r["slope"] > 0.6 and r["theta_i"] <= 30]
        if not errors:
            errors = [r[method] for r in rows]
        low, middle, high = np.percentile(errors, [0, 50, 100])
        time_each = np.mean([s[method] for s in seconds if method in s])
        left.errorbar(time_each, middle, [[middle - low], [high - middle]], fmt="o", color=colours[method], capsize=3)
        left.annotate(method, (time_each, middle), xytext=LABELS[method], textcoords="offset points",
                      color=colours[method], ha="right" if LABELS[method][0] < 0 else "left")  # fmt: skip
    noise = np.median([r["noise"] for r in rows if r["slope"] > 0.6 and r["theta_i"] <= 30] or [rows[0]["noise"]])
    left.axhline(noise, color="k", lw=0.8, ls=":")
    left.annotate(
        "chance: two halves of the ensemble", (0.3, noise), xycoords=("axes fraction", "data"), va="bottom", size=8
    )
    left.axvline(np.mean([s["full wave"] for s in seconds]), color="k", lw=0.8)
    at = (np.mean([s["full wave"] for s in seconds]), 0.8)
    left.annotate("full wave", at, xycoords=("data", "axes fraction"), rotation=90, ha="right", size=9)
    left.set(xscale="log", yscale="log", ylim=(0.04, 0.8), xlim=(time_range[0] / 2.5, time_range[1] * 1.8),
             xlabel="seconds, one profile of 60 λ, four θ_i",
             ylabel="error of the mean lobe", title="Slopes 0.7 to 1.0, incidence 0° and 20°, TE and TM")  # fmt: skip
    left.xaxis.set_minor_formatter(NullFormatter())
    names = {
        "full wave": ("k", "-"),
        "iterated 3": ("#d64550", "-"),
        "shadowed": ("#5b8ff9", "-"),
        "single": ("#888888", "--"),
    }
    for method, (colour, style) in names.items():
        right.plot(FINE[np.abs(FINE) < 80].reshape(-1, 4).mean(axis=1), binned(curves[method]), style, color=colour,
                   label=method, lw=1.4)  # fmt: skip
    right.axvline(curves["theta_i"], color="k", lw=0.6, ls=":")
    right.set(xlabel="θ_o in degrees (retro direction dotted)", ylabel="power per radian / incident power",
              title=curves["title"], ylim=(0, None))  # fmt: skip
    right.legend(frameon=False)
    grows = ", ".join(f"{m} {g['exponent']:.1f}" for m, g in growths.items())
    figure.suptitle(f"{where}; exponents of time over length: {grows}", size=8)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def page(result: dict) -> str:
    """Markdown: what was compared, the table, run times and retro peaks."""
    shown = ("single", "shadowed", "rays", "iterated 2", "iterated 3", "noise")
    head = ["σ/λ", "T/λ", "slope", "", "θ_i", *shown, "power single", "power iterated 3"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for r in result["rows"]:
        cells = [f"{r['sigma']:g}", f"{r['T']:g}", f"{r['slope']:.2f}", r["polarisation"], f"{r['theta_i']:g}°"]
        cells += [f"{r[m]:.3f}" for m in shown] + [f"{r[f'power {m}']:.2f}" for m in ("single", "iterated 3")]
        lines.append("| " + " | ".join(cells) + " |")
    grows = [
        f"- {m}: " + ", ".join(f"{n:g} λ {s:.3f} s" for n, s in zip(g["lengths"], g["seconds"]))
        + f"; grows as length^{g['exponent']:.1f}"
        for m, g in result["growth"].items()
    ]  # fmt: skip
    retro_lines = [f"- {n}: " + ", ".join(f"{m} {p:.2f}" for m, p in v.items()) for n, v in result["retro"].items()]
    return "\n".join([
        "# Multiple scattering: four theories against the full-wave solver", "",
        f"Made by `python benchmarks/multiple_scattering.py -n {result['realisations']} --page …`.",
        f"{result['machine']}.", "", *__doc__.splitlines()[5:], "",
        REMARKS, "",
        "![Error against run time, and the mean lobe of steep profiles](multiple_scattering.png)",
        "", *lines, "", "## Run time, one polarisation, four angles", *grows, "",
        "## Power within 2° of the retro direction over that 8 … 16° beside it", *retro_lines, "",
    ])  # fmt: skip


def main(arguments: list[str] | None = None) -> dict:
    """Run everything, print it, and return it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one ensemble of four profiles, some seconds")
    parser.add_argument("-n", "--realisations", type=int, default=20, help="profiles of each ensemble")
    parser.add_argument("-o", "--output", help="JSON file for the figures")
    parser.add_argument("--figure", help="PNG file")
    parser.add_argument("--page", help="Markdown file for the table")
    asked = parser.parse_args(arguments)
    cases = ((1.0, 2.0),) if asked.quick else CASES
    realisations = 4 if asked.quick else asked.realisations
    print(machine())
    rows, seconds, steep, retros = [], [], None, {}
    header = ("σ/λ", "T/λ", "slope", "pol", "θ_i", *METHODS, "noise", "power 1", "power 3", "oracle")
    print("  ".join(f"{h:>8s}" for h in header))
    for sigma, correlation in cases:
        traced = None
        for polarisation in ("TE", "TM"):
            found = ensemble(sigma, correlation, polarisation, realisations, 4000 if asked.quick else 40_000)
            traced = found["powers"]["rays"] if traced is None else traced
            new = judged(sigma, correlation, polarisation, found, traced)
            for r in new:
                cells = [r["sigma"], r["T"], round(r["slope"], 2), r["polarisation"], r["theta_i"]]
                cells += [f"{r[m]:.3f}" for m in (*METHODS, "noise", "power single", "power iterated 3", "balance")]
                print("  ".join(f"{c!s:>8s}" for c in cells), flush=True)
            rows += new
            seconds.append(found["seconds"])
            steep = (sigma, correlation, polarisation, found)
            retros[f"σ {sigma:g} λ, T {correlation:g} λ, {polarisation}, {THETA_I[1]:g}°"] = retro(found, 1)
    growths = growth(asked.quick)
    for method, g in growths.items():
        spent = ", ".join(f"{n:g} λ {s:.3f} s" for n, s in zip(g["lengths"], g["seconds"]))
        print(f"{method:10s} {spent}; time grows as length^{g['exponent']:.2f}")
    for name, peaks in retros.items():
        print(f"retro peak over its surroundings, {name}: " + ", ".join(f"{m} {p:.2f}" for m, p in peaks.items()))
    if asked.figure:
        sigma, correlation, polarisation, found = steep
        curves = {m: found["powers"][m][:, 1].mean(axis=0) for m in ("full wave", "iterated 3", "shadowed", "single")}
        curves |= {
            "theta_i": THETA_I[1],
            "title": f"σ = {sigma:g} λ, T = {correlation:g} λ, {polarisation}, {realisations} profiles",
        }
        draw(asked.figure, rows, seconds, growths, curves, machine())
    result = {"machine": machine(), "rows": rows, "seconds": seconds, "growth": growths, "retro": retros}
    result["mean_of_polarisations"] = together(rows)
    result["realisations"] = realisations
    if asked.page:
        with open(asked.page, "w", encoding="utf-8") as file:
            file.write(page(result))
    if asked.output:
        with open(asked.output, "w", encoding="utf-8") as file:
            json.dump(result, file, indent=1, default=float)
    return result


if __name__ == "__main__":
    main()
