"""The usual pictures of any result in one call: `vg.report.plot_lobes(result)` or `result.vgonio.plot_lobes()`.

>>> tree = vg.open("result.nc")
>>> tree.vgonio.plot_lobes()                                # all results of the file in one figure
>>> tree["rays"].vgonio.plot_decomposition(wavelength_nm=450)
>>> vg.report.plot_lobes({"rays": rays, "waves": waves}).savefig("lobes.png", dpi=200)
>>> vg.report.plot_surface(surface)

A result is a whole one (DataTree of `vg.open`, `vg.simulate`), one of its datasets, or several of these by name;
pictures of the surface take a Heightfield as well. Every function returns a matplotlib Figure, which a notebook shows
by itself, and raises InputError, with what to use instead, where the result does not hold what its picture needs. The
functions of `vgonio.report.figures` behind them take datasets by name.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from .chosen import holding, in_the_plane, results_of, surface_of, tree_of, with_spectra

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from ..surface import Heightfield
    from .verdict import Verdict

    Result = xr.DataTree | xr.Dataset | dict[str, xr.Dataset]
    Surface = xr.DataTree | xr.Dataset | Heightfield


# ---- scattering
def plot_lobes(result: Result, wavelength_nm: float | None = None, decades: float = 4.5) -> Figure:
    """BRDF in the plane of incidence against θₒ, logarithmic, a panel for each θᵢ, all results overlaid with ±1 error.

    wavelength_nm : the nearest there is, by default to 550 nm;  decades : depth of the scale.
    Raises InputError for a hemisphere: use `plot_hemisphere`.
    """
    from .figures import lobes

    return lobes(in_the_plane(result, "plot_lobes", "plot_hemisphere"), wavelength_nm, decades)


def plot_hemisphere(
    result: Result, theta_i_deg: float = 30.0, wavelength_nm: float | None = None, decades: float = 3.0
) -> Figure:
    """BRDF over the hemisphere for one θᵢ and one wavelength, a map for each result, one logarithmic scale for all.

    theta_i_deg, wavelength_nm : the nearest there are (550 nm by default);  decades : depth of the colour scale.
    Raises InputError for in-plane results: use `plot_lobes`.
    """
    from . import quantities as q
    from .figures import polar_maps

    sphere = {name: data for name, data in results_of(result).items() if not q.in_plane(data)}
    if not sphere:
        raise InputError("plot_hemisphere needs a hemisphere and this result is in the plane: use plot_lobes")
    return polar_maps(sphere, theta_i_deg, wavelength_nm, decades)


def plot_decomposition(result: Result, wavelength_nm: float | None = None, theta_i_deg: float = 30.0) -> Figure:
    """Share of single and multiple reflections of the rays (thesis figure 4.10).

    In the plane of incidence: against θₒ, a panel for each θᵢ. Over the hemisphere: the share of multiple reflections
    for the θᵢ nearest to `theta_i_deg`. Too few rays to split are hatched or grey.
    wavelength_nm : the nearest there is, by default to 550 nm. Raises InputError where rays were not split.
    """
    from . import figures
    from . import quantities as q

    rays = holding(result, "plot_decomposition", "brdf_by_bounce", "results of rays have it")
    if q.in_plane(rays):
        return figures.decomposition(rays, wavelength_nm)
    return figures.polar_decomposition(rays, theta_i_deg, wavelength_nm)


def plot_energy(result: Result, wavelength_nm: float | None = None) -> Figure:
    """Where the energy goes against θᵢ: tallies of the rays, stacked, whose sum is the check; else power of waves.

    wavelength_nm : of the rays, the nearest there is, by default to 550 nm; waves show the range over all wavelengths.
    Raises InputError where a result holds neither energy_by_bounce nor energy_reflected.
    """
    from . import figures

    found = results_of(result)
    rays = next((data for data in found.values() if "energy_by_bounce" in data), None)
    if rays is not None:
        return figures.energy(rays, wavelength_nm)
    return plot_wave_energy(result)


def plot_wave_energy(result: Result) -> Figure:
    """Reflected power of the waves against θᵢ, its range over the wavelengths as a band; 100 % is marked.

    Raises InputError without energy_reflected, which waves have on a hemisphere and with `energy=True`.
    """
    from .figures import wave_energy

    found = {name: data for name, data in results_of(result).items() if "energy_reflected" in data}
    if not found:
        raise InputError(
            "no energies in this result: energy_by_bounce (rays) or energy_reflected (waves on a hemisphere, or with "
            "energy=True) is needed"
        )
    return wave_energy(found)


def plot_mueller(result: Result, theta_i_deg: float = 30.0, wavelength_nm: float | None = None) -> Figure:
    """All elements of the Mueller matrix over that of I from I against θₒ, for one θᵢ and wavelength.

    theta_i_deg, wavelength_nm : the nearest there are (550 nm by default). Raises InputError where a result was made
    without `polarised=True`, and for a hemisphere.
    """
    from .figures import mueller
    from .spectral_figures import nearest_incidence

    found = {name: data for name, data in in_the_plane(result, "plot_mueller").items() if "mueller" in data}
    if not found:
        raise InputError("plot_mueller needs the variable 'mueller': simulate with polarised = true")
    return mueller(found, nearest_incidence(found, theta_i_deg), wavelength_nm)


def plot_ways(result: Result) -> Figure:
    """Path length, slope of the last facet and distance of second hits of the rays, by number of reflections.

    Raises InputError where the rays were traced without `statistics=True`.
    """
    from .figures import ways

    return ways(holding(result, "plot_ways", "path_length", "rays have it with statistics = true"))


def plot_orders(result: xr.Dataset | dict[str, xr.Dataset], wavelength_nm: float | None = None) -> Figure:
    """Efficiencies of a grating's orders, logarithmic, a panel for each θᵢ, one solver's beside the other's.

    result : of `solver.orders`, or several by name;  wavelength_nm : the nearest there is, by default to 550 nm.
    Raises InputError for results without efficiencies.
    """
    from .figures import orders

    found = result if isinstance(result, dict) else {"orders": result}
    for name, data in found.items():
        if "efficiency" not in data:
            raise InputError(
                f"plot_orders needs the variable 'efficiency', which {name!r} does not hold: it is of gratings, as "
                'vg.wave.Kirchhoff("Al", 550).orders(surface, theta_i_deg) gives it'
            )
    return orders(found, wavelength_nm)


# ---- colour
def plot_spectra(result: Result, theta_i_deg: float = 40.0, back_deg: float | None = None) -> Figure:
    """Spectra in the mirror direction and in back-scattering at one θᵢ, absolute and over 600 nm (thesis figure 4.5).

    theta_i_deg : the nearest there is;  back_deg : θₒ of the back-scattering, by default θᵢ.
    Raises InputError for fewer than three wavelengths.
    """
    from .figures import spectra

    return spectra(with_spectra(results_of(result), "plot_spectra"), theta_i_deg, back_deg)


def plot_rgb(result: Result, exposure: float | None = None, chromatic: bool = False) -> Figure:
    """In-plane maps of the colour under D65, a square for each pair of directions (thesis figures 4.4, 4.7).

    exposure : factor on the linear values, by default the same for all and such that no map has more than 2 % of its
    squares above white;  chromatic : all squares at the same luminance, so that the colour is left.
    Raises InputError for a hemisphere, for fewer than three wavelengths, and where they miss the visible.
    """
    from ..compare.colour import rgb_map
    from . import quantities as q
    from .figures import rgb_maps

    plane = with_spectra(in_the_plane(result, "plot_rgb"), "plot_rgb")
    if exposure is None and not chromatic:
        exposure = min(float(rgb_map(data).attrs["exposure"]) for data in plane.values())
    maps = {name: rgb_map(data, exposure, chromatic) for name, data in plane.items()}
    return rgb_maps(maps, {name: q.title(name, data) for name, data in plane.items()})


def plot_delta_e(result: Result, reference: Result | None = None, scale: str = "normalised") -> Figure:
    """ΔE₀₀ of every result against a reference over the pairs of directions; about 1 is just noticeable.

    reference : another result, by default the last of this one (the measurement where there is one)
    scale : "normalised", the colour alone, as in the verdict, where both results exceed 10⁻³ of their largest BRDF
        (what is left out stands in the figure); "reference-Y50" or "absolute", brightness too and everywhere, see
        `vg.compare.delta_e_2000`
    Raises InputError where there is nothing to compare with, for a hemisphere, for fewer than three wavelengths, and
    for the colour alone without 600 nm among them.
    """
    from ..compare.bright import colour_difference
    from . import quantities as q
    from .figures import delta_e_maps

    plane = with_spectra(in_the_plane(result, "plot_delta_e"), "plot_delta_e")
    if reference is None:
        *_, name = plane
        against = plane.pop(name)
    else:
        *_, (name, against) = with_spectra(in_the_plane(reference, "plot_delta_e"), "plot_delta_e").items()
    if not plane:
        raise InputError("plot_delta_e compares results and this is one alone: give another as reference")
    pairs = {f"{q.title(n, d)} and {q.in_words(name, against)}": d for n, d in plane.items()}
    return delta_e_maps({words: colour_difference(against, data, scale) for words, data in pairs.items()})


def plot_shift(result: Result, material: Any = None) -> Figure:
    """Slope of the linear colour shift against θₒ, fitted spectrum by spectrum, with the global fit (figure 4.8).

    material : of the Fresnel term, by default the result's, else "Al".
    Raises InputError for a hemisphere, for fewer than three wavelengths and where no shift can be fitted.
    """
    from ..compare.comparison import compare
    from . import quantities as q
    from . import shifts
    from .figures import shift_slopes

    plane = with_spectra(in_the_plane(result, "plot_shift"), "plot_shift")
    if material is None:
        material = next((d.attrs["material"] for d in plane.values() if d.attrs.get("material")), "Al")
    slopes = shifts.shift_slopes(compare(plane, material=material), plane)
    if not slopes:
        raise InputError("no linear shift can be fitted to this result: wavelengths on both sides of 600 nm are needed")
    return shift_slopes(slopes, {name: q.title(name, data) for name, data in plane.items()})


# ---- the surface
def plot_surface(result: Surface) -> Figure:
    """Height map with its scale bar, and a detail at full resolution where there is one.

    result : a Heightfield, a whole result with the group `surface`, or such a summary. Raises InputError without one.
    """
    from .figures import surface_map

    return surface_map(surface_of(result, "plot_surface", "z"))


def plot_heights(result: Surface) -> Figure:
    """Distribution of the heights with the Gaussian of the same Sq; InputError without a summary of the surface."""
    from .figures import height_histogram

    return height_histogram(surface_of(result, "plot_heights", "height_density"))


def plot_slopes(result: Surface) -> Figure:
    """Distribution of the slopes with the Gaussian of Beckmann's α; InputError without a summary of the surface."""
    from .figures import slope_histogram

    return slope_histogram(surface_of(result, "plot_slopes", "slope_density"))


