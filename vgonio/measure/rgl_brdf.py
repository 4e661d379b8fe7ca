"""The BRDF of an RGL `.bsdf` at any pair of directions (Dupuy and Jakob 2018, as Mitsuba's `measured` evaluates it).

The half vector is u = (√(2θ_h/π), (φ_h + π)/2π) in the unit square, φ_h from the azimuth of incidence. A table of
visible normals `vndf` (φ_i, θ_i, φ_h, θ_h), taken as bilinear density, warps u to the sample s by its marginal and
conditional distribution functions; `spectra` (φ_i, θ_i, λ, s_2, s_1) is bilinear in s. Then
f cos θ_o = spectra · ndf(u) / (4 sigma(u_i)), the last factor where `jacobian` is set.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..directions import half_vectors
from ..errors import FileFormatError
from .isotropic import IsotropicBrdf

Floats = NDArray[np.float64]
DIMENSIONS = {"theta_i": 1, "phi_i": 1, "ndf": 2, "sigma": 2, "vndf": 4, "jacobian": 1}


def theta_to_unit(theta: Floats) -> Floats:
    return np.sqrt(np.clip(theta * (2 / np.pi), 0, 1))


def unit_to_theta(u: Floats) -> Floats:
    return u**2 * (np.pi / 2)


def bilinear(table: Floats, x: Floats, y: Floats) -> Floats:
    """`table` (…, ny, nx) over the unit square at x (n,) and y (n,): (…, n), ends held."""
    ny, nx = table.shape[-2:]
    (i, s), (j, t) = _patch(x, nx), _patch(y, ny)
    i1, j1 = np.minimum(i + 1, nx - 1), np.minimum(j + 1, ny - 1)
    low = (1 - s) * table[..., j, i] + s * table[..., j, i1]
    return (1 - t) * low + t * ((1 - s) * table[..., j1, i] + s * table[..., j1, i1])


def _patch(x: Floats, size: int) -> tuple[NDArray[np.intp], Floats]:
    at = np.clip(x, 0, 1) * (size - 1)
    low = np.clip(np.floor(at).astype(np.intp), 0, max(size - 2, 0))
    return low, at - low


@dataclass(frozen=True)
class Warp:
    """A bilinear density over the unit square for each of n parameters, and its distribution functions.

    density : (n, ny, nx), integral 1;  rows : (n, ny, nx) ∫ along x up to each sample;  columns : (n, ny) ∫ of whole
    rows along y
    """

    density: Floats
    rows: Floats
    columns: Floats

    @staticmethod
    def of(density: Floats) -> Warp:
        rows = _cumulative(density)
        columns = _cumulative(rows[..., -1])
        total = columns[..., -1]
        if not np.all(total > 0):
            raise FileFormatError("a table of visible normals (vndf) has no positive integral: the file is damaged")
        return Warp(density / total[:, None, None], rows / total[:, None, None], columns / total[:, None])

    def mixed(self, which: list[NDArray[np.intp]], weights: list[Floats], i: Any, j: Any) -> tuple[Floats, Floats]:
        density = sum(w * self.density[k, j, i] for k, w in zip(which, weights))
        rows = sum(w * self.rows[k, j, i] for k, w in zip(which, weights))
        return np.asarray(density), np.asarray(rows)

    def invert(
        self, x: Floats, y: Floats, which: list[NDArray[np.intp]], weights: list[Floats]
    ) -> tuple[Floats, Floats]:
        """The sample (s_1, s_2) that the density warps to (x, y), for a mixture of parameters at each point."""
        ny, nx = self.density.shape[-2:]
        (i, s), (j, t) = _patch(x, nx), _patch(y, ny)
        last = np.full_like(i, nx - 1)
        upto, whole = [], []
        for row in (j, j + 1):
            (a, c), (b, _) = self.mixed(which, weights, i, row), self.mixed(which, weights, i + 1, row)
            upto.append(c + (a * s + 0.5 * s**2 * (b - a)) / (nx - 1))
            whole.append(self.mixed(which, weights, last, row)[1])
        below = np.asarray(sum(w * self.columns[k, j] for k, w in zip(which, weights)))
        s2 = below + (whole[0] * t + 0.5 * t**2 * (whole[1] - whole[0])) / (ny - 1)
        total = (1 - t) * whole[0] + t * whole[1]
        s1 = ((1 - t) * upto[0] + t * upto[1]) / np.where(total > 0, total, np.inf)
        return np.clip(s1, 0, 1), np.clip(s2, 0, 1)

    def forward(self, k: int, s1: Floats, s2: Floats) -> tuple[Floats, Floats]:
        """(x (n2, n1), y (n2,)) that parameter k's density warps the grid of samples s1 (n1,), s2 (n2,) from."""
        whole = self.rows[k, :, -1]
        y = _quantile(self.columns[k], whole, s2)
        ny = whole.size
        j, t = _patch(y, ny)
        x = np.empty((s2.size, s1.size))
        for n, (row, share) in enumerate(zip(j, t)):
            upto = (1 - share) * self.rows[k, row] + share * self.rows[k, row + 1]
            here = (1 - share) * self.density[k, row] + share * self.density[k, row + 1]
            x[n] = _quantile(upto / upto[-1], here / upto[-1], s1)
        return x, y


