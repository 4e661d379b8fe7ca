"""The colour of BRDF spectra: XYZ, in-plane RGB maps (thesis figure 4.4) and ΔE₀₀, all spectra in one matrix product.

CIE 1931 2° observer and D65 from colour-science. White is what scatters f cos θ_i = 1 at every wavelength.

Wavelength weights. A spectrum is taken as linear between its samples and, beyond its ends, as constant (CIE 15:2018,
section 7.2.2); observer × D65 (which CIE also takes as linear between its 5 nm) is integrated against that in steps of
1 nm from 360 to 780 nm. So any grid works, 20 nm or irregular, and a flat spectrum is exactly white. Columns are scaled
by up to 2·10⁻⁴ so that this white is the standard's (x, y) = (0.3127, 0.3290).
"""

from __future__ import annotations

import warnings
from functools import lru_cache
from types import ModuleType
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import check, takes_nodes
from ..errors import InputError, VgonioWarning, nearest
from ..units import meant_nm, radians
from .metrics import align, at_wavelengths, labelled

Floats = NDArray[np.float64]
OBSERVER = "CIE 1931 2 Degree Standard Observer"
SCALES = ("reference-Y50", "absolute", "normalised")
# how a number of each is named: they differ by much, since brightness counts in the first two
SCALE_WORDS = {"reference-Y50": "with brightness, Y = 50", "absolute": "with brightness", "normalised": "colour alone"}
# shares of the weight of X, Y, Z that may lie beyond the ends of a spectrum; more is refused
LARGEST_SHARE_OUTSIDE = np.array([0.5, 0.1, 0.5])


@lru_cache(maxsize=1)
def _colour() -> ModuleType:
    with warnings.catch_warnings():
        # optional dependencies of colour-science that are not needed here
        warnings.simplefilter("ignore")
        import colour
    return colour


@lru_cache(maxsize=1)
def _standard() -> tuple[Floats, Floats, Floats, Floats]:
    """(n,) nm, (n, 3) observer × D65 with Σ ȳ D65 = 1, (3,) white XYZ, (3, 3) XYZ to linear sRGB."""
    colour = _colour()
    cmfs, d65 = colour.MSDS_CMFS[OBSERVER], colour.SDS_ILLUMINANTS["D65"]
    first = max(cmfs.wavelengths[0], d65.wavelengths[0])
    last = min(cmfs.wavelengths[-1], d65.wavelengths[-1])
    nm = np.arange(first, last + 0.5)
    observer = np.stack([np.interp(nm, cmfs.wavelengths, column) for column in cmfs.values.T], axis=1)
    weight = observer * np.interp(nm, d65.wavelengths, d65.values)[:, None]
    srgb = colour.RGB_COLOURSPACES["sRGB"]
    white = colour.xy_to_XYZ(srgb.whitepoint)
    # the primaries' own matrix: the standard prints it rounded to four digits, which would tint white by 10⁻⁴
    to_rgb = np.linalg.inv(colour.normalised_primary_matrix(srgb.primaries, srgb.whitepoint))
    return nm, weight / weight[:, 1].sum(), white, to_rgb


@lru_cache(maxsize=32)  # so it also warns once for a grid, not for every pair of results
def _weights(wavelength: tuple[float, ...]) -> tuple[Floats, Floats]:
    """(n_λ, 3) weights of sorted wavelengths in nm for X, Y, Z, and (3,) the share of them beyond the ends."""
    nm, standard, white, _ = _standard()
    w = np.array(wavelength)
    # column j: the linear interpolant that is 1 at sample j; np.interp continues it as a constant
    hats = np.stack([np.interp(nm, w, row) for row in np.eye(w.size)], axis=1)
    total = standard.sum(axis=0)
    outside = standard[(nm < w[0]) | (nm > w[-1])].sum(axis=0) / total
    if outside.max() > 0.05 and np.all(outside <= LARGEST_SHARE_OUTSIDE):
        warnings.warn(
            f"colour from {w[0]:g} to {w[-1]:g} nm: "
            + ", ".join(f"{s:.0%} of {c}" for s, c in zip(outside, "XYZ"))
            + " lie beyond the ends, where the spectrum is taken as constant",
            VgonioWarning,
            stacklevel=4,
        )
    return hats.T @ standard * (white / total), outside


