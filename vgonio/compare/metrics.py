"""How far two BRDFs are apart: alignment on common angles and wavelengths, NSE, RMSE, NRMSE (thesis, section 3.4)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import check, takes_nodes
from ..errors import InputError

Floats = NDArray[np.float64]
# angles closer than this, and wavelengths closer than that, are the same: files hold them as decimal numbers
SAME_ANGLE_DEG = 1e-3
SAME_WAVELENGTH_NM = 1e-3
_KEPT = ("brdf", "brdf_stderr")


def detector_dim(data: xr.Dataset) -> str:
    """ "theta_o" in plane, "cell" on a hemisphere; InputError for further dimensions."""
    dims = [str(d) for d in data["brdf"].dims if d not in ("theta_i", "wavelength")]
    if dims not in (["theta_o"], ["cell"]):
        got = ", ".join(map(str, data["brdf"].dims))
        raise InputError(
            f"a BRDF over theta_i, theta_o (or cell) and wavelength is needed, got {got}: "
            "select one entry of the further dimensions first"
        )
    return dims[0]


def matches(a: Floats, b: Floats, tolerance: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Indices into a (n,) and b (m,) of the values that both have, ordered by value."""
    if a.size == 0 or b.size == 0:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    order = np.argsort(a)
    nearest = np.abs(b[None, :] - a[order, None]).argmin(axis=1)
    kept = np.abs(b[nearest] - a[order]) <= tolerance
    return order[kept], nearest[kept]


def interpolate_wavelength(data: xr.Dataset, wavelength: Floats) -> xr.Dataset:
    """`data` at other wavelengths (nm, inside its range), linear between its own; exact where it has them."""
    data = data.sortby("wavelength")
    own = data["wavelength"].values
    if own.size == 1:
        return data.isel(wavelength=np.zeros(wavelength.size, int)).assign_coords(wavelength=wavelength)
    new = xr.Dataset(
        coords={**data.drop_dims("wavelength").coords, "wavelength": ("wavelength", wavelength)}, attrs=data.attrs
    )
    new["wavelength"].attrs = data["wavelength"].attrs
    for name in data.data_vars:
        if "wavelength" not in data[name].dims:
            continue
        values = data[name].transpose(..., "wavelength")
        new[name] = (values.dims, at_wavelengths(values.values, own, wavelength), data[name].attrs)
    return new


def at_wavelengths(values: Floats, own: Floats, wavelength: Floats) -> Floats:
    """Spectra (…, n), at sorted wavelengths, linearly between them at others (m,) inside: (…, m)."""
    if own.size == 1:
        return np.repeat(values, wavelength.size, axis=-1)
    right = np.clip(np.searchsorted(own, wavelength), 1, own.size - 1)
    t = np.clip((wavelength - own[right - 1]) / (own[right] - own[right - 1]), 0.0, 1.0)
    # an end point that is hit exactly must not take NaN from the other end
    snap = SAME_WAVELENGTH_NM / (own[right] - own[right - 1])
    t = np.where(t < snap, 0.0, np.where(t > 1 - snap, 1.0, t))
    low, high = values[..., right - 1], values[..., right]
    return np.where(t == 0, low, np.where(t == 1, high, (1 - t) * low + t * high))


def _common_wavelengths(a: Floats, b: Floats) -> Floats:
    low, high = max(a.min(), b.min()) - SAME_WAVELENGTH_NM, min(a.max(), b.max()) + SAME_WAVELENGTH_NM
    inside = [np.sort(w[(w >= low) & (w <= high)]) for w in (a, b)]
    # the sparser grid decides, so that the one that is interpolated is the one that knows more
    target = min((w for w in inside if w.size), key=lambda w: w.size, default=None)
    if target is None:
        raise InputError(
            f"the two results have no wavelengths in common: {a.min():g} to {a.max():g} nm ({a.size}) and "
            f"{b.min():g} to {b.max():g} nm ({b.size})"
        )
    return target


