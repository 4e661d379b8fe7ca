"""What the page says in numbers, taken from the datasets: shares, errors, directions. No drawing here."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr

from ..compare.bright import bright
from ..dataset import ascending

TOO_FEW = 0.25  # relative standard error of a bin above which its split is not drawn: fewer than about 16 rays
NAMES = {"rays": "Rays", "waves": "Waves", "measured": "Measured"}
THEORIES = {
    "kirchhoff": "Kirchhoff",
    "generalized-harvey-shack": "generalized Harvey–Shack",
    "harvey-shack": "Harvey–Shack",
    "full-wave": "full wave",
    "iterated-kirchhoff": "iterated Kirchhoff",
}


def results(tree: xr.DataTree) -> dict[str, xr.Dataset]:
    """The BRDF groups of a result by name: rays, waves, further `waves_…`, measured; those that are there."""
    found = {str(name): node.to_dataset() for name, node in tree.children.items() if "brdf" in node.data_vars}
    order = {"rays": 0, "waves": 1, "measured": 9}
    return {name: ascending(found[name]) for name in sorted(found, key=lambda n: (order.get(n, 5), n))}


def title(name: str, data: xr.Dataset) -> str:
    """What a result is called on the page: Rays, Waves (Kirchhoff), Measured, …"""
    base = NAMES.get(name) or NAMES.get(name.split("_")[0], name)
    theory = str(data.attrs.get("theory", ""))
    return f"{base} ({THEORIES.get(theory, theory)})" if theory and base == "Waves" else base


def in_words(name: str, data: xr.Dataset) -> str:
    """The same inside a sentence: the rays, the waves (Kirchhoff), the measurement."""
    called = title(name, data)
    return "the measurement" if name == "measured" else f"the {called[0].lower()}{called[1:]}"


def in_plane(data: xr.Dataset) -> bool:
    return "theta_o" in data["brdf"].dims


def spectral(data: xr.Dataset, least: int = 3) -> bool:
    return data.sizes["wavelength"] >= least


def near(data: xr.Dataset, wavelength_nm: float | None = None, default: float = 550.0) -> xr.Dataset:
    """One wavelength of a result: the nearest to the one asked, or to 550 nm."""
    return data.sel(wavelength=default if wavelength_nm is None else wavelength_nm, method="nearest")


def incidence(data: xr.Dataset, theta_i: float, tolerance: float = 0.5) -> xr.Dataset | None:
    """One angle of incidence of a result, None where it holds none within the tolerance in degrees."""
    offset = np.abs(data["theta_i"].values - theta_i)
    return data.isel(theta_i=int(offset.argmin())) if offset.min() <= tolerance else None


def direction(data: xr.Dataset, theta_o: float, tolerance: float = 10.0) -> xr.Dataset | None:
    """The detector element nearest to the signed in-plane angle θₒ (data of one θᵢ), None where all are further off.

    Elements that hold no value at all are passed over: an instrument cannot look back into its own source.
    """
    if in_plane(data):
        values = data["brdf"].transpose("theta_o", ...).values
        known = np.isfinite(values).reshape(len(values), -1).any(axis=1)
        offset = np.where(known, np.abs(data["theta_o"].values - theta_o), np.inf)
        return data.isel(theta_o=int(offset.argmin())) if offset.min() <= tolerance else None
    polar, azimuth = (
        np.deg2rad(data["theta_o"].values),
        np.deg2rad(data["phi_o"].values - float(data.get("phi_i", 0.0))),
    )
    t = np.deg2rad(theta_o)
    cosine = np.sin(polar) * np.cos(azimuth) * np.sin(t) + np.cos(polar) * np.cos(t)
    best = int(cosine.argmax())
    return data.isel(cell=best) if np.rad2deg(np.arccos(np.clip(cosine[best], -1, 1))) <= tolerance else None


def bounce_shares(rays: xr.Dataset) -> tuple[xr.DataArray, xr.DataArray]:
    """Share of brdf by number of reflections, and where to trust it; dims of brdf_by_bounce.

    Shares are NaN where nothing was caught. The second array is true where the relative standard error of brdf is
    at most `TOO_FEW`.
    """
    parts = rays["brdf_by_bounce"]
    total = parts.sum("bounce")
    shares = parts / total.where(total > 0)
    if "brdf_stderr" not in rays:
        return shares, total > 0
    return shares, (total > 0) & (rays["brdf_stderr"] <= TOO_FEW * rays["brdf"])


def multiple_share(rays: xr.Dataset) -> tuple[xr.DataArray, xr.DataArray]:
    """Share of light reflected more than once, and its standard error; NaN where too few rays were caught.

    The error follows from those of single and multiple parts where these are given, else from brdf's, as of a count.
    """
    shares, trusted = bounce_shares(rays)
    share = 1.0 - shares.sel(bounce=1)
    if "brdf_by_bounce_stderr" in rays:
        first, total = rays["brdf_by_bounce"].sel(bounce=1), rays["brdf_by_bounce"].sum("bounce")
        errors = rays["brdf_by_bounce_stderr"]
        variance = ((total - first) * errors.sel(bounce=1)) ** 2
        variance = variance + first**2 * (errors.sel(bounce=errors["bounce"] > 1) ** 2).sum("bounce")
        error = variance**0.5 / total.where(total > 0) ** 2
    elif "brdf_stderr" in rays:
        relative = rays["brdf_stderr"] / rays["brdf"].where(rays["brdf"] > 0)
        error = relative * (share * (1 - share)).clip(0, 1) ** 0.5
    else:
        error = xr.full_like(share, np.nan)
    return share.where(trusted), error.where(trusted)


def total_share(rays: xr.Dataset, theta_i: float) -> float:
    """Share of the reflected power that was reflected more than once; NaN without tallies."""
    if "energy_by_bounce" not in rays:
        return float("nan")
    energy = near(rays)["energy_by_bounce"].sel(theta_i=theta_i, method="nearest")
    total = float(energy.sum())
    return 1 - float(energy.sel(bounce=1)) / total if total > 0 else float("nan")


def relative_error(data: xr.Dataset) -> float:
    """Median of the relative standard error over the bright directions that chance has a part in; NaN without any.

    Where rays are sent onto chosen facets, an error of exactly 0 says that no chance was left, not that none is wrong.
    """
    if "brdf_stderr" not in data:
        return float("nan")
    return float((data["brdf_stderr"] / data["brdf"]).where(bright(data) & (data["brdf_stderr"] > 0)).median())


def without_chance(data: xr.Dataset) -> float:
    """Share of the bright directions whose standard error is exactly 0; NaN where no error is known."""
    if "brdf_stderr" not in data or not bool(bright(data).any()):
        return float("nan")
    return float((data["brdf_stderr"] == 0).where(bright(data)).mean())


def tallies(rays: xr.Dataset) -> xr.Dataset:
    """Energy by bounce, absorbed, lost and their sum, shares of the incident power over (theta_i, wavelength)."""
    parts = {"by_bounce": rays["energy_by_bounce"]}
    for name in ("energy_absorbed", "energy_lost"):
        if name in rays:
            parts[name.removeprefix("energy_")] = rays[name]
    total = sum((part.sum("bounce") if "bounce" in part.dims else part) for part in parts.values())
    return xr.Dataset(parts | {"sum": total})


def text(value: Any, default: Any = None) -> Any:
    """An attribute that holds JSON as what it says; anything else as it is."""
    if not isinstance(value, str):
        return default if value is None else value
    try:
        return json.loads(value)
    except ValueError:
        return value
