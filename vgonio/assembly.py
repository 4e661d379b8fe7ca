"""From a scene to the objects that do the work: surface, gonioreflectometer, solvers, measured data.

Each is made only when asked for, so that a scene without waves never loads a wave library and one without rays never
loads the ray tracer.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from .errors import InputError
from .materials import Material, stack
from .scene import Scene

if TYPE_CHECKING:
    import xarray as xr

    from .measure import Gonioreflectometer
    from .surface import Heightfield

Progress = Callable[[float], None]
T = TypeVar("T")


# ---- the surface
def source_surface(scene: Scene) -> Heightfield:
    """The surface as its file or generator gives it, with the scene's overrides of pitch, unit and interpolation."""
    from . import surface

    asked = _required(scene.surface, "surface")
    if asked.file is not None:
        return surface.read(
            scene.resolve(asked.file),
            pitch_um=asked.pitch_um,
            height_unit=asked.height_unit,
            interpolation=asked.interpolation,
            periodic=asked.periodic,
        )
    parameters = dict(asked.generate or {})
    made = getattr(surface, parameters.pop("kind"))(**parameters)
    changes = {k: getattr(asked, k) for k in ("interpolation", "periodic") if getattr(asked, k) is not None}
    return made.replace(**changes) if changes else made


def levelling(scene: Scene, source: Heightfield) -> str:
    """What the scene asks for; by default a plane off a measured field, nothing off a periodic or generated one."""
    asked = _required(scene.surface, "surface")
    return asked.level or ("none" if source.periodic or asked.generate is not None else "plane")


def prepared_surface(scene: Scene, source: Heightfield | None = None) -> Heightfield:
    """The surface that is measured: read or generated, then cropped, outliers out, filled, levelled and filtered.

    Raises InputError for missing points that the scene does not fill.
    """
    from . import surface

    asked = _required(scene.surface, "surface")
    made = source_surface(scene) if source is None else source
    if asked.crop_um is not None:
        made = made.cropped(asked.crop_um)
    if asked.outliers is not None:
        before, made = made.missing, surface.remove_outliers(made, asked.outliers)
        if made.missing > before and asked.fill == "error":
            raise _marked(made, before, asked.outliers)
    if made.missing:
        if asked.fill == "error":
            made.require_complete()
        made = surface.fill(made, asked.fill)
    level = levelling(scene, made)
    if level != "none":
        made = surface.level(made, level)
    if asked.filter is not None and (asked.filter.s_um or asked.filter.l_um):
        made = surface.gaussian_filter(made, s_um=asked.filter.s_um, l_um=asked.filter.l_um)
    return made


def _marked(made: Heightfield, before: int, limit: float) -> InputError:
    """That the outlier filter left points missing which nothing fills."""
    also = f", beside {before} that the file lacks" if before else ""
    return InputError(
        f"surface.outliers = {limit:g} marks {made.missing - before} of {made.z.size} points of "
        f"{made.name or 'the surface'} as missing{also}, and nothing says what they get: add "
        'fill = "interpolate" to [surface], or take a larger outliers'
    )


# ---- light, detector, material
def scene_material(scene: Scene) -> Material:
    """The material, checked against the scene's wavelengths; MaterialError outside its table."""
    asked = _required(scene.material, "material")

    def named(table: Any) -> Any:
        return table.name if table.name is not None else scene.resolve(table.file or "")

    made = stack([(named(film), film.thickness_nm) for film in asked.film], on=named(asked))
    if scene.light is not None:
        made.check(scene.light.wavelength_nm)
    return made


def gonioreflectometer(scene: Scene) -> Gonioreflectometer:
    """The instrument with the scene's light and detector."""
    from .measure import Gonioreflectometer

    light, detector = _required(scene.light, "light"), _required(scene.detector, "detector")
    source: dict[str, Any] = {
        "theta_i_deg": light.theta_i_deg,
        "phi_i_deg": light.phi_i_deg,
        "coherence_um": light.coherence_um,
        "divergence_deg": light.divergence_deg,
        "polarisation": light.polarisation,
    }
    if detector.kind == "hemisphere":
        resolution: dict[str, float] = (
            {} if detector.resolution_deg is None else {"resolution_deg": detector.resolution_deg}
        )
        return Gonioreflectometer.hemisphere(**source, **resolution)
    return Gonioreflectometer(theta_o_deg=detector.theta_o_deg, aperture_deg=detector.aperture_deg, **source)


