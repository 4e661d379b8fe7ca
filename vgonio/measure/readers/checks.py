"""What is wrong with measured data, said clearly or repaired as asked; every reader's data go through here.

| what | what is done |
|---|---|
| a pair of angles (and wavelength) twice | error; `duplicates="mean"` or `"first"` repairs |
| negative values | missing, with a warning that counts them; `negative="keep"`, `"zero"` or `"error"` |
| wavelengths that look like µm | error; `wavelength_unit="um"` converts |
| more light reflected than falls in | error; `unit="percent"`, `"reflectance-factor"` convert, `"sr-1"` insists |
| absent angles, back-scattering among them | NaN, counted in the attributes |
| unsorted angles and wavelengths | sorted |
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...errors import FileFormatError, InputError, VgonioWarning, nearest
from ...units import radians

Floats = NDArray[np.float64]
Once = tuple[NDArray[np.intp], Floats, Floats | None]
# to sr⁻¹; a reflectance factor is that of the perfect diffuser, 1/π, in units of it
UNITS = {"sr-1": 1.0, "percent": 0.01, "reflectance-factor": 1 / np.pi, "reflectance-factor-percent": 0.01 / np.pi}
WAVELENGTH_UNITS = {"nm": 1.0, "um": 1e3, "µm": 1e3, "m": 1e9, "angstrom": 0.1}
NEGATIVE = ("missing", "keep", "zero", "error")
DUPLICATES = ("error", "mean", "first")
# nm; X-rays and far infrared beyond are no business of a gonioreflectometer, a slip of the unit is
PLAUSIBLE_NM = (100.0, 100_000.0)
# share of the incident power; a rough integral over coarse angles is 1.4 too high at most, percent are 100 too high
LARGEST_REFLECTANCE = 2.0
# values; a table of scattered angles makes a grid that is mostly empty
LARGEST_GRID = 2**27


@dataclass(frozen=True)
class Repairs:
    """What to do with data that are not as they should be; the defaults refuse what could be a mistake.

    unit : of the BRDF in the file, None for sr⁻¹ that are checked for plausibility;  wavelength_unit : None for the
    format's own;  negative, duplicates : see the table of this module
    Raises InputError for names that are not known.
    """

    unit: str | None = None
    wavelength_unit: str | None = None
    negative: str = "missing"
    duplicates: str = "error"

    def __post_init__(self) -> None:
        for name, value, known in (
            ("unit", self.unit, UNITS),
            ("wavelength_unit", self.wavelength_unit, WAVELENGTH_UNITS),
            ("negative", self.negative, NEGATIVE),
            ("duplicates", self.duplicates, DUPLICATES),
        ):
            if value not in known and not (value is None and name.endswith("unit")):
                raise InputError(f"{name} = {value!r}: {nearest(value, known)}")


def once(index: NDArray[np.intp], values: Floats, stderr: Floats | None, how: str) -> Once:
    """Rows whose index appears once: index (m,), values (m, n), stderr (m, n) or None; `how` merges the others.

    index : (n,) place of each row;  values, stderr : (n, n_λ);  how : "mean" (errors as of independent readings) or
    "first". The order is that of the index.
    """
    place, first, inverse, count = np.unique(index, return_index=True, return_inverse=True, return_counts=True)
    if how == "first" or np.all(count == 1):
        return place, values[first], None if stderr is None else stderr[first]
    shape = (place.size, values.shape[1])
    total, square, n = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    np.add.at(total, inverse, np.nan_to_num(values))
    np.add.at(n, inverse, np.isfinite(values))
    with np.errstate(invalid="ignore"):
        mean = total / np.where(n > 0, n, np.nan)
        if stderr is None:
            return place, mean, None
        np.add.at(square, inverse, np.nan_to_num(stderr) ** 2)
        return place, mean, np.sqrt(square) / np.where(n > 0, n, np.nan)


def check_size(values: int, where: str) -> None:
    """FileFormatError for more values than a dataset shall hold: a header or scattered angles must not fill memory."""
    if values > LARGEST_GRID:
        raise FileFormatError(
            f"{where}: its angles and wavelengths make a grid of {values:.3g} values, more than {LARGEST_GRID:.3g}"
        )


def check_values(theta: Floats, wavelength: Floats, where: str) -> None:
    """FileFormatError unless 0 ≤ θ < 90° and wavelengths are positive, finite and none twice."""
    bad = theta[~((theta >= 0) & (theta < 90))]
    if bad.size:
        raise FileFormatError(f"{where}: polar angle {bad[0]:g}° is not allowed, 0° ≤ θ < 90° (φ tells the side)")
    if wavelength.size == 0:
        raise FileFormatError(f"{where}: the list of wavelengths is empty")
    bad = wavelength[~(np.isfinite(wavelength) & (wavelength > 0))]
    if bad.size:
        raise FileFormatError(f"{where}: wavelength {bad[0]:g} nm is not allowed, wavelengths are positive")
    if np.unique(wavelength).size != wavelength.size:
        raise FileFormatError(f"{where}: a wavelength is listed twice")


def sound(data: xr.Dataset, where: str, repairs: Repairs) -> xr.Dataset:
    """The dataset in nm and sr⁻¹ after the repairs asked for; what was done is in attrs["repairs"].

    Raises FileFormatError for data that look like a mistake; the message names the option that repairs it.
    """
    if np.isinf(data["brdf"].values).any():
        raise FileFormatError(f"{where} holds an infinite value")
    done = [data.attrs["repairs"]] if data.attrs.get("repairs") else []
    data = _wavelengths(data, where, repairs, done)
    data = _unit(data, where, repairs, done)
    data = _negative(data, where, repairs, done)
    if not np.any(np.isfinite(data["brdf"].values)):
        raise FileFormatError(f"{where} holds no finite BRDF value")
    if done:
        data.attrs["repairs"] = "; ".join(done)
    return data


def _wavelengths(data: xr.Dataset, where: str, repairs: Repairs, done: list[str]) -> xr.Dataset:
    unit = repairs.wavelength_unit
    if unit not in (None, "nm"):
        attrs = data["wavelength"].attrs
        data = data.assign_coords(wavelength=np.round(data["wavelength"].values * WAVELENGTH_UNITS[unit], 9))
        data["wavelength"].attrs = attrs
        done.append(f"wavelengths converted from {unit}")
    nm = data["wavelength"].values
    bad = nm[(nm < PLAUSIBLE_NM[0]) | (nm > PLAUSIBLE_NM[1])]
    if bad.size:
        remedy = "wavelength_unit=um (--set) converts" if 0 < bad.min() < 50 else "wavelength_unit names another unit"
        raise FileFormatError(
            f"{where}: a wavelength of {bad[0]:g} nm, allowed is {PLAUSIBLE_NM[0]:g} to {PLAUSIBLE_NM[1]:g} nm; if the "
            f"file counts in another unit, {remedy}"
        )
    return data


def _unit(data: xr.Dataset, where: str, repairs: Repairs, done: list[str]) -> xr.Dataset:
    if repairs.unit is None:
        share = reflectance_bound(data)
        if share > LARGEST_REFLECTANCE:
            raise FileFormatError(
                f"{where} reflects at least {share:.3g} times the light that falls in, so its values are not sr⁻¹: "
                "unit=percent (--set), reflectance-factor or reflectance-factor-percent converts, unit=sr-1 insists"
            )
    elif repairs.unit != "sr-1":
        data = data.copy()
        for name in ("brdf", "brdf_stderr"):
            if name in data:
                data[name] = data[name].copy(data=data[name].values * UNITS[repairs.unit])
        done.append(f"BRDF converted from {repairs.unit}")
    return data


def _negative(data: xr.Dataset, where: str, repairs: Repairs, done: list[str]) -> xr.Dataset:
    values = data["brdf"].values
    negative = values < 0
    count = int(negative.sum())
    if not count or repairs.negative == "keep":
        return data
    found = f"{count} of {int(np.isfinite(values).sum())} values are negative, the least {np.nanmin(values):.3g} sr⁻¹"
    if repairs.negative == "error":
        raise FileFormatError(f"{where}: {found}; negative=missing, zero or keep (--set negative=zero) goes on")
    data = data.copy()
    data["brdf"] = data["brdf"].copy(data=np.where(negative, 0.0 if repairs.negative == "zero" else np.nan, values))
    taken = "set to zero" if repairs.negative == "zero" else "taken as missing"
    done.append(f"{count} negative values {taken}")
    if repairs.negative == "missing":
        warnings.warn(f"{where}: {found}: {taken} (--set negative=keep, zero or error)", VgonioWarning, stacklevel=5)
    return data


def reflectance_bound(data: xr.Dataset) -> float:
    """A lower bound of the directional reflectance at the steepest θ_i, the largest over wavelengths; 0 when unknown.

    In plane the BRDF is turned about the mirror direction, and every interval counts its smaller end: a peak that the
    angles do not resolve cannot raise it. On a hemisphere it is the sum over the cells.
    """
    k = int(np.abs(data["theta_i"].values).argmin())
    here = data["brdf"].isel(theta_i=k)
    theta_o = radians(data["theta_o"].values)
    if "cell" in here.dims:
        weight = data["solid_angle"].values * np.cos(theta_o)
        values = here.transpose("cell", "wavelength").values
        return float(np.max(np.nansum(values * np.nan_to_num(weight)[:, None], axis=0), initial=0.0))
    values = here.transpose("theta_o", "wavelength").values
    kept = np.isfinite(values).all(axis=1)
    order = np.argsort(theta_o[kept])
    theta, f = theta_o[kept][order], values[kept][order]
    if theta.size < 2:
        return 0.0
    middle, step = (theta[1:] + theta[:-1]) / 2, np.diff(theta)
    ring = np.pi * np.abs(np.sin(middle + radians(float(data["theta_i"].values[k])))) * np.cos(middle) * step
    return float(np.max(ring @ np.minimum(f[1:], f[:-1]), initial=0.0))
