"""Make the height fields of this folder from their seeds.

    python heightfields/make.py                        all of them: 200 µm squares at 0.625 µm, and the gratings
    python heightfields/make.py --sample 1             one of them
    python heightfields/make.py --sample 1 --full      the 1280 µm square, to sample1_full.npz
    python heightfields/make.py --table                put the table of README.md right
    python heightfields/make.py --tune --sample 1      search seed, depth and base of the recipe again

Samples 1 to 8 are *statistics-matched surrogates* of the eight aluminium samples of Clausen, "Towards predictive
virtual prototyping" (2022), table 4.1. They are NOT measurements: the blasting conditions are its, RMS height and RMS
slope are made to agree, all the rest follows from the model (vgonio.surface.sandblasted).
"""

from __future__ import annotations

import argparse
import itertools
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vgonio import surface as sf
from vgonio.surface.heightfield import Heightfield

FOLDER = Path(__file__).resolve().parent
PITCH_UM = 0.625
CROP, FULL = (320, 320), (2048, 2048)


@dataclass(frozen=True)
class Recipe:
    """One sample: what it has to agree with, the process, and what was tuned for it as (crop, full size).

    rms_um, alpha : the targets; `derived` where the thesis gives no α
    seed, depth_um, base_rms_um : tuned. depth_um is of the cavities or, on the polished sample, of the scratches;
        base_rms_um is the roughness of the surface below them (0: an ideal plane), tuned only where tune_base says so
    """

    process: str
    rms_um: float
    alpha: float
    seed: tuple[int, int]
    depth_um: tuple[float, float]
    coverage: float = 0.0
    depth_spread: float = 0.2
    bead_diameter_um: tuple[float, float] = (70.0, 100.0)
    base_rms_um: tuple[float, float] = (0.0, 0.0)
    base_correlation_um: float = 50.0
    derived: bool = False
    tune_base: bool = False


RECIPES = {
    # what these beads leave untouched is not mirror flat: rough enough for no peak in the mirror direction
    1: Recipe(
        "glass beads 70–100 µm, 6.5 bar, 100 mm",
        2.39,
        0.294,
        (44, 0),
        (2.983, 2.968),
        3.0,
        base_rms_um=(0.4, 0.4),
        base_correlation_um=20.0,
    ),
    2: Recipe(
        "glass beads 70–100 µm, 4 bar, 100 mm",
        1.76,
        0.256,
        (19, 1),
        (2.453, 2.424),
        2.5,
        0.1,
        base_rms_um=(0.3, 0.3),
        base_correlation_um=20.0,
    ),
    3: Recipe("glass beads 70–100 µm, 3 bar, 100 mm", 1.20, 0.201, (24, 3), (1.484, 1.458), 3.5),
    4: Recipe("glass beads 70–100 µm, 2 bar, 100 mm", 0.98, 0.174, (0, 1), (1.07, 1.09), 6.0),
    5: Recipe("glass beads 70–100 µm, 1 bar, 100 mm", 0.52, 0.122, (13, 0), (0.5881, 0.56), 6.5),
    6: Recipe(
        "polished, with scratches", 0.10, 0.024, (1, 0), (0.03115, 0.03521), base_rms_um=(0.095, 0.0931), tune_base=True
    ),
    7: Recipe(
        "glass beads 35 µm, 1 bar, 200 mm",
        0.66,
        0.149,
        (0, 0),
        (0.3721, 0.376),
        4.0,
        bead_diameter_um=(30.0, 40.0),
        base_rms_um=(0.6151, 0.5941),
        derived=True,
        tune_base=True,
    ),
    8: Recipe(
        "glass beads 70–100 µm, 1 bar, 200 mm; base partly visible",
        0.43,
        0.046,
        (0, 0),
        (0.1147, 0.1193),
        0.7,
        0.5,
        base_rms_um=(0.4281, 0.4235),
        derived=True,
        tune_base=True,
    ),
}


def blasted(recipe: Recipe, i: int) -> Heightfield:
    """Cavities on a plane or, where beads leave much of the base or the surface is uneven, on a wavy one."""
    shape = (CROP, FULL)[i]
    base = sf.flat(shape, PITCH_UM)
    if recipe.base_rms_um[i]:
        base = sf.gaussian(recipe.base_rms_um[i], recipe.base_correlation_um, shape, PITCH_UM, recipe.seed[i] + 1000)
    return sf.sandblasted(
        bead_diameter_um=recipe.bead_diameter_um,
        depth_um=recipe.depth_um[i],
        depth_spread=recipe.depth_spread,
        coverage=recipe.coverage,
        resolution_um=PITCH_UM,
        base=base,
        seed=recipe.seed[i],
    )


