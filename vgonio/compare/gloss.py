"""Specular gloss at 20°, 60°, 85° (ISO 2813) and reflection haze at 20° (ISO 13803) of a model or of in-plane data.

Both are the luminous flux in a rectangular receptor over that of polished black glass of index 1.567, times 100. The
source has the standard's image of 0.75° × 2.5°. Flux is weighted by V(λ) and D65 here (the standard: illuminant C; for
spectra without sharp lines the difference is far below the 1 unit to which gloss is read).
In-plane data say nothing beside the plane: there f is that of the in-plane direction with the same θ_m of the half
vector, as for facets, once as it is and once times the ratio of the cosines of both directions (masked facets lie
between). The mean of both is read, their difference is part of the error: small at 20°, considerable at 85°.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import ascending, takes_nodes
from ..directions import unit_vectors
from ..errors import InputError
from ..models import Geometry, brdf
from ..models.cook_torrance_1982 import fresnel_dielectric
from .drawn_errors import standard_errors
from .fit_files import fit_parameters

Floats = NDArray[np.float64]
GLASS = 1.567  # index of the black glass that is 100 gloss units (ISO 2813:2014)
SOURCE_DEG = (0.75, 2.5)  # image of the source, full angles, as the receptors' below
# in the plane of measurement and across it, full angles (ISO 2813:2014, table 1)
RECEPTORS_DEG = {20.0: (1.8, 3.6), 60.0: (4.4, 11.7), 85.0: (4.0, 6.0)}
HAZE_OFFSET_DEG = 1.9  # ISO 13803: receptors of the 20° geometry at 18.1° and 21.9°
NEAR_DEG = 0.5  # an angle of incidence this near the standard's is the same
LARGEST_ERROR = 0.1  # of the gloss, from steps of θ_o too coarse for the lobe: beyond it no figure is given
RADII, TURNS = 28, 128
Luminance = Callable[[Geometry], Floats]  # luminous mean of f in sr⁻¹ at pairs of directions


@dataclass(frozen=True)
class Reading:
    """What an instrument would show.

    error : numerical, of the interpolation between the angles (0 for a model)
    stderr : standard error that follows from `brdf_stderr`; NaN where the data have none
    """

    value: float
    error: float
    stderr: float = float("nan")

    @property
    def both(self) -> float:
        """Both errors in squares."""
        return float(np.hypot(self.error, np.nan_to_num(self.stderr)))


def luminous_weights(wavelength: Floats) -> Floats:
    """(n_λ,) weights with sum 1: V(λ) times D65; one wavelength alone counts by itself."""
    if wavelength.size == 1:
        return np.ones(1)
    from .colour import weights

    y = weights(wavelength)[0][:, 1]
    return y / y.sum()


def of_model(model: str, wavelength: Floats, **parameters: Any) -> Luminance:
    """Luminous f of a model of `models.table()`."""
    w = luminous_weights(wavelength)
    return lambda geometry: brdf(model, geometry, wavelength, **parameters) @ w


def of_fit(fit: xr.Dataset) -> Luminance:
    """Luminous f of a fitted model, at the wavelengths of the fit."""
    return of_model(str(fit.attrs["model"]), fit["wavelength"].values, **fit_parameters(fit))


def at_angle(data: xr.Dataset, angle: float) -> xr.Dataset:
    """In-plane data at the angle of incidence nearest to `angle` degrees, sorted, θ_i kept as a dimension of one.

    Raises InputError where the data are not in plane or lack that angle.
    """
    if "theta_o" not in data["brdf"].dims:
        raise InputError("gloss needs in-plane data or a model: the cells of a hemisphere are wider than the receptor")
    data = ascending(data)
    offset = np.abs(data["theta_i"].values - angle)
    if offset.min() > NEAR_DEG:
        raise InputError(f"no angle of incidence of {angle:g}° (nearest: {data['theta_i'].values[offset.argmin()]:g}°)")
    return data.isel(theta_i=[int(offset.argmin())])


def _luminous(one: xr.Dataset) -> Floats:
    """(n,) luminous f over θ_o."""
    spectra = one["brdf"].isel(theta_i=0).transpose("theta_o", "wavelength").values
    return spectra @ luminous_weights(one["wavelength"].values)


def of_data(one: xr.Dataset, angle: float, every: int = 1, ratio: float = 0.0) -> Lobe:
    """Luminous f of the data of `at_angle`, from every n-th θ_o.

    ratio : exponent of the ratio of cosines beside the plane. Raises InputError where the data hold nothing about the
    mirror direction, or fewer than three values.
    """
    f = _luminous(one)
    known = np.isfinite(f) & (f > 0)
    theta, log_f = np.deg2rad(one["theta_o"].values[known]), np.log(f[known])
    mirror = -np.deg2rad(angle)
    # thinned outwards from the sample at the mirror direction, so that the peak is never lost by the choice
    middle = int(np.abs(theta - mirror).argmin()) if theta.size else 0
    if not theta.size or abs(theta[middle] - mirror) > np.deg2rad(RECEPTORS_DEG[angle][0]) / 2:
        raise InputError(
            f"no value within the receptor about the mirror direction of {angle:g}°: the angles are too coarse"
        )
    kept = np.arange(theta.size) % every == middle % every
    if kept.sum() < 3:
        raise InputError(f"fewer than three values at an angle of incidence of {angle:g}°")
    return Lobe(theta[kept], log_f[kept], np.flatnonzero(known)[kept], mirror, ratio)


@dataclass(frozen=True, eq=False)
class Lobe:
    """Luminous f of in-plane data at one angle of incidence, between and beside its directions: a `Luminance`.

    theta : (n,) rad, ascending;  log_f : (n,) ln of f in sr⁻¹;  place : (n,) where in the data;  mirror : rad
    ratio : exponent of the ratio of cosines beside the plane
    """

    theta: Floats
    log_f: Floats
    place: NDArray[np.intp]
    mirror: float
    ratio: float

    def __call__(self, geometry: Geometry) -> Floats:
        return sum(value for value, _, _ in self._sides(geometry))  # type: ignore[return-value]

    def sensitivity(self, geometry: Geometry, weight: Floats) -> Floats:
        """(n,) derivatives of Σ weight · f by f at each of the data's directions."""
        total = np.zeros(self.theta.size)
        for value, right, t in self._sides(geometry):
            total += np.bincount(right - 1, weight * value * (1 - t), total.size)
            total += np.bincount(right, weight * value * t, total.size)
        return total / np.exp(self.log_f)

    def _sides(self, geometry: Geometry) -> Iterator[tuple[Floats, NDArray[np.intp], Floats]]:
        """What both sides of the lobe give: f, the direction above and how far from the one below it lies, 0 … 1."""
        wi = unit_vectors(geometry.theta_i, geometry.phi_i)
        wo = unit_vectors(geometry.theta_o, geometry.phi_o)
        dx, r = wi[..., 0] + wo[..., 0], geometry.sine_shift
        c = np.divide(dx, r, out=np.ones_like(r), where=r > 0)
        for side, share in ((1, (1 + c) / 2), (-1, (1 - c) / 2)):
            other = np.clip(self.mirror + side * 2 * geometry.theta_m, -np.pi / 2, np.pi / 2)
            # beyond the last angle, and below the horizon, the other side speaks for both
            beyond = (other < self.theta[0]) | (other > self.theta[-1])
            other = np.where(beyond, self.mirror - side * 2 * geometry.theta_m, other)
            right = np.clip(np.searchsorted(self.theta, other), 1, self.theta.size - 1)
            step = self.theta[right] - self.theta[right - 1]
            t = np.clip((other - self.theta[right - 1]) / step, 0.0, 1.0)
            value = np.exp((1 - t) * self.log_f[right - 1] + t * self.log_f[right])
            yield share * value * (np.maximum(np.cos(other), 0.0) / geometry.cos_o) ** self.ratio, right, t


