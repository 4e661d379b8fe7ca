"""Models fitted to BRDFs (thesis 3.3.2 and 4.5): nonlinear parameters by lmfit, k_d(λ) and k_s(λ) inside."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import label, plain, takes_nodes, versions
from ..errors import InputError, nearest
from ..materials import Material
from ..models import RANGES, Model, Range, find
from ..models.registry import EMPTY
from ..models.two_shifts import share_at
from .fit_errors import Errors, bootstrap, sandwich
from .fit_notes import notes_of
from .pairs import COEFFICIENT_BOUNDS, Pairs, Problem, pairs_of
from .search import Descent, at_bounds, search

Floats = NDArray[np.float64]
ERRORS = ("sandwich", "bootstrap", "none")
CLUSTERS = ("spectrum", "theta_i", "value")
UNITS = {
    "h": "nm-1", "t_y": "nm-1", "h1": "nm-1", "h2": "nm-1", "c": "sr-1", "sigma_deg": "degree", "rms_um": "um",
    "b_um": "um",
}  # fmt: skip


@takes_nodes
def fit_model(
    data: xr.Dataset,
    model: str = "clausen-2022",
    *,
    material: str | Material | None = "Al",
    free: tuple[str, ...] | list[str] | None = None,
    coefficients: tuple[str, ...] | list[str] | None = None,
    exponent: float = 1.0,
    wavelength_range_nm: tuple[float, float] | None = None,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    start: Mapping[str, float] | None = None,
    starts: int = 6,
    errors: str = "sandwich",
    cluster: str = "spectrum",
    samples: int = 50,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
    **fixed: Any,
) -> xr.Dataset:
    """Fit a model of `models.table()` to a BRDF under the cost function of thesis 3.2–3.4.

    material : of the facets; None is a dielectric of unknown constant index: then eta is fitted and k_d(λ) as well
    free : parameters to vary, by default those of the model's row;  coefficients : those fitted at each wavelength
    inside, "k_d" and "k_s";  exponent : w of 3.2, weights steep incidence more
    wavelength_range_nm : nm, both ends included;  ranges : bounds other than `models.RANGES`
    start : a guess that is tried beside the `starts` best of a quasi-random sample
    errors : "sandwich", "bootstrap" (with `samples` refits) or "none"
    cluster : what is an observation of its own: a "spectrum", all spectra of one "theta_i" (where what the model misses
    is alike in neighbours), or each "value" (only where the noise is independent from wavelength to wavelength)
    fixed : values of parameters that do not vary, for example c=0.01, distribution="beckmann", single_share=…

    Returns a dataset like a BRDF: brdf (fitted), residual (of the cost), each free parameter and coefficient with its
    standard error, `correlation`, `independent`; attrs: model, cost, minima, `notes` (JSON list: bounds hit, second
    minima, what the data cannot tell), everything needed by `evaluate_fit`. Multiplicative noise σ biases a
    logarithmic cost by −σ²/2 of f: 2·10⁻⁴ at 2 %.
    Raises InputError for unknown names, too few spectra, no positive value and as the model, MaterialError outside the
    material's table.
    """
    began = time.perf_counter()
    entry = find(model)
    _check_words(errors, cluster, exponent)
    chosen, inside, values = _choices(model, entry, material, free, coefficients, fixed)
    pairs = pairs_of(data, wavelength_range_nm)
    _check_enough(pairs, chosen, inside)
    bounds = _ranges(chosen, ranges)
    _check_start(start or {}, bounds)
    problem = Problem(entry, pairs, pairs.target(exponent), inside, _at_pairs(values, pairs))
    part = (lambda x: progress(0.5 * x)) if progress and errors == "bootstrap" else progress
    minima = search(problem, bounds, start or {}, starts, seed, part)
    best = Descent(problem, bounds)
    inner = best.solve(minima[0].u)
    held = at_bounds(minima[0].u, bounds)
    spectra = np.arange(len(pairs.place))
    groups = {"spectrum": spectra, "theta_i": _incidence(pairs), "value": None}[cluster]
    found = sandwich(problem, bounds, minima[0].u, inner, groups, [list(bounds).index(k) for k in held])
    if errors == "bootstrap":
        rest = (lambda x: progress(0.5 + 0.5 * x)) if progress else None
        found = bootstrap(
            problem, bounds, minima[0].u, inner, spectra if groups is None else groups, found, samples, seed, rest
        )
    result = _dataset(
        problem, best.shape(minima[0].u), inner, found if errors != "none" else None, values.get("single_share")
    )
    result.attrs |= {
        "method": "fit",
        "model": model,
        "material": _named(values.get("material")),
        "free": json.dumps(list(bounds)),
        "coefficients": json.dumps(list(inside)),
        "fixed": json.dumps({k: _plain(v) for k, v in values.items() if not isinstance(v, xr.DataArray)}),
        "exponent": float(exponent),
        "errors": errors,
        "cluster": cluster,
        "cost": minima[0].cost,
        "rms_residual": float(np.sqrt(minima[0].cost / max(problem.target.weight.sum(), 1.0))),
        "spectra": len(pairs.place),
        "condition": plain(float(min(found.condition, 1e99))),
        "minima": json.dumps([{"cost": m.cost} | best.shape(m.u) for m in minima]),
        "notes": json.dumps(notes_of(problem, bounds, minima, inner, found), ensure_ascii=False),
        "fit_seconds": time.perf_counter() - began,
        "versions": versions(),
        **_chi_square(data, result, len(bounds) + len(inside) * pairs.wavelength.size),
    }
    return result


def _check_words(errors: str, cluster: str, exponent: float) -> None:
    if errors not in ERRORS or cluster not in CLUSTERS:
        name, known = (errors, ERRORS) if errors not in ERRORS else (cluster, CLUSTERS)
        raise InputError(f"unknown choice {name!r}: {nearest(name, known)}")
    if not (np.isfinite(exponent) and exponent >= 0):
        raise InputError(f"exponent = {exponent}: w of the cost function is 0 or more (the thesis uses 1 to 6)")


def _check_enough(pairs: Pairs, chosen: list[str], inside: tuple[str, ...]) -> None:
    if not np.any(pairs.values > 0):
        raise InputError("no value of the BRDF is positive: there is nothing that a model could be fitted to")
    needed = len(chosen) + len(inside) + 1
    if len(pairs.place) < needed:
        raise InputError(f"{len(pairs.place)} spectra are too few for {len(chosen)} parameters and {len(inside)} "
                         f"coefficients at each wavelength: {needed} are needed")  # fmt: skip


def _choices(
    model: str, entry: Model, material: Any, free: Any, coefficients: Any, fixed: Mapping[str, Any]
) -> tuple[list[str], tuple[str, ...], dict[str, Any]]:
    """Names that vary, coefficients inside, and the values of all other parameters."""
    values = {k: v for k, v in entry.parameters.items() if v is not EMPTY} | dict(fixed)
    unknown = [k for k in [*(free or []), *fixed, *(coefficients or [])] if k not in entry.parameters]
    if unknown:
        raise InputError(f"model {model!r} has no parameter {unknown[0]!r}: {nearest(unknown[0], entry.parameters)}")
    dielectric = entry.takes_material and material is None
    chosen = [k for k in (free if free is not None else entry.free) if k not in fixed]
    if dielectric and free is None and fixed.get("eta") is None:
        chosen.append("eta")
    if entry.takes_material:
        values["material"] = "Al" if material is None else material
        if not (dielectric or "eta" in chosen or fixed.get("eta") is not None):
            values["eta"] = None
    if coefficients is None:
        needed = [k for k, v in entry.coefficients.items() if v is EMPTY]
        coefficients = [k for k in [*needed, *(["k_d"] if dielectric else [])] if k not in fixed]
    wrong = [k for k in coefficients if k not in COEFFICIENT_BOUNDS or k not in entry.coefficients]
    if wrong:
        raise InputError(f"{wrong[0]!r} is no coefficient of {model!r}: {nearest(wrong[0], entry.coefficients)}")
    cannot = [k for k in chosen if k not in RANGES]
    if cannot:
        raise InputError(f"{cannot[0]!r} cannot be varied: {nearest(cannot[0], set(entry.parameters) & set(RANGES))}")
    open_ = [k for k in entry.parameters if k not in values and k not in chosen and k not in coefficients]
    if open_:
        raise InputError(f"model {model!r} needs {open_[0]}: give {open_[0]}=…, or let it vary with free=[…]")
    for name in (*chosen, *coefficients):
        values.pop(name, None)
    return list(dict.fromkeys(chosen)), tuple(coefficients), values


def _ranges(names: list[str], given: Mapping[str, tuple[float, float]] | None) -> dict[str, Range]:
    for name in given or {}:
        if name not in names:
            raise InputError(f"bounds for {name!r}, which does not vary: {nearest(name, names)}")
    found = {}
    for name in names:
        r = RANGES[name]
        low, high = (given or {}).get(name, (r.low, r.high))
        if not (np.isfinite(low) and np.isfinite(high) and low < high) or (r.log and low <= 0):
            raise InputError(f"bounds {low:g} to {high:g} of {name}: finite numbers, the lower one first, are needed")
        found[name] = Range(float(low), float(high), r.log)
    return found


def _check_start(start: Mapping[str, float], bounds: Mapping[str, Range]) -> None:
    for name, value in start.items():
        if name not in bounds:
            raise InputError(f"a start for {name!r}, which does not vary: {nearest(name, bounds)}")
        if not bounds[name].low <= value <= bounds[name].high:
            raise InputError(f"start {name} = {value:g} lies outside {bounds[name].low:g} to {bounds[name].high:g}")


def _incidence(pairs: Pairs) -> NDArray[np.intp]:
    return np.unique(np.round(pairs.geometry.theta_i, 9), return_inverse=True)[1]


def _at_pairs(values: dict[str, Any], pairs: Pairs) -> dict[str, Any]:
    """The table of a share of single reflections looked up once, not at every trial."""
    if not isinstance(values.get("single_share"), xr.DataArray):
        return values
    return values | {"single_share": share_at(pairs.geometry, values["single_share"])}


def _dataset(problem: Problem, shape: Mapping[str, float], inner: Any, errors: Errors | None, share: Any) -> xr.Dataset:
    pairs = problem.pairs
    dims, values = pairs.on_grid(problem.value(shape, inner.c))
    residual = np.where(problem.target.weight > 0, inner.residual, np.nan)
    one = {"units": "1"}
    found: dict[str, Any] = {
        "brdf": (dims, values),
        "residual": (
            dims,
            pairs.on_grid(residual)[1],
            one | {"long_name": "ln(1 + cos^w f) of the fit minus the data"},
        ),
    }
    for j, (name, value) in enumerate(shape.items()):
        units = {"units": UNITS.get(name, "1")}
        found[name] = ((), value, units | {"long_name": f"fitted parameter {name}"})
        error = np.nan if errors is None else errors.shape[j]
        found[f"{name}_stderr"] = ((), error, units | {"long_name": f"standard error of {name}"})
    for k, name in enumerate(problem.names):
        error = np.full(inner.c[k].shape, np.nan) if errors is None else errors.coefficients[k]
        found[name] = ("wavelength", inner.c[k], one | {"long_name": f"fitted coefficient {name}"})
        found[f"{name}_stderr"] = ("wavelength", error, one | {"long_name": f"standard error of {name}"})
    names = [*shape, *problem.names]
    if errors is not None and names:
        two = ("parameter", "parameter_2")
        found["correlation"] = (two, errors.correlation, one | {"long_name": "correlation of the fitted parameters"})
    if isinstance(share, xr.DataArray):
        renamed = share.rename(theta_i="share_theta_i", theta_o="share_theta_o")
        texts = {"units": "1", "long_name": "share of light reflected once"}
        found["single_share"] = (renamed.dims, renamed.values, texts)
    result = xr.Dataset(found, coords={k: v for k, v in pairs.grid.coords.items()})
    if "correlation" in found:
        texts = {"units": "1", "long_name": "name of the parameter"}
        result = result.assign_coords({d: (d, names, texts) for d in ("parameter", "parameter_2")})
    if isinstance(share, xr.DataArray):
        for d in ("theta_i", "theta_o"):
            texts = {"units": "degree", "long_name": f"{d} of single_share"}
            result = result.assign_coords({f"share_{d}": (f"share_{d}", share[d].values, texts)})
    return label(result)


def _chi_square(data: xr.Dataset, fit: xr.Dataset, parameters: int) -> dict[str, float]:
    """Reduced χ² of the fit where the data have errors: 1 where the model is right and the errors are."""
    if "brdf_stderr" not in data:
        return {}
    from .metrics import align

    a, b = align(data, fit[["brdf"]])
    if "brdf_stderr" not in a:
        return {}
    error = a["brdf_stderr"].where(a["brdf_stderr"] > 0)
    pull = ((b["brdf"] - a["brdf"]) / error).values
    known = np.isfinite(pull)
    if known.sum() <= parameters:
        return {}
    return {"chi2_reduced": float(np.sum(pull[known] ** 2) / (known.sum() - parameters))}


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if value is None or isinstance(value, (str, int, float, bool, list, tuple)):
        return value
    return getattr(value, "name", str(value))


def _named(value: Any) -> str:
    return "none" if value is None else str(getattr(value, "name", value))
