"""Instruments against each other on the same sample (thesis 2.2.3): deviations at common angles, grazing spectra."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ..dataset import check
from ..errors import InputError, nearest
from ..units import meant_nm
from .hemisphere import interp

Floats = NDArray[np.float64]
SAME_THETA_I = 0.5  # degrees
GRAZING_DEG = (-50.0, -60.0, -70.0, -80.0)
MEAN = "mean of all"


def cross_validate(
    data: Mapping[str, xr.Dataset],
    *,
    wavelength_nm: float | None = None,
    reference: str | None = None,
    theta_i_deg: ArrayLike | None = None,
) -> list[dict[str, Any]]:
    """How far in-plane BRDFs of one sample are apart: a row for each data set and angle of incidence, and one over all.

    data : any number of data sets by name;  reference : name of the one that the others are measured against, else
    the mean of all;  wavelength_nm : one wavelength that all cover (linear in between), else all common ones
    theta_i_deg : angles of incidence, else those that all have (within 0.5°)
    At each θ_i the angles are those of the sparsest set that lie within all, the others linear between theirs.
    Rows: name, theta_i_deg (None: all), angles, mean, largest, bias (mean with sign), relative to the reference (a
    fraction), and the θ_o and wavelength of the largest.
    Raises InputError for fewer than two sets, or where they have nothing in common.
    """
    _require_two(data)
    if reference is not None and reference not in data:
        raise InputError(f"reference {reference!r} is none of the data sets: {nearest(reference, data)}")
    nm = _wavelengths(data, wavelength_nm)
    found = []
    for theta in _common_theta_i(data, theta_i_deg):
        theta_o, values = _at(data, theta, nm)
        if theta_o.size:
            found.append((theta, theta_o, values))
    if not found:
        raise InputError("the data sets have no directions of reflection in common")
    base = None if reference is None else list(data).index(reference)
    rows = []
    for k, name in enumerate(data):
        if k == base:
            continue
        parts = []
        for theta, theta_o, values in found:
            truth = values.mean(axis=0) if base is None else values[base]
            deviation = values[k] / truth - 1
            parts.append((theta, np.repeat(theta_o, nm.size), np.tile(nm, theta_o.size), deviation.ravel()))
            rows.append(_row(name, reference or MEAN, theta, *parts[-1][1:]))
        if len(parts) > 1:
            rows.append(
                _row(name, reference or MEAN, None, *(np.concatenate([p[j] for p in parts]) for j in (1, 2, 3)))
            )
    return rows


def _row(
    name: str, reference: str, theta: float | None, theta_o: Floats, nm: Floats, deviation: Floats
) -> dict[str, Any]:
    k = int(np.abs(deviation).argmax())
    return {
        "name": name,
        "reference": reference,
        "theta_i_deg": theta,
        "angles": int(np.unique(theta_o).size),
        "mean": float(np.abs(deviation).mean()),
        "largest": float(np.abs(deviation[k])),
        "bias": float(deviation.mean()),
        "largest_theta_o_deg": float(theta_o[k]),
        "largest_wavelength_nm": float(nm[k]),
    }


def _require_two(data: Mapping[str, xr.Dataset]) -> None:
    if len(data) < 2:
        raise InputError(f"{len(data)} data sets: two and more are needed to compare instruments")
    for name, one in data.items():
        if "theta_o" not in check(one, name)["brdf"].dims:
            raise InputError(f"{name} is a hemisphere: read it in plane (theta_o_deg) to compare instruments")


def _wavelengths(data: Mapping[str, xr.Dataset], asked: float | None) -> Floats:
    low = max(float(d["wavelength"].min()) for d in data.values())
    high = min(float(d["wavelength"].max()) for d in data.values())
    if asked is not None:
        if not low - 1e-6 <= float(asked) <= high + 1e-6:
            raise InputError(
                f"wavelength_nm = {asked:g}, but all data sets cover {low:g} to {high:g} nm only"
                + meant_nm(asked, low, high)
            )
        return np.array([float(asked)])
    axes = [np.sort(d["wavelength"].values) for d in data.values()]
    inside = [a[(a >= low - 1e-6) & (a <= high + 1e-6)] for a in axes]
    found = min((a for a in inside if a.size), key=lambda a: a.size, default=None)
    if found is None or low > high:
        raise InputError("the data sets have no wavelengths in common")
    return found


def _common_theta_i(data: Mapping[str, xr.Dataset], asked: ArrayLike | None) -> list[float]:
    first = min((np.abs(d["theta_i"].values) for d in data.values()), key=len)
    wanted = np.sort(first if asked is None else np.abs(np.atleast_1d(np.asarray(asked, float))))
    kept = [
        float(t)
        for t in wanted
        if all(np.abs(np.abs(d["theta_i"].values) - t).min() <= SAME_THETA_I for d in data.values())
    ]
    if not kept or (asked is not None and len(kept) < wanted.size):
        listed = "; ".join(f"{n}: {np.round(d['theta_i'].values, 3).tolist()}" for n, d in data.items())
        raise InputError(f"not all data sets have the angles of incidence {wanted.tolist()}. They have {listed}")
    return kept


def _plane(one: xr.Dataset, theta: float, nm: Floats) -> tuple[Floats, Floats]:
    """θ_o (n,) and values (n, n_λ) at the nearest θ_i, the light from positive angles; gaps left out."""
    axis = one["theta_i"].values
    k = int(np.abs(np.abs(axis) - theta).argmin())
    here = one["brdf"].isel(theta_i=k).transpose("theta_o", "wavelength").sortby("wavelength")
    own = here["wavelength"].values
    values = here.values @ np.stack([np.interp(nm, own, row) for row in np.eye(own.size)])
    theta_o = here["theta_o"].values if axis[k] >= 0 else -here["theta_o"].values
    order = np.argsort(theta_o)
    theta_o, values = theta_o[order], values[order]
    kept = np.isfinite(values).all(axis=1)
    return theta_o[kept], values[kept]


def _at(data: Mapping[str, xr.Dataset], theta: float, nm: Floats) -> tuple[Floats, Floats]:
    """Common θ_o (n,) and values (sets, n, n_λ) at one angle of incidence."""
    planes = [_plane(one, theta, nm) for one in data.values()]
    if any(not t.size for t, _ in planes):
        return np.zeros(0), np.zeros((len(planes), 0, nm.size))
    low, high = max(t[0] for t, _ in planes), min(t[-1] for t, _ in planes)
    axis = min((t for t, _ in planes), key=len)
    axis = axis[(axis >= low - 1e-9) & (axis <= high + 1e-9)]
    return axis, np.stack([interp(axis, t, v) for t, v in planes])


def grazing_spectra(
    data: Mapping[str, xr.Dataset],
    *,
    theta_i_deg: float = 80.0,
    theta_o_deg: ArrayLike = GRAZING_DEG,
    wavelength_nm: tuple[float, float] | None = None,
) -> xr.Dataset:
    """Spectra of several instruments at grazing angles and how they tilt (thesis figure 2.6: 80°, −50 … −80°).

    theta_i_deg : nearest measured angle within 0.5°;  theta_o_deg : linear between measured angles
    wavelength_nm : first and last one to use, else all that are common
    Returns brdf (name, theta_o, wavelength), tilt (name, theta_o), the slope of f/mean(f) in 1/nm by least squares, and
    tilt_stderr, from its residuals (NaN for two wavelengths).
    Raises InputError where an angle is not covered, or with fewer than two wavelengths.
    """
    for name, one in data.items():
        check(one, name)
    nm = _wavelengths(data, None)
    if wavelength_nm is not None:
        nm = nm[(nm >= wavelength_nm[0]) & (nm <= wavelength_nm[1])]
    if nm.size < 2:
        raise InputError(f"{nm.size} common wavelengths: a tilt of spectra needs two and more")
    (theta,) = _common_theta_i(data, [theta_i_deg])
    asked = np.atleast_1d(np.asarray(theta_o_deg, float))
    spectra = []
    for name, one in data.items():
        theta_o, values = _plane(one, theta, nm)
        if not theta_o.size or asked.min() < theta_o[0] - 1e-6 or asked.max() > theta_o[-1] + 1e-6:
            covered = f"{theta_o[0]:g} to {theta_o[-1]:g}°" if theta_o.size else "nothing"
            raise InputError(f"{name} covers {covered} at θ_i = {theta:g}°, {asked.tolist()} are asked for")
        spectra.append(interp(asked, theta_o, values))
    f = np.stack(spectra)
    tilt, stderr = _slopes(nm, f / f.mean(axis=-1, keepdims=True))
    dims = ("name", "theta_o")
    return xr.Dataset(
        {
            "brdf": ((*dims, "wavelength"), f, {"units": "sr-1", "long_name": "BRDF at grazing angles"}),
            "tilt": (dims, tilt, {"units": "nm-1", "long_name": "slope of the spectrum over its mean"}),
            "tilt_stderr": (dims, stderr, {"units": "nm-1", "long_name": "standard error of tilt, from its residuals"}),
        },
        coords={"name": list(data), "theta_o": asked, "wavelength": nm, "theta_i": theta},
    )


def _slopes(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Slopes of y (…, n) over x (n,) and their standard errors."""
    centred = x - x.mean()
    slope = y @ centred / np.sum(centred**2)
    residual = y - y.mean(axis=-1, keepdims=True) - slope[..., None] * centred
    if x.size < 3:
        return slope, np.full(slope.shape, np.nan)
    return slope, np.sqrt(np.sum(residual**2, axis=-1) / (x.size - 2) / np.sum(centred**2))
