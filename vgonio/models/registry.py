"""The table of models: terms, coefficients, source and what a fit may vary."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import InputError, nearest
from . import clausen_2022, cook_torrance_1982, harvey_1976, krywonos_2011, lambert_1760, oren_nayar_1994, two_shifts

EMPTY = inspect.Parameter.empty


@dataclass(frozen=True)
class Range:
    """Where a fit looks for a parameter; `log` where it spans decades. Units are those of the parameter."""

    low: float
    high: float
    log: bool = False


#: Name → `Range` within which a fit looks for a parameter.
#: α down to a polished surface; h: ±1 % per nm turns a spectrum over within the visible; below w = 0.25 the cosine is a
#: parabola, above 20 steps of 5° alias; p counts reflections (thesis, below 4.2)
RANGES = {
    "alpha": Range(0.002, 2.0, log=True),
    "eta": Range(1.01, 3.0),
    "c": Range(-0.3, 0.3),
    "h": Range(-0.01, 0.01),
    "w": Range(0.25, 20.0),
    "t_y": Range(-0.01, 0.01),
    "p": Range(0.0, 5.0),
    "h1": Range(-0.01, 0.01),
    "w1": Range(0.25, 20.0),
    "h2": Range(-0.02, 0.02),
    "w2": Range(0.25, 20.0),
    "sigma_deg": Range(0.0, 90.0),
    "l": Range(1e-4, 1.0, log=True),
    "s": Range(-6.0, -0.2),
    "rms_um": Range(1e-4, 1.0, log=True),
    "b_um": Range(0.02, 500.0, log=True),
    "c_psd": Range(2.02, 8.0),
}


@dataclass(frozen=True)
class Model:
    """A row of the table. A BRDF is the sum of `terms`, each times the coefficient of its name (the name "" has none).

    coefficients : names and defaults of what multiplies the terms, a number or one value per wavelength
    free : parameters that a fit varies unless told otherwise, in front of those of a fitted coefficient
    shift : the factor that may become negative, where there is one
    """

    terms: Callable[..., dict[str, np.ndarray]]
    coefficients: Mapping[str, Any]
    free: tuple[str, ...]
    source: str
    summary: str
    shift: Callable[..., np.ndarray] | None = None
    preset: Mapping[str, Any] = field(default_factory=dict)

    @property
    def shape_parameters(self) -> dict[str, Any]:
        """Names and defaults of what is not a coefficient; `EMPTY` where a value has to be given."""
        signature = inspect.signature(self.terms).parameters.values()
        keywords = (p for p in signature if p.kind is inspect.Parameter.KEYWORD_ONLY and p.name not in self.preset)
        return {p.name: p.default for p in keywords}

    @property
    def parameters(self) -> dict[str, Any]:
        """Names and defaults of everything that can be given."""
        return self.shape_parameters | dict(self.coefficients)

    @property
    def takes_material(self) -> bool:
        """Whether Fresnel's reflectance of a material enters, unless `eta` is given."""
        return "eta" in self.shape_parameters


_FACETS = {"k_s": 1.0, "k_d": 0.0}
#: Name → `Model`: every BRDF formula that there is; `table` prints it.
MODELS = {
    "lambert-1760": Model(lambert_1760.terms, {"k_d": EMPTY}, (), "Lambert 1760", "k_d/pi"),
    "oren-nayar-1994": Model(
        oren_nayar_1994.terms,
        {"k_d": EMPTY},
        ("sigma_deg",),
        "Oren and Nayar 1994, equation 30",
        "Lambertian V-grooves of slope angle sigma",
    ),
    "cook-torrance-1982": Model(
        cook_torrance_1982.terms,
        _FACETS,
        ("alpha",),
        "Cook and Torrance 1982; D, G1 of Walter 2007: thesis 2.23 to 2.27, 3.1 (c), 4.6 (k_d = 0), 4.7 (k_s = 1)",
        "k_d/pi + k_s D F G/(4 cos cos) - c, exact Fresnel",
    ),
    "beckmann-1963": Model(
        cook_torrance_1982.terms,
        _FACETS,
        ("alpha",),
        "the same with D of Beckmann and Spizzichino 1963, G1 of Smith 1967",
        "Gaussian slopes",
        preset={"distribution": "beckmann"},
    ),
    "clausen-2022": Model(
        clausen_2022.terms,
        _FACETS,
        ("alpha", "h", "w"),
        "Clausen 2022, thesis 4.4, 4.5 and 4.8",
        "cook-torrance-1982 times a shift linear in wavelength, 1 at 600 nm, slope h cos(w theta_m) + t_y in 1/nm",
        shift=clausen_2022.shift_factor,
    ),
    "two-shifts": Model(
        two_shifts.terms,
        _FACETS,
        ("alpha", "h1", "w1", "h2", "w2"),
        "vgonio, as Clausen 2022 proposes at the end of thesis 4.4",
        "two shifts, of single reflections about the mirror direction and of multiple ones about back-scattering",
        shift=two_shifts.shift_factor,
    ),
    "harvey-1976": Model(
        harvey_1976.terms,
        {"k_s": EMPTY, "k_d": 0.0},
        ("l", "s"),
        "Harvey 1976, three-parameter form",
        "shift-invariant lobe of smooth surfaces, k_s its peak in 1/sr",
    ),
    "krywonos-2011": Model(
        krywonos_2011.terms,
        _FACETS,
        ("rms_um", "b_um", "c_psd"),
        "Krywonos 2011, reciprocal form of Yan 2018; PSD of Church 1989",
        "smooth surfaces, generalised Harvey-Shack with an ABC spectrum; no mirror peak",
    ),
}


def find(name: str) -> Model:
    """The model of that name; InputError with the nearest one otherwise."""
    if name not in MODELS:
        raise InputError(f"unknown model {name!r}: {nearest(name, MODELS)}")
    return MODELS[name]


def table() -> list[tuple[str, str, str, str]]:
    """Rows (name, parameters, what it is, source) of all models, for printing."""
    rows = []
    for name, model in MODELS.items():
        names = ", ".join(k if v is EMPTY else f"{k}={v}" for k, v in model.parameters.items())
        rows.append((name, names, model.summary, model.source))
    return rows