def reading(luminance: Luminance, angle: float, offset_deg: float = 0.0) -> float:
    """Flux in the receptor of a geometry (turned by offset_deg in the plane) over that of black glass, times 100."""
    geometry, weight = receptor_rule(angle, offset_deg)
    return float(np.sum(luminance(geometry) * weight))


@lru_cache(maxsize=8)
def receptor_rule(angle: float, offset_deg: float = 0.0) -> tuple[Geometry, Floats]:
    """Pairs of directions (n,) and weights (n,) that make luminous f a reading of the instrument."""
    theta = np.deg2rad(angle)
    width = [np.tan(np.deg2rad(a) / 2) for a in RECEPTORS_DEG[angle]]
    centre = np.deg2rad(-angle + offset_deg)
    across = [np.tan(np.deg2rad(a) / 2) for a in SOURCE_DEG]
    axis = _axes(theta)
    parts = []
    for x in (-0.6, 0.0, 0.6):  # a quadrature over the image of the source
        for y in (-0.6, 0.0, 0.6):
            source = _unit(axis @ np.array([x * across[0], y * across[1], 1.0]))
            wo, weight = _in_receptor(source, centre, width)
            parts.append((np.broadcast_to(source, wo.T.shape), wo.T, weight))
    wi, wo, weight = (np.concatenate(p) for p in zip(*parts))
    glass = float(fresnel_dielectric(np.cos(theta), GLASS))
    (theta_i, phi_i), (theta_o, phi_o) = _polar(wi), _polar(wo)
    return Geometry.of(theta_i, theta_o, phi_i, phi_o), 100 * weight / (9 * glass)


def _polar(w: Floats) -> tuple[Floats, Floats]:
    """Polar angles and azimuths (n,) of directions (n, 3), radians."""
    return np.arccos(np.clip(w[:, 2], -1, 1)), np.arctan2(w[:, 1], w[:, 0])


