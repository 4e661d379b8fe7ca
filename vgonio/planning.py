"""What a scene will do before it is done: every stage with its reason, library and rough cost, and what to be wary of.

Planning reads the surface (and a measured file) but simulates nothing and loads no ray or wave library.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import assembly
from .errors import InputError
from .scene import Light, Scene, load_scene
from .validity import expectations, wave_warnings

if TYPE_CHECKING:
    import xarray as xr

    from .surface import Heightfield

# endings that vgonio reads by itself; everything else goes through SurfaceTopography
OWN_FORMATS = (".npz", ".vgms", ".txt", ".asc", ".csv")


FEWEST_FOR_SHIFT = 3  # wavelengths: a line through two points fits whatever they are


@dataclass(frozen=True)
class Stage:
    """One step: needed or left out, and why; the library it loads and what it costs, roughly."""

    name: str
    needed: bool
    why: str
    library: str = ""
    cost: str = ""


@dataclass(frozen=True)
class Plan:
    """The stages of a scene in order, and warnings about where its numbers should not be trusted."""

    title: str
    stages: tuple[Stage, ...]
    warnings: tuple[str, ...] = ()

    def needs(self, name: str) -> bool:
        """Is the stage of that name done? False as well for a stage that is not in the plan."""
        return any(s.name == name and s.needed for s in self.stages)

    def rows(self) -> list[dict[str, Any]]:
        """One dictionary a stage: name, needed, why, library, cost."""
        return [asdict(s) for s in self.stages]

    def to_dict(self) -> dict[str, Any]:
        return {"title": self.title, "stages": self.rows(), "warnings": list(self.warnings)}

    def to_json(self) -> str:
        return json.dumps(self.to_dict(), ensure_ascii=False)

    def __str__(self) -> str:
        cells = [("", "stage", "library", "cost", "why")]
        cells += [("+" if s.needed else "-", s.name, s.library, s.cost, s.why) for s in self.stages]
        widths = [max(len(row[i]) for row in cells) for i in range(4)]
        lines = [f"Plan of {self.title}   (+ is done, - is left out)"]
        lines += ["  ".join([*(c.ljust(w) for c, w in zip(row, widths)), row[4]]).rstrip() for row in cells]
        return "\n".join([*lines, *(f"warning: {w}" for w in self.warnings)])


def plan(scene: str | os.PathLike[str] | Mapping[str, Any] | Scene, overrides: Iterable[str] = ()) -> Plan:
    """The plan of a scene: what is done, left out and why, rough costs, warnings. Nothing is simulated.

    Raises what `simulate` would raise for bad input: InputError, FileFormatError, MaterialError.
    """
    checked = load_scene(scene, overrides)
    check_outputs(checked)
    return plan_of(checked, assembly.gather(checked))


def plan_of(scene: Scene, inputs: assembly.Inputs) -> Plan:
    """The plan of a checked scene whose inputs were read already."""
    stages = [
        *_surface_stages(scene, inputs.source),
        *_ray_stages(scene, inputs.surface),
        *_wave_stages(scene, inputs.surface),
        *_verdict_stages(scene),
        *_output_stages(scene),
    ]
    return Plan(scene.name, tuple(stages), tuple(_warnings(scene, inputs)))


# ---- stages
def _left_out(names: Iterable[str], why: str) -> list[Stage]:
    return [Stage(name, False, why) for name in names]


def _surface_stages(scene: Scene, source: Heightfield | None) -> list[Stage]:
    if scene.surface is None or source is None:
        return _left_out(("read surface", "generate surface"), "the scene has no [surface]")
    from .surface import describe_import

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


def _ray_stages(scene: Scene, surface: Heightfield | None) -> list[Stage]:
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


def _wave_stages(scene: Scene, surface: Heightfield | None) -> list[Stage]:
    if scene.wave is None or scene.light is None or surface is None:
        return _left_out(("interpolate", "transform"), "the scene has no [wave]")
    from .wave.coherence import tile

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
    from .wave.full_wave import forecast

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
    from .wave.iterated.forecast import forecast

    solver = assembly.waves(scene, "iterated-kirchhoff")
    what, cost = forecast(solver, surface, assembly.gonioreflectometer(scene).incoming)
    return Stage("iterate", True, what, "numpy" if surface.is_profile else "pyopencl", cost)


def _duration(seconds: float) -> str:
    if seconds < 2:
        return "seconds"
    return f"about {seconds:.0f} s" if seconds < 120 else f"about {seconds / 60:.0f} min"


def wave_seconds(scene: Scene, surface: Heightfield) -> float:
    """Rough seconds of the wave theories of a scene, all together: right within a factor of a few."""
    from .wave import cost
    from .wave.coherence import REACH, tile
    from .wave.theories import THEORIES

    asked, light, detector = scene.wave, scene.light, scene.detector
    if asked is None or light is None or detector is None:
        return 0.0
    spacing = np.array(surface.pitch_um) / refinement(surface, light.wavelength_nm)
    counts = np.maximum(np.minimum(2 * REACH * light.coherence_um, surface.size_um) / spacing, 16)
    k = 2e3 * np.pi / np.asarray(light.wavelength_nm)
    in_plane = detector.theta_o_deg is not None
    radius = k * light.coherence_um * (np.sin(np.deg2rad(detector.aperture_deg / 2)) if in_plane else 0.0)
    angles, elements = len(light.theta_i_deg), detector_elements(scene)
    local = (2 if light.polarisation == "unpolarised" else 1) if asked.fresnel == "local" else 12 * asked.polarised
    passes = float(angles * (elements if asked.shadowing else 1) * max(1, local * len(k)))
    plain = not local and not asked.shadowing
    one = cost.seconds(
        len(tile(surface, light.coherence_um)),
        float(counts[1] if surface.is_profile else counts.prod()) * (4 if asked.shadowing else 1),
        angles * elements * float(np.sum(np.maximum(0.7 * np.pi * radius**2, 1) if in_plane else 4 + 0 * k)),
        float(2 * radius.max() + 1) if in_plane else 10.0,
        1.0 if plain else passes,
        plain and in_plane and not surface.is_profile and asked.method in ("auto", "nufft"),
        asked.method,
    )
    return one * sum(t in THEORIES for t in asked.theory)


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


def _verdict_stages(scene: Scene) -> list[Stage]:
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


def _output_stages(scene: Scene) -> list[Stage]:
    file, page = scene.output.file, scene.output.report
    return [
        Stage("save", bool(file), str(file) if file else "no output.file", "h5netcdf" if file else ""),
        Stage("report", bool(page), str(page) if page else "no output.report", "matplotlib, jinja2" if page else ""),
    ]


def result_groups(scene: Scene) -> list[str]:
    """Names of the groups that hold a BRDF, in order: rays, waves …, measured."""
    rays = ["rays"] if scene.geometric is not None else []
    return rays + list(assembly.wave_groups(scene)) + (["measured"] if scene.measured is not None else [])


# ---- sizes
def detector_elements(scene: Scene) -> int:
    """Number of detector cones or cells."""
    from .directions import Detector

    asked = scene.detector
    if asked is None:
        return 0
    if asked.theta_o_deg is not None:
        return len(asked.theta_o_deg)
    return len(Detector.hemisphere(5.0 if asked.resolution_deg is None else asked.resolution_deg))


def refinement(surface: Heightfield, wavelength_nm: list[float]) -> int:
    """Points per sample and axis for at most half a cycle of phase between points on the steepest RMS slope."""
    from .surface.plausible import rms_step_slope

    k = 2 * np.pi / (min(wavelength_nm) * 1e-3)
    return max(1, int(np.ceil(2 * k * max(surface.pitch_um) * (1 + rms_step_slope(surface)) / np.pi)))


# ---- checks and warnings
def check_outputs(scene: Scene) -> None:
    """Raise InputError for an output that could not be written, or that would overwrite an input."""
    for name, endings in ((scene.output.file, (".nc", ".nc4", ".h5")), (scene.output.report, (".html", ".htm"))):
        if name is not None:
            check_output(scene.resolve(name), endings, scene.inputs)


def check_output(path: Path, endings: tuple[str, ...], inputs: Iterable[Path] = ()) -> None:
    """Raise InputError unless `path` has one of the endings and its folder is, or can be made, writable."""
    if path.suffix.lower() not in endings:
        raise InputError(f"output {path.name!r}: the name has to end in {' or '.join(endings)}")
    if path.is_dir():
        raise InputError(f"output {path} is a folder")
    if any(path.resolve() == other.resolve() for other in inputs):
        raise InputError(f"output {path} would overwrite an input of the scene")
    folder = next(p for p in path.resolve().parents if p.exists())
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        raise InputError(f"output {path} cannot be written: {folder} is not a writable folder")


def with_folder(path: Path) -> Path:
    """The same path, its folder made where it was missing; InputError where it cannot be."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise InputError(f"cannot make the folder {path.parent}: {e.strerror or e}") from None
    return path


