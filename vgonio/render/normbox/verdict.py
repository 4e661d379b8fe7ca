"""What a validation says in figures: errors of each model, what explains them, what is left."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .comparison import LARGEST_SMALL_ANGLE, compare, correlations

Floats = NDArray[np.float64]


def group(model: str) -> str:
    """Group of the tree that holds the prediction with a model."""
    return f"predicted_{model}"


def verdict(tree: xr.DataTree) -> dict[str, Any]:
    """The figures of a validation.

    models : NRMSE (mean of all, of small and of large angles), mean ΔE₀₀ and ΔE₇₆, correlations of each;
    removed : share of the first model's mean square NRMSE that each further model removes;
    modelled : mean NRMSE of the two-term model, its correlation with what was found, and the regressed terms;
    path : mean of the combined sources of error, the largest of them (without the fits);
    virtual only: fit : NRMSE of each model against the prediction with true BRDFs, `fit_share` its share of the mean
    square NRMSE, noise : that of the true prediction against the reference
    """
    names = json.loads(tree.attrs["models"])
    sets = {n: tree[group(n)].to_dataset() for n in names}
    found: dict[str, Any] = {"models": {n: _figures(d) for n, d in sets.items()}}
    squares = {n: float((d["nrmse"] ** 2).mean()) for n, d in sets.items()}
    found["removed"] = {n: 1 - squares[n] / squares[names[0]] for n in names[1:]}
    model = tree["error_model"].to_dataset()
    observed = sets[names[0]]["nrmse"].values.ravel()
    found["modelled"] = {
        "nrmse": float(model["modelled_nrmse"].mean()),
        "correlation": _correlation(observed, model["modelled_nrmse"].values.ravel()),
        "spectral_correlation": float(model.attrs["spectral_correlation"]),
        **json.loads(model.attrs["regressed"]),
    }
    if "error_path" in tree.children:
        path = tree["error_path"].to_dataset()
        each = np.sqrt((path["deviation"].values ** 2).mean(axis=(1, 2)))
        small = path["angle"].values <= LARGEST_SMALL_ANGLE
        squared = path["combined"].values ** 2
        found["path"] = {
            "combined": float(np.sqrt(squared.mean())),
            "combined_small": _root_mean(squared[:, small]),
            "combined_large": _root_mean(squared[:, ~small]),
            "sources": {str(n): float(x) for n, x in zip(path["source"].values, each)},
        }
    if "true" in tree.children:
        true, reference = (tree[g].to_dataset()["radiance"] for g in ("true", "reference"))
        fit = {n: float((compare(true, d["radiance"])["nrmse"] ** 2).mean()) for n, d in sets.items()}
        found["fit"] = {n: float(np.sqrt(x)) for n, x in fit.items()}
        found["fit_share"] = {n: min(1.0, fit[n] / squares[n]) for n in names}
        found["noise"] = float(np.sqrt((compare(reference, true)["nrmse"] ** 2).mean()))
    return found


def _figures(data: xr.Dataset) -> dict[str, Any]:
    small = data["angle"] <= LARGEST_SMALL_ANGLE
    return {
        "nrmse": float(data["nrmse"].mean()),
        "nrmse_rms": float(np.sqrt((data["nrmse"] ** 2).mean())),
        "nrmse_rms_small": float(np.sqrt((data["nrmse"].where(small) ** 2).mean())),
        "nrmse_rms_large": float(np.sqrt((data["nrmse"].where(~small) ** 2).mean())),
        "nrmse_small": float(data["nrmse"].where(small).mean()),
        "nrmse_large": float(data["nrmse"].where(~small).mean()),
        "delta_e_2000": float(data["delta_e_2000"].mean()),
        "delta_e_1976": float(data["delta_e_1976"].mean()),
        "correlations": correlations(data),
    }


def _root_mean(squares: Floats) -> float:
    return float(np.sqrt(squares.mean())) if squares.size else float("nan")


def _correlation(x: Any, y: Any) -> float:
    return float(np.corrcoef(x, y)[0, 1]) if x.size > 2 and np.ptp(x) > 0 and np.ptp(y) > 0 else float("nan")


def spectral_correlation(predicted: xr.DataArray, fit: xr.DataArray) -> float:
    """Mean over patches and small angles of the correlation of NSE_pred(λ) with NSE_fit(λ) (thesis figure 3.8)."""
    small = predicted["angle"].values <= LARGEST_SMALL_ANGLE
    both = zip(*(x.values[:, small].reshape(-1, x.sizes["wavelength"]) for x in (predicted, fit)))
    found = [_correlation(a, b) for a, b in both if np.isfinite(a).all() and np.isfinite(b).all()]
    return float(np.nanmean(found)) if found and np.isfinite(found).any() else float("nan")
