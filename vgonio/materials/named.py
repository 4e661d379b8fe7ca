"""What a name means: a half-space, or one under films, each a name again; films and stacks from such names."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable

import numpy as np

from ..errors import MaterialError
from .films import Coated
from .half_space import Material
from .sources import half_space

# how a coated material names itself, so that its name in a result is a material again
COATED = re.compile(r"(\S+) ([0-9.]+(?:e[+-]?[0-9]+)?) nm on (.+)")


def material(name: str | os.PathLike[str] | Material) -> Material:
    """The material of that name ("Al", "Al:McPeak", "perfect", "Al2O3 4 nm on Al") or of that YAML or CSV file."""
    if isinstance(name, Material):
        return name
    coated = COATED.fullmatch(str(name))
    return film(coated[1], float(coated[2]), on=coated[3]) if coated else half_space(name)


def film(
    layer: str | os.PathLike[str] | Material, thickness_nm: float, on: str | os.PathLike[str] | Material = "Al"
) -> Coated:
    """A film of `thickness_nm` of one material on another, which may be coated already (a stack).

    >>> film("Al2O3", 4.0, on="Al")                             # native oxide of aluminium
    >>> film("MgF2:Li-o", 100.0, on=film("SiO2", 50.0, on="Ag"))   # two layers, MgF2 outside

    Raises MaterialError for thicknesses below zero, and for "perfect", which has no index that a film could meet.
    """
    top, below = material(layer), material(on)
    if isinstance(top, Coated):
        raise MaterialError(f"{top.name!r} cannot be a film: put its layers on one by one, the innermost first")
    if top.perfect or below.perfect:
        raise MaterialError("a film needs refractive indices on both sides: 'perfect' has none, name a material")
    d = float(thickness_nm)
    if not (np.isfinite(d) and d >= 0):
        raise MaterialError(f"a film of {thickness_nm} nm: the thickness has to be 0 nm or more")
    inner = below.layers if isinstance(below, Coated) else ((below, np.inf),)
    limits = max(top.range_nm[0], below.range_nm[0]), min(top.range_nm[1], below.range_nm[1])
    return Coated(
        name=f"{top.name} {d:.12g} nm on {below.name}",
        source=f"film: {top.source}; {'' if isinstance(below, Coated) else 'half-space: '}{below.source}",
        table=None,
        range_nm=limits,
        layers=((top, d), *inner),
    )


def stack(layers: Iterable[tuple[str | os.PathLike[str] | Material, float]], on: str | Material) -> Material:
    """Films (material, thickness in nm) from the outside in, on a half-space; no film at all gives the half-space."""
    made = material(on)
    for layer, thickness_nm in reversed(list(layers)):
        made = film(layer, thickness_nm, on=made)
    return made
