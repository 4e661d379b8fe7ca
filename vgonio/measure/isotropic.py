"""A BRDF as a function of two directions: what files that hold whole hemispheres need, and what they give.

An isotropic sample needs four things less than a dataset has and one more: any pair of directions, above the horizon.
In-plane data do not have it; how the missing azimuths are filled has to be said (`fill`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ..dataset import brdf_dataset, check
from ..directions import Detector, angle_list, half_vectors, unit_vectors
from ..errors import InputError, nearest
from ..units import degrees, radians

Floats = NDArray[np.float64]
Values = Callable[[Floats, Floats], Floats]
FILLS = {
    "half-angle": "f cos θ_i cos θ_o depends on the half and difference angles alone, as of facets (any lobe)",
    "azimuth": "cosine in azimuth between the mirror and the back-scattering side (diffuse samples)",
}
THETA_I_DEG = tuple(range(0, 81, 10))
THETA_O_DEG = tuple(range(-85, 86, 5))
# directions evaluated at once, so that memory stays small
BATCH = 50_000
LOWEST_COS = np.cos(radians(89.5))


@dataclass(frozen=True)
class IsotropicBrdf:
    """`values(wi, wo)`: (n, 3) and (n, 3) unit vectors, z > 0, to (n, n_λ) sr⁻¹; NaN where nothing is known.

    wavelength : (n_λ,) nm;  note : how values between and beyond the measured ones come about
    """

    wavelength: Floats
    values: Values
    note: str

    def __call__(self, wi: Floats, wo: Floats) -> Floats:
        parts = [self.values(wi[k : k + BATCH], wo[k : k + BATCH]) for k in range(0, len(wi), BATCH)]
        return np.concatenate(parts) if parts else np.zeros((0, self.wavelength.size))


def sampled(
    brdf: IsotropicBrdf,
    theta_i_deg: ArrayLike | None = None,
    theta_o_deg: ArrayLike | None = None,
    resolution_deg: float | None = None,
    attrs: dict[str, Any] | None = None,
) -> xr.Dataset:
    """The dataset of a BRDF known everywhere: in plane at the angles asked for, or on a hemisphere.

    theta_i_deg : by default 0, 10 … 80°;  theta_o_deg : signed, by default −85, −80 … 85°;  resolution_deg : a
    hemisphere of cells of that size in place of theta_o_deg. Values are at the centres, without a detector cone.
    """
    if resolution_deg is not None and theta_o_deg is not None:
        raise InputError("give either theta_o_deg (in plane) or resolution_deg (a hemisphere), not both")
    theta_i = angle_list(THETA_I_DEG if theta_i_deg is None else theta_i_deg, "theta_i_deg")
    if resolution_deg is not None:
        detector = Detector.hemisphere(resolution_deg)
    else:
        detector = Detector.in_plane(THETA_O_DEG if theta_o_deg is None else theta_o_deg, 1.0)
    wi = np.repeat(unit_vectors(radians(theta_i)), len(detector), axis=0)
    values = brdf(wi, np.tile(detector.directions, (theta_i.size, 1)))
    values = values.reshape(theta_i.size, len(detector), brdf.wavelength.size)
    dims = ("theta_i", detector.dims[0], "wavelength")
    data = brdf_dataset(
        {"brdf": (dims, values)},
        theta_i,
        brdf.wavelength,
        detector,
        attrs={"method": "measured", "interpolation": brdf.note, **(attrs or {})},
    )
    if detector.kind == "in-plane":
        data = data.drop_vars("solid_angle")  # values at points have none
    return data


def isotropic(data: xr.Dataset, fill: str | IsotropicBrdf | None = None) -> IsotropicBrdf:
    """The BRDF of a dataset at any pair of directions.

    Hemispheres are linear between cells, both halves averaged. In-plane data need `fill`: one of FILLS, or an
    IsotropicBrdf (say, of a fitted model), which is then taken everywhere. Between angles of incidence the
    half vector is held, so that lobes move and do not fade; beyond the measured angles the nearest values are held.
    Raises InputError for in-plane data without `fill`, naming the choices.
    """
    check(data)
    if isinstance(fill, IsotropicBrdf):
        return fill
    wavelength = np.sort(data["wavelength"].values)
    data = data.sortby("wavelength")
    if "cell" in data["brdf"].dims:
        rows = _hemisphere_rows(data)
        return IsotropicBrdf(wavelength, lambda wi, wo: _between(rows, wi, wo), "linear between cells")
    if fill is None or fill not in FILLS:
        got = "in-plane data do not say what happens at other azimuths" if fill is None else f"fill = {fill!r}"
        choices = "; ".join(f"fill={k!r}: {v}" for k, v in FILLS.items())
        hint = "" if fill is None else f" {nearest(fill, FILLS)}."
        raise InputError(f"{got}.{hint} Say how they are filled: {choices}")
    plane = _plane_rows(data)

    def values(wi: Floats, wo: Floats) -> Floats:
        return (_half_angle if fill == "half-angle" else _azimuth)(plane, wi, wo)

    return IsotropicBrdf(wavelength, values, f"in-plane data filled by {fill}: {FILLS[fill]}")


@dataclass(frozen=True)
class _Row:
    """One angle of incidence θ ≥ 0, radians, and its values at directions (n, 3), the light coming from +x."""

    theta: float
    at: Callable[[Floats], Floats]


def _interp(x: Floats, xp: Floats, fp: Floats) -> Floats:
    """Linear interpolation of (n, n_λ) values, held beyond the ends."""
    if xp.size == 1:
        return np.repeat(fp, x.size, axis=0)
    k = np.clip(np.searchsorted(xp, x), 1, xp.size - 1)
    t = np.clip((x - xp[k - 1]) / (xp[k] - xp[k - 1]), 0.0, 1.0)[:, None]
    return (1 - t) * fp[k - 1] + t * fp[k]


def _plane_rows(data: xr.Dataset) -> list[tuple[float, Floats, Floats]]:
    """(θ_i ≥ 0, θ_o (n,), values (n, n_λ)) sorted, radians, gaps filled between neighbours in θ_o."""
    theta_o = radians(data["theta_o"].values)
    values = data["brdf"].transpose("theta_i", "theta_o", "wavelength").values
    rows: dict[float, tuple[float, Floats, Floats]] = {}
    for t, f in sorted(zip(radians(data["theta_i"].values), values), key=lambda r: r[0]):
        kept = np.isfinite(f).any(axis=1)
        if not kept.any():
            continue
        x = theta_o[kept] if t >= 0 else -theta_o[kept]
        order = np.argsort(x)
        x, f = x[order], f[kept][order].copy()
        for column in f.T:
            known = np.isfinite(column)
            column[~known] = np.interp(x[~known], x[known], column[known]) if known.any() else np.nan
        rows[round(abs(float(t)), 9)] = (abs(float(t)), x, f)
    if not rows:
        raise InputError("the BRDF holds no finite value")
    return [rows[k] for k in sorted(rows)]


def _in_plane(rows: list[tuple[float, Floats, Floats]], theta_i: Floats, theta_o: Floats) -> Floats:
    """(n, n_λ) at θ_i ≥ 0 and signed θ_o, radians: linear in θ_o, and in θ_i at the same half angle."""
    axis = np.array([r[0] for r in rows])
    low = np.clip(np.searchsorted(axis, theta_i, side="right") - 1, 0, max(axis.size - 2, 0))
    total, weight = np.zeros((theta_i.size, rows[0][2].shape[1])), np.zeros(theta_i.size)
    for k, (theta, x, f) in enumerate(rows):
        near = (low == k) | (low + 1 == k)
        if not near.any():
            continue
        t = _closeness(axis, k, low[near], theta_i[near])
        # θ_i beyond the ends: the same half angle as well, or a lobe would stand still
        at = theta_i[near] + theta_o[near] - theta
        # a neighbour that was not measured at this half angle counts only where the other was not either
        t = t * np.where((at < x[0] - 1e-9) | (at > x[-1] + 1e-9), 1e-6, 1.0)
        total[near] += t[:, None] * _interp(at, x, f)
        weight[near] += t
    return total / np.maximum(weight, 1e-300)[:, None]


def _closeness(axis: Floats, k: int, low: NDArray[np.intp], theta: Floats) -> Floats:
    """Weight of the k-th of two neighbouring angles of incidence."""
    if axis.size == 1:
        return np.ones(theta.size)
    t = np.clip((theta - axis[low]) / (axis[low + 1] - axis[low]), 0.0, 1.0)
    return np.where(low == k, 1 - t, t)


def _half_angle(rows: list[tuple[float, Floats, Floats]], wi: Floats, wo: Floats) -> Floats:
    """f cos θ_i cos θ_o of the in-plane pair with the same half and difference angles, both signs mixed by cos φ_d.

    At φ_d = 0 and 180° (in plane) this is the datum itself. Pairs that would lie beyond what was measured are brought
    there by a smaller half angle.
    """
    h = half_vectors(wi, wo)
    theta_h = np.arccos(np.clip(h[:, 2], -1, 1))
    theta_d = np.arccos(np.clip(np.sum(wi * h, axis=1), -1, 1))
    # cos φ_d from z of ω_i: cos θ_i = cos θ_h cos θ_d − sin θ_h sin θ_d cos φ_d
    product = np.sin(theta_h) * np.sin(theta_d)
    cos_d = (np.cos(theta_h) * np.cos(theta_d) - wi[:, 2]) / np.where(product > 1e-12, product, np.inf)
    top = max(max(abs(x[0]), abs(x[-1])) for _, x, _ in rows)
    theta_h = np.minimum(theta_h, np.maximum(top - theta_d, 0.0))
    theta_d = np.minimum(theta_d, top)
    total = np.zeros((len(wi), rows[0][2].shape[1]))
    for sign in (1.0, -1.0):
        i, o = theta_d + sign * theta_h, sign * theta_h - theta_d
        flip = np.where(i < 0, -1.0, 1.0)
        f = _in_plane(rows, i * flip, o * flip) * (np.cos(i) * np.cos(o))[:, None]
        total += (0.5 * (1 + sign * np.clip(cos_d, -1, 1)))[:, None] * f
    return total / np.maximum(wi[:, 2] * wo[:, 2], LOWEST_COS**2)[:, None]


def _azimuth(rows: list[tuple[float, Floats, Floats]], wi: Floats, wo: Floats) -> Floats:
    theta_i, theta_o = (np.arccos(np.clip(w[:, 2], -1, 1)) for w in (wi, wo))
    along = np.sum(wi[:, :2] * wo[:, :2], axis=1)
    size = np.linalg.norm(wi[:, :2], axis=1) * np.linalg.norm(wo[:, :2], axis=1)
    cos_phi = np.clip(np.where(size > 1e-12, along / np.maximum(size, 1e-300), 0.0), -1, 1)[:, None]
    back, mirror = _in_plane(rows, theta_i, theta_o), _in_plane(rows, theta_i, -theta_o)
    return 0.5 * (1 + cos_phi) * back + 0.5 * (1 - cos_phi) * mirror


def _hemisphere_rows(data: xr.Dataset) -> list[_Row]:
    """One interpolant for each angle of incidence, over the azimuthal equidistant map of the hemisphere."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    values = data["brdf"].transpose("theta_i", "cell", "wavelength").values
    theta, phi = radians(data["theta_o"].values), radians(data["phi_o"].values - float(data.get("phi_i", 0.0)))
    rows = []
    for t, f in sorted(zip(radians(data["theta_i"].values), values), key=lambda r: abs(r[0])):
        kept = np.isfinite(f).all(axis=1)
        if kept.sum() < 4:
            raise InputError(f"θ_i = {degrees(t):g}°: {kept.sum()} cells with values, a hemisphere needs four and more")
        turned = phi[kept] + (np.pi if t < 0 else 0.0)
        points = np.stack([theta[kept] * np.cos(turned), theta[kept] * np.sin(turned)], axis=1)
        # isotropic samples are symmetric about the plane of incidence: both halves count
        points, f = np.concatenate([points, points * [1, -1]]), np.concatenate([f[kept], f[kept]])
        rows.append(_Row(abs(float(t)), _over(points, f, LinearNDInterpolator, NearestNDInterpolator)))
    return rows