def _axes(theta: float) -> Floats:
    """(3, 3) columns: in the plane, across it, and the direction of polar angle θ in the plane y = 0."""
    return np.array([[np.cos(theta), 0, np.sin(theta)], [0, 1, 0], [-np.sin(theta), 0, np.cos(theta)]])


def _unit(v: Floats) -> Floats:
    return v / np.linalg.norm(v, axis=0)


def _in_receptor(source: Floats, centre: float, width: list[Any]) -> tuple[Floats, Floats]:
    """Directions ω_o (3, n) and weights (n,) of ∫ f cos θ_o dω_o over the rectangle, in polar coordinates about the
    mirror image of the source where it is in there, so that the peak of any lobe is resolved; about the centre
    otherwise."""
    axis = _axes(centre)
    mirror = axis.T @ (source * [-1, -1, 1])
    x0, y0 = mirror[:2] / mirror[2]
    inside = abs(x0) < width[0] and abs(y0) < width[1]
    if not inside:
        x0 = y0 = 0.0
    t, dt = np.polynomial.legendre.leggauss(RADII)
    t, dt = (t + 1) / 2, dt / 2
    kappa = 7.0 if inside else 0.01
    psi = (np.arange(TURNS) + 0.5) / TURNS * 2 * np.pi
    c, s = np.cos(psi), np.sin(psi)
    rim = np.minimum((np.sign(c) * width[0] - x0) / c, (np.sign(s) * width[1] - y0) / s)
    r = rim[:, None] * np.expm1(kappa * t) / np.expm1(kappa)
    weight = rim[:, None] * kappa * np.exp(kappa * t) / np.expm1(kappa) * dt * r * 2 * np.pi / psi.size
    x, y = x0 + r * c[:, None], y0 + r * s[:, None]
    wo = _unit(axis @ np.stack([x.ravel(), y.ravel(), np.ones(x.size)]))
    above = wo[2] > 1e-6
    solid = weight.ravel() / (1 + x.ravel() ** 2 + y.ravel() ** 2) ** 1.5
    return wo[:, above], (wo[2] * solid)[above]


@takes_nodes
def gloss(data: xr.Dataset, angle_deg: float) -> Reading:
    """Specular gloss of ISO 2813 in gloss units at 20°, 60° or 85°, of in-plane data or of a fit (`fit_model`).

    `error` of data is what half of their angles change, `stderr` follows from their brdf_stderr. Raises InputError for
    another angle, data that lack it, or angles too coarse for their lobe (more than 10 % change).
    """
    if angle_deg not in RECEPTORS_DEG:
        raise InputError(f"gloss at {angle_deg:g}°: ISO 2813 has 20°, 60° and 85°")
    return _read(data, angle_deg, [0.0], f"gloss at {angle_deg:g}°")


@takes_nodes
def haze(data: xr.Dataset) -> Reading:
    """Reflection haze of ISO 13803 (20°, receptors at 18.1° and 21.9°, both together), not logarithmic.

    Errors and what is raised are as of `gloss`.
    """
    return _read(data, 20.0, [-HAZE_OFFSET_DEG, HAZE_OFFSET_DEG], "haze")


def _read(data: xr.Dataset, angle: float, offsets: list[float], what: str) -> Reading:
    if data.attrs.get("method") == "fit":
        source = of_fit(data)
        return Reading(sum(reading(source, angle, o) for o in offsets), 0.0)
    one = at_angle(data, angle)
    lobes = [of_data(one, angle, 1, 0.0), of_data(one, angle, 1, 1.0), of_data(one, angle, 2, 0.0)]
    plain, turned, coarse = (sum(reading(lobe, angle, o) for o in offsets) for lobe in lobes)
    step = abs(plain - coarse) / 3  # linear interpolation: the error falls with the square of the step
    if step > LARGEST_ERROR * plain:
        raise InputError(f"{what}: the angles of reflection are too coarse for the lobe (error {step / plain:.0%})")
    error = float(np.hypot(step, plain - turned))
    return Reading((plain + turned) / 2, error, _stderr(one, lobes[:2], angle, offsets))


def _stderr(one: xr.Dataset, lobes: list[Lobe], angle: float, offsets: list[float]) -> float:
    """Standard error of the mean reading of the lobes, to first order in the noise of the data."""
    slope = np.zeros(one.sizes["theta_o"])
    for lobe in lobes:
        for offset in offsets:
            slope[lobe.place] += lobe.sensitivity(*receptor_rule(angle, offset)) / len(lobes)

    weight = luminous_weights(one["wavelength"].values)

    def figures(brdf: Floats) -> dict[str, float]:
        return {"reading": float(slope @ np.nan_to_num(brdf[0] @ weight))}

    return standard_errors(figures, one).get("reading", float("nan"))
