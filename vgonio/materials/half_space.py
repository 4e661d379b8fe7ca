"""A reflecting half-space and Fresnel's equations for complex indices n + ik (k ≥ 0, time dependence exp(−iωt))."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import MaterialError
from ..units import meant_nm

Complex = NDArray[np.complex128]
Floats = NDArray[np.float64]
LARGEST_INDEX = 1e100  # its square is still a number; reflects like a perfect conductor


def fresnel(cos_i: ArrayLike, index: ArrayLike) -> tuple[Complex, Complex]:
    """Amplitude reflectances r_s and r_p from air (thesis 2.19, 2.20), broadcast over cos_i and index.

    r_p refers to p = d × s along the direction of propagation d, so that r_s = −1, r_p = +1 for a perfect conductor.
    """
    c = np.asarray(cos_i, dtype=np.float64)
    n = np.asarray(index, dtype=np.complex128)
    eps = n**2
    # ε − sin² θ_i without a difference of numbers near 1: for an index near 1 at grazing incidence it would be rounding
    root: Complex = np.sqrt((n - 1) * (n + 1) + c * c)
    return _quotient(c - root, c + root), _quotient(eps * c - root, eps * c + root)


def _quotient(above: Complex, below: Complex) -> Complex:
    """above / below, 0 where both vanish: an index of 1 at grazing incidence."""
    return np.divide(above, below, out=np.zeros(np.shape(below), np.complex128), where=below != 0)


@dataclass(frozen=True)
class Material:
    """A reflecting half-space. `table` gives n + ik at wavelengths in µm; None means a perfect reflector."""

    name: str
    source: str
    table: Callable[[Floats], Complex] | None
    range_nm: tuple[float, float]

    @property
    def perfect(self) -> bool:
        """Whether it reflects everything at every angle."""
        return self.table is None

    def index(self, wavelength_nm: ArrayLike) -> Complex:
        """n + ik at wavelengths in nm; MaterialError outside the table, for a perfect reflector or bad values."""
        w = np.asarray(wavelength_nm, dtype=np.float64)
        if self.table is None:
            raise MaterialError("a perfect reflector has no refractive index")
        lo, hi = self.range_nm
        # tables are given to a few digits: half a picometre of slack
        if np.any(w < lo - 5e-4) or np.any(w > hi + 5e-4):
            out = w[(w < lo - 5e-4) | (w > hi + 5e-4)].flat[0]
            remedy = meant_nm(out, lo, hi) or (
                ": name the sample's own material if it is another ('perfect' has no table), choose wavelengths "
                "inside, or another source of the same ('Al:McPeak')"
            )
            raise MaterialError(
                f"material {self.name!r} is tabulated from {lo:g} to {hi:g} nm, {out:g} nm was asked for{remedy}"
            )
        index = self.table(np.clip(w, lo, hi) * 1e-3)
        good = (np.abs(index) <= LARGEST_INDEX) & (index.real >= 0) & (index.imag >= 0) & (index != 0)
        if not np.all(good):
            raise MaterialError(
                f"material {self.name!r} ({self.source}) has n + ik = {index[~good].flat[0]:.4g} at "
                f"{np.broadcast_to(w, good.shape)[~good].flat[0]:g} nm: finite n and k, none negative, are "
                f"needed, up to {LARGEST_INDEX:g}"
            )
        return index

    def check(self, wavelength_nm: ArrayLike) -> None:
        """Raise MaterialError unless every wavelength is inside the table."""
        if not self.perfect:
            self.index(wavelength_nm)

    def amplitudes(self, cos_i: ArrayLike, wavelength_nm: ArrayLike) -> tuple[Complex, Complex]:
        """(r_s, r_p) of shape cos_i.shape + wavelength.shape."""
        c = np.asarray(cos_i, dtype=np.float64)
        w = np.asarray(wavelength_nm, dtype=np.float64)
        c = c.reshape(c.shape + (1,) * w.ndim)
        if self.perfect:
            one = np.ones(np.broadcast_shapes(c.shape, w.shape), dtype=np.complex128)
            return -one, one
        return fresnel(c, self.index(w))

    def reflectance(self, cos_i: ArrayLike, wavelength_nm: ArrayLike, polarisation: str = "unpolarised") -> Floats:
        """|r|² of shape cos_i.shape + wavelength.shape for "unpolarised" (2.21), "s" or "p" light."""
        rs, rp = self.amplitudes(cos_i, wavelength_nm)
        s, p = np.abs(rs) ** 2, np.abs(rp) ** 2
        return {"s": s, "p": p}.get(polarisation, 0.5 * (s + p))