def weights(wavelength_nm: Floats) -> tuple[Floats, Floats]:
    """Weights (n_λ, 3) that turn a spectrum at sorted wavelengths (n_λ,) in nm into XYZ, and the shares (3,) of the
    weight that had to be taken from its ends; a flat spectrum of 1 gives D65 with Y = 1.

    Raises InputError for fewer than two wavelengths, or when more than `LARGEST_SHARE_OUTSIDE` lies beyond the ends.
    """
    wavelength_nm = np.asarray(wavelength_nm, dtype=np.float64)
    if wavelength_nm.size < 2:
        one = float(wavelength_nm[0])
        raise InputError(
            f"colour needs a spectrum, got the single wavelength {one:g} nm: several are needed"
            + (meant_nm(one) or ": simulate or measure them")
        )
    matrix, outside = _weights(tuple(wavelength_nm.tolist()))
    if np.any(outside > LARGEST_SHARE_OUTSIDE):
        shares = ", ".join(f"{share:.0%} of {c}" for share, c in zip(outside, "XYZ"))
        raise InputError(
            f"wavelengths from {wavelength_nm[0]:g} to {wavelength_nm[-1]:g} nm miss {shares} of CIE 1931 XYZ, "
            "allowed are 50 %, 10 %, 50 %" + (meant_nm(wavelength_nm[-1]) or ": cover at least 450 to 650 nm")
        )
    return matrix, outside


@lru_cache(maxsize=8)
def _emitted(wavelength: tuple[float, ...]) -> Floats:
    cmfs = _colour().MSDS_CMFS[OBSERVER]
    nm = np.arange(cmfs.wavelengths[0], cmfs.wavelengths[-1] + 0.5)
    observer = np.stack([np.interp(nm, cmfs.wavelengths, column) for column in cmfs.values.T], axis=1)
    w = np.array(wavelength)
    hats = np.stack([np.interp(nm, w, row, left=0.0, right=0.0) for row in np.eye(w.size)], axis=1)
    return hats.T @ observer


def emitted_weights(wavelength_nm: Floats) -> Floats:
    """Weights (n_λ, 3) that turn a spectral radiance at sorted wavelengths in nm into X, Y, Z: ∫ L x̄ dλ and so on.

    For light itself, without an illuminant; linear between the samples, nothing beyond them.
    """
    return _emitted(tuple(np.asarray(wavelength_nm, dtype=np.float64).tolist()))


def _cos_i(data: xr.Dataset) -> xr.DataArray:
    return xr.DataArray(np.cos(radians(data["theta_i"].values)), dims="theta_i")


def _xyz(f: xr.DataArray) -> xr.DataArray:
    """XYZ of spectra over "wavelength" (sorted), dims (…, xyz); NaN where any wavelength is."""
    matrix, outside = weights(f["wavelength"].values)
    f = f.transpose(..., "wavelength")
    kept = {k: v for k, v in f.coords.items() if "wavelength" not in v.dims}
    values = xr.DataArray(f.values @ matrix, dims=(*f.dims[:-1], "xyz"), coords=kept)
    return values.assign_coords(xyz=["X", "Y", "Z"]).assign_attrs(weight_beyond_ends=float(outside.max()))


@takes_nodes
def xyz(data: xr.Dataset) -> xr.DataArray:
    """Tristimulus values of f(λ) cos θ_i under D65, dims (theta_i, theta_o or cell, xyz); f cos θ_i = 1 is Y = 1.

    NaN where a spectrum has a gap. attrs["weight_beyond_ends"] is the largest share of X, Y or Z that was taken from
    the ends of the spectra. Raises InputError for a single wavelength or a range that misses the visible.
    """
    data = check(data).sortby("wavelength")
    result = _xyz(data["brdf"] * _cos_i(data))
    share = result.attrs["weight_beyond_ends"]
    return labelled(result, "xyz", "1", "CIE 1931 XYZ of BRDF times cos theta_i under D65", weight_beyond_ends=share)


