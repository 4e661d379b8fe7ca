"""What the shift extension costs the renderer, and how long the predictions of the Normbox take.

python benchmarks/render.py [--quick] [--variant auto]
Names its machine. Renderings of the plain and the extended model are interleaved, each preview scene as its own pair;
the ratio of processor seconds (all threads) is the median of the pairs with a bootstrap interval of 95 %: other work
on the machine moves it less than wall-clock time.
"""

from __future__ import annotations

import argparse
import json
import time
from typing import Any

import numpy as np

from vgonio.accuracy import machine
from vgonio.render import Preview, choose, of_model, radiance, use
from vgonio.render.normbox import load
from vgonio.render.normbox import predict as predictions
from vgonio.render.normbox import virtual as made_up
from vgonio.render.preview import scenes_of

SHIFT = {"h": 8e-4, "w": 2.2}
KINDS: dict[str, dict[str, Any]] = {
    "conductor": {"alpha": 0.3, "material": "Al"},
    "dielectric": {"alpha": 0.3, "eta": 1.5, "k_d": 0.3},
}


def overhead(mi: Any, kind: str, pairs: int, size: int, samples: int) -> dict[str, float]:
    """Processor seconds of plain and extended renderings, their median ratio and its interval."""
    options = Preview(size=size, samples=samples)
    models = {"cook-torrance-1982": KINDS[kind], "clausen-2022": KINDS[kind] | SHIFT}
    integrator = mi.load_dict({"type": "path", "max_depth": 4})
    scenes = {m: scenes_of(mi, options, of_model(m, p).bsdf) for m, p in models.items()}
    seconds: dict[str, list[float]] = {m: [] for m in models}
    for k in range(-1, pairs):  # the first round compiles
        for m in list(models) if k % 2 else list(models)[::-1]:
            start = time.process_time()
            for scene in scenes[m]:
                radiance(mi, scene, integrator, options.wavelength_nm[:4], samples, seed=k + 1)
            if k >= 0:
                seconds[m].append(time.process_time() - start)
    plain, extended = (np.array(seconds[m]) for m in models)
    ratios = extended / plain
    rng = np.random.default_rng(0)
    medians = np.median(rng.choice(ratios, (4000, ratios.size)), axis=1)
    low, high = np.percentile(medians, [2.5, 97.5])
    return {
        "plain_s": float(np.median(plain)),
        "extended_s": float(np.median(extended)),
        "overhead": float(np.median(ratios) - 1),
        "low": float(low - 1),
        "high": float(high - 1),
    }


def predictions_rate(
    mi: Any, angles: tuple[float, ...], patches: tuple[int, ...], wavelengths: int, samples: int
) -> dict[str, float]:
    """Seconds of predictions of the virtual Normbox at some angles, and of all 312 at this rate."""
    w = np.linspace(380.0, 780.0, wavelengths)
    box = load({"virtual": {}}).box
    light_nm, light = made_up.light_spectra(box.light_count, 1)
    light = np.stack([np.interp(w, light_nm, row) for row in light])

    def plain(number: int) -> Any:
        p = made_up.true_parameters(number, w, 1.5e-3)
        return of_model("cook-torrance-1982", {k: p[k] for k in ("alpha", "eta", "k_d")}, w)

    samples_of = {n: plain(n) for n in patches}
    job = predictions.Job(box, plain(0), samples_of, angles, w, light, samples)
    start, busy = time.perf_counter(), time.process_time()
    made = predictions.predict(mi, job)
    seconds, busy = time.perf_counter() - start, time.process_time() - busy
    error = float((made["radiance_stderr"] / made["radiance"]).mean())
    count = len(angles) * len(patches)
    return {
        "seconds": seconds,
        "count": count,
        "all_312_s": 312 * seconds / count,
        "all_312_cpu_s": 312 * busy / count,
        "error_per_wavelength": error,
    }


def main(arguments: list[str] | None = None) -> dict[str, Any]:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a small version, for the tests")
    parser.add_argument("--variant", default="auto")
    parser.add_argument("--pairs", type=int, default=41, help="of renderings; 0 leaves the overhead out")
    parser.add_argument("--no-predictions", action="store_true", help="only the overhead")
    parser.add_argument("--all", action="store_true", help="all 312 predictions at 200 wavelengths, not a part")
    chosen = parser.parse_args(arguments)
    choice = choose(chosen.variant)
    mi = use(choice)
    print(f"{machine()}; Mitsuba {mi.__version__} {choice.variant}")
    scalar = choice.variant.startswith("scalar")
    pairs, size, samples = (3, 16, 1) if chosen.quick else (chosen.pairs, 24 if scalar else 256, 2 if scalar else 32)
    found: dict[str, Any] = {"variant": choice.variant, "overhead": {}}
    for kind in KINDS if pairs else ():
        row = found["overhead"][kind] = overhead(mi, kind, pairs, size, samples)
        print(
            f"{kind}: processor seconds plain {row['plain_s']:.4f} s, extended {row['extended_s']:.4f} s, "
            f"the extension costs {row['overhead']:+.1%} ({row['low']:+.1%} … {row['high']:+.1%}, {pairs} pairs)"
        )
    if not (scalar or chosen.no_predictions):
        angles = tuple(range(30, 91, 5)) if chosen.all else (30.0, 60.0, 90.0)
        patches = (4,) if chosen.quick else tuple(range(1, 25))
        wavelengths = 8 if chosen.quick else 200
        row = found["predictions"] = predictions_rate(mi, angles, patches, wavelengths, 64)
        print(
            f"{row['count']} predictions, 64 samples, {wavelengths} wavelengths: {row['seconds']:.1f} s, "
            f"312 at this rate {row['all_312_s']:.0f} s ({row['all_312_cpu_s']:.0f} s of the processor); "
            f"mean error {row['error_per_wavelength']:.2%} per wavelength"
        )
    print(json.dumps(found))
    return found


if __name__ == "__main__":
    main()
