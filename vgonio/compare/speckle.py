"""Noise as speckle has it: shared by directions, angles of incidence and wavelengths of nearly the same q.

Speckle is the interference of pairs of points of the surface. Of a window exp(−r²/2ℓ²) the horizontal distance of a
pair is normally distributed with ℓ along each axis, the difference of heights with √2 Sq, and the intensities at q and
q′ correlate as ⟨cos(Δq · pair)⟩ = exp(−ℓ² Δq_∥²/2 − Sq² Δq_z²): the memory effect and Parry's decorrelation of
wavelengths (Goodman 2007, chapter 5) for speckle that is fully developed, from heights whose correlation length is
short against ℓ. A detector cone averages it: each pair's fringes count by the transform of the disc, 2 J₁(u)/u. Noise
is drawn as fringes of pairs drawn from that distribution.

Two things are not in it. Light that is reflected several times has longer paths, and its wavelengths correlate less.
And where a window holds few facets, what a sample has too many or too few of, as of steep ones, all directions and
wavelengths share that: figures of whole lobes then scatter more (docs/tutorial.md has numbers). `shared` bounds the
wavelengths' part of it: speckle of the mean wavelength at all of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..directions import unit_vectors
from ..units import radians, wavenumber
from .metrics import detector_dim

Floats = NDArray[np.float64]
PAIRS, FEWEST = 64, 8  # fringes of one draw
MOST = 400_000  # of them for all directions and wavelengths together


@dataclass(frozen=True, eq=False)
class Speckle:
    """What the speckle of a wave result depends on.

    length_um : ℓ;  height_um : Sq;  profile : whether the surface is the same along y
    incoming (n, 3), outgoing (m, 3) : unit vectors, the third component 1 where q_z does not follow the angles;
    k : (w,) rad/µm;  source, cone : sines of the half-angles of the source and of the detector's cones
    azimuth : of the plane that these lie in, radians
    lit : the surface and its windows: speckle of the same ones is the same
    """

    length_um: float
    height_um: float
    profile: bool
    incoming: Floats
    outgoing: Floats
    k: Floats
    source: float
    cone: float
    azimuth: float
    lit: tuple[str, ...]

    @staticmethod
    def of(data: xr.Dataset) -> Speckle | None:
        """From the attributes of a wave result; None for other data, and where these do not tell."""
        a = data.attrs
        try:
            length, height = float(a["coherence_um"]), float(a["surface_sq_um"])
        except (KeyError, ValueError):
            return None
        if "theory" not in a:
            return None
        dim = detector_dim(data)
        phi_i = float(radians(float(data["phi_i"].values.ravel()[0]))) if "phi_i" in data.coords else 0.0
        phi_o = radians(data["phi_o"].values) if dim == "cell" else phi_i
        wi = unit_vectors(radians(data["theta_i"].values), phi_i)
        wo = unit_vectors(radians(data["theta_o"].values), phi_o)
        if str(a["theory"]) == "harvey-shack":
            wi[:, 2] = wo[:, 2] = 1.0
        # cells of a hemisphere hold a few directions, not a mean over all of them
        cone = 0.0 if dim == "cell" else _sine(a, "aperture_deg")
        k = wavenumber(data["wavelength"].values)
        flat = bool(a.get("surface_profile", 0))
        lit = tuple(str(a.get(n)) for n in ("surface_digest", "coherence_um", "windows"))
        return Speckle(length, height, flat, wi, wo, k, _sine(a, "divergence_deg"), cone, phi_i, lit)

    def __call__(self, rng: np.random.Generator, shared: bool = False) -> Floats:
        """One draw (θ_i, direction, λ), of variance 1 everywhere; shared : (…, 1), by all wavelengths."""
        if shared:
            return replace(self, k=self.k.mean(keepdims=True))(rng)
        pairs, weight = self._pairs(rng)
        turn = rng.uniform(0, 2 * np.pi, len(pairs))
        k = self.k[:, None, None]
        left = np.exp(1j * k * (self.incoming @ pairs.T)) * self._seen(self.incoming, self.source, pairs)
        right = np.exp(1j * (k * (self.outgoing @ pairs.T) + turn)) * self._seen(self.outgoing, self.cone, pairs)
        values = np.real((left * weight) @ right.swapaxes(1, 2))  # (λ, θ_i, direction)
        square = (np.abs(left * weight) ** 2) @ (np.abs(right) ** 2).swapaxes(1, 2) / 2
        return np.moveaxis(values / np.sqrt(square), 0, 2)

    def _pairs(self, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """(n, 3) distances in µm and their weights (n,): half of them near enough for the cones to see."""
        wide, sine = self.length_um, float(np.hypot(self.source, self.cone))
        near = wide / np.sqrt(1 + (wide * float(self.k.mean()) * sine) ** 2 / 2)
        scale = np.where(np.arange(self.many) % 2, wide, near)[:, None]
        xy = scale * rng.standard_normal((self.many, 2)) * ([1, 0] if self.profile else [1, 1])
        r2, axes = np.sum(xy**2, axis=1), 1 if self.profile else 2

        def density(s: float) -> Floats:
            return np.exp(-r2 / (2 * s**2)) / s**axes

        weight = np.sqrt(density(wide) / (density(wide) + density(near)))
        z = np.sqrt(2) * self.height_um * rng.standard_normal((self.many, 1))
        return np.concatenate([xy, z], axis=1), weight

    def _seen(self, axes: Floats, sine: float, pairs: Floats) -> Floats:
        """(λ or 1, direction or 1, n) what cones about unit vectors (n, 3) leave of the fringes of a pair."""
        from scipy.special import j1

        if sine == 0:
            return np.ones((1, 1, len(pairs)))
        # a cone is an ellipse in direction cosines, narrower in its plane by cos θ
        c, s = np.cos(self.azimuth), np.sin(self.azimuth)
        narrow = np.sqrt(np.clip(1 - np.sum(axes[:, :2] ** 2, axis=1), 0.0, 1.0))[:, None]
        along, across = pairs[:, 0] * c + pairs[:, 1] * s, pairs[:, 1] * c - pairs[:, 0] * s
        u = self.k[:, None, None] * sine * np.hypot(narrow * along, across) + 1e-9
        return 2 * j1(u) / u

    @property
    def many(self) -> int:
        """Pairs in a draw: fewer where the result is large, as of a hemisphere; their mean over draws is the same."""
        return int(np.clip(MOST // (len(self.outgoing) * self.k.size), FEWEST, PAIRS))


def _sine(attrs: dict[str, Any], name: str) -> float:
    try:
        return float(np.sin(radians(float(attrs[name])) / 2))
    except (KeyError, ValueError):
        return 0.0
