"""The stages of a scene: what each is needed for, or why it is left out."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from .. import assembly
from ..scene import Light, Scene
from ..surface import Heightfield
from ..validity import expectations
from .plans import Stage
from .rough import wave_seconds
from .sizes import detector_elements, refinement, result_groups

# endings that vgonio reads by itself; everything else goes through SurfaceTopography
OWN_FORMATS = (".npz", ".vgms", ".txt", ".asc", ".csv")
FEWEST_FOR_SHIFT = 3  # wavelengths: a line through two points fits whatever they are


def _left_out(names: Iterable[str], why: str) -> list[Stage]:
    return [Stage(name, False, why) for name in names]


def surface_stages(scene: Scene, source: Heightfield | None) -> list[Stage]:
    if scene.surface is None or source is None:
        return _left_out(("read surface", "generate surface"), "the scene has no [surface]")
    from ..surface import describe_import

    asked, size = scene.surface, describe_import(source)
    if asked.file is not None:
        path = Path(asked.file)
        library = "numpy" if path.suffix.lower() in OWN_FORMATS else "SurfaceTopography"
        first = Stage("read surface", True, path.name, library, size)
    else:
        first = Stage("generate surface", True, f"kind {asked.generate['kind']!r}, no file", "numpy", size)  # type: ignore[index]
    level = assembly.levelling(scene, source)
    wanted = asked.filter is not None and (asked.filter.s_um or asked.filter.l_um)
    cut_offs = ", ".join(f"{k} = {v:g} µm" for k, v in (asked.filter or {}) if v) if wanted else ""
    unlevelled = 'level = "none"' if asked.level else "periodic and generated surfaces are level as they are"
    return [
        first,
        Stage("crop", asked.crop_um is not None, f"crop_um = {asked.crop_um}" if asked.crop_um else "no crop_um"),
        Stage(
            "fill", source.missing > 0, f"{source.missing} missing points" if source.missing else "no point is missing"
        ),
        Stage("level", level != "none", f"{level} removed" if level != "none" else unlevelled),
        Stage(
            "filter",
            bool(wanted),
            f"ISO 16610 Gaussian, {cut_offs}" if wanted else "no filter asked for",
            "scipy" if wanted else "",
        ),
    ]


def ray_stages(scene: Scene, surface: Heightfield | None) -> list[Stage]:
    if scene.geometric is None or scene.light is None or surface is None:
        return _left_out(("mesh", "trace"), "the scene has no [geometric]")
    asked = scene.geometric
    facets = 2 * surface.shape[0] * surface.shape[1]
    angles = len(scene.light.theta_i_deg)
    cap = f", at most (tol = {asked.tol:g})" if asked.tol else ""
    # 24 B a vertex in double precision, 12 B of indices and about 100 B of Embree's hierarchy a facet
    memory = facets * (12 + 12 + 100) / 1e6
    return [
        Stage("mesh", True, "facets for the rays", "numpy", f"{facets:,} facets, {memory:.0f} MB"),
        Stage(
            "trace",
            True,
            "one trace serves all wavelengths",
            {"embree": "embreex", "warp": "warp-lang"}.get(asked.tracer, "numpy"),
            f"{asked.rays * angles:,} rays: {asked.rays:,} × {angles} angles{cap}{_rays_beside(scene)}",
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
        # each with its error in double precision; measured: in plane few paths are caught, on a hemisphere all
        whole = scene.detector is not None and scene.detector.theta_o_deg is None
        slower = f", about {1 + 0.1 * len(light.wavelength_nm):.1f} times the seconds" if whole else ""
        parts.append(f"Mueller matrices of {numbers:,} elements ({16 * numbers / 1e6:.1f} MB){slower}")
    if asked.statistics:
        parts.append(f"statistics of {min(asked.rays, 50_000) * angles:,} rays more")
    if asked.refinement_check:
        parts.append("the same again on 4 times the facets")
    return "".join(f", {part}" for part in parts)


def wave_stages(scene: Scene, surface: Heightfield | None) -> list[Stage]:
    if scene.wave is None or scene.light is None or surface is None:
        return _left_out(("interpolate", "transform"), "the scene has no [wave]")
    from ..wave.coherence import tile

    light = scene.light
    scalar = [t for t in scene.wave.theory if t not in ("full-wave", "iterated-kirchhoff")]
    rigorous = [_full_wave_stage(scene, surface)] if "full-wave" in scene.wave.theory else []
    rigorous += [_iterated_stage(scene, surface)] if "iterated-kirchhoff" in scene.wave.theory else []
    if not scalar:
        return [*_left_out(("interpolate", "transform"), "no theory asked for integrates the surface once"), *rigorous]
    count = len(light.theta_i_deg) * len(light.wavelength_nm) * detector_elements(scene) * len(scalar)
    windows = len(tile(surface, light.coherence_um))
    library = {"opencl": "pyopencl", "reference": "numpy"}.get(scene.wave.method, "finufft")
    refined = refinement(surface, light.wavelength_nm)
    return [
        Stage(
            "interpolate",
            True,
            f"the {surface.interpolation} surface between its samples",
            "scipy",
            f"about {refined} points per sample and axis",
        ),
        Stage(
            "transform",
            True,
            ", ".join(scalar) + f", method {scene.wave.method!r}, tol = {scene.wave.tol:g}",
            library,
            f"{count:,} directions × wavelengths, {windows} coherence windows{_dearer(scene)}, "
            f"{_duration(wave_seconds(scene, surface))}",
        ),
        _trust_stage(surface, scene.wave.theory, light),
        *rigorous,
    ]


def _full_wave_stage(scene: Scene, surface: Heightfield) -> Stage:
    """The rigorous solver; InputError for a surface that is no one-dimensional profile."""
    from ..wave.full_wave import forecast

    expected = forecast(assembly.waves(scene, "full-wave"), surface, assembly.gonioreflectometer(scene).incoming)
    why = "rigorous, of a one-dimensional profile, TE and TM" + ("" if expected.affordable else ": TOO LARGE")
    return Stage("full wave", expected.affordable, why, "scipy", str(expected))


def _trust_stage(surface: Heightfield, theories: list[str], light: Light) -> Stage:
    """How far the theories are from rigorous gratings like this surface."""
    found = expectations(surface, theories, light)
    if not found:
        return Stage("expected error", False, "no rigorous grating to compare with (a plane, or another theory)")
    if any(e.outside for e in found):
        return Stage("expected error", False, "no rigorous grating is like this surface: see the warnings")
    most = "; ".join(f"{e.theory} {e.error[1]:.1%}, worst at {e.theta_i_deg:g}°" for e in found)
    return Stage("expected error", True, f"{most}; from rigorous gratings like this surface (docs/trust.md)")


def _iterated_stage(scene: Scene, surface: Heightfield) -> Stage:
    from ..wave.iterated.forecast import forecast

    solver = assembly.waves(scene, "iterated-kirchhoff")
    what, cost = forecast(solver, surface, assembly.gonioreflectometer(scene).incoming)
    return Stage("iterate", True, what, "numpy" if surface.is_profile else "pyopencl", cost)


def _duration(seconds: float) -> str:
    if seconds < 2:
        return "seconds"
    return f"about {seconds:.0f} s" if seconds < 120 else f"about {seconds / 60:.0f} min"


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
    measured = Stage(
        "measured", bool(file), Path(file).name if file else "the scene has no [measured]", "numpy" if file else ""
    )
    if not results:
        return [measured, *_left_out(("shift", "compare", "colour"), "no result to judge")]
    fitted = scene.light is None or len(scene.light.wavelength_nm) >= FEWEST_FOR_SHIFT
    few = f"fewer than {FEWEST_FOR_SHIFT} wavelengths"
    shift = Stage(
        "shift", fitted, f"linear shift of {', '.join(results)}" if fitted else few, "lmfit" if fitted else ""
    )
    if len(results) < 2:
        return [measured, shift, *_left_out(("compare", "colour"), f"nothing to compare {results[0]} with")]
    why = " with ".join(results) if len(results) == 2 else ", ".join(results) + " with each other"
    return [
        measured,
        shift,
        Stage("compare", True, why, "scipy", f"pairs: {len(results) * (len(results) - 1) // 2}"),
        Stage("colour", True, "ΔE₀₀ and RGB of each result", "colour-science"),
    ]


def output_stages(scene: Scene) -> list[Stage]:
    file, page = scene.output.file, scene.output.report
    return [
        Stage("save", bool(file), str(file) if file else "no output.file", "h5netcdf" if file else ""),
        Stage("report", bool(page), str(page) if page else "no output.report", "matplotlib, jinja2" if page else ""),
    ]
