"""From the reflections of every window to means, standard errors and Mueller matrices; what the user has to be told."""

from __future__ import annotations

import warnings

import numpy as np
import xarray as xr

from ...dataset import label
from ...errors import VgonioWarning
from ..quadrature import Floats
from .diffraction import Diffraction
from .place import Places
from .profile import Reflections

GROWING = 0.9  # power of one reflection over that before from which on the series counts as not converging
MISSED = 0.05  # share of the light that meets the surface again outside the patch, from which on a warning says so


def mean(found: list[Reflections], places: Places, name: str) -> tuple[Floats, Floats]:
    """Mean over windows of a variable and its standard error: power sent out over power received, each summed.

    The standard error is that of a ratio of means; one window says nothing of it: NaN.
    """
    values, caught = np.stack([getattr(o, name) for o in found]), np.stack([o.caught for o in found])
    if values.ndim == 5:
        caught = caught[:, None, :, None]
    else:
        caught = caught[:, None]
    share = np.maximum(caught.mean(axis=0), 1e-300)
    average = values.mean(axis=0) / share
    if len(found) < 2:
        return average, np.full(average.shape, np.nan)
    left = (values - average * caught) / share
    return average, np.sqrt(np.sum(left**2, axis=0) / (len(found) - 1) / places.independent)


def with_mueller(data: xr.Dataset, found: list[Reflections], places: Places) -> xr.Dataset:
    """With Mueller matrices (…, stokes_out, stokes_in) of the coherent sum."""
    over = (*data.brdf.dims, "stokes_out", "stokes_in")
    for name, a in zip(("mueller", "mueller_stderr"), mean(found, places, "mueller")):
        data[name] = (over, np.moveaxis(a, 0, -1).reshape(*a.shape[1:], 4, 4))
    return label(data.assign_coords(stokes_out=list("IQUV"), stokes_in=list("IQUV")))


def stacked(spectrum: list[Reflections]) -> Reflections:
    return Reflections(
        np.stack([o.brdf for o in spectrum], axis=-1),
        np.stack([o.energy for o in spectrum], axis=-1),
        max(o.used for o in spectrum),
        np.stack([o.mueller for o in spectrum], axis=-1),
        np.stack([o.caught for o in spectrum], axis=-1),
        diffraction=Diffraction.worst(o.diffraction for o in spectrum),
        pairs_error=max(o.pairs_error for o in spectrum),
    )


def check_series(data: xr.Dataset, tol: float) -> None:
    """Warn where the last reflection still sends out more than `tol` and hardly less than the one before."""
    done = int(data.attrs["bounces_done"])
    if done < 3:  # of two reflections the second may well be the stronger
        return
    by = data["energy_by_bounce"].values
    last, before = by[:, done - 1], by[:, done - 2]
    bad = (last > tol * by.sum(axis=1)) & (last > GROWING * before)
    if bad.any():
        warnings.warn(
            f"iterated Kirchhoff does not converge: reflection {done} sends out {float(last[bad].max()):.2g} of "
            f"the incident power, {float(np.max(last[bad] / before[bad])):.2g} times as much as the one before",
            VgonioWarning,
            stacklevel=4,
        )


def check_spacing(error: float, tol: float, per: float) -> None:
    """Warn where the spacing of the points makes an error above `tol`, which ends the series of reflections alone."""
    if error > tol:
        warnings.warn(
            f"iterated Kirchhoff: error {error:.1e} of the largest brdf instead of {tol:.1e}: tol ends the series of "
            f"reflections, this is from the spacing of {per:g} points per wavelength, edges of shadows between them. "
            f"Take more points_per_wavelength, or tol = {_rounded_up(error):g}",
            VgonioWarning,
            stacklevel=4,
        )


def _rounded_up(error: float) -> float:
    """To one digit."""
    digit = 10.0 ** np.floor(np.log10(error))
    return float(np.ceil(error / digit) * digit)


def check_patch(data: xr.Dataset) -> None:
    """Warn where much of the light meets the surface again outside the patch, and is lost."""
    missed = float((data.second_hits * data.second_hits_outside).max())
    if missed > MISSED:
        warnings.warn(
            f"iterated Kirchhoff: up to {missed:.0%} of the light meets the surface again outside the patch of "
            f"{data.attrs['window_um']:g} µm (second_hits, second_hits_outside): take a larger window_um",
            VgonioWarning,
            stacklevel=4,
        )
