"""What multiple reflections of waves make of the reflected power, by reflection, interference and diffraction."""

from __future__ import annotations

import xarray as xr

from . import quantities as q
from .style import angle
from .tables import number, percent


def shares(data: xr.Dataset) -> xr.Dataset | None:
    """Of the reflected power, near 550 nm, over theta_i; None for waves that are reflected once.

    later : what the second and all further reflections would send out each by itself;  interference : what they and the
    first add to that or take away in the coherent sum;  diffraction : what diffraction does then. With the first
    reflection they add up to 1.
    """
    if not {"energy_by_bounce", "energy_interference", "energy_reflected"} <= set(data.data_vars):
        return None
    if data.sizes["bounce"] < 2:
        return None
    near = q.near(data)
    whole = near["energy_reflected"].where(near["energy_reflected"] > 0)
    later = near["energy_by_bounce"].sel(bounce=near["bounce"] > 1).sum("bounce")
    parts = {"later": later, "interference": near["energy_interference"]}
    if "energy_diffraction" in near:
        parts["diffraction"] = near["energy_diffraction"]
    return xr.Dataset({name: part / whole for name, part in parts.items()})


def reflections_in_words(name: str, data: xr.Dataset) -> str | None:
    """Of the incidence at which later reflections have the largest share; None where there are none to speak of."""
    found = shares(data)
    if found is None or not bool(found["later"].notnull().any()):
        return None
    worst = found.isel(theta_i=int(found["later"].fillna(-1.0).argmax("theta_i")))
    where = f"at θᵢ = {angle(float(worst['theta_i']))}, {number(float(q.near(data)['wavelength']))} nm"
    if not float(worst["later"]) > 0:
        return f"No light of {q.in_words(name, data)} is reflected more than once."
    parts = [f"{percent(float(worst['later']))} of the reflected power by themselves"]
    parts += [f"{_signed(float(worst[part]))} by {part}" for part in ("interference", "diffraction") if part in worst]
    most = ", where their share is largest" if data.sizes["theta_i"] > 1 else ""
    return f"Multiple reflections of {q.in_words(name, data)} make {', '.join(parts)} ({where}{most})."


def _signed(share: float) -> str:
    return ("+" if share > 0 else "") + percent(share)
