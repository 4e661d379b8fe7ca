"""The one dataset that every result is: dims, units and names of variables and coordinates, and their check.

dims (theta_i, theta_o, wavelength), on a hemisphere (theta_i, cell, wavelength); further dims come first (bounce).
"""

from __future__ import annotations

import functools
import json
import platform
from collections.abc import Callable, Mapping
from typing import Any, ParamSpec, TypeVar

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from .directions import Detector
from .errors import FileFormatError, InputError

P = ParamSpec("P")
R = TypeVar("R")
# name: (units, long_name)
COORDINATES = {
    "theta_i": ("degree", "angle of incidence, signed in the plane of incidence"),
    "theta_o": ("degree", "angle of reflection, signed in plane; polar angle on a hemisphere"),
    "phi_i": ("degree", "azimuth of the plane of incidence"),
    "phi_o": ("degree", "azimuth of the reflected direction"),
    "wavelength": ("nm", "wavelength"),
    "solid_angle": ("sr", "solid angle of the detector element"),
    "distance": ("um", "horizontal distance"),
    "bounce": ("1", "number of reflections; the last entry gathers all higher ones"),
    "order": ("1", "diffraction order"),
    "polarisation": ("1", "TE: E along the grooves (s), TM: H along the grooves (p)"),
    "stokes_out": ("1", "Stokes parameter of the reflected light"),
    "stokes_in": ("1", "Stokes parameter of the incident light"),
    "cell": ("1", "cell of the hemisphere"),
    "theta_h": ("degree", "polar angle of the facets' normals"),
    "phi_h": ("degree", "azimuth of the facets' normals"),
    "theta": ("degree", "polar angle of the direction, signed in its plane"),
    "phi": ("degree", "azimuth of the plane of directions"),
    "projected_solid_angle": ("sr", "integral of cos θ over the element"),
}
VARIABLES = {
    "brdf": ("sr-1", "bidirectional reflectance distribution function"),
    "brdf_stderr": ("sr-1", "standard error of the mean of brdf"),
    "brdf_refinement_change": ("sr-1", "what brdf changes by on twice the mesh refinement, the noise of both included"),
    "brdf_by_bounce": ("sr-1", "part of brdf by number of reflections"),
    "brdf_by_bounce_stderr": ("sr-1", "standard error of the mean of brdf_by_bounce"),
    "brdf_interference": ("sr-1", "interference of the reflections: their coherent sum less the sum of each by itself"),
    "energy_interference": ("1", "interference of the reflections, share of the incident power"),
    "brdf_diffraction": ("sr-1", "what diffraction adds to the coherent sum of reflections"),
    "energy_diffraction": ("1", "what diffraction adds to the sum of reflections, share of the incident power"),
    "second_hits": ("1", "share of mirrored rays from the patch that meet the surface a second time"),
    "second_hits_outside": ("1", "share of those second hits that lie outside the patch"),
    "brdf_by_polarisation": ("sr-1", "brdf for light of one polarisation"),
    "energy_transmitted": ("1", "share of the incident power in the orders inside a loss-free material"),
    "energy_balance": ("1", "reflected, absorbed and lost shares of the incident power together: 1 when exact"),
    "condition_number": ("1", "condition number of the linear system, 1-norm, estimated"),
    "residual": ("1", "relative residual of the linear system"),
    "energy_by_bounce": ("1", "share of the incident power that leaves upward after that many reflections"),
    "energy_absorbed": ("1", "share of the incident power that is absorbed"),
    "energy_lost": ("1", "share of the incident power that leaves through the sides or stops at the bounce limit"),
    "energy_reflected": ("1", "share of the incident power that reaches the hemisphere of the detector"),
    "energy_reflected_stderr": ("1", "standard error of energy_reflected"),
    "fresnel_macro": ("1", "Fresnel reflectance of a flat surface at the angle of incidence"),
    "renormalisation": ("1", "factor that brdf was multiplied by: fresnel_macro over energy_reflected"),
    "efficiency_single": ("1", "diffraction efficiency of the first reflection alone"),
    "efficiency": ("1", "diffraction efficiency: power of the order over incident power"),
    "fresnel": ("1", "Fresnel reflectance at the half vector"),
    "averaged_shortcut_error": (
        "1",
        "relative error that the product of unpolarised reflectances would have made in the power of two and more "
        "reflections",
    ),
    "paths_followed": ("1", "number of rays behind the path statistics, by number of reflections"),
    "path_length": ("um", "mean length of path between the first and the last reflection"),
    "path_length_rms": ("um", "root mean square length of path between the first and the last reflection"),
    "horizontal_distance": ("um", "mean horizontal distance between the first and the last reflection"),
    "second_hit_beyond": ("1", "share of second reflections further than `distance` from the first, horizontally"),
    "last_facet_slope_rms": ("1", "root mean square slope (both axes) of the facet that reflects last"),
    "last_facet_slope_mean": ("1", "mean slope of the facet that reflects last, along the plane of incidence"),
    "rays": ("1", "number of rays traced"),
    "ndf": ("sr-1", "distribution of normals D of the facets"),
    "masking": ("1", "masking G1: visible share of the projected area of the facets that face the direction"),
    "masking_stderr": ("1", "standard error of the mean of masking"),
    "masking_2": ("1", "masking and shadowing G2: share of the facets that source and detector both see"),
    "masking_2_stderr": ("1", "standard error of the mean of masking_2"),
    "projected_area": ("1", "projected area of the facets that face the direction, over the ground area"),
    "brdf_uncorrelated": ("sr-1", "microfacet BRDF with the product of the two G1 in place of G2"),
    "brdf_unmasked": ("sr-1", "microfacet BRDF without masking and shadowing"),
    "mueller": ("sr-1", "Mueller matrix BRDF, not normalised: [0, 0] is the BRDF of unpolarised light"),
    "mueller_stderr": ("sr-1", "standard error of the mean of mueller"),
    "windows": ("1", "effective independent coherence windows"),
}


