"""The sections on colour: RGB maps, ΔE₀₀, spectra and the slopes of the linear shift."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np
import xarray as xr

from ..errors import InputError, VgonioError
from . import figures
from . import quantities as q
from .content import Content
from .section import Section
from .style import angle
from .tables import Table, number

MOST_PAIRS = 6


def colour_differences(content: Content) -> dict[str, dict[str, xr.DataArray]]:
    """ΔE₀₀ maps by pair and scale; empty where there are no spectra or no pairs."""
    from ..compare.colour import delta_e_2000

    found: dict[str, dict[str, xr.DataArray]] = {}
    usable = [name for name, data in content.results.items() if q.spectral(data)]
    for a, b in list(itertools.combinations(usable, 2))[:MOST_PAIRS]:
        for scale in ("reference-Y50", "normalised"):
            try:
                found.setdefault(f"{a} and {b}", {})[scale] = delta_e_2000(
                    content.results[b], content.results[a], scale=scale
                )
            except InputError:
                continue
    return {key: maps for key, maps in found.items() if maps}


def colour_section(content: Content, colour: Mapping[str, Mapping[str, xr.DataArray]]) -> Section:
    from ..compare.colour import rgb_map

    made = Section("colour", "Colour", "Colour")
    plane = {name: data for name, data in content.plane.items() if q.spectral(data)}
    if not plane:
        made.missing = colour_reason(content)
        return made
    try:
        exposure = float(rgb_map(list(plane.values())[-1]).attrs["exposure"])
    except InputError as e:
        made.missing = f"{e}."
        return made
    titles = content.titles()
    maps = {name: rgb_map(data, exposure=exposure) for name, data in plane.items()}
    width = "wide" if len(maps) > 1 else "half"
    caption = (
        "Each square is one pair of directions: BRDF times cos θᵢ under D65, in sRGB (as thesis figure 4.4). Exposure "
        f"{number(exposure)} for all; the share of clipped squares stands below each."
    )
    made.draw(figures.rgb_maps(maps, titles), caption, width)
    maps = {name: rgb_map(data, chromatic=True) for name, data in plane.items()}
    caption = "The same at equal luminance: what is left is the colour. Pale squares: nothing to show a colour of."
    made.draw(figures.rgb_maps(maps, titles), caption, width)
    words = {
        "reference-Y50": "both results times the factor that brings the second one's Y to 50, so brightness counts",
        "normalised": "each spectrum over its value at 600 nm, so colour alone counts (as thesis figure 4.7)",
    }
    for scale, meaning in words.items():
        shown = {key: d[scale] for key, d in colour.items() if scale in d and "theta_o" in d[scale].dims}
        if shown:
            made.draw(figures.delta_e_maps(shown), f"Colour difference ΔE₀₀: {meaning}. About 1 is just noticeable.")
    return made


def colour_reason(content: Content) -> str:
    if not content.results:
        return "the result holds no BRDF."
    if not any(q.spectral(data) for data in content.results.values()):
        n = max(data.sizes["wavelength"] for data in content.results.values())
        return f"colour needs spectra, and there {'is one wavelength' if n == 1 else f'are only {n} wavelengths'}."
    return "RGB maps are drawn for in-plane results; this one covers a hemisphere."


def comparison_of(content: Content) -> xr.Dataset | None:
    """The stored comparison; worked out here where there is none, as of a single result; None without spectra."""
    if content.comparison is not None:
        return content.comparison
    from ..compare.comparison import compare

    spectra = {name: data for name, data in content.results.items() if q.spectral(data)}
    try:
        return compare(spectra, material=content.material()) if spectra else None
    except VgonioError:
        return None


def shift_slopes_of(comparison: xr.Dataset | None) -> dict[str, xr.Dataset]:
    """The shift fits of each in-plane result: slope, slope_stderr, slope_global over (theta_i, theta_o)."""
    if comparison is None or "slope" not in comparison or "theta_o" not in comparison["slope"].dims:
        return {}
    names = [n for n in ("slope", "slope_stderr", "slope_global") if n in comparison]
    found = {str(name): comparison[names].sel(result=name, drop=True) for name in comparison["result"].values}
    known = {name: data.dropna("theta_i", how="all", subset=["slope"]) for name, data in found.items()}
    return {name: data for name, data in known.items() if data.sizes["theta_i"]}


def global_fit_table(comparison: xr.Dataset, titles: Mapping[str, str]) -> Table | None:
    """Parameters of the global shift fit with their standard errors; None where there is no fit."""
    if "shift_h" not in comparison:
        return None
    scale = {"h": 1e4, "t_y": 1e4}
    rows = []
    for name in comparison["result"].values:
        fit = comparison.sel(result=name)
        if np.isfinite(float(fit["shift_h"])):
            cells = [with_error(fit, k, scale.get(k, 1.0)) for k in ("h", "w", "t_y", "p")]
            rows.append((titles.get(str(name), str(name)), *cells, number(float(fit["shift_r2"]), 2)))
    head = ("Global fit of the shift", "h (% per 100 nm)", "w", "t (% per 100 nm)", "p", "r²")
    return Table(head, rows, numeric=(1, 2, 3, 4, 5)) if rows else None


def with_error(fit: xr.Dataset, name: str, scale: float) -> str:
    value, error = (scale * float(fit[f"shift_{name}{end}"]) for end in ("", "_stderr"))
    return number(value, 3) + (f" ± {number(error, 2)}" if np.isfinite(error) else "")


def spectra_section(content: Content, slopes: Mapping[str, xr.Dataset], comparison: xr.Dataset | None) -> Section:
    made = Section("spectra", "Spectra and the colour shift", "Spectra")
    spectra = {name: data for name, data in content.results.items() if q.spectral(data)}
    if not spectra:
        made.missing = colour_reason(content)
        return made
    theta_i = content.theta_i
    caption = (
        f"Spectra at θᵢ = {angle(theta_i)} in the mirror direction and in back-scattering (as thesis figure 4.5); "
        f"below, relative to 600 nm. Bands and bars are ± one standard error.{nearest_words(spectra, theta_i)}"
    )
    made.draw(figures.spectra(spectra, theta_i), caption)
    if slopes:
        caption = (
            "Slope of the linear shift, f/f(600 nm) = (mλ + b)·(F/F(600 nm))ᵖ, fitted spectrum by spectrum with its "
            "standard error, and the global fit in cos(w·θₘ) (as thesis figure 4.8). Above zero the light turns "
            "towards red."
        )
        made.draw(figures.shift_slopes(slopes, content.titles()), caption)
    table = None if comparison is None else global_fit_table(comparison, content.titles())
    if table is not None:
        made.tables.append(table)
    made.text += skipped_words(comparison)
    return made


def skipped_words(comparison: xr.Dataset | None) -> list[str]:
    """What the comparison could not work out, and why."""
    skipped = {} if comparison is None else q.text(comparison.attrs.get("skipped"), {})
    return [f"Not worked out, {part}: {why}." for part, why in skipped.items()] if isinstance(skipped, dict) else []


def nearest_words(results: Mapping[str, xr.Dataset], theta_i: float) -> str:
    """Which result has no value in exact back-scattering and shows its neighbour instead."""
    words = ""
    for name, data in results.items():
        one = q.incidence(q.sort(data), theta_i)
        here = None if one is None else q.direction(one, theta_i)
        if here is None:
            words += f" {q.title(name, data)}: nothing near back-scattering."
        elif q.in_plane(data) and abs(float(here["theta_o"]) - theta_i) > 0.5:
            words += f" {q.title(name, data)}: the nearest to back-scattering is θₒ = {angle(float(here['theta_o']))}."
    return words
