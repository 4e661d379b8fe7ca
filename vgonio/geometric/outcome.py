"""From tallies to the dataset: BRDF and energies by number of reflections, standard errors, attributes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import brdf_dataset, versions
from ..directions import Detector, Incoming
from .sampling import relative_error
from .tally import Tally

if TYPE_CHECKING:
    from .rays import RayOptics

Floats = NDArray[np.float64]
ERROR_IS = (
    "chance alone: of sampling the facets as they are; exactly 0 where all light comes from known facets and where no "
    "light came. What the size of the facets does is not in it: refinement_check = true tells"
)
Variables = dict[str, tuple[tuple[str, ...], Floats]]


def dataset(solver: RayOptics, tallies: list[Tally], incoming: Incoming, detector: Detector) -> xr.Dataset:
    """The result of `solver` from the tally of every incidence, (theta_i, detector, wavelength)."""
    n = np.array([t.rays for t in tallies], float)
    shortcut = np.stack([shortcut_error(t) for t in tallies])
    variables = brdf_variables(tallies, n, detector) | energy_variables(tallies)
    variables |= {
        "averaged_shortcut_error": (("theta_i", "wavelength"), shortcut),
        "rays": (("theta_i",), n.astype(np.int64)),
    }
    coords: dict[str, Any] = {"bounce": np.arange(1, solver.bounces + 1)}
    if solver.polarised:
        variables |= mueller_variables(tallies, n, detector)
        coords |= {"stokes_out": list("IQUV"), "stokes_in": list("IQUV")}
    error = float(max(relative_error(t) for t in tallies))
    made = brdf_dataset(
        variables,
        incoming.theta_deg,
        solver.wavelength_nm,
        detector,
        phi_i_deg=incoming.phi_deg,
        coords=coords,
        attrs=attributes(solver, incoming, error, float(np.abs(shortcut).max())),
    )
    made["brdf_stderr"].attrs["comment"] = ERROR_IS
    return made


def attributes(solver: RayOptics, incoming: Incoming, error: float, shortcut: float) -> dict[str, Any]:
    """How the result was made and what its errors are: `error` achieved, `shortcut` of unpolarised reflectances."""
    return {
        "method": "rays: geometric optics, Stokes vectors from hit to hit",
        "solver": "RayOptics",
        "material": solver.material.name,  # type: ignore[union-attr]
        "material_source": solver.material.source,  # type: ignore[union-attr]
        "polarisation": incoming.polarisation,
        "seed": solver.seed,
        "rays_asked": solver.rays,
        "tolerance_asked": "none" if solver.tol is None else solver.tol,
        "error_achieved": error,
        "error_estimate": "largest relative standard error where brdf exceeds 1e-3 of its largest value "
        "per theta_i and wavelength, from pairs of rays in one cell of the starts and from points on facets",
        "error_leaves_out": f"what finer facets change (refinement = {solver.refinement}): errors are those of "
        "sampling the facets as they are, 0 where no sampling is needed; refinement_check tells",
        "averaged_shortcut": "the product of unpolarised reflectances would have been off by up to "
        f"{100 * shortcut:.2g} % in the power of two and more reflections",
        "max_bounces": solver.max_bounces,
        "bounce_last": f"{solver.bounces} gathers {solver.bounces} and more reflections",
        "versions": versions(),
    }


def brdf_variables(tallies: list[Tally], n: Floats, detector: Detector) -> Variables:
    """`brdf` in all and by number of reflections, each with its standard error, from n (t,) rays."""
    over = ("theta_i", *detector.dims, "wavelength")
    by = np.moveaxis(np.stack([t.caught for t in tallies]), 1, 0)
    variance = np.moveaxis(np.stack([t.caught_variance for t in tallies]), 1, 0)
    scale = 1 / (n[:, None] * detector.projected_solid_angle)[..., None]
    return {
        "brdf": (over, by.sum(axis=0) * scale),
        "brdf_stderr": (over, np.sqrt(variance.sum(axis=0)) * scale),
        "brdf_by_bounce": (("bounce", *over), by * scale),
        "brdf_by_bounce_stderr": (("bounce", *over), np.sqrt(variance) * scale),
    }


def energy_variables(tallies: list[Tally]) -> Variables:
    """Shares of the incident power, each tallied by itself."""
    over = ("theta_i", "wavelength")
    # a difference of sums: rounding may leave −1e-16 where nothing is absorbed
    absorbed = np.maximum(np.stack([t.absorbed / t.rays for t in tallies]), 0.0)
    return {
        "energy_by_bounce": (("theta_i", "bounce", "wavelength"), np.stack([t.upward / t.rays for t in tallies])),
        "energy_absorbed": (over, absorbed),
        "energy_lost": (over, np.stack([t.lost / t.rays for t in tallies])),
    }


def shortcut_error(t: Tally) -> Floats:
    """(w,) relative error of the product of unpolarised reflectances over paths of two and more; 0 without any."""
    return np.where(t.multiple > 0, t.averaged / np.where(t.multiple > 0, t.multiple, 1.0) - 1, 0.0)


def mueller_variables(tallies: list[Tally], n: Floats, detector: Detector) -> Variables:
    """`mueller` and its standard error, (theta_i, detector, wavelength, stokes_out, stokes_in), from n (t,) rays."""
    scale = 1 / (n[:, None] * detector.projected_solid_angle)[:, :, None, None, None]
    over = ("theta_i", *detector.dims, "wavelength", "stokes_out", "stokes_in")

    def variable(values: list[Floats]) -> Floats:
        return np.moveaxis(np.stack(values), -1, 2)

    return {
        "mueller": (over, variable([t.mueller for t in tallies]) * scale),
        "mueller_stderr": (over, np.sqrt(variable([t.mueller_variance for t in tallies])) * scale),
    }
