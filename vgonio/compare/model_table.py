"""Thesis table 4.2 from any data: mean ΔE₀₀ of each fitted model per sample, and whether the difference is real."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from ..errors import InputError
from ..materials import Material
from ..models import find
from .colour import delta_e_2000
from .goodness import spectra_r2
from .metrics import nrmse
from .model_fit import fit_model
from .significance import HEIGHT_OF, no_shift

MODELS = ("cook-torrance-1982", "clausen-2022")


def fit_models(
    samples: Mapping[str, xr.Dataset],
    models: Sequence[str] = MODELS,
    material: str | Material | None = "Al",
    progress: Callable[[float], None] | None = None,
    only_where_known: Mapping[str, Any] | None = None,
    **options: Any,
) -> dict[str, dict[str, xr.Dataset]]:
    """Every model fitted to every sample: {sample: {model: fit}}.

    options : of `fit_model`;  only_where_known : parameters for those models that have them, None is not given
    Raises InputError without a sample or a model, and as `fit_model`.
    """
    if not samples or not models:
        raise InputError("nothing to fit: at least one sample and one model are needed")
    found: dict[str, dict[str, xr.Dataset]] = {}
    done, total = 0, len(samples) * len(models)
    for name, data in samples.items():
        found[name] = {}
        for model in models:
            known = find(model).parameters
            own = options | {k: v for k, v in (only_where_known or {}).items() if k in known and v is not None}
            at = done

            def part(x: float, at: int = at) -> None:
                if progress:
                    progress((at + x) / total)

            found[name][model] = fit_model(data, model, material=material, progress=part, **own)
            done += 1
    return found


def model_table(
    samples: Mapping[str, xr.Dataset],
    fits: Mapping[str, Mapping[str, xr.Dataset]],
    scale: str = "reference-Y50",
) -> list[dict[str, Any]]:
    """Rows sample, model, delta_e (mean ΔE₀₀, None without colour), nrmse, rms_residual, gain, gain_stderr, parameters.

    scale : of ΔE₀₀, see `delta_e_2000`. gain : by how much ΔE₀₀ is smaller than with the first model of the sample,
    mean over the same spectra, with its standard error (angles of incidence as observations, spectra where there are
    fewer than five).
    """
    rows = []
    for sample, models in fits.items():
        first: xr.DataArray | None = None
        for model, fit in models.items():
            difference, why = _difference(samples[sample], fit, scale)
            gain = _gain(first, difference)
            first = difference if first is None else first
            r2 = spectra_r2(samples[sample], fit) if "h" in fit or "h1" in fit else np.nan
            rows.append(
                {
                    "sample": sample,
                    "model": model,
                    "delta_e": None if difference is None else float(difference.mean()),
                    "nrmse": float(nrmse(samples[sample], fit)),
                    "rms_residual": fit.attrs["rms_residual"],
                    "gain": gain[0],
                    "gain_stderr": gain[1],
                    "parameters": parameter_text(fit, r2),
                    "notes": [*json.loads(fit.attrs["notes"]), *([f"no dE00: {why}"] if why else [])],
                }
            )
    return rows


def _difference(data: xr.Dataset, fit: xr.Dataset, scale: str) -> tuple[xr.DataArray | None, str]:
    try:
        return delta_e_2000(data, fit, scale), ""
    except InputError as e:  # a single wavelength, or a range without colour
        return None, str(e)


def _gain(first: xr.DataArray | None, second: xr.DataArray | None) -> tuple[float | None, float | None]:
    if first is None or second is None:
        return None, None
    gain = (first - second).transpose("theta_i", ...).values
    rows = [row[np.isfinite(row)] for row in gain.reshape(gain.shape[0], -1)]
    rows = [r for r in rows if r.size]
    if not rows:
        return None, None
    everything = np.concatenate(rows)
    if len(rows) < 5:
        return float(everything.mean()), float(everything.std(ddof=1) / np.sqrt(everything.size))
    sums, counts = np.array([r.sum() for r in rows]), np.array([r.size for r in rows])
    mean = sums.sum() / counts.sum()
    error = np.sqrt(np.sum((sums - mean * counts) ** 2) * len(rows) / (len(rows) - 1)) / counts.sum()
    return float(mean), float(error)


def parameter_text(fit: xr.Dataset, r2: float = np.nan) -> str:
    """alpha = 0.3500 ± 0.0002, h = …; coefficients as their range over the spectrum.

    Where h is no shift, by its error or by r2 of the normalised spectra, w means nothing: the reason stands there.
    """
    parts = []
    for name in json.loads(fit.attrs["free"]):
        value, error = float(fit[name]), float(fit[f"{name}_stderr"])
        height = HEIGHT_OF.get(name)
        why = no_shift(float(fit[height]), float(fit.get(f"{height}_stderr", np.nan)), r2) if height in fit else ""
        if why:
            parts.append(why)
            continue
        text = f"{name} = {value:.4g}" + (f" ± {error:.1g}" if np.isfinite(error) else "")
        units = str(fit[name].attrs.get("units", "1"))
        parts.append(text + ("" if units == "1" else f" {units}"))
    for name in json.loads(fit.attrs["coefficients"]):
        low, high = float(fit[name].min()), float(fit[name].max())
        parts.append(f"{name} = {low:.3g}" if np.isclose(low, high, rtol=1e-3) else f"{name} = {low:.3g} … {high:.3g}")
    return ", ".join(parts)