def polished(recipe: Recipe, i: int) -> Heightfield:
    """Self-affine polish of 6 to 60 µm with scratches of random direction, 1500 to the square millimetre."""
    base = sf.power_law(recipe.base_rms_um[i], 0.8, (CROP, FULL)[i], PITCH_UM, 60.0, 6.0, recipe.seed[i] + 1000)
    count = round(1500 * base.area_um2 * 1e-6)
    z = base.z - scratches(base, count, recipe.depth_um[i], recipe.seed[i])
    step = f"{count} scratches of mean depth {recipe.depth_um[i]:g} µm, seed {recipe.seed[i]}"
    return base.with_history(z - z.mean(), step)


def scratches(field: Heightfield, count: int, depth_um: float, seed: int) -> np.ndarray:
    """(ny, nx) depth of straight grooves: exponential depths, 30 to 200 µm long, Gaussian section of 3 to 5 µm FWHM."""
    rng = np.random.default_rng(seed)
    out = np.zeros(field.shape)
    centre = rng.random((count, 2)) * field.size_um
    turn = rng.random(count) * np.pi
    half, width = rng.uniform(15, 100, count), rng.uniform(3, 5, count) / 2.3548
    depth = rng.exponential(depth_um, count)
    for (cy, cx), angle, length, s, d in zip(centre, turn, half, width, depth):
        along = np.array([np.sin(angle), np.cos(angle)])
        index, offset = [], []
        for n, h, c, reach in zip(field.shape, field.pitch_um, (cy, cx), np.abs(along) * length + 15 * s):
            i = np.arange(np.floor((c - reach) / h), np.ceil((c + reach) / h) + 1).astype(int)
            index.append(i % n)
            offset.append((i + 0.5) * h - c)
        t = offset[0][:, None] * along[0] + offset[1] * along[1]
        across = offset[0][:, None] * along[1] - offset[1] * along[0]
        # the ends run out three times as slowly as the sides
        beyond = np.maximum(np.abs(t) - length, 0) / 3
        np.add.at(out, np.ix_(*index), d * np.exp(-(across**2 + beyond**2) / (2 * s**2)))
    return out


def make(sample: int, full: bool = False) -> Heightfield:
    """Surrogate of sample 1 to 8, as it ships or at its full size of 1280 µm."""
    recipe = RECIPES[sample]
    field = _field(recipe, int(full))
    note = (
        f"statistics-matched surrogate of sample {sample} ({recipe.process}) of Clausen 2022, table 4.1, made to have "
        f"Sq {recipe.rms_um:g} µm and alpha {recipe.alpha:g}; not a measurement"
    )
    meta = {"surrogate": True, "measurement": False, "seed": recipe.seed[int(full)], "licence": "MIT"}
    return field.replace(name=f"sample {sample} (surrogate)", history=(*field.history, note), meta=meta)


def grating(name: str) -> Heightfield:
    """Sinusoid of 2 µm period and 0.1 µm amplitude, or blazed grating of 2 µm and 10°; 50 × 3.2 µm at 0.05 µm."""
    if name == "grating_sinusoid":
        return sf.sinusoid(2.0, 0.1, (64, 1000), 0.05).replace(name="sinusoidal grating")
    return sf.blazed(2.0, blaze_deg=10.0, shape=(64, 1000), pitch_um=0.05).replace(name="blazed grating")


GRATINGS = ("grating_sinusoid", "grating_blazed")


def save(field: Heightfield, path: Path) -> Path:
    """Surrogates in 16 bits, in steps of about 3e-4 of their Sq; gratings exactly."""
    if not field.meta.get("surrogate"):
        return sf.write(field, path)
    return sf.write(field, path, int16=True, scale_um=float(f"{3e-4 * field.z.std():.1g}"))


