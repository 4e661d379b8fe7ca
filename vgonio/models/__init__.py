"""BRDF formulas, one author and year a file, behind one table.

>>> evaluate("cook-torrance-1982", [0, 30], range(-80, 81, 10), [450, 550, 650], alpha=0.3, material="Al")
>>> for row in table(): print(*row)
"""

from __future__ import annotations

import inspect
import json
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ..dataset import label, plain, versions
from ..directions import angle_list, wavelength_list
from ..errors import InputError, VgonioWarning, nearest
from ..units import radians
from . import beckmann_1963, clausen_2022, cook_torrance_1982, walter_2007
from .half_angle import half_angles

__all__ = [
    "MODELS",
    "Model",
    "beckmann_1963",
    "clausen_2022",
    "cook_torrance_1982",
    "evaluate",
    "half_angles",
    "table",
    "walter_2007",
]


@dataclass(frozen=True)
class Model:
    """A row of the table: `brdf(theta_i, theta_o, wavelength_nm, **parameters)` gives values and figures to report."""

    brdf: Callable[..., tuple[np.ndarray, dict[str, float]]]
    source: str
    summary: str

    @property
    def parameters(self) -> dict[str, Any]:
        """Names and defaults; `inspect.Parameter.empty` where a value has to be given."""
        signature = inspect.signature(self.brdf).parameters.values()
        return {p.name: p.default for p in signature if p.kind is inspect.Parameter.KEYWORD_ONLY}


MODELS = {
    "cook-torrance-1982": Model(
        cook_torrance_1982.brdf,
        "Cook and Torrance 1982, modified as thesis 4.6 and 4.7; D and G1 of Walter 2007 or Beckmann 1963",
        "facets D F G/(4 cos cos), exact Fresnel, diffuse part for dielectrics",
    ),
    "clausen-2022": Model(
        clausen_2022.brdf,
        "Clausen 2022, thesis 4.4, 4.5 and 4.8",
        "the same times a shift linear in wavelength, 1 at 600 nm, its slope h cos(w theta_m) + t_y in 1/nm",
    ),
}


def table() -> list[tuple[str, str, str, str]]:
    """Rows (name, parameters, what it is, source) of all models, for printing."""
    empty = inspect.Parameter.empty
    rows = []
    for name, model in MODELS.items():
        names = ", ".join(k if v is empty else f"{k}={v}" for k, v in model.parameters.items())
        rows.append((name, names, model.summary, model.source))
    return rows


def evaluate(
    model: str, theta_i_deg: ArrayLike, theta_o_deg: ArrayLike, wavelength_nm: ArrayLike, **parameters: Any
) -> xr.Dataset:
    """The BRDF of a named model on a grid of signed in-plane angles, as the dataset that every result is.

    theta_i_deg (n_i,), theta_o_deg (n_o,) : degrees;  wavelength_nm (n_λ,);  parameters : see `table()`
    Returns brdf (theta_i, theta_o, wavelength) in sr⁻¹ at the exact directions (no detector cone); attrs name the
    model, its source and the parameters. A model whose shift is negative somewhere warns (VgonioWarning) and says so
    in attrs.
    Raises InputError for an unknown model, a missing, unknown or impossible parameter, MaterialError for wavelengths
    outside the material's table.
    """
    if model not in MODELS:
        raise InputError(f"unknown model {model!r}: {nearest(model, MODELS)}")
    entry = MODELS[model]
    _check_parameters(model, entry, parameters)
    theta_i, theta_o = angle_list(theta_i_deg, "theta_i_deg"), angle_list(theta_o_deg, "theta_o_deg")
    wavelength = wavelength_list(wavelength_nm)
    values, report = entry.brdf(radians(theta_i), radians(theta_o), wavelength, **parameters)
    if report.get("shift_negative_share", 0) > 0:
        warnings.warn(
            f"{model}: the shift is negative at {report['shift_negative_share']:.1%} of the points (minimum "
            f"{report['shift_minimum']:.3g}); choose a smaller slope, or clamp=True to set it to 0",
            VgonioWarning,
            stacklevel=2,
        )
    used = {k: v for k, v in entry.parameters.items() if v is not inspect.Parameter.empty} | parameters
    return label(
        xr.Dataset(
            {"brdf": (("theta_i", "theta_o", "wavelength"), values)},
            coords={"theta_i": theta_i, "theta_o": theta_o, "wavelength": wavelength, "phi_i": 0.0},
            attrs={
                "method": "model",
                "model": model,
                "source": entry.source,
                "parameters": json.dumps({k: _json(v) for k, v in used.items()}),
                "versions": versions(),
                **{k: plain(v) for k, v in report.items()},
            },
        )
    )


def _check_parameters(name: str, entry: Model, given: dict[str, Any]) -> None:
    known = entry.parameters
    for key in given:
        if key not in known:
            raise InputError(f"model {name!r} has no parameter {key!r}: {nearest(key, known)}")
    missing = [k for k, v in known.items() if v is inspect.Parameter.empty and k not in given]
    if missing:
        raise InputError(f"model {name!r} needs {', '.join(missing)}: give {missing[0]}=…")
    if given.get("eta") is not None and "material" in given:
        raise InputError("give either eta (a dielectric of constant index) or material, not both")


def _json(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    kept = value is None or isinstance(value, (str, int, float, list, tuple))
    return value if kept else getattr(value, "name", str(value))
