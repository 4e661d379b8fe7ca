"""Fitted models kept and used again: as NetCDF (everything) or JSON (parameters), and evaluated anywhere."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ..directions import Detector, wavelength_list
from ..errors import FileFormatError, InputError
from ..files import json_of, written_whole
from ..measure import storage
from ..models import evaluate, find, physics

FORMAT = "vgonio fit"


def fit_parameters(fit: xr.Dataset, wavelength_nm: ArrayLike | None = None) -> dict[str, Any]:
    """All parameters of a fit as keywords of `models.evaluate(fit.attrs["model"], …)`.

    wavelength_nm : where coefficients k_d(λ), k_s(λ) are wanted, linear between the fitted ones and constant beyond;
    None leaves them at the wavelengths of the fit. Raises InputError for a dataset that is no fit.
    """
    if fit.attrs.get("method") != "fit":
        raise InputError("this dataset is no fitted model: fit_model makes one")
    entry = find(str(fit.attrs["model"]))
    found: dict[str, Any] = dict(json.loads(fit.attrs["fixed"]))
    found |= {name: float(fit[name]) for name in json.loads(fit.attrs["free"])}
    own = fit["wavelength"].values
    at = own if wavelength_nm is None else wavelength_list(wavelength_nm)
    for name in json.loads(fit.attrs["coefficients"]):
        found[name] = np.interp(at, own, fit[name].values)
    for name in entry.coefficients:
        if np.ndim(found.get(name, 0.0)) == 1 and np.size(found[name]) == own.size:
            found[name] = np.interp(at, own, np.asarray(found[name], float))
    if "single_share" in fit:
        found["single_share"] = fit["single_share"].rename(share_theta_i="theta_i", share_theta_o="theta_o")
    if found.get("eta") is not None:
        found.pop("material", None)
    return {k: v for k, v in found.items() if v is not None}


def evaluate_fit(
    fit: xr.Dataset, theta_i_deg: ArrayLike, theta_o_deg: ArrayLike | Detector, wavelength_nm: ArrayLike
) -> xr.Dataset:
    """The BRDF of a fitted model in other directions and at other wavelengths, see `models.evaluate`."""
    return evaluate(
        str(fit.attrs["model"]), theta_i_deg, theta_o_deg, wavelength_nm, **fit_parameters(fit, wavelength_nm)
    )


def broken_physics(fit: xr.Dataset) -> list[str]:
    """Where the fitted model breaks energy, reciprocity or positivity, at three of its wavelengths."""
    w = fit["wavelength"].values
    chosen = np.unique(w[[0, w.size // 2, -1]])
    found = physics(str(fit.attrs["model"]), chosen, **fit_parameters(fit, chosen))
    return [f"the fitted model {sentence}" for sentence in json.loads(found.attrs["broken"])]


def save_fit(fit: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write a fit under a temporary name, then rename: .nc holds everything, .json the parameters with their errors.

    Raises InputError for another suffix, FileFormatError where the folder cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() in (".nc", ".h5"):
        return storage.save(fit, path)
    if path.suffix.lower() != ".json":
        raise InputError(f"{path.name}: a fit is written as .nc (everything) or .json (parameters)")
    text = json.dumps(_as_json(fit), ensure_ascii=False, indent=1)
    with written_whole(path) as stream:
        stream.write(text.encode())
    return path


def _as_json(fit: xr.Dataset) -> dict[str, Any]:
    names = [*json.loads(fit.attrs["free"]), *json.loads(fit.attrs["coefficients"])]
    kept = [n for name in names for n in (name, f"{name}_stderr")] + ["single_share"]
    variables = {k: fit[k] for k in kept if k in fit}
    return {
        "format": FORMAT,
        "attrs": {str(k): v.item() if hasattr(v, "item") else v for k, v in fit.attrs.items()},
        "variables": {k: {"dims": list(v.dims), "units": v.attrs.get("units", "1"), "values": _finite(v.values)}
                      for k, v in variables.items()},
        "coords": {d: fit[d].values.tolist() for d in {"wavelength", *(d for v in variables.values() for d in v.dims)}},
    }  # fmt: skip


def _finite(values: np.ndarray) -> Any:
    return np.where(np.isfinite(values), values, None).tolist()  # type: ignore[call-overload]


def open_fit(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read what `save_fit` wrote; a JSON file gives the parameters without the fitted BRDF.

    Raises FileFormatError for a missing, damaged or foreign file.
    """
    path = Path(path)
    if path.suffix.lower() in (".nc", ".h5"):
        fit = storage.open(path).to_dataset()
    else:
        fit = _from_json(path)
    if fit.attrs.get("method") != "fit":
        raise FileFormatError(f"{path} holds no fitted model: its attribute 'method' is not 'fit'")
    try:
        fit_parameters(fit)
    except (ValueError, KeyError, TypeError) as e:
        raise FileFormatError(f"{path} is a damaged fit: its parameters cannot be read ({e})") from None
    return fit


def _from_json(path: Path) -> xr.Dataset:
    found = json_of(path, "fit")
    try:
        if found.get("format") != FORMAT:
            raise FileFormatError(f"{path} is no fit of vgonio: its 'format' is not {FORMAT!r}")
        return xr.Dataset(
            {
                k: (v["dims"], np.array(v["values"], float), {"units": v["units"]})
                for k, v in found["variables"].items()
            },
            coords=found["coords"],
            attrs=found["attrs"],
        )
    except (ValueError, KeyError, TypeError, AttributeError) as e:
        if isinstance(e, FileFormatError):
            raise
        raise FileFormatError(f"{path} is damaged or no fit of vgonio: {e}") from None
