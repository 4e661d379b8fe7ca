"""From counts of a spectrometer to a BRDF: relative calibration against a diffuse standard (thesis 2.2.2, 2.28–2.32).

f = V / (C ΔE₀ cos θ_i), and C ΔE₀ = V_standard / (f_standard cos θ_i), averaged over the angles of reflection at one
angle of incidence. C ΔE₀ holds the lamp's spectrum and the spectrometer's sensitivity, so it is always found for each
wavelength; what the thesis takes at one wavelength (533 nm) is the standard's BRDF, which hardly varies with it.

What is uncertain: the noise of the counts; the standard's BRDF, common to all values; the angles of the stage, at
random from pair to pair; the tilt of sample and detector, which measures another pair of directions than in plane.
"""

from __future__ import annotations

import warnings

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ..dataset import label
from ..directions import unit_vectors
from ..errors import InputError, VgonioWarning
from ..units import meant_nm, radians
from .hardware import REPEATABILITY_DEG, Tilt, tilt_effect
from .isotropic import isotropic
from .standards import DIMS

Floats = NDArray[np.float64]
THETA_I_DEG = 10.0
THETA_O_DEG = tuple(range(-80, 81, 10))
STANDARD_NM = 533.0
SOURCES = ("noise", "standard", "angle", "tilt")
WHITER = 1.1  # median of π f: in plane and with errors a white standard itself comes to a little above 1
UNEVEN = 0.2  # of the factor over θ_o, relative standard deviation: white standards stay within a few per cent


def calibration_factor(
    counts: xr.Dataset,
    standard: xr.Dataset,
    *,
    theta_i_deg: float = THETA_I_DEG,
    theta_o_deg: ArrayLike = THETA_O_DEG,
    standard_nm: float | None = STANDARD_NM,
    standard_uncertainty: float | None = None,
) -> xr.Dataset:
    """C ΔE₀ for each wavelength, from counts on a diffuse standard whose BRDF is known (thesis 2.32).

    counts : `counts` (theta_i, theta_o, wavelength), and `counts_stderr` where known
    standard : in-plane `brdf` of the standard; between its angles and wavelengths it is interpolated linearly
    theta_i_deg, theta_o_deg : where it is averaged; angles that were not counted, or that lie beyond those of the
    standard, are left out
    standard_nm : the wavelength at which the standard's BRDF is taken for all; None for each wavelength its own
    standard_uncertainty : relative standard uncertainty of the standard, else from its `brdf_stderr`
    Returns factor (wavelength) in counts · sr, factor_stderr (of the mean over angles), factor_standard (the part of
    the standard's uncertainty), factor_by_angle (theta_o, wavelength).
    Raises InputError where angles or wavelengths do not overlap, a count or the standard's BRDF is not positive, or the
    standard is known at one angle of reflection only.
    """
    _check_choices(theta_i_deg, standard_nm, standard_uncertainty)
    counts = _counts(counts)
    here = _nearest_theta_i(counts, theta_i_deg)
    here = _counted(here, standard, np.asarray(theta_o_deg, float))
    v = here["counts"].values
    f, relative = _standard_at(standard, here, standard_nm, standard_uncertainty)
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


def _counted(here: xr.Dataset, standard: xr.Dataset, asked: Floats) -> xr.Dataset:
    """Counts at the angles of reflection asked for that were counted and where the standard is known."""
    asked = asked[np.abs(asked) <= _widest(standard) + 0.5]
    wanted = np.abs(here["theta_o"].values[:, None] - asked).min(axis=1) < 0.5
    finite = np.isfinite(here["counts"].values).all(axis=1)
    if not np.any(wanted & finite):
        raise InputError(f"no counts of the standard at θ_i = {float(here['theta_i']):g}° and θ_o = {asked.tolist()}")
    return here.isel(theta_o=np.flatnonzero(wanted & finite))


def _check_choices(theta_i_deg: float, standard_nm: float | None, standard_uncertainty: float | None) -> None:
    if not abs(theta_i_deg) < 90:
        raise InputError(f"θ_i = {theta_i_deg:g}° of the calibration: an angle below 90° is needed")
    if standard_nm is not None and not 0 < standard_nm < np.inf:
        raise InputError(
            f"standard_nm (--standard-nm) = {standard_nm:g}: a positive wavelength in nm, or all, is needed"
        )
    if standard_uncertainty is not None and not 0 <= standard_uncertainty < 1:
        raise InputError(
            f"uncertainty of the standard (--standard-uncertainty) = {standard_uncertainty:g}: relative, from 0 to "
            "below 1 is needed (0.02 for 2 %)"
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
        asked = f"{nm.min():g}" if standard_nm is not None else f"{nm.min():g} to {nm.max():g}"
        raise InputError(
            f"the standard is known from {own[0]:g} to {own[-1]:g} nm, its BRDF is needed at {asked} nm"
            + (meant_nm(nm.min(), own[0], own[-1]) or ": choose standard_nm (--standard-nm)")
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
    Raises InputError where wavelengths differ from those of the factor, or no count is positive. Warns (VgonioWarning)
    where the standard looks like a sample or the sample like a standard: their counts may have changed places.
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
    _warn_of_swapped(data, factor)
    data = data.assign_coords(source=list(SOURCES))
    data["source"].attrs = {"units": "1", "long_name": "what is uncertain"}
    return label(data)


def _warn_of_swapped(data: xr.Dataset, factor: xr.Dataset) -> None:
    """Warn where the sample outshines an ideal white in most directions, or the standard is no diffuser."""
    near = int(np.abs(data["theta_i"].values).argmin())
    white = float(np.nanmedian(np.pi * data["brdf"].isel(theta_i=near).mean("wavelength")))
    by_angle = factor["factor_by_angle"].mean("wavelength").values if "factor_by_angle" in factor else np.ones(1)
    uneven = float(by_angle.std() / abs(by_angle.mean()))
    found = []
    if white > WHITER:
        found.append(
            f"the sample is brighter than an ideal white in most directions (median of π f at θ_i = "
            f"{data['theta_i'].values[near]:g}°: {white:.2f})"
        )
    if uneven > UNEVEN:
        found.append(f"counts on the standard over its BRDF vary by {uneven:.0%} with θ_o, of a diffuser they do not")
    if found:
        warnings.warn(
            f"{' and '.join(found)}: have the counts of sample and standard changed places?", VgonioWarning, 3
        )


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