def plot_psd(result: Surface) -> Figure:
    """Power spectral density of the heights against spatial frequency; InputError without a summary of the surface."""
    from .figures import psd

    return psd(surface_of(result, "plot_psd", "psd"))


# ---- studies
def plot_sweep(result: xr.DataTree, wavelength_nm: float | None = None) -> Figure:
    """A sweep at a glance, over the first key that was varied: reflected power, lobes, seconds a point.

    result : of `vg.sweep`; shown at its middle θᵢ and near `wavelength_nm` (550 nm by default). Values of the second
    key have lines of different dashes; further keys are shown at their first value.
    Raises InputError for what is no sweep and where no point is done.
    """
    from .sweep_figures import overview

    if "state" not in getattr(result, "data_vars", {}):
        raise InputError("plot_sweep needs the result of a sweep (vg.sweep, vgonio sweep): use plot_lobes")
    drawn = overview(result, wavelength_nm)
    if drawn is None:
        raise InputError("no point of this sweep is done: its 'reason' says why")
    return drawn


# ---- in words
def verdict(result: Result) -> Verdict:
    """What the page says at its top: agreement, energies, shift, the largest error; `print` gives it as plain text.

    Alarms begin with "!", cautions, warnings of the plan among them, with "?".
    """
    from .content import Content
    from .sections import judged

    return judged(Content.of(tree_of(result)))


# ---- pages
def page(result: Result, path: str | os.PathLike[str]) -> Path:
    """Write the report of a result as one HTML page that needs nothing else; returns the path. See `vg.report.page`."""
    from .document import page as write

    return write(tree_of(result), path)


def explore(result: Result, path: str | os.PathLike[str]) -> Path:
    """Write a page to explore a result in a browser, with sliders for θᵢ, λ and θₒ; see `vg.report.explorer_page`."""
    from .explorer import explorer_page

    return explorer_page(tree_of(result), path)


PLOTS = (
    plot_lobes,
    plot_hemisphere,
    plot_decomposition,
    plot_energy,
    plot_wave_energy,
    plot_mueller,
    plot_ways,
    plot_orders,
    plot_spectra,
    plot_rgb,
    plot_delta_e,
    plot_shift,
    plot_surface,
    plot_heights,
    plot_slopes,
    plot_psd,
    plot_sweep,
)
