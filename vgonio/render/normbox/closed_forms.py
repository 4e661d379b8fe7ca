"""What the scene is held against: direct irradiance of a Lambertian rectangle, balance of a white closed box."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .box import GAP_MM, Box, Scene, light_centres

Floats = NDArray[np.float64]


def polygon_irradiance(point: ArrayLike, normal: ArrayLike, corners: ArrayLike) -> float:
    """Irradiance over radiance, sr, at a point with unit normal from a Lambertian polygon, corners (n, 3) in its plane.

    ½ Σ Θ_k (Γ_k · n) over the edges, Θ_k the angle that an edge subtends and Γ_k the unit normal of its plane through
    the point (Lambert 1760; Baum, Rushmeier and Winget 1989), the part below the horizon cut off.
    """
    n = np.asarray(normal, dtype=np.float64)
    v = _above_horizon(np.asarray(corners, dtype=np.float64) - np.asarray(point, dtype=np.float64), n)
    if len(v) < 3:
        return 0.0
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    after = np.roll(v, -1, axis=0)
    across = np.cross(v, after)
    size = np.linalg.norm(across, axis=1)
    angle = np.arctan2(size, np.sum(v * after, axis=1))
    gamma = np.divide(across, size[:, None], out=np.zeros_like(across), where=size[:, None] > 0)
    return float(abs(0.5 * np.sum(angle * (gamma @ n))))


def _above_horizon(v: Floats, n: Floats) -> Floats:
    """A polygon (n, 3) around the origin cut by the plane through it (Sutherland and Hodgman 1974)."""
    kept = []
    for a, b in zip(v, np.roll(v, -1, axis=0)):
        ha, hb = a @ n, b @ n
        if ha >= 0:
            kept.append(a)
        if (ha >= 0) != (hb >= 0):
            kept.append(a + (b - a) * ha / (ha - hb))
    return np.array(kept).reshape(-1, 3)


def sample_frame(angle_deg: float) -> tuple[Floats, Floats, Floats]:
    """Unit vectors of the sample: along x, up its slope, and its normal."""
    b = np.radians(angle_deg)
    return np.array([1.0, 0, 0]), np.array([0, np.cos(b), np.sin(b)]), np.array([0, -np.sin(b), np.cos(b)])


def field_points(box: Box, angle_deg: float, count: int = 10) -> Floats:
    """(count², 3) points of the sample that the field of view covers evenly, in mm."""
    along, up, normal = sample_frame(angle_deg)
    at = np.array(box.sample_at_mm)
    eye = at + [box.instrument_offset_mm[0], -box.distance_mm, box.instrument_offset_mm[1]]
    forward = (at - eye) / np.linalg.norm(at - eye)
    right = np.cross(forward, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    t = ((np.arange(count) + 0.5) / count - 0.5) * 2 * np.tan(np.radians(box.acceptance_deg / 2))
    a, c = np.meshgrid(t, t)
    d = forward + a.ravel()[:, None] * right + c.ravel()[:, None] * np.cross(right, forward)
    return eye + d * ((at - eye) @ normal / (d @ normal))[:, None]


def direct_irradiance(box: Box, angle_deg: float, light: ArrayLike) -> Floats:
    """Mean direct irradiance (n_λ,) over the field of view, from the light's radiances (n points, n_λ)."""
    _, _, normal = sample_frame(angle_deg)
    half = np.array(box.light_mm) / np.array(box.light_points) / 2
    z = box.size_mm[2] - GAP_MM
    points = field_points(box, angle_deg)
    total = 0.0
    for (x, y), radiance in zip(light_centres(box), np.asarray(light, dtype=np.float64)):
        ends = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
        corners = np.array([(x + i * half[0], y + j * half[1], z) for i, j in ends])
        share = np.mean([polygon_irradiance(p, normal, corners) for p in points])
        total = total + share * radiance
    return np.asarray(total)


def mean_irradiance(scene: Scene, wavelength_nm: float, count: int, seed: int = 0) -> tuple[float, float]:
    """Mean irradiance over all surfaces of a closed box with its standard error, sampled by the renderer's own paths.

    Points are spread evenly over the area of all shapes, directions by the cosine. What one shape covers of another
    gets no light, and is counted on both sides of the balance.
    """
    mi = scene.mi
    integrator = mi.load_dict({"type": "path", "max_depth": -1, "rr_depth": 50})
    shapes = list(scene.scene.shapes())
    area = np.array([float(np.ravel(s.surface_area())[0]) for s in shapes])
    sums, squares, total = 0.0, 0.0, 0
    for k, (shape, n) in enumerate(zip(shapes, np.random.default_rng(seed).multinomial(count, area / area.sum()))):
        if n:
            values = _arriving(mi, scene.scene, integrator, shape, int(n), seed * 1000 + k, wavelength_nm)
            sums, squares, total = sums + values.sum(), squares + (values**2).sum(), total + n
    mean = sums / total
    return np.pi * mean, np.pi * float(np.sqrt((squares / total - mean**2) / total))


def _arriving(mi: Any, scene: Any, integrator: Any, shape: Any, count: int, seed: int, wavelength_nm: float) -> Floats:
    """(count,) radiances that arrive at random points of a shape from directions spread by the cosine."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, count)
    place = shape.sample_position(0.0, sampler.next_2d())
    frame = mi.Frame3f(place.n)
    d = frame.to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d()))
    ray = mi.RayDifferential3f(place.p + 1e-2 * place.n, d)
    ray.wavelengths = mi.Spectrum(float(wavelength_nm))
    value, hit, _ = integrator.sample(scene, sampler, ray)
    import drjit as dr

    return np.array(dr.select(hit, value, 0.0), dtype=np.float64)[0]


def balanced_irradiance(scene: Scene, radiance: float, reflectance: float) -> float:
    """Mean irradiance of a closed box whose surfaces all reflect `reflectance`: Φ/((1 − ρ) A), Φ = π L A_light."""
    shapes = list(scene.scene.shapes())
    area = sum(float(np.ravel(s.surface_area())[0]) for s in shapes)
    light = float(np.prod(scene.box.light_mm))
    return float(np.pi * radiance * light / ((1 - reflectance) * area))
