"""The stages of a scene: what each is needed for, or why it is left out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from .. import assembly
from ..scene import Light, Scene
from ..surface import Heightfield
from ..validity import expectations
from .forecast import Forecast
from .plans import Stage, duration
from .sizes import FEWEST_FOR_SHIFT, detector_elements, refinement, result_groups
from .slips import step_of

# endings that vgonio reads by itself; everything else goes through SurfaceTopography
OWN_FORMATS = (".npz", ".vgms", ".txt", ".asc", ".csv")
WORTH_TELLING = 0.05  # seconds


def with_forecasts(stages: list[Stage], found: Mapping[str, Forecast]) -> list[Stage]:
    """The same; the first stage that is needed of each part has the part's forecast."""
    out, told = [], set[str]()
    for s in stages:
        if s.needed and s.part in found and s.part not in told:
            told.add(s.part)
            f = found[s.part]
            s = replace(
                s,
                seconds=f.seconds,
                memory_bytes=f.memory_bytes,
                error=f.error,
                rough=f.rough,
                loading=f.loading,
                why=s.why + _speckle(f) + (f"; {f.how}" if f.how else "") + _loading(s, f),
            )
        out.append(s)
    return out


def _speckle(f: Forecast) -> str:
    return "" if f.speckle is None else f"; speckle of about {f.speckle:.2g} of a cone's brdf stays"


def _loading(s: Stage, f: Forecast) -> str:
    told = f.loading >= WORTH_TELLING and s.name != "start"
    return f"; {duration(f.loading)} of it to load libraries" if told else ""


def is_own_format(file: str) -> bool:
    """Does vgonio read it by itself?"""
    return Path(file).suffix.lower() in OWN_FORMATS


def start_stages(new_process: bool) -> list[Stage]:
    if not new_process:
        return _left_out(("start",), "Python has started: of a run in this process, which has what it has loaded")
    return [Stage("start", True, "Python and what every run needs", "numpy, xarray", part="start")]


def _left_out(names: Iterable[str], why: str) -> list[Stage]:
    return [Stage(name, False, why) for name in names]


def surface_stages(scene: Scene, source: Heightfield | None, surface: Heightfield | None) -> list[Stage]:
    if scene.surface is None or source is None:
        return _left_out(("read surface", "generate surface"), "the scene has no [surface]")
    from ..surface import describe_import

    asked, size = scene.surface, describe_import(source)
    if asked.file is not None:
        library = "numpy" if is_own_format(asked.file) else "SurfaceTopography"
        first = Stage("read surface", True, Path(asked.file).name, library, size, "surface")
    else:
        kind = (asked.generate or {})["kind"]
        first = Stage("generate surface", True, f"kind {kind!r}, no file", "numpy", size, "surface")
    level = assembly.levelling(scene, source)
    wanted = asked.filter is not None and (asked.filter.s_um or asked.filter.l_um)
    cut_offs = ", ".join(f"{k} = {v:g} µm" for k, v in (asked.filter or {}) if v) if wanted else ""
    outliers = step_of(source, surface, "outliers: ")
    filled = step_of(source, surface, "filled: ")
    unlevelled = 'level = "none"' if asked.level else "periodic and generated surfaces are level as they are"
    return [
        first,
        Stage("crop", asked.crop_um is not None, f"crop_um = {asked.crop_um}" if asked.crop_um else "no crop_um"),
        Stage("outliers", asked.outliers is not None, outliers or "no outliers"),
        Stage("fill", bool(filled), filled or "no point is missing"),
        Stage("level", level != "none", f"{level} removed" if level != "none" else unlevelled),
        Stage(
            "filter",
            bool(wanted),
            f"ISO 16610 Gaussian, {cut_offs}" if wanted else "no filter asked for",
            "scipy" if wanted else "",
        ),
        Stage("describe", True, "statistics of the surface, for the result", "scipy", part="surface summary"),
    ]


def ray_stages(scene: Scene, surface: Heightfield | None) -> list[Stage]:
    if scene.geometric is None or scene.light is None or surface is None:
        return _left_out(("mesh", "trace"), "the scene has no [geometric]")
    asked = scene.geometric
    facets = 2 * surface.shape[0] * surface.shape[1]
    angles = len(scene.light.theta_i_deg)
    cap = f", at most (tol = {asked.tol:g})" if asked.tol else ""
    return [
        Stage("mesh", True, "facets for the rays", "numpy", f"{facets:,} facets"),
        Stage(
            "trace",
            True,
            "one trace serves all wavelengths",
            {"embree": "embreex", "warp": "warp-lang"}.get(asked.tracer, "numpy"),
            f"{asked.rays * angles:,} rays: {asked.rays:,} × {angles} angles{cap}{_rays_beside(scene)}",
            "rays",
        ),
    ]


def _rays_beside(scene: Scene) -> str:
    """What polarisation and statistics cost beside the trace."""
    asked, light = scene.geometric, scene.light
    if asked is None or light is None:
        return ""
    angles, elements = len(light.theta_i_deg), detector_elements(scene)
    parts = []
    if asked.polarised:
        numbers = 16 * angles * elements * len(light.wavelength_nm)
        parts.append(f"Mueller matrices of {numbers:,} elements ({16 * numbers / 1e6:.1f} MB)")
    if asked.statistics:
        parts.append(f"statistics of {min(asked.rays, 50_000) * angles:,} rays more")
    if asked.refinement_check:
        parts.append("the same again on 4 times the facets")
    return "".join(f", {part}" for part in parts)


