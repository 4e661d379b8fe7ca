"""What the instrument does to a measurement: noise of the spectrometer, tilt of sample holder and detector head."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ..directions import unit_vectors
from ..errors import InputError
from ..units import degrees, radians
from .isotropic import isotropic

Floats = NDArray[np.float64]
REPEATABILITY_DEG = 0.01  # of the stage's angles (thesis 2.2.1)


@dataclass(frozen=True)
class Spectrometer:
    """Noise of the counts: σ² = (full_scale/dynamic_range)² + V · full_scale/snr², over `averages` scans.

    The first term is that of the read-out, the second of photons; `snr` is reached at full scale. The defaults are the
    QE Pro's of the thesis (2.2.1), 1000:1 and 85,000:1, with the scale of its 18 bits.
    Raises InputError for numbers that are not positive.
    """

    full_scale: float = 200_000.0
    snr: float = 1000.0
    dynamic_range: float = 85_000.0
    averages: int = 1

    def __post_init__(self) -> None:
        for name in ("full_scale", "snr", "dynamic_range", "averages"):
            if not 0 < getattr(self, name) < np.inf:
                raise InputError(f"{name} = {getattr(self, name)!r} of the spectrometer: a positive number is needed")

    def noise(self, counts: ArrayLike) -> Floats:
        """Standard deviation of counts of that mean, same shape."""
        photons = np.maximum(np.asarray(counts, float), 0) * self.full_scale / self.snr**2
        return np.sqrt(((self.full_scale / self.dynamic_range) ** 2 + photons) / self.averages)


@dataclass(frozen=True)
class Tilt:
    """Sample holder and detector head tilted out of the plane; 4° and 8° in the thesis' first configuration, else 0.

    With the detector tilted twice as much as the sample the mirror direction stays one at normal incidence; at 60° it
    is missed by 4°, which is why mirror-like samples need the second configuration.
    """

    sample_deg: float = 4.0
    detector_deg: float = 8.0

    def directions(self, theta_i_deg: ArrayLike, theta_o_deg: ArrayLike) -> tuple[Floats, Floats]:
        """(…, 3) unit vectors ω_i and ω_o in the frame of the tilted sample, of the stage's signed angles (broadcast).

        The stage turns the untilted normal by θ_i from the lamp and by θ_o from the detector's column.
        """
        theta_i, theta_o = np.broadcast_arrays(radians(theta_i_deg), radians(theta_o_deg))
        s, d = radians(self.sample_deg), radians(self.detector_deg)
        lamp = unit_vectors(theta_i)
        head = np.stack(
            [np.sin(theta_o) * np.cos(d), np.full(theta_o.shape, np.sin(d)), np.cos(theta_o) * np.cos(d)], -1
        )
        # the normal leans by s towards y: turned back about x
        turn = np.array([[1, 0, 0], [0, np.cos(s), -np.sin(s)], [0, np.sin(s), np.cos(s)]])
        return lamp @ turn.T, head @ turn.T


def tilt_effect(data: xr.Dataset, tilt: Tilt) -> Floats:
    """f at the pair of directions that a tilted instrument has, minus f in plane, sr⁻¹, (θ_i, θ_o, λ)."""
    brdf = isotropic(data, "half-angle")
    theta_i, theta_o = np.meshgrid(data["theta_i"].values, data["theta_o"].values, indexing="ij")
    pairs = [Tilt(0.0, 0.0).directions(theta_i, theta_o), tilt.directions(theta_i, theta_o)]
    found = []
    for wi, wo in pairs:
        wi, wo = wi.reshape(-1, 3), wo.reshape(-1, 3)
        above = np.minimum(wi[:, 2], wo[:, 2]) > 0
        values = np.full((len(wi), brdf.wavelength.size), np.nan)
        values[above] = brdf(wi[above], wo[above])
        found.append(values)
    return np.nan_to_num(found[1] - found[0]).reshape(*theta_i.shape, -1)


def tilted_angles(theta_i_deg: ArrayLike, theta_o_deg: ArrayLike, tilt: Tilt) -> tuple[Floats, Floats, Floats]:
    """Polar angles θ_i, θ_o and the azimuth between them in degrees that a tilted stage really has, broadcast."""
    wi, wo = tilt.directions(theta_i_deg, theta_o_deg)
    azimuth = degrees(np.arctan2(wo[..., 1], wo[..., 0]) - np.arctan2(wi[..., 1], wi[..., 0]))
    polar = [degrees(np.arccos(np.clip(w[..., 2], -1, 1))) for w in (wi, wo)]
    return polar[0], polar[1], (azimuth + 180.0) % 360.0 - 180.0
