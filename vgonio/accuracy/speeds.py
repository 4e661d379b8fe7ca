"""What a machine can do: the elementary speeds that forecasts of a scene's stages are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Speeds:
    """Seconds of one elementary piece of work, all threads of a run at it together.

    facet : of a mesh with its hierarchy;  ray : cast and counted, one reflection;  hit : of every reflection more
    point : drawn on a facet and tried;  mueller : matrix of a path at one wavelength
    height : of the interpolated surface at a point;  phase : of a point at the first q_z;  line : at each further one,
        with `product` for each row of q_y that shares it
    fft : point of a transform, times log₂ of its length;  tap : weight of the interpolation
    vector : scattering vector turned into a BRDF;  spread : point spread on a plane's grid (FINUFFT)
    row : transform of a row of scattering vectors, however small;  space : factor on the transforms in space
    term, plain_term : of a direct sum, by OpenCL and by numpy;  shadow : point found lit or not
    kernel : factor on a full-wave solver's matrix;  flop : of a dense factorisation
    profile_pair, patch_pair, far_term : of the iterated solver: points of a profile, points of a patch, its far field
    fixed : part of a run → seconds that it takes however little there is to do, each time
    loading : part of a run → (seconds, bytes) of the libraries that it loads, once in a process
    """

    facet: float = 1.0e-6
    ray: float = 2.5e-7
    hit: float = 1.4e-6
    point: float = 1.6e-6
    mueller: float = 2.5e-7
    height: float = 6e-9
    phase: float = 4e-8
    line: float = 1.6e-9
    product: float = 1.3e-10
    fft: float = 2.5e-9
    tap: float = 3.6e-9
    vector: float = 2.8e-7
    spread: float = 6e-8
    row: float = 1e-3
    space: float = 1.0
    term: float = 1.2e-9
    plain_term: float = 4e-8
    shadow: float = 1e-7
    kernel: float = 1.0
    flop: float = 6.7e-11
    profile_pair: float = 1e-7
    patch_pair: float = 2.5e-9
    far_term: float = 3e-8
    fixed: Mapping[str, float] = field(default_factory=dict)
    loading: Mapping[str, tuple[float, float]] = field(default_factory=dict)