def wave_stages(scene: Scene, surface: Heightfield | None) -> list[Stage]:
    if scene.wave is None or scene.light is None or surface is None:
        return _left_out(("interpolate", "transform"), "the scene has no [wave]")
    light = scene.light
    of_theory = {
        "full-wave": _full_wave_stage,
        "iterated-kirchhoff": _iterated_stage,
    }
    made = [
        of_theory.get(theory, _transform_stage)(scene, surface, theory, group)
        for group, theory in assembly.wave_groups(scene).items()
    ]
    if all(s.name != "transform" for s in made):
        return [*_left_out(("interpolate", "transform"), "no theory asked for integrates the surface once"), *made]
    refined = refinement(surface, light.wavelength_nm)
    what = f"the {surface.interpolation} surface between its samples"
    cost = f"about {refined} points per sample and axis"
    return [
        Stage("interpolate", True, what, "scipy", cost),
        *made,
        _trust_stage(surface, scene.wave.theory, light, scene.material.name if scene.material else None),
    ]


def _transform_stage(scene: Scene, surface: Heightfield, theory: str, group: str) -> Stage:
    """The integral over the surface, of one scalar theory."""
    from ..wave.coherence import WindowPlan

    asked, gonio = scene.wave, assembly.gonioreflectometer(scene)
    assert asked is not None
    angles, wavelengths = len(gonio.incoming.theta_deg), len(scene.light.wavelength_nm if scene.light else ())
    count = angles * wavelengths * detector_elements(scene)
    plan = WindowPlan.of(surface, gonio.incoming.coherence_um, asked.windows)
    library = {"opencl": "pyopencl", "reference": "numpy"}.get(asked.method, "finufft")
    return Stage(
        "transform",
        True,
        f"{theory}, method {asked.method!r}, tol = {asked.tol:g}",
        library,
        f"{count:,} directions × wavelengths, {windows_in_words(len(plan.windows), plan.independent)}{_dearer(scene)}",
        group,
    )


def windows_in_words(count: int, independent: float) -> str:
    """How many coherence windows, and how many they are worth since neighbours overlap."""
    if count == 1:
        return "1 coherence window"
    return f"{count} overlapping coherence windows, worth {min(independent, count):.2g} independent ones"


def _full_wave_stage(scene: Scene, surface: Heightfield, theory: str, group: str) -> Stage:
    """The rigorous solver; InputError for a surface that is no one-dimensional profile."""
    from ..wave.full_wave import forecast

    expected = forecast(assembly.waves(scene, theory), surface, assembly.gonioreflectometer(scene).incoming)
    why = "rigorous, of a one-dimensional profile, TE and TM" + ("" if expected.affordable else ": TOO LARGE")
    return Stage("full wave", expected.affordable, why, "scipy", expected.size, group)


def _trust_stage(surface: Heightfield, theories: list[str], light: Light, material: str | None) -> Stage:
    """How far the theories are from rigorous solutions of surfaces like this one, as the verdict has it."""
    found = expectations(surface, theories, light, material)
    if not found:
        return Stage("expected error", False, "nothing to expect (a plane, or another theory)")
    known = any(e.basis != "none" for e in found)
    return Stage("expected error", known, f"{'; '.join(e.short for e in found)}; from docs/trust.md")


def _iterated_stage(scene: Scene, surface: Heightfield, theory: str, group: str) -> Stage:
    from ..wave.iterated.forecast import forecast

    solver = assembly.waves(scene, theory)
    what, cost = forecast(solver, surface, assembly.gonioreflectometer(scene).incoming)
    return Stage("iterate", True, what, "numpy" if surface.is_profile else "pyopencl", cost, group)


def _dearer(scene: Scene) -> str:
    """What the options of [wave] cost: transforms of each window that plain waves do at once."""
    asked, light = scene.wave, scene.light
    if asked is None or light is None:
        return ""
    angles, wavelengths = len(light.theta_i_deg), len(light.wavelength_nm)
    local = (2 if light.polarisation == "unpolarised" else 1) * wavelengths if asked.fresnel == "local" else 1
    local = 12 * wavelengths if asked.polarised else local
    pairs = angles * (detector_elements(scene) if asked.shadowing else 1)
    if local == 1 and not asked.shadowing:
        return ""
    finer = " (of those pairs θ_i, θ_o that see shadows), on at least 4 times the points" if asked.shadowing else ""
    return f", each up to {pairs * local:,} transforms{finer}"


def verdict_stages(scene: Scene) -> list[Stage]:
    results = result_groups(scene)
    file = scene.measured.file if scene.measured is not None else ""
    why = Path(file).name if file else "the scene has no [measured]"
    measured = Stage("measured", bool(file), why, "numpy" if file else "", part="surface")
    if not results:
        return [measured, *_left_out(("shift", "compare", "colour"), "no result to judge")]
    fitted = scene.light is None or len(scene.light.wavelength_nm) >= FEWEST_FOR_SHIFT
    few = f"fewer than {FEWEST_FOR_SHIFT} wavelengths"
    why = f"linear shift of {', '.join(results)}" if fitted else few
    shift = Stage("shift", fitted, why, "lmfit" if fitted else "", part="comparison")
    if len(results) < 2:
        return [measured, shift, *_left_out(("compare", "colour"), f"nothing to compare {results[0]} with")]
    why = " with ".join(results) if len(results) == 2 else ", ".join(results) + " with each other"
    return [
        measured,
        shift,
        Stage("compare", True, why, "scipy", f"pairs: {len(results) * (len(results) - 1) // 2}", "comparison"),
        Stage("colour", True, "ΔE₀₀ and RGB of each result", "colour-science"),
    ]


def output_stages(scene: Scene) -> list[Stage]:
    file, page = scene.output.file, scene.output.report
    libraries = "matplotlib, jinja2" if page else ""
    return [
        Stage("save", bool(file), str(file) if file else "no output.file", "h5netcdf" if file else "", part="save"),
        Stage("report", bool(page), str(page) if page else "no output.report", libraries, part="report"),
    ]