def label(data: xr.Dataset) -> xr.Dataset:
    """The same dataset with units and long_name on every variable and coordinate that this module knows."""
    for name in data.variables:
        known = COORDINATES.get(str(name)) or VARIABLES.get(str(name))
        if known:
            data[name].attrs.setdefault("units", known[0])
            data[name].attrs.setdefault("long_name", known[1])
    return data


def detector_coords(detector: Detector) -> dict[str, Any]:
    """Coordinates of a result's detector dimension."""
    dim = detector.dims[0]
    coords: dict[str, Any] = {"solid_angle": (dim, detector.solid_angle)}
    if dim == "theta_o":
        return coords | {"theta_o": (dim, detector.theta_deg)}
    return coords | {
        "cell": (dim, np.arange(len(detector))),
        "theta_o": (dim, detector.theta_deg),
        "phi_o": (dim, detector.phi_deg),
    }


def brdf_dataset(
    variables: Mapping[str, tuple[tuple[str, ...], ArrayLike]],
    theta_i_deg: ArrayLike,
    wavelength_nm: ArrayLike,
    detector: Detector,
    *,
    phi_i_deg: float = 0.0,
    coords: Mapping[str, Any] | None = None,
    attrs: Mapping[str, Any] | None = None,
) -> xr.Dataset:
    """A labelled result. `variables` maps a name to (dims, array) as in xarray; attrs become strings and numbers."""
    data = xr.Dataset(
        {k: (dims, np.asarray(v)) for k, (dims, v) in variables.items()},
        coords={
            "theta_i": ("theta_i", np.asarray(theta_i_deg, float)),
            "wavelength": ("wavelength", np.asarray(wavelength_nm, float)),
            "phi_i": float(phi_i_deg),
            **detector_coords(detector),
            **(coords or {}),
        },
        attrs={k: plain(v) for k, v in (attrs or {}).items()},
    )
    return label(data)


def plain(value: Any) -> Any:
    """Attributes in a file are strings and numbers; anything else becomes JSON, a number beyond 64 bits as well."""
    if isinstance(value, (bool, np.bool_)):
        return int(value)
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        return str(value)
    if isinstance(value, (str, int, float, np.integer, np.floating)):
        return value
    return json.dumps(value, default=str)


def versions() -> str:
    """Versions of what made a result, as JSON."""
    from importlib.metadata import PackageNotFoundError, version

    from . import __version__

    found = {"vgonio": __version__, "python": platform.python_version()}
    for name in ("numpy", "scipy", "xarray", "embreex", "finufft", "pyopencl"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return json.dumps(found)


def takes_nodes(function: Callable[P, R]) -> Callable[P, R]:
    """`function` of datasets, which then takes groups of a result (DataTree nodes) as well, also in a dictionary."""

    @functools.wraps(function)
    def taking(*arguments: P.args, **keywords: P.kwargs) -> R:
        given: Any = [_dataset_of(a) for a in arguments]
        named: Any = {k: _dataset_of(v) for k, v in keywords.items()}
        return function(*given, **named)

    return taking


def _dataset_of(value: Any) -> Any:
    if isinstance(value, Mapping) and not isinstance(value, (xr.Dataset, xr.DataTree)):
        return {k: _dataset_of(v) for k, v in value.items()}
    if isinstance(value, xr.DataArray) and value.name == "brdf":
        raise InputError("this is the variable 'brdf' alone: give the dataset that it belongs to")
    if not isinstance(value, xr.DataTree):
        return value
    groups = [k for k, node in value.children.items() if "brdf" in node.data_vars]
    if "brdf" not in value.data_vars and groups:
        raise InputError(f"a whole result has several BRDFs: give one of its groups, as in result[{groups[0]!r}]")
    return value.to_dataset()


def check(data: xr.Dataset, what: str = "result") -> xr.Dataset:
    """Raise FileFormatError unless `data` is one of our results: numbers over angles and wavelengths, none twice.

    InputError for what is no dataset at all.
    """
    if not isinstance(data, xr.Dataset):
        raise InputError(
            f"{what}: a dataset with a BRDF is needed, of measure, read or open, not a {type(data).__name__}"
        )
    dims = data["brdf"].dims if "brdf" in data else ()
    if not {"theta_i", "wavelength"} <= set(dims) or not {"theta_o", "cell"} & set(dims):
        raise FileFormatError(
            f"{what} holds no BRDF of vgonio: a variable 'brdf' over theta_i, theta_o (or cell) and wavelength is "
            f"needed, found {sorted(map(str, data.variables)) or 'nothing'}"
        )
    if data["brdf"].dtype.kind not in "fiu" or data["brdf"].size == 0 or np.isinf(data["brdf"].values).any():
        raise FileFormatError(f"{what}: 'brdf' holds no values, infinite ones, or something that is no number")
    for name in [d for d in ("theta_i", "theta_o", "wavelength") if d in dims]:
        values = data[name].values if name in data.coords else np.zeros(0)
        if values.size == 0 or values.dtype.kind not in "fiu" or not np.isfinite(values).all():
            raise FileFormatError(f"{what}: the coordinate {name!r} of 'brdf' is missing or holds no finite numbers")
        if np.unique(values).size < values.size:
            raise FileFormatError(f"{what}: the coordinate {name!r} of 'brdf' holds a value twice")
    return data


def ascending(data: xr.Dataset) -> xr.Dataset:
    """Sorted by every angle and by wavelength."""
    return data.sortby([d for d in ("theta_i", "theta_o", "wavelength") if d in data["brdf"].dims])