def _cumulative(values: Floats) -> Floats:
    """∫ of a piecewise linear function on 0 … 1 up to each sample, along the last axis."""
    steps = 0.5 * (values[..., 1:] + values[..., :-1]) / (values.shape[-1] - 1)
    return np.concatenate([np.zeros((*values.shape[:-1], 1)), np.cumsum(steps, axis=-1)], axis=-1)


def _quantile(upto: Floats, density: Floats, s: Floats) -> Floats:
    """Where the distribution function `upto` (n,) of a piecewise linear `density` (n,) reaches s (m,), in 0 … 1."""
    n = upto.size - 1
    k = np.clip(np.searchsorted(upto, s * upto[-1], side="right") - 1, 0, n - 1)
    a, b, rest = density[k], density[k + 1], np.maximum(s * upto[-1] - upto[k], 0.0) * n
    root = np.sqrt(np.maximum(a**2 + 2 * (b - a) * rest, 0.0))
    # a t + (b − a) t²/2 = rest, in the form that has no difference of near equals
    t = np.where(a + root > 0, 2 * rest / np.maximum(a + root, 1e-300), 0.0)
    return (k + np.clip(t, 0, 1)) / n


def evaluator(fields: dict[str, NDArray[Any]], wavelength: Floats, spectra: NDArray[Any], where: str) -> IsotropicBrdf:
    """The BRDF of the fields of an RGL file; anisotropic ones depend on the azimuth of ω_i, folded as they allow.

    spectra : (φ_i, θ_i, λ, n, n). Raises FileFormatError for fields that are missing, of other shapes or not finite.
    """
    _check(fields, spectra, wavelength, where)
    phi, theta = (fields[k].astype(float) for k in ("phi_i", "theta_i"))
    size = phi.size * theta.size
    warp = Warp.of(fields["vndf"].astype(float).reshape(size, *fields["vndf"].shape[2:]))
    table = np.moveaxis(spectra, 2, -1).reshape(size, *spectra.shape[3:], wavelength.size)
    ndf, sigma = fields["ndf"].astype(float), fields["sigma"].astype(float)
    isotropic, jacobian = phi.size <= 2, bool(fields["jacobian"][0])
    folds = 1 if isotropic else int(np.rint(2 * np.pi / max(phi[-1] - phi[0], 1e-6)))

    def values(wi: Floats, wo: Floats) -> Floats:
        if not isotropic:
            wi, wo = _folded(wi, wo, folds)
        h = half_vectors(wi, wo)
        theta_i, phi_i = np.arccos(np.clip(wi[:, 2], -1, 1)), np.arctan2(wi[:, 1], wi[:, 0])
        x = theta_to_unit(np.arccos(np.clip(h[:, 2], -1, 1)))
        y = (np.arctan2(h[:, 1], h[:, 0]) - (phi_i if isotropic else 0.0) + np.pi) / (2 * np.pi) % 1.0
        which, weights = _neighbours(phi, theta, phi_i, theta_i)
        s1, s2 = warp.invert(x, y, which, weights)
        found = _spectra(table, s1, s2, which, weights)
        if jacobian:
            u_i = (phi_i + np.pi) / (2 * np.pi)
            found *= (bilinear(ndf, x, y) / (4 * bilinear(sigma, theta_to_unit(theta_i), u_i)))[:, None]
        # nodes below the horizon may continue f cos θ_o through zero, as ours do
        return np.maximum(found, 0.0) / wo[:, 2:]

    return IsotropicBrdf(wavelength, values, "as Mitsuba's `measured` interpolates")