# ---- solvers
def rays(scene: Scene, progress: Progress | None = None) -> Any:
    """The ray solver of [geometric]."""
    from .geometric import RayOptics

    asked, light = _required(scene.geometric, "geometric"), _required(scene.light, "light")
    given: dict[str, Any] = {} if asked.max_bounces is None else {"max_bounces": asked.max_bounces}
    return RayOptics(
        material=scene_material(scene),
        wavelength_nm=light.wavelength_nm,
        rays=asked.rays,
        seed=asked.seed,
        tol=asked.tol,
        tracer=asked.tracer,
        estimator=asked.estimator,
        polarised=asked.polarised,
        statistics=asked.statistics,
        refinement_check=asked.refinement_check,
        threads=_threads(),
        progress=progress,
        **given,
    )


def _threads() -> int | None:
    """What --threads set for the numerical libraries holds for the ray tracer's threads as well."""
    asked = os.environ.get("OMP_NUM_THREADS", "")
    return int(asked) if asked.isdigit() and int(asked) > 0 else None


def waves(scene: Scene, theory: str, progress: Progress | None = None) -> Any:
    """The wave solver of [wave] for one of its theories."""
    from .wave import FullWave, IteratedKirchhoff, Kirchhoff

    asked, light = _required(scene.wave, "wave"), _required(scene.light, "light")
    given: dict[str, Any] = {} if progress is None else {"progress": progress}
    if theory == "full-wave":
        return FullWave(
            material=scene_material(scene),
            wavelength_nm=light.wavelength_nm,
            tol=asked.tol,
            windows=asked.windows,
            **given,
        )
    if theory == "iterated-kirchhoff":
        asked_for = {k: getattr(asked, k) for k in ("bounces", "window_um", "windows") if getattr(asked, k) is not None}
        return IteratedKirchhoff(
            material=scene_material(scene),
            wavelength_nm=light.wavelength_nm,
            tol=asked.tol,
            polarised=asked.polarised,
            **asked_for,
            **given,
        )
    return Kirchhoff(
        material=scene_material(scene),
        wavelength_nm=light.wavelength_nm,
        tol=asked.tol,
        method=asked.method,
        theory=theory,
        windows=asked.windows,
        shadowing=asked.shadowing,
        fresnel=asked.fresnel,
        polarised=asked.polarised,
        energy=asked.energy,
        renormalise=asked.renormalise,
        **given,
    )


def wave_groups(scene: Scene) -> dict[str, str]:
    """Names of the result's wave groups and their theories: `waves` is the first, further ones are waves_<theory>."""
    theories = scene.wave.theory if scene.wave is not None else []
    return {"waves" if i == 0 else "waves_" + t.replace("-", "_"): t for i, t in enumerate(theories)}


def measured(scene: Scene) -> xr.Dataset:
    """The measured BRDF of [measured]."""
    from . import measure
    from .measure import formats

    asked = _required(scene.measured, "measured")
    path = scene.resolve(asked.file)
    given = {k: v for k, v in asked.model_dump(exclude={"file"}).items() if v is not None}
    known = formats.options(formats.FORMATS[formats.recognise(path, asked.format)].read)
    return measure.read(path, **{k: v for k, v in _scene_angles(scene).items() if k in known} | given)


def _scene_angles(scene: Scene) -> dict[str, Any]:
    """The angles of the scene as options of readers that can read at any: what is simulated is then compared."""
    angles: dict[str, Any] = {} if scene.light is None else {"theta_i_deg": scene.light.theta_i_deg}
    asked = scene.measured
    if scene.detector is None or (asked and (asked.theta_o_deg or asked.resolution_deg)):
        return angles
    if scene.detector.kind == "hemisphere":
        return angles | {"resolution_deg": scene.detector.resolution_deg or 5.0}
    return angles | {"theta_o_deg": scene.detector.theta_o_deg}


@dataclass(frozen=True)
class Inputs:
    """Everything that a scene reads: the surface as found and as prepared, the material, the measured BRDF."""

    source: Heightfield | None
    surface: Heightfield | None
    material: Material | None
    measured: xr.Dataset | None


def gather(scene: Scene) -> Inputs:
    """Read and check all inputs of a scene, before any work starts."""
    source = source_surface(scene) if scene.surface is not None else None
    return Inputs(
        source,
        prepared_surface(scene, source) if source is not None else None,
        scene_material(scene) if scene.material is not None else None,
        measured(scene) if scene.measured is not None else None,
    )


def _required(table: T | None, name: str) -> T:
    if table is None:
        raise InputError(f"the scene has no table [{name}]")
    return table