def _warnings(scene: Scene, inputs: assembly.Inputs) -> list[str]:
    found: list[str] = []
    scalar = [t for t in scene.wave.theory if t != "full-wave"] if scene.wave is not None else []
    if inputs.surface is not None and scene.wave is not None and scalar:
        found += wave_warnings(inputs.surface, scalar, scene.light, _largest_theta_o(scene), scene.wave.shadowing)
        found += _long(scene, inputs.surface)
    if inputs.measured is not None and scene.light is not None:
        found += _measured_warnings(inputs.measured, scene.light)
    return found


def _long(scene: Scene, surface: Heightfield) -> list[str]:
    """A line where the waves are long work, and whether they would be begun at all."""
    from .wave import cost

    expected = wave_seconds(scene, surface)
    if expected <= cost.WARN_SECONDS:
        return []
    refused = f"; more than {cost.MOST_SECONDS / 3600:.0f} h are refused" if expected > cost.MOST_SECONDS else ""
    return [f"waves: {cost.remedy(expected)}{refused}"]


def _largest_theta_o(scene: Scene) -> float:
    asked = scene.detector
    if asked is None:
        return 0.0
    return 90.0 if asked.theta_o_deg is None else float(np.max(np.abs(asked.theta_o_deg)))


def _measured_warnings(data: xr.Dataset, light: Light) -> list[str]:
    found = []
    for name, asked, unit in (("theta_i", light.theta_i_deg, "°"), ("wavelength", light.wavelength_nm, " nm")):
        have = np.asarray(data[name], float)
        outside = [a for a in asked if not have.min() - 1e-6 <= a <= have.max() + 1e-6]
        if outside:
            found.append(
                f"{name} of the measured file goes from {have.min():g} to {have.max():g}{unit}: "
                f"{len(outside)} of {len(asked)} values of the scene are outside and cannot be compared"
            )
    return found