def _check(fields: dict[str, NDArray[Any]], spectra: NDArray[Any], wavelength: Floats, where: str) -> None:
    for name, dims in DIMENSIONS.items():
        if name not in fields or fields[name].ndim != dims or not fields[name].size:
            raise FileFormatError(f"{where}: the field {name!r} with {dims} dimensions is missing: no RGL .bsdf")
        if not np.all(np.isfinite(fields[name])):
            raise FileFormatError(f"{where}: the field {name!r} holds a value that is not finite")
    expected = (fields["phi_i"].size, fields["theta_i"].size)
    vndf = fields["vndf"]
    fits = spectra.ndim == 5 and spectra.shape[:3] == (*expected, wavelength.size) and vndf.shape[:2] == expected
    if not fits or min(*spectra.shape[3:], *vndf.shape[2:]) < 2 or np.any(vndf < 0):
        raise FileFormatError(
            f"{where}: spectra {spectra.shape} and vndf {vndf.shape} do not fit {expected[0]} azimuths, {expected[1]} "
            f"angles of incidence and {wavelength.size} wavelengths, or a density is negative"
        )
    if np.any(np.diff(fields["theta_i"]) <= 0) or np.any(np.diff(fields["phi_i"]) <= 0):
        raise FileFormatError(f"{where}: theta_i and phi_i have to ascend")
    if not np.all(np.isfinite(spectra)) or not (np.all(fields["ndf"] >= 0) and np.all(fields["sigma"] > 0)):
        raise FileFormatError(f"{where}: spectra, ndf or sigma hold values that are not finite or not positive")


def _folded(wi: Floats, wo: Floats, folds: int) -> tuple[Floats, Floats]:
    """The pair mirrored into the azimuths that the file holds: all, a half or a quarter of the circle."""
    if folds < 2:
        return wi, wo
    sy = np.where(wi[:, 1] >= 0, -1.0, 1.0)
    sx = np.where(wi[:, 0] >= 0, -1.0, 1.0) if folds == 4 else sy
    signs = np.stack([sx, sy, np.ones_like(sx)], axis=1)
    return wi * signs, wo * signs


def _neighbours(
    phi: Floats, theta: Floats, phi_i: Floats, theta_i: Floats
) -> tuple[list[NDArray[np.intp]], list[Floats]]:
    """Up to four entries of the flat (φ_i, θ_i) grid around each direction, and their weights."""
    sides = []
    for axis, x in ((phi, phi_i), (theta, theta_i)):
        low = np.clip(np.searchsorted(axis, x, side="right") - 1, 0, max(axis.size - 2, 0))
        if axis.size == 1:
            sides.append([(low, np.ones(x.size))])
            continue
        t = np.clip((x - axis[low]) / (axis[low + 1] - axis[low]), 0, 1)
        sides.append([(low, 1 - t), (low + 1, t)])
    which, weights = [], []
    for p, wp in sides[0]:
        for q, wq in sides[1]:
            which.append(p * theta.size + q)
            weights.append(wp * wq)
    return which, weights


def _spectra(table: Floats, s1: Floats, s2: Floats, which: list[NDArray[np.intp]], weights: list[Floats]) -> Floats:
    (i, s), (j, t) = _patch(s1, table.shape[2]), _patch(s2, table.shape[1])
    total = np.zeros((s1.size, table.shape[3]))
    for k, w in zip(which, weights):
        for dj, wj in ((0, 1 - t), (1, t)):
            for di, wi in ((0, 1 - s), (1, s)):
                total += (w * wj * wi)[:, None] * table[k, j + dj, i + di]
    return total
