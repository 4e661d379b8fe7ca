"""Thin films on a half-space: native oxides, coatings, stacks of several layers.

Amplitudes come from the transfer matrices of `tmm` (Byrnes 2016, arXiv:1603.02720), one angle and one wavelength at a
time. They are smooth in cos θ_i, so a Chebyshev series through few angles gives all others; it is lengthened until its
last terms are negligible, and kept per wavelength.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike, NDArray

from ..errors import MaterialError
from .half_space import Complex, Material

Floats = NDArray[np.float64]
NEGLIGIBLE = 1e-10  # of the terms in the last quarter of a series of amplitudes, which are of order 1
FEWEST, MOST = 32, 4096  # terms


@dataclass(frozen=True)
class Coated(Material):
    """A half-space under thin films. layers : (material, thickness in nm) from the outside in, the half-space last.

    It has amplitudes and reflectances like any material, but no one refractive index: `index` raises MaterialError.
    """

    layers: tuple[tuple[Material, float], ...] = ()

    @property
    def perfect(self) -> bool:
        """False: a film absorbs or not, but it is made of something."""
        return False

    def index(self, wavelength_nm: ArrayLike) -> Complex:
        """Raises MaterialError: layers have no single refractive index."""
        raise MaterialError(f"{self.name!r} has layers, so no single refractive index: use amplitudes or reflectance")

    def check(self, wavelength_nm: ArrayLike) -> None:
        """Raise MaterialError unless every wavelength is inside the table of every layer."""
        for layer, _ in self.layers:
            layer.check(wavelength_nm)

    def amplitudes(self, cos_i: ArrayLike, wavelength_nm: ArrayLike) -> tuple[Complex, Complex]:
        """(r_s, r_p) of shape cos_i.shape + wavelength.shape, with the signs of `fresnel`."""
        c, w = np.asarray(cos_i, dtype=np.float64), np.asarray(wavelength_nm, dtype=np.float64)
        self.check(w)
        series = [_series(self.layers, float(one)) for one in w.ravel()]
        x = 2 * c.ravel() - 1
        shape = c.shape + w.shape
        s: Complex = np.stack([chebyshev.chebval(x, one[0]) for one in series], axis=-1)
        p: Complex = np.stack([chebyshev.chebval(x, one[1]) for one in series], axis=-1)
        return s.reshape(shape), p.reshape(shape)


@lru_cache(maxsize=4096)
def _series(layers: tuple[tuple[Material, float], ...], wavelength_nm: float) -> tuple[Complex, Complex]:
    """Chebyshev coefficients of r_s and r_p over 2 cos θ_i − 1."""
    index = [1.0 + 0j, *(complex(m.index(wavelength_nm)) for m, _ in layers)]
    thickness = [np.inf, *(d for _, d in layers)]
    return _fitted("s", index, thickness, wavelength_nm), _fitted("p", index, thickness, wavelength_nm)


def _fitted(polarisation: str, index: list[complex], thickness: list[float], wavelength_nm: float) -> Complex:
    """Coefficients by the discrete cosine transform over the Chebyshev nodes, as many as it takes."""
    terms = FEWEST
    while terms <= MOST:
        angle = np.pi * (np.arange(terms) + 0.5) / terms
        values = _transfer(polarisation, index, thickness, (np.cos(angle) + 1) / 2, wavelength_nm)
        c = 2 / terms * (np.cos(np.outer(np.arange(terms), angle)) @ values)
        c[0] /= 2
        if np.abs(c[-terms // 4 :]).max() < NEGLIGIBLE:
            kept = np.flatnonzero(np.abs(c) > 1e-3 * NEGLIGIBLE)
            return c[: kept[-1] + 1] if len(kept) else c[:1]  # nothing is reflected: air on air
        terms *= 2
    raise MaterialError(
        f"films of {', '.join(f'{d:g}' for d in thickness[1:-1])} nm: at {wavelength_nm:g} nm the reflectance turns "
        "too fast with the angle: thin films are thinner than some tens of micrometres"
    )


def _transfer(
    polarisation: str, index: list[complex], thickness: list[float], cos_i: Floats, wavelength_nm: float
) -> Complex:
    from tmm import tmm_core

    tmm_core.opacity_warning = True  # it would print on standard output that opaque layers are taken as 1e-30 clear
    found = [tmm_core.coh_tmm(polarisation, index, thickness, np.arccos(c), wavelength_nm)["r"] for c in cos_i]
    return np.array(found, dtype=np.complex128)
