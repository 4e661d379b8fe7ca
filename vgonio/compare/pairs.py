"""A BRDF dataset as pairs of directions, and what a model makes of them: what the fits of models work on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import ascending, check
from ..errors import InputError
from ..models import Geometry, Model
from ..units import meant_nm, radians
from .cost import Inner, Target, best_coefficients, compressed
from .metrics import detector_dim

Floats = NDArray[np.float64]
COEFFICIENT_BOUNDS = {"k_d": (0.0, 1.0), "k_s": (0.0, np.inf)}


@dataclass(frozen=True)
class Pairs:
    """n pairs of directions with a spectrum: values (n, n_λ), NaN = no data; `place` (n,) in the full grid."""

    geometry: Geometry
    values: Floats
    wavelength: Floats
    place: NDArray[np.intp]
    grid: xr.Dataset

    def on_grid(self, values: Floats) -> tuple[tuple[str, ...], Floats]:
        """(n, n_λ) or (n,) values on the grid of the data, NaN elsewhere: dims and array."""
        dims: tuple[str, ...] = ("theta_i", detector_dim(self.grid))
        shape = tuple(self.grid.sizes[d] for d in dims)
        full = np.full((int(np.prod(shape)), *values.shape[1:]), np.nan)
        full[self.place] = values
        return (*dims, "wavelength")[: 1 + values.ndim], full.reshape(*shape, *values.shape[1:])

    def target(self, exponent: float) -> Target:
        """The right side of the cost function, 3.3; a value of −1/cos^w θ_i or less is on the tangent."""
        cosine = (np.abs(self.geometry.cos_i) ** exponent)[:, None]
        known = np.isfinite(self.values)
        g, _ = compressed(cosine * np.where(known, self.values, 0.0))
        return Target(g, cosine, known.astype(np.float64))


def pairs_of(data: xr.Dataset, wavelength_range_nm: tuple[float, float] | None = None) -> Pairs:
    """The pairs of directions of a BRDF that hold a value; `wavelength_range_nm` in nm, both ends included.

    Raises InputError for no value, no wavelength in the range or further dimensions.
    """
    data = ascending(check(data))
    dim = detector_dim(data)
    if wavelength_range_nm is not None:
        low, high = wavelength_range_nm
        w = data["wavelength"].values
        data = data.isel(wavelength=np.flatnonzero((w >= low - 1e-6) & (w <= high + 1e-6)))
        if not data.sizes["wavelength"]:
            raise InputError(
                f"no wavelength within {low:g} to {high:g} nm, the data reach from {w[0]:g} to {w[-1]:g} nm"
                + (meant_nm(high, w[0], w[-1]) or meant_nm(low, w[0], w[-1]))
            )
    kept = data[[v for v in ("brdf", "brdf_stderr") if v in data]].transpose("theta_i", dim, "wavelength")
    values = kept["brdf"].values.astype(np.float64)
    values = values.reshape(-1, values.shape[-1])
    place = np.flatnonzero(np.isfinite(values).any(axis=1))
    if not place.size:
        raise InputError("the BRDF holds no value that is a number: nothing can be fitted")
    return Pairs(_geometry(kept, dim, place), values[place], kept["wavelength"].values.astype(float), place, kept)


def _geometry(data: xr.Dataset, dim: str, place: NDArray[np.intp]) -> Geometry:
    theta_i, theta_o = radians(data["theta_i"].values), radians(data["theta_o"].values)
    phi_i = radians(float(data["phi_i"].values.ravel()[0])) if "phi_i" in data.coords and dim == "cell" else 0.0
    phi_o = radians(data["phi_o"].values) if dim == "cell" else 0.0
    full = Geometry.of(theta_i[:, None], theta_o[None, :], phi_i, phi_o)
    return Geometry(*(a.ravel()[place] for a in (full.theta_i, full.theta_o, full.phi_i, full.phi_o)))


@dataclass(frozen=True)
class Problem:
    """A model on pairs of directions: `names` are the coefficients inside, `fixed` all that does not vary."""

    entry: Model
    pairs: Pairs
    target: Target
    names: tuple[str, ...]
    fixed: Mapping[str, Any]

    def parts(self, shape: Mapping[str, Any]) -> tuple[Floats, Floats]:
        """(n, n_λ) what no free coefficient multiplies and (K, n, n_λ) what they do, for shape parameters."""
        given = {k: v for k, v in self.fixed.items() if k not in self.entry.coefficients}
        found = self.entry.terms(
            self.pairs.geometry, self.pairs.wavelength, **self.entry.preset, **(given | dict(shape))
        )
        size = self.pairs.values.shape
        constant = np.zeros(size)
        for name, part in found.items():
            if name not in self.names:
                constant += part * (np.asarray(self.fixed[name]) if name else 1.0)
        inside = [np.broadcast_to(found[name], size) for name in self.names]
        return constant, np.stack(inside) if inside else np.zeros((0, *size))

    def bounds(self) -> tuple[Floats, Floats]:
        """(K,) lower and upper bounds of the coefficients inside."""
        pairs = [COEFFICIENT_BOUNDS[name] for name in self.names]
        return np.array([low for low, _ in pairs]), np.array([high for _, high in pairs])

    def inner(self, shape: Mapping[str, Any], start: Floats | None = None) -> Inner:
        """The best coefficients for shape parameters."""
        return best_coefficients(self.target, *self.parts(shape), *self.bounds(), start)

    def value(self, shape: Mapping[str, Any], c: Floats) -> Floats:
        """The BRDF (n, n_λ) in sr⁻¹."""
        constant, parts = self.parts(shape)
        return constant + np.einsum("kl,knl->nl", c, parts)

    def thinned(self, most: int) -> Problem:
        """The same at no more than that many wavelengths, for the search of starts."""
        count = self.pairs.wavelength.size
        if count <= most:
            return self
        chosen = np.unique(np.linspace(0, count - 1, most).round().astype(int))
        pairs = Pairs(
            self.pairs.geometry,
            self.pairs.values[:, chosen],
            self.pairs.wavelength[chosen],
            self.pairs.place,
            self.pairs.grid,
        )
        target = Target(self.target.g[:, chosen], self.target.cosine, self.target.weight[:, chosen])
        fixed = {
            k: np.asarray(v)[chosen] if k in self.entry.coefficients and np.ndim(v) == 1 and np.size(v) == count else v
            for k, v in self.fixed.items()
        }
        return Problem(self.entry, pairs, target, self.names, fixed)

    def with_fixed(self, values: Mapping[str, float]) -> Problem:
        """The same with further parameters held."""
        return Problem(self.entry, self.pairs, self.target, self.names, {**self.fixed, **values})

    def weighted(self, multiplicity: Floats) -> Problem:
        """The same with every pair (n,) counted that many times, for the bootstrap."""
        target = Target(self.target.g, self.target.cosine, self.target.weight * multiplicity[:, None])
        return Problem(self.entry, self.pairs, target, self.names, self.fixed)
