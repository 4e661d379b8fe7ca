"""The virtual instrument: what a real gonioreflectometer would make of a BRDF, so that like is compared with like.

Aperture and divergence average f cos θ_o over the cones of detector and source, the spectrometer's bandwidth averages
over wavelengths, the spot grows as 1/cos θ_o and must stay within the beam and the sample, the counts are noisy and the
stage repeats its angles with an error. `measure.calibration` goes the way back.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ..dataset import label
from ..directions import angle_list, frames, scalar, unit_vectors
from ..errors import InputError
from ..units import radians
from .hardware import REPEATABILITY_DEG, Spectrometer, Tilt
from .isotropic import IsotropicBrdf, isotropic
from .standards import DIMS

Floats = NDArray[np.float64]
RINGS = 3  # of directions over the disc of source or detector,
PER_RING = 8  # eight each: a midpoint rule
# full width at half maximum of a Gaussian over its standard deviation
FWHM = 2 * np.sqrt(2 * np.log(2))


@dataclass(frozen=True)
class Instrument:
    """What blurs and disturbs a measurement; 0 switches an effect off.

    Spot, noise, repeatability and the step of the spectrometer are the thesis' (2.2.1); it does not state cones, beam
    and sample, whose defaults are guesses.

    aperture_deg, divergence_deg : full angles of the cones of detector and source;  bandwidth_nm : full width at half
    maximum of the spectrometer's Gaussian line;  tilt : out of the plane
    spot_mm : diameter of what the detector sees at θ_o = 0;  beam_mm : diameter of the collimated beam
    sample_mm : diameter of the sample
    spectrometer, repeatability_deg : noise of the counts and of the angles
    """

    aperture_deg: float = 1.0
    divergence_deg: float = 0.5
    bandwidth_nm: float = 0.8
    tilt: Tilt = field(default_factory=lambda: Tilt(0.0, 0.0))
    spot_mm: float = 2.5
    beam_mm: float = 40.0
    sample_mm: float = 50.0
    spectrometer: Spectrometer = field(default_factory=Spectrometer)
    repeatability_deg: float = REPEATABILITY_DEG

    def __post_init__(self) -> None:
        for name, most in (("aperture_deg", 60.0), ("divergence_deg", 60.0), ("bandwidth_nm", 500.0)):
            _within(name, getattr(self, name), 0.0, most)
        for name in ("spot_mm", "beam_mm", "sample_mm"):
            _within(name, getattr(self, name), 1e-6, 1e6)
        _within("repeatability_deg", self.repeatability_deg, 0.0, 10.0)

    def spot(self, theta_o_deg: ArrayLike) -> Floats:
        """Length in mm of the spot in the plane of incidence, 2.5 mm/cos θ_o: 29 mm at 85°."""
        return self.spot_mm / np.cos(radians(theta_o_deg))

    def seen(
        self,
        brdf: IsotropicBrdf | xr.Dataset,
        theta_i_deg: ArrayLike | None = None,
        theta_o_deg: ArrayLike | None = None,
        fill: str | None = None,
    ) -> xr.Dataset:
        """The BRDF as this instrument sees it without noise, in plane: brdf (theta_i, theta_o, wavelength), sr⁻¹.

        brdf : known everywhere, or a dataset whose azimuths `fill` says (`measure.isotropic.isotropic`); what a dataset
            was averaged over already stays in it
        theta_i_deg, theta_o_deg : by default those of an in-plane dataset

        The product f cos θ_i cos θ_o is averaged over both cones (the parts above the horizon) and divided by the
        average of cos θ_i cos θ_o; `lit` (theta_i, theta_o) is the share of the spot that is lit and on the sample, and
        scales the values. Raises InputError for angles outside −90 … 90°.
        """
        if isinstance(brdf, xr.Dataset):
            flat = "theta_o" in brdf["brdf"].dims
            theta_i_deg = brdf["theta_i"].values if theta_i_deg is None else theta_i_deg
            theta_o_deg = brdf["theta_o"].values if theta_o_deg is None and flat else theta_o_deg
            brdf = isotropic(brdf, fill)
        if theta_i_deg is None or theta_o_deg is None:
            raise InputError("theta_i_deg and theta_o_deg are needed: the BRDF does not say where it is to be measured")
        theta_i, theta_o = angle_list(theta_i_deg, "theta_i_deg"), angle_list(theta_o_deg, "theta_o_deg")
        i, o = (a.ravel() for a in np.meshgrid(theta_i, theta_o, indexing="ij"))
        centres = self.tilt.directions(i, o)
        source, detector = (
            _cones(w, float(radians(a))) for w, a in zip(centres, (self.divergence_deg / 2, self.aperture_deg / 2))
        )
        values = np.stack([_average(brdf, source[k], detector[k]) for k in range(len(i))])
        values = values @ line_matrix(brdf.wavelength, self.bandwidth_nm).T
        shape = (theta_i.size, theta_o.size)
        lit = self.lit(i, o).reshape(shape)
        data = xr.Dataset(
            {"brdf": (DIMS, values.reshape(*shape, -1) * lit[..., None])},
            coords={"theta_i": theta_i, "theta_o": theta_o, "wavelength": brdf.wavelength, "phi_i": 0.0},
            attrs={
                "method": "virtual instrument",
                "aperture_deg": self.aperture_deg,
                "divergence_deg": self.divergence_deg,
                "bandwidth_nm": self.bandwidth_nm,
                "interpolation": brdf.note,
            },
        )
        data["lit"] = (DIMS[:2], lit, {"units": "1", "long_name": "share of the detector's spot lit and on the sample"})
        return label(data)

    def lit(self, theta_i_deg: ArrayLike, theta_o_deg: ArrayLike) -> Floats:
        """Share of the detector's spot (an ellipse) inside both the beam's spot and the sample, by shape.

        The sample is a disc, the beam lights an ellipse of length beam_mm/cos θ_i, all about one centre.
        """
        theta_i, theta_o = np.broadcast_arrays(radians(theta_i_deg), radians(theta_o_deg))
        long = self.spot_mm / np.cos(theta_o)[..., None] / 2
        x = np.sin(np.linspace(-np.pi / 2, np.pi / 2, 401))  # dense at the ends, where the ellipses close

        def height(half_length: Floats | float, half_width: float) -> Floats:
            return half_width * np.sqrt(np.maximum(1 - (x * long / half_length) ** 2, 0))

        own = height(long, self.spot_mm / 2)
        beam = height(self.beam_mm / np.cos(theta_i)[..., None] / 2, self.beam_mm / 2)
        both = np.minimum(np.minimum(own, beam), height(self.sample_mm / 2, self.sample_mm / 2))
        return np.trapezoid(both, x, axis=-1) / np.trapezoid(own, x, axis=-1)

    def counts(
        self, brdf: xr.Dataset, factor: ArrayLike, seed: int | np.random.Generator = 0, noisy: bool = True
    ) -> xr.Dataset:
        """Counts V = f · CΔE₀ · cos θ_i of a BRDF that this instrument sees, noisy; calibrating is the inverse.

        brdf : in plane, of `seen`;  factor : C ΔE₀, one number or (n_λ,), counts · sr
        Errors of the stage's angles act through the derivatives of f cos θ_i. Returns counts and counts_stderr
        (theta_i, theta_o, wavelength). Raises InputError where counts exceed the spectrometer's full scale.
        """
        rng = np.random.default_rng(seed)
        data = brdf.transpose(*DIMS, ...)
        f = data["brdf"].transpose(*DIMS).values
        mean = f * np.cos(radians(data["theta_i"].values))[:, None, None] * np.asarray(factor, float)
        if noisy:
            shape = mean.shape[:2]
            for axis, name in enumerate(DIMS[:2]):
                if data[name].size > 1:
                    error = rng.normal(0, self.repeatability_deg, shape)[..., None]
                    mean = mean + np.nan_to_num(np.gradient(mean, data[name].values, axis=axis)) * error
        top = float(np.nanmax(mean, initial=0.0))
        if top > self.spectrometer.full_scale:
            raise InputError(
                f"{top:.3g} counts exceed the spectrometer's full scale of {self.spectrometer.full_scale:g}: a smaller "
                "factor (integration time) is needed"
            )
        v = mean + rng.normal(0, 1, mean.shape) * self.spectrometer.noise(mean) if noisy else mean
        names = {"counts": "counts of the spectrometer", "counts_stderr": "standard error of counts"}
        values = {"counts": v, "counts_stderr": self.spectrometer.noise(v)}
        return label(
            xr.Dataset(
                {k: (DIMS, values[k], {"units": "count", "long_name": text}) for k, text in names.items()},
                coords={k: data[k] for k in DIMS},
            )
        )


def _within(name: str, value: float, least: float, most: float) -> None:
    if not least <= scalar(value, name) <= most:
        raise InputError(f"{name} = {value!r} of the instrument: allowed is {least:g} … {most:g}")


def _cones(w: Floats, half: float) -> Floats:
    """(n, m, 3) directions of equal solid angle within cones about w (n, 3); m = 1 for half = 0."""
    if half == 0:
        return w[:, None, :]
    r = np.arccos(1 - (np.arange(RINGS) + 0.5) / RINGS * (1 - np.cos(half)))
    psi = (np.arange(PER_RING) + 0.5 * np.arange(RINGS)[:, None]) * 2 * np.pi / PER_RING
    local = unit_vectors(r[:, None], psi).reshape(-1, 3)
    return np.einsum("nij,mj->nmi", frames(w), local)


def _average(brdf: IsotropicBrdf, source: Floats, detector: Floats) -> Floats:
    """(n_λ,) mean of f cos θ_i cos θ_o over all pairs of (m, 3) and (k, 3) directions, over that of cos θ_i cos θ_o."""
    wi, wo = np.repeat(source, len(detector), axis=0), np.tile(detector, (len(source), 1))
    above = np.minimum(wi[:, 2], wo[:, 2]) > 0
    wi, wo = wi[above], wo[above]
    if not len(wi):
        return np.full(brdf.wavelength.size, np.nan)
    weight = wi[:, 2] * wo[:, 2]
    return weight @ brdf(wi, wo) / weight.sum()


def line_matrix(wavelength_nm: Floats, bandwidth_nm: float) -> Floats:
    """(n_λ, n_λ) weights that average a spectrum over a Gaussian line of that full width at half maximum.

    The spectrum is taken as linear between its samples; beyond its ends the line is cut and renormalised.
    """
    w = np.asarray(wavelength_nm, float)
    if bandwidth_nm == 0 or w.size == 1:
        return np.eye(w.size)
    sigma = bandwidth_nm / FWHM
    offsets = np.linspace(-4, 4, 161)
    at = w[:, None] + sigma * offsets
    weight = np.exp(-(offsets**2) / 2) * ((at >= w[0]) & (at <= w[-1]))
    weight /= weight.sum(axis=1, keepdims=True)
    hats = np.stack([np.interp(at, w, row) for row in np.eye(w.size)], axis=-1)
    return np.einsum("ns,nsm->nm", weight, hats)
