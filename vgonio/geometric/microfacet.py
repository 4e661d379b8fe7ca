"""What a microfacet model needs, from the very mesh that rays see: slopes, masking, and its prediction of the BRDF.

f = D F G₂ / (4 cos θ_i cos θ_o) (Cook and Torrance 1982; Walter 2007) holds for single reflections. D and G₂ here are
sums over facets and shares of rays, so the difference to the traced single reflections is the model's, not a fit's.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ..dataset import brdf_dataset, label
from ..directions import Detector, Incoming, angle_list, half_vectors, unit_vectors, wavelength_list
from ..errors import InputError, VgonioWarning
from ..materials import Material
from ..materials import material as named_material
from ..surface.heightfield import Heightfield
from ..surface.mesh import Mesh, mesh, mirrored
from ..surface.symmetry import leaning_in_words
from ..units import degrees, radians
from .sides import MIRROR, PERIODIC
from .trace import Tracer, next_facet
from .tracers import TRACERS

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Facets:
    """The facets of one period, or of a finite sample, each once."""

    mesh: Mesh
    index: Ints  # (n,) into the mesh
    normal: Floats  # (n, 3)
    area: Floats  # (n,) µm²
    ground: float  # µm², the area of their common projection

    @staticmethod
    def of(surface: Heightfield, refinement: int) -> Facets:
        """The facets of the mesh of `surface`, its samples split `refinement` times along each axis."""
        m = mesh(surface, refinement)
        x0, x1, y0, y1 = m.box
        first, second, third = m.corners(slice(None))
        x, y = ((first + second + third) / 3)[:, :2].T
        # a periodic mesh overlaps its box: the middle says to which period a facet belongs
        index = np.flatnonzero((x >= x0) & (x < x1) & (y >= y0) & (y < y1))
        return Facets(m, index, m.planes(index)[0], m.areas[index], (x1 - x0) * (y1 - y0))

    def points(self, which: Ints, rng: np.random.Generator) -> Floats:
        """(n, 3) a random point just above each of the facets `which` (n,)."""
        a, b, c = self.mesh.corners(self.index[which])
        u, v = rng.random((2, len(which), 1))
        over = u + v > 1
        u, v = np.where(over, 1 - u, u), np.where(over, 1 - v, v)
        return a + u * (b - a) + v * (c - a) + self.mesh.lift * self.normal[which]


def ndf(surface: Heightfield, resolution_deg: float = 2.0, azimuthal: bool = False, refinement: int = 1) -> xr.Dataset:
    """Distribution of normals D of the mesh, sr⁻¹: `ndf (theta_h)`, or `ndf (cell)` over the hemisphere if `azimuthal`.

    D is the projected area of the facets whose normals fall into an element, over the ground area and over the
    element's ∫ cos θ dω, so that Σ ndf · projected_solid_angle = 1 (Walter 2007). Vertical walls have no
    projected area; the attribute `area_ratio`, real over ground area, counts them.
    """
    facets = Facets.of(surface, refinement)
    weight = facets.area * facets.normal[:, 2] / facets.ground
    if azimuthal:
        cells = Detector.hemisphere(resolution_deg)
        place, size = cells.catch(facets.normal)[1], cells.projected_solid_angle
        dim, coords = "cell", {"theta_h": ("cell", cells.theta_deg), "phi_h": ("cell", cells.phi_deg)}
    else:
        edges = radians(np.linspace(0, 90, max(2, round(90 / resolution_deg) + 1)))
        theta = np.arccos(np.clip(facets.normal[:, 2], -1, 1))
        place = np.minimum(np.searchsorted(edges, theta, side="right") - 1, len(edges) - 2)
        size, dim = np.pi * np.diff(np.sin(edges) ** 2), "theta_h"
        coords = {"theta_h": ("theta_h", degrees((edges[1:] + edges[:-1]) / 2))}
    found = np.bincount(place, weight, len(size)) / size
    data = xr.Dataset({"ndf": (dim, found), "projected_solid_angle": (dim, size)}, coords)
    data.attrs |= {
        "area_ratio": float(facets.area.sum() / facets.ground),
        "slope_rms_x": float(np.sqrt(np.sum(weight * _slope(facets, 0) ** 2))),
        "slope_rms_y": float(np.sqrt(np.sum(weight * _slope(facets, 1) ** 2))),
        "facets": len(facets.index),
        "surface": surface.name,
    }
    return label(data)


def _slope(facets: Facets, axis: int) -> Floats:
    """One-axis slopes (n,) of the facets; those of walls do not count and are 0."""
    n = facets.normal
    return np.where(n[:, 2] > 1e-9, -n[:, axis] / np.maximum(n[:, 2], 1e-9), 0.0)


def masking(
    surface: Heightfield,
    theta_deg: ArrayLike,
    phi_deg: float = 0.0,
    points: int = 20_000,
    seed: int = 0,
    refinement: int = 1,
    tracer: str = "embree",
) -> xr.Dataset:
    """Masking G₁ per direction: the visible share of the projected area of the facets that face it, by ray casting.

    theta_deg : (n,) signed polar angles in the plane of azimuth phi_deg;  points : sample points per direction

    Returns `masking (theta)` with standard error, and `projected_area (theta)`: Σ area (ω·m)⁺ over the ground area, so
    that masking · projected_area = cos θ (Smith 1967; Heitz 2014). A finite sample is continued by its mirror images.
    Raises InputError for angles of 90° and beyond.
    """
    if points < 1:
        raise InputError(f"points = {points}: at least one per direction is needed")
    facets, caster, edges = _prepared(surface, refinement, tracer)
    theta = angle_list(theta_deg, "theta_deg")
    rng = np.random.default_rng(seed)
    share, projected = np.empty(len(theta)), np.empty(len(theta))
    for i, w in enumerate(unit_vectors(radians(theta), radians(phi_deg))):
        facing = facets.area * np.maximum(facets.normal @ w, 0)
        projected[i] = facing.sum() / facets.ground
        which = _drawn(facing, points, rng)
        share[i] = np.mean(_sees(facets, caster, facets.points(which, rng), w[None]))
    error = np.sqrt(np.maximum(share * (1 - share), 0) / points)
    data = xr.Dataset(
        {"masking": ("theta", share), "masking_stderr": ("theta", error), "projected_area": ("theta", projected)},
        {"theta": ("theta", theta), "phi": float(phi_deg)},
        {"edges": edges, "points": points, "seed": seed, "surface": surface.name},
    )
    return label(data)


def prediction(
    surface: Heightfield,
    material: str | Material,
    wavelength_nm: ArrayLike,
    incoming: Incoming,
    detector: Detector,
    points: int = 500,
    seed: int = 0,
    refinement: int = 1,
    tracer: str = "embree",
) -> xr.Dataset:
    """The microfacet BRDF D F G₂ / (4 cos θ_i cos θ_o) of the mesh, to be laid beside traced single reflections.

    incoming, detector : as a Gonioreflectometer has them;  points : per detector element

    Returns `brdf (theta_i, detector, wavelength)` and its parts over (theta_i, detector): `ndf` D at the half vector,
    the mean over the detector element; `masking_2` G₂, the share of those facets that source and detector both see,
    with standard error (NaN where no facet reflects into the element); `fresnel` F at the half vector.
    `brdf_uncorrelated` has G₁(θ_i) G₁(θ_o) of all facets in place of G₂, as common models do;
    `brdf_unmasked` has G₂ = 1.
    """
    wavelengths = wavelength_list(wavelength_nm)
    made = named_material(material)
    facets, caster, edges = _prepared(surface, refinement, tracer)
    rng = np.random.default_rng(seed)
    parts = [_both_ways(facets, caster, w, detector, points, rng) for w in incoming.vectors]
    d, g2, g2_error = (np.stack([p[k] for p in parts]) for k in range(3))
    wi, wo = incoming.vectors[:, None], detector.directions[None]
    f = made.reflectance(np.sum(half_vectors(wi, wo) * wi, axis=-1), wavelengths)
    cos_o = detector.projected_solid_angle / detector.solid_angle  # the mean over the element
    plain = (d / (4 * wi[..., 2] * cos_o))[..., None] * f
    g1 = [_one_way(facets, caster, v, 10 * points, rng) for v in (incoming.vectors, detector.directions)]
    over = ("theta_i", *detector.dims)
    return brdf_dataset(
        {
            "brdf": ((*over, "wavelength"), plain * np.nan_to_num(g2)[..., None]),
            "brdf_uncorrelated": ((*over, "wavelength"), plain * (g1[0][:, None] * g1[1])[..., None]),
            "brdf_unmasked": ((*over, "wavelength"), plain),
            "ndf": (over, d),
            "masking_2": (over, g2),
            "masking_2_stderr": (over, g2_error),
            "fresnel": ((*over, "wavelength"), f),
        },
        incoming.theta_deg,
        wavelengths,
        detector,
        phi_i_deg=incoming.phi_deg,
        attrs={
            "method": "microfacets: D F G2 / (4 cos cos), D and G2 of the mesh",
            "material": made.name,
            "material_source": made.source,
            "edges": edges,
            "points": points,
            "seed": seed,
            "surface": surface.name,
        },
    )


def _prepared(surface: Heightfield, refinement: int, tracer: str) -> tuple[Facets, Tracer, str]:
    whole = surface if surface.periodic else mirrored(surface)
    lean = "" if surface.periodic else leaning_in_words(surface)
    if lean:
        warnings.warn(
            f"microfacets: a finite sample is continued by its mirror images, but its slopes lean to one side {lean}: "
            "masking and prediction are those of both in one; give periodic = true if it repeats",
            VgonioWarning,
            stacklevel=3,
        )
    facets = Facets.of(whole, refinement)
    return facets, TRACERS[tracer](facets.mesh), PERIODIC if surface.periodic else MIRROR


def _drawn(weight: Floats, count: int, rng: np.random.Generator) -> Ints:
    """(count,) facets with probability ∝ weight, systematically: one in each of `count` equal parts of the sum."""
    total = np.cumsum(weight)
    at = (np.arange(count) + rng.random(count)) / count * total[-1]
    return np.minimum(np.searchsorted(total, at, side="right"), len(weight) - 1)


def _sees(facets: Facets, caster: Tracer, points: Floats, towards: Floats) -> NDArray[np.bool_]:
    """(n,) whether nothing lies between points (n, 3) and the sky in the directions (n or 1, 3)."""
    return next_facet(facets.mesh, caster, points, np.broadcast_to(towards, points.shape))[2]


def _one_way(facets: Facets, caster: Tracer, directions: Floats, points: int, rng: np.random.Generator) -> Floats:
    """(n,) masking G₁ in the directions (n, 3)."""
    found = []
    for w in directions:
        which = _drawn(facets.area * np.maximum(facets.normal @ w, 0), points, rng)
        found.append(np.mean(_sees(facets, caster, facets.points(which, rng), w[None])))
    return np.array(found)


def _both_ways(
    facets: Facets, caster: Tracer, wi: Floats, detector: Detector, points: int, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """D, G₂ and the standard error of G₂ per detector element, of the facets that reflect ω_i into the element.

    A facet of normal m sends the light to 2(ω_i·m)m − ω_i; the element's solid angle is 4 (ω_i·m) times as large as
    that of the normals which reach it (Walter 2007).
    """
    cos = facets.normal @ wi
    out = 2 * cos[:, None] * facets.normal - wi
    up = np.flatnonzero((cos > 0) & (out[:, 2] > 0))
    row, element = detector.catch(out[up])
    weight = 4 * facets.area[up] * cos[up]
    d = np.bincount(element, weight[row], len(detector)) / (facets.ground * detector.solid_angle)
    g2, error = np.full(len(detector), np.nan), np.full(len(detector), np.nan)
    order = np.argsort(element, kind="stable")
    row, bounds = row[order], np.searchsorted(element[order], np.arange(len(detector) + 1))
    for e in range(len(detector)):
        here = row[bounds[e] : bounds[e + 1]]
        if len(here):
            which = up[here[_drawn(weight[here], points, rng)]]
            start = facets.points(which, rng)
            seen = _sees(facets, caster, start, wi[None]) & _sees(facets, caster, start, out[which])
            g2[e] = seen.mean()
            error[e] = np.sqrt(g2[e] * (1 - g2[e]) / points)
    return d, g2, error
