"""What of a scene's input looks like a slip, of a unit or of a few points: said before what the physics objects to."""

from __future__ import annotations

import numpy as np

from ..assembly import Inputs
from ..directions import like_radians
from ..scene import Scene
from ..surface import Heightfield
from ..surface.plausible import implausible_in_words

SPIKED = 20.0  # kurtosis of heights, 3 for Gaussian ones, beyond which a few points decide


def slips(scene: Scene, inputs: Inputs) -> list[str]:
    """A line on every value of the scene, and every figure of its surface, that is probably not meant."""
    found = [_implausible(scene, inputs)]
    if scene.light is not None:
        found += [like_radians(scene.light.theta_i_deg, "theta_i_deg")]
    if scene.detector is not None and scene.detector.theta_o_deg is not None:
        found += [like_radians(scene.detector.theta_o_deg, "theta_o_deg")]
    if inputs.surface is not None and scene.surface is not None and scene.surface.file is not None:
        found += [_spiked(inputs.source, inputs.surface)]
    return [line for line in found if line]


def _spiked(source: Heightfield | None, surface: Heightfield) -> str:
    """That few points, spikes or pits, make the roughness; "" where they do not."""
    z = surface.z - surface.z.mean()
    variance = float(np.mean(z**2))
    kurtosis = float(np.mean(z**4)) / variance**2 if variance > 0 else 0.0
    if surface.periodic or kurtosis <= SPIKED:
        return ""
    done = step_of(source, surface, "outliers: ")
    removed = f"surface.outliers removed {done.removesuffix(' removed')}" if done else "surface.outliers is not set"
    return (
        f"kurtosis Sku = {kurtosis:.3g} (3 for Gaussian heights): a few points, spikes of the instrument or pits of "
        f"the sample, make the roughness and decide the scatter; {removed}: look at the heights "
        "(vg.report.plot_surface), then take a smaller surface.outliers with a fill, or crop_um"
    )


def step_of(source: Heightfield | None, surface: Heightfield | None, begin: str) -> str:
    """What preparing the surface did in a step, of its history without the source's; "" where there was none such."""
    steps = () if source is None or surface is None else surface.history[len(source.history) :]
    return next((s.removeprefix(begin) for s in steps if s.startswith(begin)), "")


def suspected(scene: Scene, inputs: Inputs, error: str) -> str:
    """An error of the plan, begun with what is implausible about the surface as read: a wrong unit is its likely cause.

    "" stays "".
    """
    odd = _implausible(scene, inputs) if error else ""
    return f"{odd}; as it is: {error}" if odd else error


def _implausible(scene: Scene, inputs: Inputs) -> str:
    if inputs.source is None or scene.surface is None:
        return ""
    return implausible_in_words(inputs.source, generated=scene.surface.file is None)
