"""BRDFs in closed form over the whole hemisphere, for files that hold such."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio.directions import half_vectors, unit_vectors
from vgonio.measure.isotropic import IsotropicBrdf

WAVELENGTH = np.array([450.0, 550.0, 650.0])


def _facets(alpha: float, diffuse: float = 0.0, wavelength: np.ndarray = WAVELENGTH) -> IsotropicBrdf:
    """GGX with Smith's masking and Schlick's Fresnel plus a Lambertian, redder than grey."""

    def values(wi, wo):
        h = half_vectors(wi, wo)
        d = alpha**2 / (np.pi * (h[:, 2] ** 2 * (alpha**2 - 1) + 1) ** 2)
        g = [2 / (1 + np.sqrt(1 + alpha**2 * (1 / w[:, 2] ** 2 - 1))) for w in (wi, wo)]
        fresnel = 0.5 + 0.5 * (1 - np.sum(wi * h, axis=1)) ** 5
        f = d * fresnel * g[0] * g[1] / (4 * wi[:, 2] * wo[:, 2]) + diffuse / np.pi
        return f[:, None] * (1 + 0.2 * (wavelength - 550) / 100)

    return IsotropicBrdf(wavelength, values, "closed form")


def _pairs(n: int, seed: int, up_to: float = 80.0) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) directions ω_i and ω_o, uniform over the sphere down to a polar angle in degrees."""
    rng = np.random.default_rng(seed)
    theta = np.arccos(1 - rng.random((2, n)) * (1 - np.cos(np.radians(up_to))))
    phi = rng.random((2, n)) * 2 * np.pi
    return unit_vectors(theta[0], phi[0]), unit_vectors(theta[1], phi[1])


@pytest.fixture
def facets():
    """facets(alpha, diffuse, wavelength): a BRDF known everywhere."""
    return _facets


@pytest.fixture
def pairs():
    """pairs(n, seed, up_to): random directions to source and detector."""
    return _pairs


@pytest.fixture(scope="session")
def mitsuba():
    """Mitsuba, in the variant that needs no compiler."""
    mi = pytest.importorskip("mitsuba", reason="mitsuba is not installed: pip install 'vgonio[render]'")
    mi.set_variant("scalar_spectral")
    return mi
