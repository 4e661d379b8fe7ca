"""Make the height fields of this folder from their seeds.

    python heightfields/make.py                 all of them, 200 µm squares at 0.625 µm
    python heightfields/make.py --sample 1      one of them
    python heightfields/make.py --sample 1 --full -o sample1_full.npz      the 1280 µm square
    python heightfields/make.py --tune          search the seeds and depths of the table below again

Samples 1 to 8 are *statistics-matched surrogates* of the eight aluminium samples of Clausen, "Towards predictive virtual
prototyping" (2022), table 4.1. They are NOT measurements: beads, RMS height and RMS slope agree, the rest follows from
the model of spherical cavities (vgonio.surface.sandblasted).
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
    """One sample: what it has to agree with, the process behind it, and what was tuned for the crop and the full size.

    rms_um, alpha : targets; `derived` marks an α that the thesis does not give
    seed, depth_um, base_rms_um : (crop, full)
    """

    what: str
    rms_um: float
    alpha: float
    seed: tuple[int, int]
    depth_um: tuple[float, float]
    coverage: float
    depth_spread: float = 0.2
    bead_diameter_um: tuple[float, float] = (70.0, 100.0)
    base_rms_um: tuple[float, float] = (0.0, 0.0)
    base_correlation_um: float = 0.0
    derived: bool = False


RECIPES = {
    1: Recipe("blasted at 6.5 bar, 100 mm", 2.39, 0.294, (57, 0), (3.0635, 2.94), 3.0),
    2: Recipe("blasted at 4 bar, 100 mm", 1.76, 0.256, (19, 0), (2.4123, 2.30), 2.5, depth_spread=0.1),
    3: Recipe("blasted at 3 bar, 100 mm", 1.20, 0.201, (6, 0), (1.4777, 1.46), 3.5),
    4: Recipe("blasted at 2 bar, 100 mm", 0.98, 0.174, (9, 0), (1.1289, 1.10), 6.0),
    5: Recipe("blasted at 1 bar, 100 mm", 0.52, 0.122, (13, 0), (0.5882, 0.56), 6.5),
}


def sandblasted(recipe: Recipe, shape: tuple[int, int]) -> Heightfield:
    """The blasted surface of one recipe, on a flat or a wavy base."""
    i = int(shape == FULL)
    base = sf.flat(shape, PITCH_UM)
    if recipe.base_rms_um[i]:
        base = sf.gaussian(recipe.base_rms_um[i], recipe.base_correlation_um, shape, PITCH_UM, seed=recipe.seed[i])
    return sf.sandblasted(
        bead_diameter_um=recipe.bead_diameter_um,
        depth_um=recipe.depth_um[i],
        depth_spread=recipe.depth_spread,
        coverage=recipe.coverage,
        resolution_um=PITCH_UM,
        base=base,
        seed=recipe.seed[i],
    )


def tuned(recipe: Recipe, shape: tuple[int, int]) -> Recipe:
    """The first seed whose field agrees in Sq to 1 % once its depth gives α to 0.3 %.

    A crop holds a hundred-odd cavities, so that its Sq varies by some 5 % from seed to seed, as that of a measured
    crop would.
    """
    i = int(shape == FULL)
    for seed in itertools.count():
        recipe = _with(recipe, i, seed=seed)
        for _ in range(8):
            field = sandblasted(recipe, shape)
            ratio, height = recipe.alpha / sf.parameters(field)["alpha"], recipe.rms_um / field.z.std()
            base = recipe.base_rms_um[i] * (height if recipe.base_rms_um[i] else 1)
            if abs(ratio - 1) < 0.005 and (abs(height - 1) < 0.01 or not base):
                break
            recipe = _with(recipe, i, depth_um=round(recipe.depth_um[i] * ratio**1.5, 4), base_rms_um=round(base, 4))
        z = field.z / field.z.std()
        gaussian = abs((z**3).mean()) < 0.2 and abs((z**4).mean() - 3) < 0.4  # "almost Gaussian", thesis section 4.4
        if abs(height - 1) < 0.01 and abs(ratio - 1) < 0.005 and gaussian:
            return recipe
    raise AssertionError("unreachable")


def _with(recipe: Recipe, i: int, **changes: float) -> Recipe:
    """The recipe with one of each pair changed."""
    pairs = {k: tuple(v if j == i else old for j, old in enumerate(getattr(recipe, k))) for k, v in changes.items()}
    return replace(recipe, **pairs)


def make(sample: int, full: bool = False) -> Heightfield:
    """Sample 1 to 8 as it ships, or its full size."""
    recipe, shape = RECIPES[sample], FULL if full else CROP
    field = sandblasted(recipe, shape)
    note = (
        f"statistics-matched surrogate of sample {sample} ({recipe.what}) of Clausen 2022, table 4.1; not a measurement: "
        f"aimed at Sq {recipe.rms_um:g} µm and alpha {recipe.alpha:g}"
    )
    meta = {"surrogate": True, "measurement": False, "licence": "MIT", "seed": recipe.seed[int(full)]}
    return field.replace(name=f"sample {sample} (surrogate)", history=(*field.history[-1:], note), meta=meta)
