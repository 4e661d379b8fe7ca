"""The whole comparison of several results as one dataset: every one by itself, every pair, and the reference's shift.

`summary` makes rows of it; what the command line prints and the page shows is read from here.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Hashable, Mapping
from typing import Any

import numpy as np
import xarray as xr

from ..dataset import ascending, check, label
from ..errors import InputError, VgonioError, nearest
from ..materials import Material
from ..models.clausen_2022 import WAVELENGTH_N_NM
from .alike import unlike
from .bright import bright_spectra
from .colour import SCALES, delta_e_2000
from .explained import explained_shares
from .exponent import FEWEST_FOR_P
from .looks import looks
from .metrics import SAME_ANGLE_DEG, align, detector_dim, labelled, nrmse, rmse
from .pair_figures import pair_figures
from .r2_error import r2_error
from .reference import chosen_reference, reference_last
from .shift import fit_global_shift, fit_local_shift
from .spectra import inside_table

_SPECTRAL = {"theta_i", "theta_o", "cell", "wavelength"}
_AXES = ("theta_i", "theta_o", "wavelength")
# of each result: what pairs are compared by, and the reflected energies that a simulation has summed up
_KEPT = ("brdf", "brdf_stderr", "energy_reflected", "energy_reflected_stderr", "renormalisation", "energy_by_bounce",
         "rays")  # fmt: skip
_NAMES = {
    "result": "name of the result",
    "pair": "two results, the second is the reference",
    "pair_predicted": "first result of the pair",
    "pair_reference": "second result of the pair, the reference",
}


def compare(
    results: Mapping[str, xr.Dataset | xr.DataTree] | xr.DataTree,
    reference: str | None = None,
    material: str | Material | None = "Al",
    *,
    scale: str = "reference-Y50",
    p: float | str = "fit",
    wavelength_n_nm: float = WAVELENGTH_N_NM,
    instruments: bool = True,
) -> xr.Dataset:
    """Compare results by name, or the groups of a DataTree that hold a BRDF: the group `comparison` of a result.

    reference : name of the result that the others are measured against; by default the most trusted: measured, then
        full wave, iterated Kirchhoff, rays, Kirchhoff, Harvey–Shack (`reference.TRUST`), among equals the last
    material : of the Fresnel reflectance in the shift fits, None for F = 1;  p, wavelength_n_nm : of the shift fits
    scale : of ΔE₀₀, see `delta_e_2000`;  instruments : False leaves out what instruments of one number would read
    Over `result`: slope, slope_stderr, slope_p, slope_r2, slope_global, slope_bright (…, theta_i, theta_o or cell; the
    last is 1 where there is light enough for a colour, see `bright.bright_spectra`); shift_h,
    shift_w, shift_t_y, shift_p with their standard errors, and shift_r2.
    Over `result` as well what instruments would read, see `looks`: gloss_20, gloss_60, gloss_85, haze_20, and
    reflectance, tis (…, theta_i).
    Over `pair` ("a and b", b is the reference): rmse, nrmse, rmse_spectral, nrmse_spectral (…, wavelength),
    delta_e_2000 (…, theta_i, theta_o or cell), values_compared, values_left_out, and the figures of
    `pair_figures.TEXTS`: median_difference, delta_e_mean, delta_e_colour (of the colour alone), …
    Over `explanation` (the other results and the global shift): explained_share, _significance, _chi2_reduced, _slopes,
    _kind, of the reference's shift, see `explained_shares`.
    What has a standard error has it beside it as …_stderr, in the same unit: figures of a pair where both BRDFs have
    errors. attrs["unlike"] names, as JSON {pair: words}, what was not simulated alike.
    Missing grid points are NaN. What could not be computed is absent or NaN, and attrs["skipped"] says why, as JSON
    {part: reason}; attrs["not_covered"] does so, {result: {quantity: reason}}, for what instruments would read.
    Raises InputError for no result, an unknown reference or an unknown scale.
    """
    if scale not in SCALES:
        raise InputError(f"scale {scale!r} of a colour difference: {nearest(scale, SCALES)}")
    named = _split(_datasets(results))
    last, why = chosen_reference(named, reference)
    # the reference last, so that it is the second of every pair it is in
    named = {name: named[name] for name in [*(n for n in named if n != last), last]}
    skipped: dict[str, str] = {}
    named = _same_directions(named, skipped)
    missing: dict[str, dict[str, str]] = {}
    parts = [_shift_parts(name, data, material, p, wavelength_n_nm, skipped) for name, data in named.items()]
    if instruments:
        parts = [xr.merge([part, _looks(name, named[name], missing)], join="outer") for part, name in zip(parts, named)]
    oriented = [reference_last(a, b, named, last) for a, b in itertools.combinations(named, 2)]
    pairs = [_pair_parts(a, b, named, scale, wavelength_n_nm, skipped) for a, b in oriented]
    merged = _side_by_side(parts, [pair for pair in pairs if pair is not None])
    shares, why_none = _explained(named, material, p, wavelength_n_nm, skipped)
    merged = merged.merge(shares)
    apart = {f"{a} and {last}": unlike(data, named[last]) for a, data in named.items() if a != last}
    merged.attrs = {
        "method": "comparison",
        "results": json.dumps(list(named)),
        "reference": last,
        "reference_chosen": why,
        "material": "none (F = 1)" if material is None else str(getattr(material, "name", material)),
        "exponent": str(p),
        "wavelength_n": float(wavelength_n_nm),
        "delta_e_scale": scale,
        "skipped": json.dumps(skipped, ensure_ascii=False),
        "not_covered": json.dumps(missing, ensure_ascii=False),
        "not_explained": why_none,
        "unlike": json.dumps({pair: words for pair, words in apart.items() if words}, ensure_ascii=False),
    }
    return merged


def _datasets(results: Mapping[str, xr.Dataset | xr.DataTree] | xr.DataTree) -> dict[str, xr.Dataset]:
    if isinstance(results, xr.DataTree):
        results = {str(k): node for k, node in results.children.items() if "brdf" in node.data_vars}
    if not results:
        raise InputError("nothing to compare: no result with a BRDF")
    flat = {str(k): data.to_dataset() if isinstance(data, xr.DataTree) else data for k, data in results.items()}
    return {name: ascending(check(data, f"result {name!r}")) for name, data in flat.items()}


def _split(results: Mapping[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    """Results with a further dimension, as several theories or polarisations, become one result for each entry."""
    found: dict[str, xr.Dataset] = {}
    for name, data in results.items():
        data = data[[v for v in _KEPT if v in data]]
        further = [d for d in data["brdf"].dims if d not in _SPECTRAL]
        for index in np.ndindex(*(data.sizes[d] for d in further)):
            chosen: dict[Hashable, int] = dict(zip(further, index))
            tags = [str(data[d].values[i]) if d in data.coords else str(i) for d, i in chosen.items()]
            found[":".join([name, *tags])] = data.isel(chosen).drop_vars(further, errors="ignore")
    return found


def _same_directions(results: dict[str, xr.Dataset], skipped: dict[str, str]) -> dict[str, xr.Dataset]:
    """Only what shares the kind of detector (and the cells) of the reference: the rest has no common dimensions."""
    name, reference = list(results.items())[-1]
    kept = {}
    for other, data in results.items():
        try:
            if detector_dim(data) == "cell" or detector_dim(reference) == "cell":
                align(data, reference)
            kept[other] = data
        except InputError as e:
            skipped[other] = f"{e} (reference: {name})"
    return kept


def _attempt(part: str, skipped: dict[str, str], function: Callable[[], Any]) -> Any:
    """The result of a part, or None and the reason among `skipped`: one gap must not cost the whole comparison."""
    try:
        return function()
    except VgonioError as e:
        skipped[part] = str(e)
        return None


def _shift_parts(
    name: str, data: xr.Dataset, material: Any, p: float | str, wavelength_n_nm: float, skipped: dict[str, str]
) -> xr.Dataset:
    if p == "fit" and data.sizes["wavelength"] < FEWEST_FOR_P:
        p = 1.0
    part = f"local shift of {name}"
    inside = _attempt(part, skipped, lambda: inside_table(data, material))
    if inside is None:
        return xr.Dataset(coords={"result": name})
    data, words = inside
    if words:
        skipped[f"wavelengths of the shift of {name}"] = words
    local = _attempt(part, skipped, lambda: fit_local_shift(data, material, p, wavelength_n_nm))
    if local is None:
        return xr.Dataset(coords={"result": name})
    lit = (
        bright_spectra(data)
        .astype(float)
        .transpose("theta_i", detector_dim(data))
        .drop_vars("solid_angle", errors="ignore")
    )
    local["slope_bright"] = labelled(lit, "", "1", "1 where there is light enough for a colour, else 0")
    found = local.rename(p="slope_p", r2="slope_r2").drop_vars("p_stderr").assign_coords(result=name)
    fit = _attempt(
        f"global shift of {name}", skipped, lambda: fit_global_shift(data, material, p, "fit", wavelength_n_nm)
    )
    if fit is None:
        return found
    fit["r2_stderr"] = labelled(xr.DataArray(r2_error(data, fit)), "", "1", "standard error of r2")
    scalars = {k: f"shift_{k}" for k, v in fit.data_vars.items() if v.ndim == 0}
    return found.assign(fit.drop_vars("theta_m").rename(scalars).data_vars)


def _looks(name: str, data: xr.Dataset, missing: dict[str, dict[str, str]]) -> xr.Dataset:
    found, missing[name] = looks(data)
    return found


def _explained(
    results: Mapping[str, xr.Dataset], material: Any, p: float | str, wavelength_n_nm: float, skipped: dict[str, str]
) -> tuple[xr.Dataset, str]:
    """Shares of the shift of the last result that each of the others explains; or why there are none."""
    *others, last = results
    if not others:
        return xr.Dataset(), "there is one result alone"
    try:
        found = explained_shares(results[last], {name: results[name] for name in others}, material, p, wavelength_n_nm)
    except VgonioError as e:
        return xr.Dataset(), str(e)
    left_out = json.loads(found.attrs["left_out"] or "{}")
    skipped |= {f"explained share of {last} by {name}": why for name, why in left_out.items()}
    names = {str(k): f"explained_{k}" for k in (*found.data_vars, "kind")}
    return found.reset_coords("kind").rename(names).drop_attrs(deep=False), ""


def _pair_parts(
    a: str, b: str, results: Mapping[str, xr.Dataset], scale: str, wavelength_n_nm: float, skipped: dict[str, str]
) -> xr.Dataset | None:
    """Errors of `a` against the reference `b`."""
    pair = f"{a} and {b}"
    aligned = _attempt(pair, skipped, lambda: align(results[b], results[a]))
    if aligned is None:
        return None
    reference, predicted = aligned
    angles = ("theta_i", detector_dim(reference))
    left_out = int(rmse(reference, predicted).attrs["values_left_out"])
    found = pair_figures(reference, predicted, scale, wavelength_n_nm) | {
        "rmse_spectral": rmse(reference, predicted, angles),
        "nrmse_spectral": nrmse(reference, predicted, angles),
        "values_left_out": labelled(xr.DataArray(left_out), "", "1", "values that one of the two results lacks"),
        "values_compared": labelled(
            xr.DataArray(reference["brdf"].size - left_out), "", "1", "common values that the errors are taken over"
        ),
    }
    difference = _attempt(f"colour of {pair}", skipped, lambda: delta_e_2000(reference, predicted, scale))
    if difference is not None:
        found["delta_e_2000"] = difference
    return xr.Dataset(found).assign_coords(pair=pair, pair_predicted=a, pair_reference=b)


def _side_by_side(results: list[xr.Dataset], pairs: list[xr.Dataset]) -> xr.Dataset:
    """One dataset with the dimensions `result` and `pair` over the union of all grids; what a part lacks is NaN."""
    parts = [*results, *pairs]
    axes = {d: _union([part[d].values for part in parts if d in part.dims]) for d in _AXES}
    axes = {d: values for d, values in axes.items() if values.size}
    merged = xr.Dataset(coords={d: (d, values) for d, values in axes.items()})
    for part in parts:
        if "cell" in part.dims:
            merged = merged.assign_coords({k: part[k] for k in ("cell", "theta_o", "phi_o")})
    for dim, group in (("result", results), ("pair", pairs)):
        if not group:
            continue
        for name in ("result",) if dim == "result" else ("pair", "pair_predicted", "pair_reference"):
            texts = {"units": "1", "long_name": _NAMES[name]}
            merged = merged.assign_coords({name: (dim, [str(part[name].values) for part in group], texts)})
        gridded = [part.reindex(_axes_of(part, axes), method="nearest", tolerance=SAME_ANGLE_DEG) for part in group]
        for variable in sorted({str(v) for part in group for v in part.data_vars}):
            merged[variable] = _stack([part.get(variable) for part in gridded], dim)
    return label(merged)


def _axes_of(part: xr.Dataset, axes: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {d: values for d, values in axes.items() if d in part.dims}


def _union(grids: list[np.ndarray]) -> np.ndarray:
    """Sorted values of all grids; those that differ by less than the tolerance of `align` are one."""
    values = np.sort(np.concatenate([np.zeros(0), *grids]))
    return values[np.concatenate([[True], np.diff(values) > SAME_ANGLE_DEG])] if values.size else values


def _stack(arrays: list[xr.DataArray | None], dim: str) -> tuple[tuple[str, ...], np.ndarray, dict[str, Any]]:
    known = next(array for array in arrays if array is not None)
    empty = np.full(known.shape, np.nan)
    values = [empty if array is None else array.transpose(*known.dims).values for array in arrays]
    return (dim, *map(str, known.dims)), np.stack(values), {k: known.attrs[k] for k in ("units", "long_name")}
