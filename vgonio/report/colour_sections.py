"""The sections on colour: RGB maps, ΔE₀₀, spectra and the slopes of the linear shift."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import xarray as xr

from ..compare.bright import bright_spectra, colour_difference
from ..dataset import ascending
from ..errors import InputError
from . import figures
from . import quantities as q
from .agreement import Agreement
from .content import Content
from .section import Section
from .shifts import global_fit_table, mean_table, skipped_words
from .style import angle
from .tables import number

MOST_PAIRS = 6


def colour_differences(content: Content, pairs: Sequence[Agreement]) -> dict[str, dict[str, xr.DataArray]]:
    """ΔE₀₀ maps by pair and scale; empty where there are no spectra or no pairs.

    Of the colour alone ("normalised") only where both results catch light: noise has colours too.
    """
    found: dict[str, dict[str, xr.DataArray]] = {}
    usable = [pair.names for pair in pairs if all(q.spectral(content.results[name]) for name in pair.names)]
    for a, b in usable[:MOST_PAIRS]:
        reference, predicted = content.results[b], content.results[a]
        for scale in ("normalised", "reference-Y50"):
            try:
                found.setdefault(f"{a} and {b}", {})[scale] = colour_difference(reference, predicted, scale)
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
        # the darkest of the automatic exposures: no map has more than 2 % of its squares above white
        exposure = min(float(rgb_map(data).attrs["exposure"]) for data in plane.values())
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
    maps = {name: rgb_map(data, chromatic=True).where(bright_spectra(data)) for name, data in plane.items()}
    for rgb in maps.values():
        rgb.attrs.pop("clipped", None)  # counted with the squares that are left out here
    caption = (
        "The same at equal luminance: what is left is the colour. Pale squares hold no value, or less than 10⁻³ of the "
        "largest BRDF at that θᵢ."
    )
    made.draw(figures.rgb_maps(maps, titles), caption, width)
    words = {
        "normalised": "each spectrum over its value at 600 nm, so colour alone counts (as thesis figure 4.7), where "
        "both results exceed 10⁻³ of their largest value",
        "reference-Y50": "both results times the factor that brings the second one's Y to 50, so brightness counts",
    }
    for scale, meaning in words.items():
        shown = {
            " and ".join(q.title(n, content.results[n]) for n in key.split(" and ")): d[scale]
            for key, d in colour.items()
            if scale in d and "theta_o" in d[scale].dims
        }
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
            "towards red. Pale: less than 10⁻³ of the largest BRDF at that θᵢ is left. The means below take only the "
            "others."
        )
        made.draw(figures.shift_slopes(slopes, content.titles()), caption)
        made.tables.append(mean_table(slopes, content.titles()))
    table = None if comparison is None else global_fit_table(comparison, content.titles())
    if table is not None:
        made.tables.append(table)
    made.text += skipped_words(comparison)
    return made


def nearest_words(results: Mapping[str, xr.Dataset], theta_i: float) -> str:
    """Which result has no value in exact back-scattering and shows its neighbour instead."""
    words = ""
    for name, data in results.items():
        one = q.incidence(ascending(data), theta_i)
        here = None if one is None else q.direction(one, theta_i)
        if here is None:
            words += f" {q.title(name, data)}: nothing near back-scattering."
        elif q.in_plane(data) and abs(float(here["theta_o"]) - theta_i) > 0.5:
            words += f" {q.title(name, data)}: the nearest to back-scattering is θₒ = {angle(float(here['theta_o']))}."
    return words
