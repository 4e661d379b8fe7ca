"""What a surface looks like to the renderer: models, fits and results turned into Mitsuba BSDFs."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import check
from ..errors import FileFormatError, InputError, nearest
from ..materials import material
from ..measure import tensor_file
from ..models import MODELS
from . import bsdf as plugins

Floats = NDArray[np.float64]
# parameters of vgonio.models that the plug-ins have as well
KNOWN = {
    plugins.PLAIN: ("alpha", "material", "eta", "k_d", "k_s", "c"),
    plugins.EXTENDED: ("alpha", "material", "eta", "k_d", "k_s", "h", "w", "t_y", "p"),
}
SPECTRA = ("k_d", "k_s")
FORMULA, TABLE = "formula", "measured"


@dataclass(frozen=True)
class Appearance:
    """A material for the renderer: `bsdf` is a dictionary for `mitsuba.load_dict`.

    route : "formula" (a plug-in of vgonio) or "measured" (Mitsuba's plug-in for tables);  range_nm : where it is known
    note : what the picture's caption has to say about it
    """

    name: str
    bsdf: Mapping[str, Any]
    route: str
    range_nm: tuple[float, float] = plugins.RANGE_NM
    note: str = ""
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def check(self, wavelength_nm: Floats) -> None:
        """Raise InputError unless the material is known at all these wavelengths."""
        low, high = self.range_nm
        if wavelength_nm.min() < low - 1e-3 or wavelength_nm.max() > high + 1e-3:
            raise InputError(
                f"{self.name} is known from {low:g} to {high:g} nm, {wavelength_nm.min():g} to {wavelength_nm.max():g} "
                "nm were asked for: choose --wavelengths inside"
            )


def of_model(
    model: str, parameters: Mapping[str, Any], wavelength_nm: Any = None, name: str | None = None
) -> Appearance:
    """The plug-in of a model of `vgonio.models` that has one.

    parameters : as in `vgonio.models.table()`; k_d and k_s are numbers or one value for each of wavelength_nm (n_λ,)
    Models without a plug-in, and other distributions than GGX, become a table over wavelength_nm.
    Raises InputError for parameters that are missing, unknown or impossible.
    """
    if model not in MODELS:
        raise InputError(f"unknown model {model!r}: {nearest(model, MODELS)}")
    if model not in KNOWN or parameters.get("distribution", "ggx") != "ggx":
        return _as_table(model, parameters, wavelength_nm, name)
    _check_names(model, parameters)
    made: dict[str, Any] = {"type": model}
    low, high = plugins.RANGE_NM
    for key, value in parameters.items():
        if value is None or key in ("distribution", "clamp", "wavelength_n_nm"):
            continue
        if key == "k_d" and not np.any(value):
            continue  # as the fits of conductors say it; Mitsuba takes no spectrum of zeros
        if key in SPECTRA:
            texture, ends = _coefficient(key, value, wavelength_nm)
            made[key] = texture
            low, high = max(low, ends[0]), min(high, ends[1])
        elif key == "material":
            reflector = material(value)
            if reflector.name != "perfect":
                low, high = max(low, reflector.range_nm[0]), min(high, reflector.range_nm[1])
            made[key] = str(value)
        else:
            made[key] = _number(key, value)
    if "eta" in made:
        made.pop("material", None)
    if "k_d" in made:
        made["k_d_mean"] = float(np.clip(np.mean(parameters["k_d"]), 0.01, 1.0))
    _check_values(made)
    made |= {} if "eta" in made else {"wavelength_min": low, "wavelength_max": high}
    return Appearance(name or model, made, FORMULA, (low, high), "", dict(parameters))


def _as_table(model: str, parameters: Mapping[str, Any], wavelength_nm: Any, name: str | None) -> Appearance:
    from .tables import formula_file

    w = np.arange(400.0, 721.0, 20.0) if wavelength_nm is None else np.sort(np.asarray(wavelength_nm, float))
    path, note = formula_file(model, parameters, w)
    return of_table(path, name or model, note)


def of_fit(fit: xr.Dataset, name: str = "fit") -> Appearance:
    """The material of a fitted model (`vgonio.compare.fit_model`, `vgonio fit`)."""
    from ..compare.fit_files import fit_parameters  # loads the readers of files as well

    return of_model(str(fit.attrs["model"]), fit_parameters(fit), fit["wavelength"].values, name)


def _check_names(model: str, parameters: Mapping[str, Any]) -> None:
    known = MODELS[model].parameters
    for key in parameters:
        if key not in known:
            raise InputError(f"model {model!r} has no parameter {key!r}: {nearest(key, known)}")
    if parameters.get("wavelength_n_nm", plugins.WAVELENGTH_N_NM) != plugins.WAVELENGTH_N_NM:
        raise InputError("the renderer's shift is 1 at 600 nm: wavelength_n_nm cannot be changed")
    needed = ("alpha",) if model == plugins.PLAIN else ("alpha", "h", "w")
    missing = [k for k in needed if k not in parameters]
    if missing:
        raise InputError(f"model {model!r} needs {', '.join(missing)}: give {missing[0]}=…")


def _number(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {value!r}: one number is needed") from None
    if not np.isfinite(number):
        raise InputError(f"{name} = {value} is not a finite number")
    return number


def _check_values(made: Mapping[str, Any]) -> None:
    if not made["alpha"] > 0:
        raise InputError(f"alpha = {made['alpha']:g}: the width of the facet distribution has to be positive")
    if "eta" in made and not made["eta"] > 1:
        raise InputError(f"eta = {made['eta']:g}: the refractive index of a dielectric in air is above 1")


def _coefficient(name: str, value: Any, wavelength_nm: Any) -> tuple[dict[str, Any], tuple[float, float]]:
    """A Mitsuba spectrum of a number or of one value for each wavelength, and where it is known."""
    values = np.atleast_1d(np.asarray(value, dtype=np.float64))
    if not np.all(np.isfinite(values)):
        raise InputError(f"{name} holds values that are no finite numbers")
    if values.size == 1:
        return plugins.spectrum(plugins.RANGE_NM, np.repeat(values, 2)), plugins.RANGE_NM
    w = np.asarray([] if wavelength_nm is None else wavelength_nm, dtype=np.float64)
    if values.shape != w.shape:
        raise InputError(f"{name} has {values.size} values for {w.size} wavelengths: give a number or one for each")
    order = np.argsort(w)
    return plugins.spectrum(w[order], values[order]), (float(w.min()), float(w.max()))


def of_dataset(data: xr.Dataset, name: str = "result", fill: Any = "half-angle", folder: Any = None) -> Appearance:
    """The material of a BRDF dataset: by formula where its attributes name a model with a plug-in, else as a table.

    fill : what in-plane data are outside their plane, see `vgonio.measure.isotropic`;  folder : where the table's file
    (.bsdf of RGL, for Mitsuba's `measured`) is put, by default a temporary one that lives as long as the process
    """
    if data.attrs.get("method") == "fit":
        return of_fit(data, name)
    data = check(data, name)
    if data.attrs.get("method") == "model" and data.attrs.get("model") in KNOWN:
        given = json.loads(data.attrs["parameters"])
        usable = {k: v for k, v in given.items() if v is not None and not (k == "material" and given.get("eta"))}
        return of_model(data.attrs["model"], usable, data["wavelength"].values, name)
    from .tables import table_file

    path, note = table_file(data, fill, folder)
    return of_table(path, name, note)


def of_table(path: str | os.PathLike[str], name: str | None = None, note: str = "") -> Appearance:
    """A BRDF in a file of RGL (.bsdf), rendered by Mitsuba's `measured`.

    Raises FileFormatError for a file that is missing, damaged, or holds no spectra.
    """
    path = Path(path)
    if not path.is_file():
        raise FileFormatError(f"no such file: {path}")
    fields = tensor_file.read(path)
    if "wavelengths" not in fields or "spectra" not in fields:
        raise FileFormatError(f"{path} holds no spectra (its fields: {', '.join(fields)}): the spectral file is needed")
    w = np.asarray(fields["wavelengths"], dtype=np.float64)
    made = {"type": "measured", "filename": str(path)}
    return Appearance(name or path.stem, made, TABLE, (float(w.min()), float(w.max())), note)
