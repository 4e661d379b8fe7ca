"""How much of a measured colour shift each explanation gives: rays, waves, the fitted function; and how surely."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..dataset import takes_nodes
from ..errors import InputError, VgonioError
from ..materials import Material
from ..models.clausen_2022 import WAVELENGTH_N_NM
from .exponent import FEWEST_FOR_P
from .metrics import SAME_ANGLE_DEG, detector_dim
from .shift import fit_global_shift, fit_local_shift
from .significance import NO_SHIFT, SIGMAS, SMALLEST_NM, no_figures

Floats = NDArray[np.float64]
SAMPLES = 400  # bootstrap draws: their standard deviation is then known to 3.5 %


def kind_of(data: xr.Dataset) -> str:
    """What an explanation is: "rays", "single-scatter waves", "multiple-scatter waves", "fitted model" or "other"."""
    method, theory = str(data.attrs.get("method", "")), str(data.attrs.get("theory", ""))
    if method in ("fit", "model"):
        return "fitted model"
    if theory or method == "waves":
        bounces = data.attrs.get("bounces")
        several = theory == "full-wave" or (theory.startswith("iterated") if bounces is None else float(bounces) > 1)
        return "multiple-scatter waves" if several else "single-scatter waves"
    return "rays" if "brdf_by_bounce" in data or "rays" in method or "ray" in method else "other"


@takes_nodes
def explained_shares(
    measured: xr.Dataset,
    explanations: Mapping[str, xr.Dataset],
    material: str | Material | None = "Al",
    p: float | str = "fit",
    wavelength_n_nm: float = WAVELENGTH_N_NM,
    seed: int = 0,
) -> xr.Dataset:
    """Share of the measured slopes m that each explanation predicts, and that of the global shift fitted to them.

    share = 1 − Σ w (m − m_k)² / Σ w m², with w = 1/σ² of the measured slope; what the errors of both slopes alone would
    give is subtracted from both sums, for the fit what its parameters follow. 1 is all, 0 what "no shift" explains,
    negative worse than that.

    material, p, wavelength_n_nm : as in `fit_local_shift`

    Returns over `explanation` (the names, then "global shift"): share, share_stderr (bootstrap over angles of
    incidence, over spectra where there are fewer than five), chi2_reduced, slopes (how many), significance =
    share/share_stderr; `kind`. What could not be fitted, a global shift that is no shift of this form included, is left
    out, and attrs["left_out"] says why, as JSON {name: reason}.
    Raises InputError where the measurement has no usable spectra, and where it has no shift to explain, as a share of
    nothing is no number: slopes below 10⁻⁶ nm⁻¹, none beyond 3 σ, or Σ m²/σ² within 3 σ of what errors alone give.
    """
    if p == "fit" and measured.sizes["wavelength"] < FEWEST_FOR_P:
        p = 1.0
    own = fit_local_shift(measured, material, p, wavelength_n_nm)
    _require_shift(own)
    dim = detector_dim(measured)
    left_out: dict[str, str] = {}
    rows: list[dict[str, Any]] = []
    for name, data in explanations.items():
        try:
            local = fit_local_shift(data, material, p, wavelength_n_nm)
            rows.append(
                {"name": name, "kind": kind_of(data)} | _share(own, local["slope"], local["slope_stderr"], 0, seed)
            )
        except VgonioError as e:
            left_out[name] = str(e)
    try:
        fit = fit_global_shift(measured, material, p, "fit", wavelength_n_nm)
        why = no_figures(*(float(fit[k]) for k in ("h", "h_stderr", "r2")))
        if why:
            raise InputError(f"{why}: what the fit says of the slopes is no explanation")
        zero = xr.zeros_like(fit["slope_global"])
        parameters = 3 + (fit.attrs["p"].startswith("fitted"))
        rows.append(
            {"name": "global shift", "kind": "empirical model"}
            | _share(own, fit["slope_global"], zero, parameters, seed)
        )
    except VgonioError as e:
        left_out["global shift"] = str(e)
    if not rows:
        raise InputError(f"nothing explains the shift: {'; '.join(f'{k}: {v}' for k, v in left_out.items())}")
    return _assembled(rows, dim, left_out)


def _require_shift(own: xr.Dataset) -> None:
    """Raise InputError where all slopes together are rounding, or what their errors give by chance."""
    m, sigma = own["slope"].values, own["slope_stderr"].values
    known = np.isfinite(m) & np.isfinite(sigma) & (sigma > 0)
    if not known.any():
        return  # what is missing is said where slopes are counted
    m, sigma = m[known], _floored(sigma[known])
    w = 1 / sigma**2
    height = float(np.sqrt(np.sum(w * m**2) / np.sum(w)))
    # χ² of n slopes scatters by √(2n) about n
    excess = float(np.sum(w * m**2 - 1) / np.sqrt(2 * m.size))
    if height < SMALLEST_NM or excess < SIGMAS or float(np.max(np.abs(m) / sigma)) < SIGMAS:
        why = f"below {SMALLEST_NM:g} nm⁻¹" if height < SMALLEST_NM else "no more than their errors give"
        raise InputError(f"{NO_SHIFT} to explain: the slopes of the reference are {height:.2g} nm⁻¹, {why}")


def _floored(sigma: Floats) -> Floats:
    """A slope whose scatter is small by luck must not rule."""
    return np.maximum(sigma, 0.1 * np.median(sigma))


def _assembled(rows: list[dict[str, Any]], dim: str, left_out: dict[str, str]) -> xr.Dataset:
    texts = {
        "share": "share of the measured slopes that is explained",
        "share_stderr": "standard error of share",
        "significance": "share over its standard error",
        "chi2_reduced": "mean squared difference of the slopes in units of both errors",
        "slopes": "pairs of directions with a slope in both",
    }
    names = [r["name"] for r in rows]
    variables = {
        k: ("explanation", np.array([r[k] for r in rows], float), {"units": "1", "long_name": text})
        for k, text in texts.items()
    }
    one = {"units": "1", "long_name": "name of the explanation"}
    kinds = ("explanation", [r["kind"] for r in rows], {"units": "1", "long_name": "kind of the explanation"})
    return xr.Dataset(
        variables,
        coords={"explanation": ("explanation", names, one), "kind": kinds},
        attrs={
            "method": "explained shares of the slope",
            "directions": dim,
            "left_out": json.dumps(left_out, ensure_ascii=False) if left_out else "",
        },
    )


def _share(own: xr.Dataset, slope: xr.DataArray, stderr: xr.DataArray, parameters: int, seed: int) -> dict[str, float]:
    dims = own["slope"].dims
    other = xr.Dataset({"m": slope, "s": stderr})
    coords = {d: own[d] for d in dims if d in own.coords}
    other = other.reindex(coords, method="nearest", tolerance=SAME_ANGLE_DEG)
    m, sigma = own["slope"].values, own["slope_stderr"].values
    m_k, sigma_k = (other[k].transpose(*dims).values for k in ("m", "s"))
    known = np.isfinite(m) & np.isfinite(m_k) & np.isfinite(sigma) & (sigma > 0)
    if known.sum() < max(5, parameters + 2):
        raise InputError(
            f"{int(known.sum())} slopes in common with the measurement, {max(5, parameters + 2)} are needed"
        )
    row = np.broadcast_to(np.arange(m.shape[0])[:, None], m.shape)[known]
    m, sigma, m_k, sigma_k = m[known], sigma[known], m_k[known], np.nan_to_num(sigma_k[known])
    sigma = _floored(sigma)
    w = 1 / sigma**2
    freedom = parameters / m.size
    terms = np.stack([w * m**2 - 1, w * ((m - m_k) ** 2 - sigma_k**2) - (1 - freedom)], axis=1)
    total = terms.sum(axis=0)
    if total[0] <= 0:
        raise InputError(f"{NO_SHIFT} to explain: the slopes in common do not exceed their errors")
    share = 1 - total[1] / total[0]
    error = _bootstrap(terms, row, seed)
    return {
        "share": share,
        "share_stderr": error,
        "significance": share / error if error > 0 else np.inf,
        "chi2_reduced": float(np.sum((m - m_k) ** 2 / (sigma**2 + sigma_k**2)) / max(m.size - parameters, 1)),
        "slopes": m.size,
    }


def _bootstrap(terms: Floats, row: NDArray[np.intp], seed: int) -> float:
    """Standard error of 1 − Σ rest / Σ total over clusters drawn with replacement."""
    present = np.unique(row)
    cluster = np.searchsorted(present, row) if present.size >= 5 else np.arange(len(terms))
    count = int(cluster.max()) + 1
    sums = np.stack([np.bincount(cluster, t, count) for t in terms.T], axis=1)
    drawn = np.random.default_rng(seed).multinomial(count, np.full(count, 1 / count), size=SAMPLES) @ sums
    good = drawn[:, 0] > 0
    return float(np.std(1 - drawn[good, 1] / drawn[good, 0], ddof=1)) if good.sum() > 1 else float("nan")
