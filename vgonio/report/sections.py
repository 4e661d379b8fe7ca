"""What stands on the page: the sections in order, each with its figures, tables and words, or why it is left out."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping

import xarray as xr

from ..compare.bright import numerical_floor
from . import figures, tables
from . import quantities as q
from .agreement import Agreement, pairs
from .colour_sections import colour_differences, colour_section, spectra_section
from .content import Content
from .path_sections import optional_sections
from .section import Detail, Section
from .shifts import comparison_of, shift_slopes
from .tables import Table, number, percent
from .verdict import Verdict, verdict


def judged(content: Content) -> Verdict:
    """The verdict alone."""
    _, slopes, agreements = _evidence(content)
    return verdict(content, slopes, agreements)


def compose(content: Content) -> tuple[Verdict, list[Section]]:
    """The verdict and all sections of the page."""
    comparison, slopes, agreements = _evidence(content)
    makers: list[Callable[[], Section]] = [
        lambda: surface_section(content),
        lambda: reflections_section(content),
        lambda: lobes_section(content),
        lambda: colour_section(content, colour_differences(content, agreements)),
        lambda: spectra_section(content, slopes, comparison),
        lambda: energy_section(content),
        *optional_sections(content),
        lambda: agreement_section(content, agreements),
        lambda: error_section(content),
        lambda: plan_section(content),
        lambda: provenance_section(content),
    ]
    return verdict(content, slopes, agreements), [make() for make in makers]


def _evidence(content: Content) -> tuple[xr.Dataset | None, dict[str, xr.Dataset], list[Agreement]]:
    """What verdict and sections rest on: the comparison, slopes of the shift, agreement of pairs."""
    comparison = comparison_of(content)
    return comparison, shift_slopes(comparison, content.results), pairs(comparison, content.results)


# ---- the surface
def surface_section(content: Content) -> Section:
    made = Section("surface", "The surface", "Surface")
    surface = content.surface
    if surface is None:
        made.missing = content.why("read surface", "the result carries no summary of its surface.")
        return made
    whole = "z_detail" not in surface
    caption = "Heights as the solvers used them. " + history_words(surface)
    made.draw(figures.surface_map(surface), caption, "half" if whole else "wide")
    if whole:
        made.beside = tables.surface_parameters(surface)
    else:
        made.tables.append(tables.surface_parameters(surface))
    if surface.attrs.get("Sq") == 0:
        return made  # flat: nothing to distribute
    if "height_density" in surface:
        made.draw(figures.height_histogram(surface), "Distribution of the heights.", "third")
    if "slope_density" in surface:
        words = "Distribution of the slope along one axis; Gaussian slopes follow the curve of Beckmann's α."
        made.draw(figures.slope_histogram(surface), words, "third")
    if "psd" in surface:
        made.draw(figures.psd(surface), "Power spectral density, averaged over directions.", "third")
    return made


def history_words(surface: xr.Dataset) -> str:
    history = q.text(surface.attrs.get("history"), [])
    steps = history if isinstance(history, list) else [str(history)]
    return f"What was done to them: {'; '.join(map(str, steps))}." if steps else ""


# ---- scattering
def reflections_section(content: Content) -> Section:
    made = Section("reflections", "Single and multiple reflections", "Reflections")
    rays = content.results.get("rays")
    if rays is None:
        made.missing = content.why("trace", "the result holds no rays.")
        return made
    if "brdf_by_bounce" not in rays:
        made.missing = "the rays of this result were not split by the number of reflections."
        return made
    nm = number(float(q.near(rays)["wavelength"]))
    if q.in_plane(rays):
        caption = (
            f"Share of the BRDF by number of reflections against θₒ, one panel for each θᵢ, rays at {nm} nm (as thesis "
            f"figure 4.10). {last_bounce(rays)} Dashed: mirror direction; dotted: back-scattering. Hatched: too few "
            f"rays were caught to split them, the relative standard error exceeds {percent(q.TOO_FEW)}."
        )
        made.draw(figures.decomposition(rays), caption)
    else:
        caption = (
            f"Share of multiple reflections over the hemisphere, rays at {nm} nm. Circle: source; cross: mirror "
            "direction."
        )
        made.draw(figures.polar_decomposition(rays, content.theta_i), caption, "half")
    return made


def last_bounce(rays: xr.Dataset) -> str:
    return f"The lightest blue gathers {int(rays['bounce'].values[-1])} and more." if rays.sizes["bounce"] > 1 else ""


def floor_words(results: Mapping[str, xr.Dataset]) -> str:
    """Below which share of the largest value the numerical error of waves leaves nothing, which no band shows."""
    floor = max((numerical_floor(data) for data in results.values()), default=0.0)
    if not floor > 0:
        return ""
    return (
        f" The bands do not hold the numerical error of waves, {percent(floor, 1)} of the largest value of a panel: "
        "what lies below that, as back-scattering from smooth surfaces, is not known."
    )


def lobes_section(content: Content) -> Section:
    made = Section("lobes", "Scattering lobes", "Lobes")
    if not content.results:
        made.missing = "the result holds no BRDF."
        return made
    plane, sphere = content.plane, content.sphere
    if plane:
        caption = (
            f"BRDF in the plane of incidence at {wavelength_of(plane)} nm, logarithmic, one panel for each θᵢ; bands "
            f"are ± one standard error. Dashed: mirror direction; dotted: back-scattering.{floor_words(plane)}"
        )
        made.draw(figures.lobes(plane), caption)
    if sphere:
        caption = (
            f"BRDF over the hemisphere at {wavelength_of(sphere)} nm, logarithmic; the centre is the surface normal. "
            "Circle: source; cross: mirror direction."
        )
        made.draw(figures.polar_maps(sphere, content.theta_i), caption)
    return made


def wavelength_of(results: Mapping[str, xr.Dataset]) -> str:
    return number(float(q.near(next(iter(results.values())))["wavelength"]))


# ---- energy, agreement, errors
def energy_section(content: Content) -> Section:
    made = Section("energy", "Where the energy goes", "Energy")
    rays = content.results.get("rays")
    if rays is not None and "energy_by_bounce" in rays:
        off = float(abs(q.tallies(rays)["sum"] - 1).max())
        caption = (
            f"Rays at {wavelength_of({'rays': rays})} nm: power that leaves upward after 1, 2, … reflections, is "
            "absorbed, or is lost through the sides. Each is counted by itself; over all angles and wavelengths "
            f"their sum differs from 100 % by at most {percent(off, 1)}."
        )
        if "averaged_shortcut" in rays.attrs:
            caption += f" Polarisation: {rays.attrs['averaged_shortcut']}."
        made.draw(figures.energy(rays), caption, "half")
        made.beside = None if "energy_reflected" in content.results.get("waves", {}) else tables.tallies(rays)
    waves = {name: data for name, data in content.results.items() if "energy_reflected" in data}
    if waves:
        caption = (
            "Waves: power that reaches the hemisphere, integrated over it; the band is the range over the wavelengths. "
            "More than 100 % is a property of the theory, not a numerical error."
        )
        made.draw(figures.wave_energy(waves), caption, "half")
    if not made.pictures:
        made.missing = content.why("trace", "the result holds no energy tallies.")
    return made


def agreement_section(content: Content, agreements: list[Agreement]) -> Section:
    made = Section("agreement", "How far the results agree", "Agreement")
    if not agreements:
        made.missing = content.why("compare", "there are no two results with directions and wavelengths in common.")
        return made
    rows = []
    for pair in agreements:
        a, b = pair.names
        name = f"{q.title(a, content.results[a])} against {q.in_words(b, content.results[b])}"
        shares = [pair.nrmse.percent, percent(pair.noise), pair.median.percent, pair.within.percent]
        rows.append((name, *shares, str(pair.brightness), str(pair.colour), str(pair.directions)))
    words = (
        "Pair|NRMSE|of noise alone|Median difference|Within 10 %|"
        "Mean ΔE₀₀, with brightness, Y = 50|Mean ΔE₀₀, colour alone|Directions"
    )
    head = tuple(words.split("|"))
    made.tables.append(Table(head, rows, numeric=tuple(range(1, len(head)))))
    made.text.append(
        "NRMSE is the root mean square of the difference over the mean of the second result, over all common "
        "directions and wavelengths; beside it, what the standard errors alone would give. Median difference and the "
        "share within 10 % count the directions where the second result exceeds 10⁻³ of its largest value. With "
        "brightness both are shown times the factor that brings the second one's Y to 50, of all directions; the "
        "colour alone is that of spectra over their value at 600 nm, where both exceed 10⁻³ of their largest value. "
        "Behind ± stand the standard errors that follow from those of both BRDFs."
    )
    return made


def error_section(content: Content) -> Section:
    made = Section("errors", "Error and seconds", "Errors")
    if not content.results and not content.seconds:
        made.missing = "the result says nothing about its parts."
        return made
    made.tables.append(tables.errors_and_seconds(content.results, content.seconds))
    made.details += [
        Detail(f"All attributes of {title}", tables.attributes(content.results[name]))
        for name, title in content.titles().items()
    ]
    return made


def plan_section(content: Content) -> Section:
    made = Section("plan", "The plan, and what was left out", "Plan")
    table = tables.plan_table(content.plan, content.seconds, content.memory_bytes)
    if table is None:
        made.missing = "the result carries no plan."
        return made
    made.tables.append(table)
    return made


def provenance_section(content: Content) -> Section:
    made = Section("provenance", "Provenance", "Provenance")
    table = tables.provenance_table(content.provenance)
    if table is not None:
        made.tables.append(table)
    if content.scene:
        body = (
            content.scene if isinstance(content.scene, str) else json.dumps(content.scene, indent=2, ensure_ascii=False)
        )
        made.details.append(Detail("The scene, as it was simulated", body))
    if table is None and not content.scene:
        made.missing = "the result says nothing about its origin."
    return made
