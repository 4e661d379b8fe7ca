"""Sections of the page that stand there only where a result has them: polarisation, the ways of light."""

from __future__ import annotations

from collections.abc import Callable

from . import path_figures
from . import quantities as q
from .content import Content
from .section import Section
from .style import angle
from .tables import Table, number


def optional_sections(content: Content) -> list[Callable[[], Section]]:
    """Makers of the sections for which the results hold something."""
    found: list[Callable[[], Section]] = []
    if any("mueller" in data for data in content.results.values()):
        found.append(lambda: polarisation_section(content))
    if "path_length" in content.results.get("rays", {}):
        found.append(lambda: ways_section(content))
    return found


def polarisation_section(content: Content) -> Section:
    made = Section("polarisation", "Polarisation", "Polarisation")
    plane = {name: data for name, data in content.plane.items() if "mueller" in data}
    if not plane:
        made.missing = "Mueller matrices over the hemisphere are in the file, but drawn in the plane of incidence only."
        return made
    data = next(iter(plane.values()))
    nm = number(float(q.near(data)["wavelength"]))
    caption = (
        f"Mueller matrix against θₒ for θᵢ = {angle(content.theta_i)} at {nm} nm: every element over that of I from I, "
        "which stands in the first panel over its largest value, with ± one standard error. Q > 0 is light polarised "
        "across the plane of incidence (s), U > 0 at +45° from s towards p, V > 0 turns from s towards p. Dashed: "
        "mirror direction; dotted: back-scattering. Left out where the BRDF is below 10⁻³ of its largest value."
    )
    made.draw(path_figures.mueller(plane, content.theta_i), caption)
    return made


def ways_section(content: Content) -> Section:
    rays = content.results["rays"]
    made = Section("ways", "Between the reflections", "Ways")
    caption = (
        "Ways of the rays that left upward, each counted once whatever it lost: path between the first and the last "
        "hit, slope of the facet where it was last reflected, and how far from the first hit the second lies, "
        "horizontally."
    )
    made.draw(path_figures.ways(rays), caption)
    counts = rays.sortby("theta_i")["paths_followed"].transpose("theta_i", "bounce")
    rows = [
        (angle(float(t)), *(number(float(n), 6) for n in here)) for t, here in zip(counts["theta_i"], counts.values)
    ]
    head = ("θᵢ", *(f"{int(n)} refl." for n in counts["bounce"].values))
    made.tables.append(Table(head, rows, numeric=tuple(range(1, len(head))), caption="Paths followed"))
    return made
