"""Libraries, which a process loads once: what each part of a run needs of them, and what that costs the first one."""

from __future__ import annotations

import sys
from collections.abc import Iterable

from .. import assembly
from ..accuracy.speeds import Speeds
from ..scene import Scene
from ..surface import Heightfield
from .sizes import FEWEST_FOR_SHIFT, result_groups

Cost = tuple[float, float]  # seconds, bytes
# library → what Python holds once it is loaded, and its share of what a part of the smallest scene loads. Drawing,
# colours and fits, which one part loads there, were measured apart; so were the formats of instruments
LIBRARIES: dict[str, tuple[str, str, float]] = {
    "Python": ("sys", "start", 1.0),
    "generators": ("vgonio.surface", "surface", 1.0),
    "SurfaceTopography": ("SurfaceTopography", "save", 1.3),
    "dask.array": ("dask.array", "surface summary", 1.0),  # by xarray, for its first dataset
    "embreex": ("embreex", "rays", 1.0),
    "finufft": ("finufft", "waves", 1.0),
    "pyopencl": ("pyopencl", "waves", 1.0),
    "matplotlib": ("matplotlib.figure", "comparison", 0.55),
    "colour": ("colour", "comparison", 0.45),
    "lmfit": ("lmfit", "comparison", 0.5),
    "h5netcdf": ("h5netcdf", "save", 1.0),
    "page": ("vgonio.report.document", "report", 1.0),
}


def costs(
    scene: Scene, surface: Heightfield | None, parts: Iterable[str], speeds: Speeds, new_process: bool
) -> dict[str, Cost]:
    """Part → (seconds, bytes) of the libraries that it is the first to need.

    parts : in their order;  new_process : of a run in a process of its own, otherwise of one in this process, which
    has started and may have loaded more
    """
    out, have = dict[str, Cost](), set[str]() if new_process else already()
    for part in parts:
        of_part = needed(scene, surface, part)
        out[part] = cost(of_part - have, speeds)
        have |= of_part
    return out


def cost(libraries: Iterable[str], speeds: Speeds) -> Cost:
    """Seconds and bytes of loading them."""
    found = [(LIBRARIES[n][2], speeds.loading.get(LIBRARIES[n][1], (0.0, 0.0))) for n in libraries]
    return sum(share * s for share, (s, _) in found), sum(share * b for share, (_, b) in found)


def already() -> set[str]:
    """The libraries that this process has."""
    return {name for name, (module, _, _) in LIBRARIES.items() if module in sys.modules}


def needed(scene: Scene, surface: Heightfield | None, part: str) -> set[str]:
    """The libraries of a part of the scene's run."""
    if part.startswith("waves"):
        return of_theory(assembly.wave_groups(scene)[part], surface is not None and surface.is_profile)
    if part == "surface":
        return _of_surface(scene)
    if part == "comparison":
        return _of_comparison(scene)
    if part == "report":
        return {"page", "matplotlib", "colour"} if _spectra(scene) else {"page", "matplotlib"}
    return {"start": {"Python"}, "surface summary": {"dask.array"}, "rays": OF_RAYS, "save": {"h5netcdf"}}[part]


OF_RAYS = {"dask.array", "embreex"}


def of_theory(theory: str, profile: bool) -> set[str]:
    """Those of a wave solver; the rigorous one and the iterated one of a profile are numpy and scipy alone."""
    if theory == "full-wave" or (theory == "iterated-kirchhoff" and profile):
        return {"dask.array"}
    return {"dask.array", "pyopencl" if theory == "iterated-kirchhoff" else "finufft"}


def _of_surface(scene: Scene) -> set[str]:
    from .stages import is_own_format

    file = scene.surface.file if scene.surface is not None else None
    return {"generators"} if file is None or is_own_format(file) else {"generators", "SurfaceTopography"}


def _spectra(scene: Scene) -> bool:
    return scene.light is None or len(scene.light.wavelength_nm) >= FEWEST_FOR_SHIFT


def _of_comparison(scene: Scene) -> set[str]:
    """Shifts of several angles are fitted, colours are those of several results."""
    if not _spectra(scene):
        return set()
    fitted = {"lmfit"} if scene.light is None or len(scene.light.theta_i_deg) > 1 else set()
    return fitted | ({"matplotlib", "colour"} if len(result_groups(scene)) > 1 else set())
