"""From counts of a spectrometer to a BRDF: relative calibration against a diffuse standard (thesis 2.2.2, 2.28–2.32).

f = V / (C ΔE₀ cos θ_i), and C ΔE₀ = V_standard / (f_standard cos θ_i), averaged over the angles of reflection at one
angle of incidence. C ΔE₀ holds the lamp's spectrum and the spectrometer's sensitivity, so it is always found for each
wavelength; what the thesis takes at one wavelength (533 nm) is the standard's BRDF, which hardly varies with it.

What is uncertain: the noise of the counts; the standard's BRDF, common to all values; the angles of the stage, at
random from pair to pair; the tilt of sample and detector, which measures another pair of directions than in plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ..dataset import label
from ..directions import unit_vectors
from ..errors import FileFormatError, InputError
from ..files import text_of
from ..units import degrees, radians
from .isotropic import isotropic

Floats = NDArray[np.float64]
THETA_I_DEG = 10.0
THETA_O_DEG = tuple(range(-80, 81, 10))
STANDARD_NM = 533.0
REPEATABILITY_DEG = 0.01
SOURCES = ("noise", "standard", "angle", "tilt")
DIMS = ("theta_i", "theta_o", "wavelength")


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


def calibration_factor(
    counts: xr.Dataset,
    standard: xr.Dataset,
    *,
    theta_i_deg: float = THETA_I_DEG,
    theta_o_deg: ArrayLike = THETA_O_DEG,
    standard_nm: float | None = STANDARD_NM,
    standard_relative: float | None = None,
) -> xr.Dataset:
    """C ΔE₀ for each wavelength, from counts on a diffuse standard whose BRDF is known (thesis 2.32).

    counts : `counts` (theta_i, theta_o, wavelength), and `counts_stderr` where known
    standard : in-plane `brdf` of the standard; between its angles and wavelengths it is interpolated linearly
    theta_i_deg, theta_o_deg : where it is averaged; angles that were not counted, or that lie beyond those of the
    standard, are left out
    standard_nm : the wavelength at which the standard's BRDF is taken for all; None for each wavelength its own
    standard_relative : relative standard uncertainty of the standard, else from its `brdf_stderr`
    Returns factor (wavelength) in counts · sr, factor_stderr (of the mean over angles), factor_standard (the part of
    the standard's uncertainty), factor_by_angle (theta_o, wavelength).
    Raises InputError where angles or wavelengths do not overlap, a count or the standard's BRDF is not positive, or the
    standard is known at one angle of reflection only.
    """
    _check_choices(theta_i_deg, standard_nm, standard_relative)
    counts = _counts(counts)
    here = _nearest_theta_i(counts, theta_i_deg)
    asked = np.asarray(theta_o_deg, float)
    asked = asked[np.abs(asked) <= _widest(standard) + 0.5]
    kept = [int(k) for k in np.flatnonzero(np.abs(here["theta_o"].values[:, None] - asked).min(axis=1) < 0.5)]
    here = here.isel(theta_o=kept)
    v = here["counts"].values
    finite = np.isfinite(v).all(axis=1)
    if not finite.any():
        raise InputError(f"no counts of the standard at θ_i = {theta_i_deg:g}° and θ_o = {asked.tolist()}")
    here, v = here.isel(theta_o=np.flatnonzero(finite)), v[finite]
    f, relative = _standard_at(standard, here, standard_nm, standard_relative)
    if not np.all((f > 0) & np.isfinite(f)):
        raise InputError("the BRDF of the standard has to be positive at every angle of the calibration")
    by_angle = v / (f * np.cos(radians(float(here["theta_i"]))))
    if not np.all(by_angle > 0):
        raise InputError("the counts of the standard have to be positive at every angle of the calibration")
    n = len(by_angle)
    scatter = by_angle.std(axis=0, ddof=1) / np.sqrt(n) if n > 1 else np.zeros(by_angle.shape[1])
    noise = np.zeros_like(scatter)
    if "counts_stderr" in here:
        share = here["counts_stderr"].values / v
        noise = np.sqrt(np.sum((by_angle * share) ** 2, axis=0)) / n
    factor = by_angle.mean(axis=0)
    return xr.Dataset(
        {
            "factor": ("wavelength", factor, _named("calibration factor C·ΔE0")),
            "factor_stderr": ("wavelength", np.maximum(scatter, noise), _named("standard error of the mean of factor")),
            "factor_standard": (
                "wavelength",
                factor * relative,
                _named("uncertainty of factor from the standard's"),
            ),
            "factor_by_angle": (
                ("theta_o", "wavelength"),
                by_angle,
                _named("factor by angle of reflection"),
            ),
        },
        coords={"wavelength": here["wavelength"], "theta_o": here["theta_o"]},
        attrs={
            "theta_i_deg": float(here["theta_i"]),
            "angles": n,
            "standard_nm": "each wavelength its own" if standard_nm is None else float(standard_nm),
        },
    )


def _check_choices(theta_i_deg: float, standard_nm: float | None, standard_relative: float | None) -> None:
    if not abs(theta_i_deg) < 90:
        raise InputError(f"θ_i = {theta_i_deg:g}° of the calibration: an angle below 90° is needed")
    if standard_nm is not None and not 0 < standard_nm < np.inf:
        raise InputError(
            f"standard_nm (--standard-nm) = {standard_nm:g}: a positive wavelength in nm, or all, is needed"
        )
    if standard_relative is not None and not 0 <= standard_relative < 1:
        raise InputError(
            f"uncertainty of the standard (--standard-error) = {standard_relative:g}: a relative error from 0 to below "
            "1 is needed (0.02 for 2 %)"
        )


def _widest(standard: xr.Dataset) -> float:
    """The largest |θ_o| of the standard, degrees: beyond it nothing is known."""
    (dim,) = standard["theta_o"].dims
    values = standard["brdf"].transpose(..., dim).values
    angles = np.unique(standard["theta_o"].values[np.isfinite(values).any(axis=tuple(range(values.ndim - 1)))])
    if angles.size < 2:
        at = f"θ_o = {angles[0]:g}°" if angles.size else "no angle"
        raise InputError(
            f"the standard is known at {at} only: its BRDF over the angles of reflection is needed, two at least"
        )
    return float(np.abs(angles).max())


def _named(text: str) -> dict[str, str]:
    return {"units": "count sr", "long_name": text}


def _counts(counts: xr.Dataset) -> xr.Dataset:
    if "counts" not in counts or set(counts["counts"].dims) != set(DIMS):
        got = ", ".join(map(str, counts["counts"].dims)) if "counts" in counts else "no variable 'counts'"
        raise InputError(f"counts over {', '.join(DIMS)} are needed, got {got}")
    names = [n for n in ("counts", "counts_stderr") if n in counts]
    return counts[names].transpose(*DIMS).sortby(list(DIMS))


def _nearest_theta_i(counts: xr.Dataset, theta_i_deg: float) -> xr.Dataset:
    axis = counts["theta_i"].values
    k = int(np.abs(np.abs(axis) - abs(theta_i_deg)).argmin())
    if abs(abs(axis[k]) - abs(theta_i_deg)) > 0.5:
        raise InputError(f"no counts at θ_i = {theta_i_deg:g}°, only at {axis.tolist()}")
    return counts.isel(theta_i=k)


def _standard_at(
    standard: xr.Dataset, here: xr.Dataset, standard_nm: float | None, given: float | None
) -> tuple[Floats, Floats]:
    """(n_o, n_λ) BRDF of the standard at the angles of the counts, (n_λ,) its relative uncertainty."""
    nm = here["wavelength"].values if standard_nm is None else np.full(here["wavelength"].size, float(standard_nm))
    own = np.sort(standard["wavelength"].values)
    if nm.min() < own[0] - 1.5 or nm.max() > own[-1] + 1.5:
        raise InputError(
            f"the standard is known from {own[0]:g} to {own[-1]:g} nm, {nm.min():g} to {nm.max():g} nm are needed: "
            "choose standard_nm (--standard-nm)"
        )
    weights = np.stack([np.interp(nm, own, row) for row in np.eye(own.size)])
    wi = np.tile(unit_vectors(radians(float(here["theta_i"]))), (here["theta_o"].size, 1))
    f = isotropic(standard, "azimuth")(wi, unit_vectors(radians(here["theta_o"].values))) @ weights
    if given is None and "brdf_stderr" in standard:
        ratio = (standard["brdf_stderr"] / standard["brdf"]).sortby("wavelength")
        given_each = ratio.mean(["theta_i", "theta_o"]).values @ weights
        return f, given_each
    return f, np.full(nm.size, 0.0 if given is None else float(given))


def calibrate(
    counts: xr.Dataset,
    factor: xr.Dataset,
    *,
    repeatability_deg: float = REPEATABILITY_DEG,
    tilt: Tilt | None = None,
) -> xr.Dataset:
    """The BRDF of a sample from its counts and a calibration factor (thesis 2.31), with its uncertainty.

    counts : `counts` (theta_i, theta_o, wavelength), `counts_stderr` where known;  factor : of `calibration_factor`
    repeatability_deg : standard deviation of the stage's angles;  tilt : of the first configuration
    Returns brdf, brdf_stderr, all in sr⁻¹, and brdf_stderr_by_source (source, …): "noise" (counts and the mean of the
    factor), "standard", "angle" (derivatives of f cos θ_i along both angles times the repeatability), "tilt" (the
    difference between the tilted and the in-plane pair of directions, azimuths filled by half angles; a bound).
    Raises InputError where wavelengths differ from those of the factor, or no count is positive.
    """
    counts = _counts(counts)
    if not np.any(counts["counts"].values > 0):
        raise InputError("no count on the sample is positive: is the dark signal subtracted twice, or the light off?")
    nm = counts["wavelength"].values
    if nm.size != factor["wavelength"].size or not np.allclose(nm, factor["wavelength"].values, atol=1e-6, rtol=0):
        raise InputError("the counts and the calibration factor have different wavelengths")
    cos_i = np.cos(radians(counts["theta_i"].values))[:, None, None]
    scale = factor["factor"].values * cos_i
    f = counts["counts"].values / scale
    noise = counts["counts_stderr"].values / scale if "counts_stderr" in counts else np.zeros_like(f)
    common = factor["factor_stderr"].values / factor["factor"].values
    data = label(
        xr.Dataset(
            {"brdf": (DIMS, f)},
            coords={k: counts[k].values for k in DIMS} | {"phi_i": 0.0},
            attrs={
                "method": "measured",
                "calibration": f"standard at θ_i = {factor.attrs['theta_i_deg']:g}°",
            },
        )
    )
    parts = [
        np.hypot(noise, f * common),
        np.abs(f) * (factor["factor_standard"].values / factor["factor"].values),
        _of_angles(f * cos_i, data, repeatability_deg) / cos_i,
        np.zeros_like(f) if tilt is None else np.abs(tilt_effect(data, tilt)),
    ]
    data["brdf_stderr"] = (DIMS, np.sqrt(np.sum(np.square(parts), axis=0)))
    data["brdf_stderr_by_source"] = (
        ("source", *DIMS),
        np.stack(parts),
        {"units": "sr-1", "long_name": "parts of brdf_stderr by what is uncertain, added in squares"},
    )
    data = data.assign_coords(source=list(SOURCES))
    data["source"].attrs = {"units": "1", "long_name": "what is uncertain"}
    return label(data)


def _of_angles(g: Floats, data: xr.Dataset, repeatability_deg: float) -> Floats:
    """Standard error of g = f cos θ_i from independent errors of both angles, by its derivatives; g's shape."""
    square = np.zeros_like(g)
    for axis, name in enumerate(("theta_i", "theta_o")):
        angles = data[name].values
        if angles.size > 1:
            square += np.nan_to_num(np.gradient(g, angles, axis=axis) * repeatability_deg) ** 2
    if data["theta_i"].size == 1:  # no derivative of f along θ_i, but that of the cosine is known
        theta_i = radians(data["theta_i"].values)[:, None, None]
        square += (g * np.tan(theta_i) * radians(repeatability_deg)) ** 2
    return np.sqrt(square)


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


def lambertian_standard(
    wavelength_nm: ArrayLike, reflectance: ArrayLike, uncertainty: ArrayLike | None = None
) -> xr.Dataset:
    """The in-plane BRDF ρ/π of a perfectly diffuse standard of known reflectance; its `brdf_stderr` where given.

    Real standards are not Lambertian (PTFE falls by 15 % towards grazing): good for the spectrum, not the angles.
    """
    nm, rho = (np.atleast_1d(np.asarray(v, float)) for v in (wavelength_nm, reflectance))
    if nm.shape != rho.shape or not np.all((rho > 0) & (rho <= 1.02)):
        raise InputError("one reflectance in 0 … 1 for each wavelength is needed (not percent)")
    angles = {"theta_i": [0.0, 89.0], "theta_o": [-89.0, 89.0], "wavelength": nm, "phi_i": 0.0}
    variables = {"brdf": (DIMS, np.broadcast_to(rho / np.pi, (2, 2, nm.size)))}
    if uncertainty is not None:
        variables["brdf_stderr"] = (DIMS, np.broadcast_to(np.asarray(uncertainty, float) / np.pi, (2, 2, nm.size)))
    return label(xr.Dataset(variables, coords=angles, attrs={"method": "measured"}))


def read_reflectance(path: str, columns: Sequence[int] = (0, 1, 2), coverage: float = 2.0) -> tuple[Floats, ...]:
    """Wavelength in nm, reflectance and its standard uncertainty from a calibration table in text columns.

    coverage : factor k of the stated uncertainty, by which it is divided. Raises FileFormatError for other files.
    """
    try:
        table = np.loadtxt(text_of(Path(path), "table").splitlines(), usecols=tuple(columns), ndmin=2)
    except (ValueError, IndexError) as e:
        raise FileFormatError(f"{path} is no table of wavelength, reflectance and uncertainty: {e}") from None
    if not table.size or not np.all(np.isfinite(table)) or np.any(table[:, 0] <= 0):
        raise FileFormatError(f"{path} holds no rows, or a value that cannot be")
    return table[:, 0], table[:, 1], table[:, 2] / coverage