@takes_nodes
def align(a: xr.Dataset, b: xr.Dataset) -> tuple[xr.Dataset, xr.Dataset]:
    """Both results on their common angles and wavelengths, sorted: brdf and, where known, brdf_stderr.

    Angles are the intersection of θ_i and of θ_o (degrees, within 0.001°; hemispheres have to have the same cells).
    Wavelengths are those of the sparser result inside the common range, the denser one is linearly interpolated there;
    attrs["wavelengths_interpolated"] counts how many of its values came about so.
    Raises InputError when nothing is common or dims differ.
    """
    dim = detector_dim(check(a, "the first result"))
    if detector_dim(check(b, "the second result")) != dim:
        raise InputError(
            "one result is in plane, the other on a hemisphere: they have no detector directions in common"
        )
    a, b = (d[[v for v in _KEPT if v in d]].transpose("theta_i", dim, "wavelength") for d in (a, b))
    if dim == "cell":
        _require_same_cells(a, b)
    for name in ("theta_i", "theta_o") if dim == "theta_o" else ("theta_i",):
        i, j = matches(a[name].values, b[name].values, SAME_ANGLE_DEG)
        if i.size == 0:
            raise InputError(
                f"the two results have no {name} in common: {_range(a[name].values)} and {_range(b[name].values)}"
            )
        a, b = a.isel({name: i}), b.isel({name: j})
        b = b.assign_coords({name: a[name]})
    target = _common_wavelengths(a["wavelength"].values, b["wavelength"].values)
    return _at(a, target), _at(b, target)


def _require_same_cells(a: xr.Dataset, b: xr.Dataset) -> None:
    for name in ("theta_o", "phi_o"):
        if a[name].shape != b[name].shape or np.abs(a[name].values - b[name].values).max() > SAME_ANGLE_DEG:
            raise InputError(
                "the hemispheres of the two results have different cells: simulate both with one resolution_deg"
            )


def _range(values: Floats) -> str:
    return f"{values.size} angles from {values.min():g}° to {values.max():g}°"


def _at(data: xr.Dataset, target: Floats) -> xr.Dataset:
    own = data["wavelength"].values
    interpolated = int(np.sum(np.abs(own[:, None] - target[None, :]).min(axis=0) > SAME_WAVELENGTH_NM))
    result = interpolate_wavelength(data, target)
    result.attrs = {**data.attrs, "wavelengths_interpolated": interpolated}
    return result


def labelled(array: xr.DataArray, name: str, units: str, long_name: str, **attrs: object) -> xr.DataArray:
    """The array with a name, units and long_name; attrs of the operands are dropped."""
    array.name = name
    array.attrs = {"units": units, "long_name": long_name, **attrs}
    return array


@takes_nodes
def nse(reference: xr.Dataset, predicted: xr.Dataset) -> xr.DataArray:
    """Normalised spectral error (reference − predicted)/reference at every common angle and wavelength, without a unit.

    NaN where a value is missing or the reference is 0; attrs["values_left_out"] counts these.
    """
    r, p = (d["brdf"] for d in align(reference, predicted))
    with np.errstate(divide="ignore", invalid="ignore"):
        error = ((r - p) / r).where(r != 0)
    left_out = int(np.isnan(error).sum())
    return labelled(error, "nse", "1", "normalised spectral error of the BRDF", values_left_out=left_out)


def _over(data: xr.DataArray, over: str | Iterable[str] | None) -> list[str]:
    dims = [str(d) for d in data.dims]
    chosen = dims if over is None else [over] if isinstance(over, str) else list(over)
    unknown = [d for d in chosen if d not in dims]
    if unknown:
        raise InputError(f"cannot average over {unknown[0]!r}: the results have {', '.join(dims)}")
    return chosen


def _mean_square(reference: xr.Dataset, predicted: xr.Dataset, over: str | Iterable[str] | None):
    r, p = (d["brdf"] for d in align(reference, predicted))
    dims = _over(r, over)
    both = np.isfinite(r) & np.isfinite(p)
    square = ((r - p) ** 2).where(both).mean(dims, skipna=True)
    return square, r.where(both).mean(dims, skipna=True), int((~both).sum())


@takes_nodes
def rmse(reference: xr.Dataset, predicted: xr.Dataset, over: str | Iterable[str] | None = None) -> xr.DataArray:
    """Root mean square of the difference in sr⁻¹ over the dimensions `over` (None = all, then a scalar).

    over=("theta_i", "theta_o") leaves it per wavelength, over="wavelength" per pair of angles. Values that one of the
    two lacks are left out and counted in attrs["values_left_out"]; NaN where nothing is left.
    """
    square, _, left_out = _mean_square(reference, predicted, over)
    return labelled(np.sqrt(square), "rmse", "sr-1", "root mean square error of the BRDF", values_left_out=left_out)


@takes_nodes
def nrmse(reference: xr.Dataset, predicted: xr.Dataset, over: str | Iterable[str] | None = None) -> xr.DataArray:
    """`rmse` over the mean of the reference's same values, without a unit; NaN where that mean is 0."""
    square, mean, left_out = _mean_square(reference, predicted, over)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (np.sqrt(square) / mean).where(mean != 0)
    return labelled(ratio, "nrmse", "1", "RMSE of the BRDF over the mean of the reference", values_left_out=left_out)
