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
from ..units import radians
from . import hemisphere
from .hemisphere import closeness, interp

Floats = NDArray[np.float64]
Values = Callable[[Floats, Floats], Floats]
FILLS = {
    "half-angle": "facets: f times both visible areas (GGX as rough as the lobe is wide) depends on the half and "
    "difference angles alone",
    "azimuth": "cosine in azimuth between the mirror and the back-scattering side (diffuse samples)",
}
THETA_I_DEG = tuple(range(0, 81, 10))
THETA_O_DEG = tuple(range(-85, 86, 5))
# directions evaluated at once, so that memory stays small
BATCH = 50_000
# where D of GGX is half of its value at the normal: tan θ = 0.6436 α
HALF_WIDTH = np.sqrt(np.sqrt(2) - 1)


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
        rows = hemisphere.rows(data)
        return IsotropicBrdf(wavelength, lambda wi, wo: hemisphere.between(rows, wi, wo), "linear between cells")
    if fill is None or fill not in FILLS:
        got = "in-plane data do not say what happens at other azimuths" if fill is None else f"fill = {fill!r}"
        choices = "; ".join(f"{k}: {v}" for k, v in FILLS.items())
        hint = "" if fill is None else f" {nearest(fill, FILLS)}."
        raise InputError(f"{got}.{hint} Say with fill (--fill) how they are filled. {choices}")
    plane = _plane_rows(data)

    alpha = lobe_roughness(IsotropicBrdf(wavelength, lambda wi, wo: _azimuth(plane, wi, wo), ""))

    def values(wi: Floats, wo: Floats) -> Floats:
        return _half_angle(plane, alpha, wi, wo) if fill == "half-angle" else _azimuth(plane, wi, wo)

    return IsotropicBrdf(wavelength, values, f"in-plane data filled by {fill}: {FILLS[fill]}")


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
        t = closeness(axis, k, low[near], theta_i[near])
        # θ_i beyond the ends: the same half angle as well, or a lobe would stand still
        at = theta_i[near] + theta_o[near] - theta
        # a neighbour that was not measured at this half angle counts only where the other was not either
        t = t * np.where((at < x[0] - 1e-9) | (at > x[-1] + 1e-9), 1e-6, 1.0)
        total[near] += t[:, None] * interp(at, x, f)
        weight[near] += t
    return total / np.maximum(weight, 1e-300)[:, None]


def visible_area(cos: ArrayLike, alpha: float) -> Floats:
    """Projected area of the facets of GGX seen from cos θ, cos θ / G1 (Walter 2007, by Smith's masking)."""
    cos = np.asarray(cos, float)
    return 0.5 * (cos + np.sqrt(cos**2 * (1 - alpha**2) + alpha**2))


def lobe_roughness(brdf: IsotropicBrdf) -> float:
    """Roughness of the GGX lobe that is as wide at half its height as the BRDF at normal incidence, 0.02 … 1."""
    theta_h = np.linspace(0, radians(44), 177)
    wi = np.tile(unit_vectors(0.0), (theta_h.size, 1))
    f = np.nanmean(brdf(wi, unit_vectors(2 * theta_h)), axis=1) * visible_area(np.cos(2 * theta_h), 0.5)
    below = np.flatnonzero(f < 0.5 * f[0])
    return float(np.clip(np.tan(theta_h[below[0]]) / HALF_WIDTH, 0.02, 1.0)) if below.size else 1.0


def _half_angle(rows: list[tuple[float, Floats, Floats]], alpha: float, wi: Floats, wo: Floats) -> Floats:
    """D F/4 of the in-plane pair with the same half and difference angles, both signs of θ_h mixed by cos φ_d.

    At φ_d = 0 and 180° (in plane) this is the datum itself. Pairs that would lie beyond what was measured are brought
    there by a smaller difference angle: of the two, lobes depend on the half angle more.
    """
    h = half_vectors(wi, wo)
    theta_h = np.arccos(np.clip(h[:, 2], -1, 1))
    theta_d = np.arccos(np.clip(np.sum(wi * h, axis=1), -1, 1))
    # cos φ_d from z of ω_i: cos θ_i = cos θ_h cos θ_d − sin θ_h sin θ_d cos φ_d
    product = np.sin(theta_h) * np.sin(theta_d)
    cos_d = (np.cos(theta_h) * np.cos(theta_d) - wi[:, 2]) / np.where(product > 1e-12, product, np.inf)
    top = max(max(abs(x[0]), abs(x[-1])) for _, x, _ in rows)
    theta_h = np.minimum(theta_h, top)
    theta_d = np.minimum(theta_d, top - theta_h)
    total = np.zeros((len(wi), rows[0][2].shape[1]))
    for sign in (1.0, -1.0):
        i, o = theta_d + sign * theta_h, sign * theta_h - theta_d
        flip = np.where(i < 0, -1.0, 1.0)
        f = (
            _in_plane(rows, i * flip, o * flip)
            * (visible_area(np.cos(i), alpha) * visible_area(np.cos(o), alpha))[:, None]
        )
        total += (0.5 * (1 + sign * np.clip(cos_d, -1, 1)))[:, None] * f
    return total / (visible_area(wi[:, 2], alpha) * visible_area(wo[:, 2], alpha))[:, None]


def _azimuth(rows: list[tuple[float, Floats, Floats]], wi: Floats, wo: Floats) -> Floats:
    theta_i, theta_o = (np.arccos(np.clip(w[:, 2], -1, 1)) for w in (wi, wo))
    along = np.sum(wi[:, :2] * wo[:, :2], axis=1)
    size = np.linalg.norm(wi[:, :2], axis=1) * np.linalg.norm(wo[:, :2], axis=1)
    cos_phi = np.clip(np.where(size > 1e-12, along / np.maximum(size, 1e-300), 0.0), -1, 1)[:, None]
    back, mirror = _in_plane(rows, theta_i, theta_o), _in_plane(rows, theta_i, -theta_o)
    return 0.5 * (1 + cos_phi) * back + 0.5 * (1 - cos_phi) * mirror
