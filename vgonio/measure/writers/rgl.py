"""RGL `.bsdf` of any result, so that it renders in Mitsuba's `measured` (layout: `measure.rgl_brdf`).

The table of visible normals only says where the samples lie: that of GGX facets whose roughness follows from the width
of the lobe, with a share of uniform normals so that no direction is without. `spectra` then holds f cos θ_o · 4σ/D,
which is smooth. Nodes whose reflected direction is below the horizon continue f cos θ_o through zero, so that
what lies above is interpolated right.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ...directions import angle_list, unit_vectors
from ...errors import InputError, whole
from ...units import radians
from .. import tensor_file
from ..hemisphere import LOWEST_COS
from ..isotropic import IsotropicBrdf, isotropic, lobe_roughness, visible_area
from ..readers.channels import mixture
from ..rgl_brdf import Warp, bilinear, theta_to_unit, unit_to_theta

Floats = NDArray[np.float64]
THETA_I_DEG = (0, 5, 10, 15, 20, 25, 30, 35, 40, 45, 50, 55, 60, 65, 70, 75, 80, 85, 89)
UNIFORM_SHARE = 0.1
NORMALS = (64, 128)  # azimuths and polar angles of the tables of normals
MOST_VALUES = 2**28


def write(
    dataset: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    fill: str | IsotropicBrdf | None = None,
    alpha: float | None = None,
    theta_i_deg: ArrayLike = THETA_I_DEG,
    resolution: int = 64,
    rgb_nm: Sequence[float] | None = None,
    description: str | None = None,
) -> Path:
    """Write the isotropic BRDF of a dataset as RGL `.bsdf`.

    fill : for in-plane data, how other azimuths come about (`measure.isotropic.isotropic`); it goes into the
    description;  alpha : GGX roughness that places the samples, by default from the width of the lobe at the steepest
    incidence;  theta_i_deg : rising, of the table;  resolution : samples along both axes
    rgb_nm : three wavelengths that are written as R, G, B in place of the spectrum, for RGB variants of Mitsuba (its
    spectral ones need the spectrum); (611, 549, 464) give a look, no colorimetry
    Raises InputError for in-plane data without `fill`, or a BRDF with directions where nothing is known.
    """
    brdf = isotropic(dataset, fill)
    if rgb_nm is not None:
        mix, spectral = mixture(brdf.wavelength, rgb_nm), brdf
        brdf = IsotropicBrdf(np.asarray(rgb_nm, float), lambda wi, wo: spectral(wi, wo) @ mix, spectral.note)
    theta_i = np.sort(angle_list(theta_i_deg, "theta_i_deg"))
    n = whole("resolution", resolution, 4, 1024)
    if theta_i[0] < 0 or theta_i.size < 2:
        raise InputError("theta_i_deg of an RGL file: two angles and more, none negative")
    if theta_i.size * brdf.wavelength.size * n * n > MOST_VALUES:
        raise InputError(
            f"{theta_i.size} angles × {brdf.wavelength.size} wavelengths × {n}² samples: choose a smaller resolution"
        )
    rough = lobe_roughness(brdf) if alpha is None else float(alpha)
    if not 0 < rough <= 2:
        raise InputError(f"alpha = {alpha!r}: a roughness between 0 and 2 is needed")
    text = description or f"{dataset.attrs.get('source', 'vgonio')}; {brdf.note}; alpha {rough:.3g}"
    fields = _fields(brdf, radians(theta_i), rough, n, text)
    if rgb_nm is not None:
        del fields["wavelengths"]
        fields["rgb"] = fields.pop("spectra")
    return tensor_file.write(path, fields)


def _fields(brdf: IsotropicBrdf, theta_i: Floats, alpha: float, n: int, text: str) -> dict[str, NDArray]:
    u = np.linspace(0, 1, 512)
    theta = unit_to_theta(u)
    ndf = np.tile(_ggx(np.cos(theta), alpha), (2, 1)).astype(np.float32)
    sigma = np.tile(visible_area(np.cos(theta), alpha), (2, 1)).astype(np.float32)
    vndf = np.stack([_normals(t, alpha) for t in theta_i]).astype(np.float32)
    warp = Warp.of(vndf.astype(float))
    s = np.linspace(0, 1, n)
    spectra = np.empty((theta_i.size, brdf.wavelength.size, n, n), np.float32)
    luminance = np.empty((theta_i.size, n, n), np.float32)
    for k, t in enumerate(theta_i):
        x, y = warp.forward(k, s, s)
        value, jacobian = _at_normals(brdf, t, x, np.repeat(y[:, None], n, axis=1))
        # what is looked up is divided by these very tables, so they are used as they are interpolated
        d = np.interp(x, u, ndf[0].astype(float))
        spectra[k] = np.moveaxis(
            value * (4 * np.interp(theta_to_unit(t), u, sigma[0].astype(float)) / d)[..., None], -1, 0
        )
        density = bilinear(warp.density[k], x.ravel(), np.repeat(y, n)).reshape(n, n)
        weight = np.maximum(value.mean(axis=-1), 0) * jacobian / np.maximum(density, 1e-9)
        luminance[k] = weight + max(1e-3 * weight.mean(), 1e-12)
    return {
        "description": np.frombuffer(text.encode(), np.uint8),
        "phi_i": np.zeros(1, np.float32),
        "theta_i": theta_i.astype(np.float32),
        "ndf": ndf,
        "sigma": sigma,
        "vndf": vndf[None],
        "luminance": luminance[None],
        "wavelengths": brdf.wavelength.astype(np.float32),
        "spectra": spectra[None],
        "jacobian": np.ones(1, np.uint8),
    }


def _at_normals(brdf: IsotropicBrdf, theta_i: float, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """f cos θ_o (…, n_λ) for the half vectors at x, y of the unit square, and dω_o over dx dy, (…)."""
    theta_h = unit_to_theta(x).ravel()
    h = unit_vectors(theta_h, (2 * y.ravel() - 1) * np.pi)
    wi = unit_vectors(theta_i)
    along = h @ wi
    wo = 2 * along[:, None] * h - wi
    # below the horizon: the value at the horizon times the negative cosine
    raised = np.where(wo[:, 2:] < LOWEST_COS, _at_horizon(wo), wo)
    value = brdf(np.tile(wi, (len(wo), 1)), raised) * wo[:, 2:]
    if not np.all(np.isfinite(value)):
        raise InputError(
            "the BRDF is not known in all directions, as an RGL file needs it: read it on a hemisphere, or with fill"
        )
    jacobian = 2 * np.pi**2 * x.ravel() * np.sin(theta_h) * 4 * np.maximum(along, 0)
    return value.reshape(*x.shape, -1), jacobian.reshape(x.shape)


def _at_horizon(wo: Floats) -> Floats:
    across = np.maximum(np.hypot(wo[:, 0], wo[:, 1]), 1e-12)
    s = np.sqrt(1 - LOWEST_COS**2)
    return np.stack([wo[:, 0] / across * s, wo[:, 1] / across * s, np.full(len(wo), LOWEST_COS)], axis=1)


def _normals(theta_i: float, alpha: float) -> Floats:
    """Density over the unit square of the normals of GGX facets as seen from θ_i, with a uniform share."""
    y, x = np.meshgrid(np.linspace(0, 1, NORMALS[0]), np.linspace(0, 1, NORMALS[1]), indexing="ij")
    theta = unit_to_theta(x)
    area = 2 * np.pi**2 * x * np.sin(theta)
    m = unit_vectors(theta, (2 * y - 1) * np.pi)
    seen = np.maximum(m @ unit_vectors(theta_i), 0) * _ggx(np.cos(theta), alpha) * area
    uniform = np.cos(theta) * area / np.pi
    return seen / visible_area(np.cos(theta_i), alpha) + UNIFORM_SHARE * (uniform + 0.1)


def _ggx(cos: Floats, alpha: float) -> Floats:
    """D of Walter 2007; not below 10⁻⁴ of a Lambertian's, since it is divided by."""
    d = alpha**2 / (np.pi * (cos**2 * (alpha**2 - 1) + 1) ** 2)
    return d + 1e-4 / np.pi