# ---- tuning and the table
def tuned(recipe: Recipe, i: int) -> Recipe:
    """The first seed whose field agrees in Sq to 1 % and in α to 0.5 %, isotropic, with near-Gaussian heights (4.4).

    A crop holds a hundred-odd cavities of sample 1: its Sq varies by some 5 % from seed to seed, as that of a measured
    crop would.
    """
    for seed in itertools.count():
        recipe = _with(recipe, i, seed=seed)
        for _ in range(10):
            found = sf.parameters(_field(recipe, i))
            slope, height = recipe.alpha / found["alpha"], recipe.rms_um / found["Sq"]
            agrees = abs(slope - 1) < 0.005 and abs(height - 1) < 0.01
            if agrees or (not recipe.tune_base and abs(height - 1) > 0.1):
                break  # depth alone does not mend such an Sq: the next seed
            base = recipe.base_rms_um[i] * (height if recipe.tune_base else 1.0)
            recipe = _with(
                recipe, i, depth_um=float(f"{recipe.depth_um[i] * slope**1.5:.4g}"), base_rms_um=round(base, 4)
            )
        isotropic = abs(found["alpha_x"] / found["alpha"] - 1) < 0.02
        if agrees and isotropic and abs(found["Ssk"]) < 0.25 and abs(found["Sku"] - 3) < 0.5:
            return recipe
    raise AssertionError("unreachable: the search ends with a return")


def table() -> str:
    """The table of README.md, from the files as they are."""
    rows = [
        "| file | what it is | points | pitch µm | size µm | Sq µm | α | Sal µm | seed |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name in (*(f"sample{n}" for n in RECIPES), *GRATINGS):
        field = sf.read(FOLDER / f"{name}.npz")
        (ny, nx), (ly, lx), p = field.shape, field.size_um, sf.parameters(field)
        what = field.name
        if name.startswith("sample"):
            recipe = RECIPES[int(name[6:])]
            what = f"surrogate: {recipe.process}. Aim: Sq {recipe.rms_um:g}, α {recipe.alpha:g}" + "¹" * recipe.derived
        rows.append(
            f"| `{name}.npz` | {what} | {nx} × {ny} | {field.dx:g} | {lx:g} × {ly:g} | {p['Sq']:.3g} "
            f"| {p['alpha']:.3f} | {p['Sal']:.3g} | {field.meta.get('seed', '–')} |"
        )
    return "\n".join(rows) + "\n"


def update_readme() -> None:
    """Put the table into README.md."""
    path = FOLDER / "README.md"
    before, rest = path.read_text(encoding="utf-8").split("--table -->\n")
    after = rest[rest.index("<!-- end of table -->") :]
    path.write_text(f"{before}--table -->\n{table()}{after}", encoding="utf-8")


def _field(recipe: Recipe, i: int) -> Heightfield:
    return blasted(recipe, i) if recipe.coverage else polished(recipe, i)


def _with(recipe: Recipe, i: int, **changes: float) -> Recipe:
    """The recipe with the crop's (0) or the full size's (1) value of each pair changed."""
    pairs = {k: tuple(v if j == i else old for j, old in enumerate(getattr(recipe, k))) for k, v in changes.items()}
    return replace(recipe, **pairs)  # type: ignore[arg-type]


def main() -> None:
    parser = argparse.ArgumentParser(description="Make the height fields of this folder from their seeds.")
    parser.add_argument("--sample", type=int, choices=RECIPES, help="one surrogate only")
    parser.add_argument("--full", action="store_true", help="the 1280 µm square of 2048 × 2048 points")
    parser.add_argument("--tune", action="store_true", help="search seed, depth and base again and print them")
    parser.add_argument("--table", action="store_true", help="put the table of README.md right")
    parser.add_argument("-o", "--output", type=Path, default=FOLDER, help="folder to write to")
    asked = parser.parse_args()
    samples = [asked.sample] if asked.sample else list(RECIPES)
    if asked.table:
        update_readme()
        return
    for n in samples:
        if asked.tune:
            r, i = tuned(RECIPES[n], int(asked.full)), int(asked.full)
            print(f"sample {n}: seed {r.seed[i]}, depth_um {r.depth_um[i]}, base_rms_um {r.base_rms_um[i]}")
        else:
            print(save(make(n, asked.full), asked.output / f"sample{n}{'_full' * asked.full}.npz"))
    if not (asked.sample or asked.full or asked.tune):
        for name in GRATINGS:
            print(save(grating(name), asked.output / f"{name}.npz"))


if __name__ == "__main__":
    main()