@takes_nodes
def rgb_map(data: xr.Dataset, exposure: float | None = None, chromatic: bool = False) -> xr.DataArray:
    """sRGB in 0…1 of f(λ) cos θ_i under D65, dims (theta_i, theta_o or cell, rgb): the map of thesis figure 4.4.

    exposure : factor on the linear values; None brings the 98th percentile of Y to 1. 1 shows f cos θ_i = 1 as white.
    chromatic : scale every square to the same luminance instead (Y = exposure, by default 0.5), so that only the
        colour is left, also where little light arrives.
    Colours outside 0…1 are clipped; attrs say `exposure`, `chromatic`, `clipped` (share of the squares with a clipped
    channel), `clipped_bright` (with one above 1) and `squares_missing` (NaN, or black in the chromatic map).
    Raises InputError for an exposure that is not positive and as `xyz`.
    """
    values = xyz(data)
    luminance = values.sel(xyz="Y", drop=True)
    if exposure is not None and not (np.isfinite(exposure) and exposure > 0):
        raise InputError(f"exposure = {exposure}: a positive factor is needed, or None for an automatic one")
    if chromatic:
        exposure = 0.5 if exposure is None else float(exposure)
        values = values / luminance.where(luminance > 0)
    elif exposure is None:
        exposure = _automatic_exposure(luminance.values)
    _, _, white, to_rgb = _standard()
    linear = xr.dot(values * exposure, xr.DataArray(to_rgb, dims=("rgb", "xyz")), dim="xyz")
    linear = linear.transpose(..., "rgb").assign_coords(rgb=["R", "G", "B"])
    encoded = xr.DataArray(_colour().models.eotf_inverse_sRGB(np.clip(linear.values, 0, 1)), linear.coords, linear.dims)
    return labelled(
        encoded, "rgb", "1", "sRGB of BRDF times cos theta_i under D65", **_clipping(linear.values, exposure, chromatic)
    )


def _automatic_exposure(luminance: Floats) -> float:
    finite = luminance[np.isfinite(luminance)]
    bright = np.percentile(finite, 98) if finite.size else 0.0
    return float(1.0 / bright) if bright > 0 else 1.0


def _clipping(linear: Floats, exposure: float, chromatic: bool) -> dict[str, Any]:
    # rounding of a neutral square is no clipping
    high, low = np.any(linear > 1 + 1e-9, axis=-1), np.any(linear < -1e-9, axis=-1)
    seen = np.all(np.isfinite(linear), axis=-1)
    return {
        "exposure": float(exposure),
        "chromatic": int(chromatic),
        "clipped": float(np.sum((high | low) & seen) / max(np.sum(seen), 1)),
        "clipped_bright": float(np.sum(high & seen) / max(np.sum(seen), 1)),
        "squares_missing": int(np.sum(~seen)),
    }


def white_point() -> Floats:
    """(3,) XYZ of D65 with Y = 1, the white of `lab`."""
    return _standard()[2]


def lab(values: Floats) -> Floats:
    """CIE L*a*b* of XYZ (…, 3) with Y = 1 for white, D65."""
    colour = _colour()
    return colour.XYZ_to_Lab(values, colour.RGB_COLOURSPACES["sRGB"].whitepoint)


def delta_e(reference: Floats, other: Floats, method: str = "CIE 2000") -> Floats:
    """Colour difference of L*a*b* values (…, 3), broadcast: "CIE 2000" (ΔE₀₀) or "CIE 1976" (ΔE₇₆)."""
    return np.asarray(_colour().delta_E(reference, other, method=method))


