"""From means over windows to the dataset: standard errors, Mueller matrices, reflected power, attributes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ..dataset import brdf_dataset, label, versions
from ..directions import Detector, Incoming
from .coherence import WindowPlan
from .job import Job
from .quadrature import Floats
from .theories import DESCRIPTION

if TYPE_CHECKING:
    from .kirchhoff import Kirchhoff

MIN_WINDOWS = 4  # fewer independent windows say too little about their spread


def dataset(solver: Kirchhoff, brdf: Floats, stderr: Floats, incoming: Incoming, detector: Detector) -> xr.Dataset:
    """`brdf` and `brdf_stderr` (theta_i, element, wavelength) with what belongs to them."""
    over = ("theta_i", *detector.dims, "wavelength")
    variables: dict[str, tuple[tuple[str, ...], Any]] = {"brdf": (over, brdf), "brdf_stderr": (over, stderr)}
    macro = solver.material.reflectance(  # type: ignore[union-attr]
        incoming.vectors[:, 2], solver.wavelength_nm, incoming.polarisation
    )
    variables["fresnel_macro"] = (("theta_i", "wavelength"), macro)
    if detector.kind == "hemisphere":
        reflected = np.einsum("iew,e->iw", brdf, detector.projected_solid_angle)
        variables["energy_reflected"] = (("theta_i", "wavelength"), reflected)
    return brdf_dataset(
        variables,
        incoming.theta_deg,
        solver.wavelength_nm,
        detector,
        phi_i_deg=incoming.phi_deg,
        attrs={
            "method": f"waves: {DESCRIPTION[solver.theory]}, single scattering, "
            + ("shadowing of source and detector" if solver.shadowing else "no shadowing"),
            "fresnel": "at the half vector" if solver.fresnel == "half" and not solver.polarised else "at each facet",
            "solver": "Kirchhoff",
            "theory": solver.theory,
            "material": solver.material.name,  # type: ignore[union-attr]
            "material_source": solver.material.source,  # type: ignore[union-attr]
            "polarisation": incoming.polarisation,
            "tolerance_asked": solver.tol,
            "backend": f"surface_fourier, {solver.method}",
            "versions": versions(),
            "seed": solver.seed,
        },
    )


def with_mueller(data: xr.Dataset, mueller: Floats, stderr: Floats) -> xr.Dataset:
    """With Mueller matrices (16, theta_i, element, wavelength) and their standard errors."""
    over = (*data.brdf.dims, "stokes_out", "stokes_in")
    for name, values in (("mueller", mueller), ("mueller_stderr", stderr)):
        data[name] = (over, np.moveaxis(values, 0, -1).reshape(*values.shape[1:], 4, 4))
    return label(data.assign_coords(stokes_out=list("IQUV"), stokes_in=list("IQUV")))


def with_energy(data: xr.Dataset, reflected: Floats, stderr: Floats, renormalise: bool) -> xr.Dataset:
    """With the total reflected power (theta_i, wavelength); scaled to the flat surface's reflectance where asked."""
    over = ("theta_i", "wavelength")
    data["energy_reflected"], data["energy_reflected_stderr"] = (over, reflected), (over, stderr)
    if renormalise:
        data = renormalised(data, ("brdf", "brdf_stderr", "mueller", "mueller_stderr"))
    return label(data)


def renormalised(data: xr.Dataset, names: tuple[str, ...]) -> xr.Dataset:
    """The variables `names` that there are times fresnel_macro / energy_reflected, the factor beside them."""
    factor = (data.fresnel_macro / data.energy_reflected.where(data.energy_reflected > 0)).fillna(1.0)
    for name in [n for n in names if n in data]:
        data[name] = (data[name] * factor).transpose(*data[name].dims)
    data["renormalisation"] = factor
    data.attrs["renormalised"] = f"{names[0]} times fresnel_macro / energy_reflected, in `renormalisation`"
    return data


def standard_error(brdf: Floats, square: Floats, single: Floats, job: Job, plan: WindowPlan) -> tuple[Floats, str]:
    """Standard error of the mean: from the spread over windows, or from that over the speckles of too few windows."""
    n = len(plan.windows)
    if plan.independent >= MIN_WINDOWS:
        variance = np.maximum(square - brdf**2, 0) * n / (n - 1)
        return np.sqrt(variance / plan.independent), f"spread over {plan.independent:.1f} effective independent windows"
    # no more speckles than directions, or than the element has room for
    directions = 1 / np.maximum(job.gather(job.weight**2), 1e-300)
    speckles = np.maximum(plan.independent * np.minimum(directions, job.room), 1.0)
    variance = np.maximum(single - brdf**2, 0)
    return (
        np.sqrt(variance / np.maximum(speckles - 1, 1.0)),
        f"spread over the directions within a detector element: only {plan.independent:.1f} independent windows",
    )


def device(method: str) -> str:
    """What the sums run on."""
    if method != "opencl":
        return "CPU"
    from . import opencl

    return f"{opencl.device().name}, {opencl.device().platform}"
