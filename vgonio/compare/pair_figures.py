"""The figures of a pair of BRDFs, one against a reference, each with the standard error that follows from both."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..errors import InputError
from .bright import both_bright, bright
from .colour import SCALE_WORDS, differences, normalised
from .drawn_errors import Noise, standard_errors, true_share
from .metrics import labelled

Floats = NDArray[np.float64]
TENTH = 0.1
# name: unit, what it is; in the order of the tables
TEXTS = {
    "nrmse": ("1", "NRMSE of the BRDF"),
    "rmse": ("sr-1", "RMSE of the BRDF"),
    "median_difference": ("1", "median of |A − B|/B where B is bright"),
    "median_mirror_side": ("1", "that on the mirror's side of the normal"),
    "median_source_side": ("1", "that on the source's side of the normal"),
    "within_tenth": ("1", "share of the bright directions within 10 % of B, averaged over the spectrum"),
    "delta_e_mean": ("1", "mean dE00"),
    "delta_e_95": ("1", "95th percentile of dE00"),
    "delta_e_largest": ("1", "largest dE00"),
    "delta_e_colour": ("1", f"mean dE00, {SCALE_WORDS['normalised']}"),
}


def pair_figures(
    reference: xr.Dataset, predicted: xr.Dataset, scale: str, wavelength_n_nm: float
) -> dict[str, xr.DataArray]:
    """Scalars by the names of `TEXTS`, and …_stderr of each where both aligned BRDFs have errors.

    Besides nrmse_of_noise, the NRMSE that the standard errors alone would give, NaN where there are none, directions,
    how many bright pairs of directions there are, and directions_of_colour, where both are bright. What the
    wavelengths do not allow is absent.
    The errors are those of `standard_errors`, around the difference less its noise (`true_share`).
    """
    data = reference, predicted
    pair = _Pair(reference, predicted, scale, wavelength_n_nm)
    brdf = [d["brdf"].values for d in data]
    found: dict[str, xr.DataArray] = {}
    for figures, centre in ((pair.figures, _nearer), (pair.of_colour_alone, pair.nearer_in_colour)):
        values, errors = figures(*brdf), standard_errors(figures, *data, centre=centre)
        for name, value in values.items():
            unit, text = TEXTS[name]
            found[name] = labelled(xr.DataArray(value), name, unit, text)
            if name in errors:
                found[f"{name}_stderr"] = labelled(xr.DataArray(errors[name]), "", unit, f"standard error of {name}")
    text = "NRMSE that the standard errors alone would give"
    found["nrmse_of_noise"] = labelled(xr.DataArray(_of_noise(reference, predicted)), "", "1", text)
    count = int(np.isfinite(pair.relative(*brdf)).any(axis=-1).sum())
    colours = int(pair.both_bright.sum())
    found["directions_of_colour"] = labelled(
        xr.DataArray(colours), "", "1", "pairs of directions where both are bright"
    )
    found["directions"] = labelled(xr.DataArray(count), "", "1", "pairs of directions where B is bright")
    return found


def _nearer(noise: Noise, reference: Floats, predicted: Floats) -> tuple[Floats, Floats]:
    """The reference, and the other as far from it as their noise does not explain."""

    def of_difference(draw: int) -> Floats:
        a, b = noise(draw)
        return b - a

    share = true_share(predicted - reference, of_difference)
    return reference, reference + share * (predicted - reference)


def _of_noise(reference: xr.Dataset, predicted: xr.Dataset) -> float:
    # two theories of one surface see the same windows: their speckle is no difference between them
    if all("theory" in d.attrs for d in (reference, predicted)):
        return float("nan")
    known = [d for d in (reference, predicted) if "brdf_stderr" in d]
    both = np.isfinite(reference["brdf"].values) & np.isfinite(predicted["brdf"].values)
    mean = float(np.mean(reference["brdf"].values[both])) if both.any() else 0.0
    if not known or not mean > 0:
        return float("nan")
    square = sum(float(np.nanmean(np.where(both, d["brdf_stderr"].values ** 2, np.nan))) for d in known)
    return float(np.sqrt(square)) / mean


class _Pair:
    """Figures of arrays (θ_i, direction, λ) on the grid of two aligned BRDFs."""

    def __init__(self, reference: xr.Dataset, predicted: xr.Dataset, scale: str, wavelength_n_nm: float) -> None:
        self.theta_i, self.wavelength = reference["theta_i"].values, reference["wavelength"].values
        self.scale, self.wavelength_n = scale, wavelength_n_nm
        self.bright = bright(reference).values
        self.both_bright = both_bright(reference, predicted).values
        self.sides: Floats | None = None
        if "theta_o" in reference["brdf"].dims:
            self.sides = np.sign(self.theta_i[:, None] * reference["theta_o"].values)

    def relative(self, reference: Floats, predicted: Floats) -> Floats:
        """|difference| over the reference where that is bright, else NaN."""
        return np.where(self.bright, np.abs(predicted - reference) / np.where(self.bright, reference, 1.0), np.nan)

    def figures(self, reference: Floats, predicted: Floats) -> dict[str, float]:
        """All but the colour alone."""
        both = np.isfinite(reference) & np.isfinite(predicted)
        if not both.any():
            return dict.fromkeys(("nrmse", "rmse"), float("nan"))
        mean, rmse = np.mean(reference[both]), np.sqrt(np.mean((predicted - reference)[both] ** 2))
        found = {"nrmse": float(rmse / mean) if mean != 0 else float("nan"), "rmse": float(rmse)}
        return found | self._medians(self.relative(reference, predicted)) | self._colour(reference, predicted)

    def _medians(self, relative: Floats) -> dict[str, float]:
        known = np.isfinite(relative)
        count = known.sum(axis=-1)
        lit = count > 0
        mean = np.sum(relative, axis=-1, where=known)[lit] / count[lit]
        found = {"median_difference": _median(relative[known]), "within_tenth": _mean(mean < TENTH)}
        if self.sides is not None:
            for name, side in (("mirror", -1), ("source", 1)):
                found[f"median_{name}_side"] = _median(relative[known & (self.sides == side)[..., None]])
        return found

    def _colour(self, reference: Floats, predicted: Floats) -> dict[str, float]:
        try:
            difference = self._differences(reference, predicted, self.scale)
        except InputError:
            return {}
        e = difference[np.isfinite(difference)]
        names = ("delta_e_mean", "delta_e_95", "delta_e_largest")
        return dict(zip(names, (float(e.mean()), float(np.percentile(e, 95)), float(e.max())))) if e.size else {}

    def _differences(self, reference: Floats, predicted: Floats, scale: str) -> Floats:
        return differences(reference, predicted, self.theta_i, self.wavelength, scale, self.wavelength_n)

    def of_colour_alone(self, reference: Floats, predicted: Floats) -> dict[str, float]:
        """Mean ΔE₀₀ of the spectra over their value at λ_n, where both catch light."""
        try:
            difference = self._differences(reference, predicted, "normalised")
        except InputError:
            return {}
        return {"delta_e_colour": _mean(difference[self.both_bright & np.isfinite(difference)])}

    def nearer_in_colour(self, noise: Noise, reference: Floats, predicted: Floats) -> tuple[Floats, Floats]:
        """The reference, and the other with spectra as far from it in shape as their noise does not explain."""
        try:
            a, b = self._shapes(reference, predicted)
        except InputError:
            return reference, predicted

        def of_difference(draw: int) -> Floats:
            drawn = self._shapes(*(f + e for f, e in zip((reference, predicted), noise(draw))))
            return np.where(self.both_bright[..., None], drawn[1] - drawn[0] - (b - a), np.nan)

        share = true_share(np.where(self.both_bright[..., None], b - a, np.nan), of_difference)
        with np.errstate(divide="ignore", invalid="ignore"):
            turned = predicted * (a + share * (b - a)) / b
        return reference, np.where(np.isfinite(turned), turned, predicted)

    def _shapes(self, reference: Floats, predicted: Floats) -> list[Floats]:
        return [normalised(f, self.wavelength, self.wavelength_n) for f in (reference, predicted)]


def _median(values: Floats) -> float:
    return float(np.median(values)) if values.size else float("nan")


def _mean(values: Floats | NDArray[np.bool_]) -> float:
    return float(np.mean(values)) if values.size else float("nan")