def linear_srgb(values: Floats) -> Floats:
    """Linear sRGB (…, 3) of XYZ (…, 3), not clipped; D65 with Y = 1 is (1, 1, 1)."""
    return values @ _standard()[3].T


def srgb(values: Floats) -> Floats:
    """Encoded sRGB in 0…1 of XYZ (…, 3), clipped."""
    return np.asarray(_colour().models.eotf_inverse_sRGB(np.clip(linear_srgb(values), 0.0, 1.0)))


@takes_nodes
def delta_e_2000(
    reference: xr.Dataset, predicted: xr.Dataset, scale: str = "reference-Y50", wavelength_n_nm: float = 600.0
) -> xr.DataArray:
    """ΔE₀₀ between two BRDFs at their common angles, dims (theta_i, theta_o or cell), D65.

    scale : how bright the two are shown
        "reference-Y50" both times the factor that brings the reference's Y to 50 of 100, square by square;
        "absolute" π f cos θ_i as reflectance factor;
        "normalised" each spectrum divided by its value at wavelength_n_nm (nm), as in thesis figure 4.7: colour only.
    The choice is in attrs["scale"] (and wavelength_n_nm), gaps and squares whose reference is black in
    attrs["squares_left_out"]. Raises InputError for an unknown scale, nothing in common, or too few wavelengths.
    """
    if scale not in SCALES:
        raise InputError(f"scale {scale!r} of a colour difference: {nearest(scale, SCALES)}")
    a, b = align(reference, predicted)
    difference = differences(
        a["brdf"].values, b["brdf"].values, a["theta_i"].values, a["wavelength"].values, scale, wavelength_n_nm
    )
    kept = a["brdf"].isel(wavelength=0, drop=True)
    result = xr.DataArray(difference, dims=kept.dims, coords=kept.coords)
    attrs = {"scale": scale, "squares_left_out": int(np.isnan(difference).sum())}
    if scale == "normalised":
        attrs["wavelength_n"] = wavelength_n_nm
    return labelled(result, "delta_e_2000", "1", "colour difference CIE DE2000 under D65", **attrs)


def differences(
    reference: Floats, predicted: Floats, theta_i_deg: Floats, wavelength: Floats, scale: str, wavelength_n_nm: float
) -> Floats:
    """ΔE₀₀ (θ_i, direction) of BRDFs (θ_i, direction, λ) on the same angles and sorted wavelengths in nm.

    scale, wavelength_n_nm : as for `delta_e_2000`; NaN for gaps and where the reference is black
    """
    matrix, _ = weights(wavelength)
    if scale == "normalised":
        x, y = (normalised(f, wavelength, wavelength_n_nm) @ matrix for f in (reference, predicted))
    else:
        cosine = np.cos(radians(theta_i_deg))[:, None, None]
        x, y = ((f * cosine) @ matrix for f in (reference, predicted))
        luminance = x[..., 1:2]
        with np.errstate(invalid="ignore"):
            known = np.where(luminance > 0, luminance, np.nan)
        factor = np.pi if scale == "absolute" else 0.5 / known
        x, y = x * factor, y * factor
    with np.errstate(invalid="ignore", over="ignore"):
        return delta_e(lab(x), lab(y))


def normalised(f: Floats, wavelength: Floats, wavelength_n_nm: float) -> Floats:
    """f/f(λ_n) of spectra (…, λ); NaN where f(λ_n) is not positive. InputError for λ_n outside the wavelengths."""
    if not wavelength[0] <= wavelength_n_nm <= wavelength[-1]:
        raise InputError(
            f"wavelength_n_nm = {wavelength_n_nm:g} lies outside the common wavelengths {wavelength[0]:g} to "
            f"{wavelength[-1]:g} nm"
        )
    at_n = at_wavelengths(f, wavelength, np.array([wavelength_n_nm]))
    with np.errstate(invalid="ignore"):
        return f / np.where(at_n > 0, at_n, np.nan)