def _over(points: Floats, f: Floats, linear: Any, nearest_neighbour: Any) -> Callable[[Floats], Floats]:
    _, place, inverse = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    mean = np.zeros((place.size, f.shape[1]))
    np.add.at(mean, inverse.ravel(), f)
    mean /= np.bincount(inverse.ravel())[:, None]
    inside, outside = linear(points[place], mean), nearest_neighbour(points[place], mean)

    def at(w: Floats) -> Floats:
        theta, phi = np.arccos(np.clip(w[:, 2], -1, 1)), np.arctan2(w[:, 1], w[:, 0])
        p = np.stack([theta * np.cos(phi), theta * np.sin(phi)], axis=1)
        found = inside(p)
        lost = ~np.isfinite(found).all(axis=1)
        found[lost] = outside(p[lost])
        return found

    return at


def _between(rows: list[_Row], wi: Floats, wo: Floats) -> Floats:
    """Values at any pair: linear in θ_i at the same half vector."""
    theta_i = np.arccos(np.clip(wi[:, 2], -1, 1))
    phi = np.arctan2(wi[:, 1], wi[:, 0])
    c, s = np.cos(phi), np.sin(phi)
    local = np.stack([wo[:, 0] * c + wo[:, 1] * s, wo[:, 1] * c - wo[:, 0] * s, wo[:, 2]], axis=1)
    h = half_vectors(unit_vectors(theta_i), local)
    axis = np.array([r.theta for r in rows])
    low = np.clip(np.searchsorted(axis, theta_i, side="right") - 1, 0, max(axis.size - 2, 0))
    total, weight = 0.0, np.zeros(len(wi))
    for k, row in enumerate(rows):
        near = np.flatnonzero((low == k) | (low + 1 == k))
        if not near.size:
            continue
        w = unit_vectors(row.theta)
        at = 2 * (h[near] @ w)[:, None] * h[near] - w
        below = at[:, 2] <= LOWEST_COS
        at[below] = local[near][below]
        t = _closeness(axis, k, low[near], theta_i[near]) * np.where(below, 1e-6, 1.0)
        found = row.at(at)
        total = np.zeros((len(wi), found.shape[1])) if np.isscalar(total) else total
        total[near] += t[:, None] * found  # type: ignore[index]
        weight[near] += t
    return total / np.maximum(weight, 1e-300)[:, None]
