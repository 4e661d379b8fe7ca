"""What is done to a measured field before it is used: level, mark outliers, fill, ISO 16610-61 Gaussian filters."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, VgonioWarning, nearest
from . import checks

if TYPE_CHECKING:
    from .heightfield import Heightfield

Floats = NDArray[np.float64]

LEVELS = {"none": 0, "mean": 1, "plane": 3, "quadratic": 6}
FILLS = ("interpolate", "nearest", "mean")
# a Gaussian weighting function transmits 50 % at its cut-off for this α (ISO 16610-21, -61)
GAUSSIAN_ALPHA = np.sqrt(np.log(2) / np.pi)


def level(surface: Heightfield, method: str = "plane") -> Heightfield:
    """Least-squares form removed: "none", "mean", "plane" or "quadratic" (each includes those before it).

    Missing points take no part and stay missing. A periodic field has no tilt or curvature that would not tear its
    seam open: only its mean is removed, and the history says so. InputError for an unknown method.
    """
    if method not in LEVELS:
        raise InputError(f"level = {method!r}: {nearest(str(method), LEVELS)}")
    if method == "none":
        return surface
    terms = 1 if surface.periodic else LEVELS[method]
    form, coefficients = _form(surface.z, terms)
    step = f"levelled: {method}" if terms == LEVELS[method] else f"levelled: mean only ({method} asked, periodic field)"
    if terms >= 3:
        ly, lx = surface.size_um
        tilt = np.rad2deg(np.arctan([2 * coefficients[1] / lx, 2 * coefficients[2] / ly]))
        step += f", tilt {tilt[0]:.4g}° along x and {tilt[1]:.4g}° along y removed"
    return surface.with_history(surface.z - form, step)


def _form(z: Floats, terms: int) -> tuple[Floats, Floats]:
    """(ny, nx) least-squares polynomial of 1, x, y, x², xy, y² on [−1, 1]², and its coefficients."""
    y, x = ((np.arange(n) + 0.5) * 2 / n - 1 for n in z.shape)
    one_y, one_x = np.ones_like(y), np.ones_like(x)
    basis = [(one_y, one_x), (one_y, x), (y, one_x), (one_y, x**2), (y, x), (y**2, one_x)][:terms]
    valid = np.isfinite(z)
    middle = z[valid].mean()
    heights = np.where(valid, z - middle, 0.0)
    weight = valid.astype(float)
    # separable basis: the normal equations are small sums of rows and columns
    normal = np.array([[(a * c) @ weight @ (b * d) for c, d in basis] for a, b in basis])
    right = np.array([a @ heights @ b for a, b in basis])
    coefficients = np.linalg.lstsq(normal, right, rcond=1e-12)[0]
    coefficients[0] += middle
    return sum(c * np.outer(a, b) for c, (a, b) in zip(coefficients, basis)), coefficients


def remove_outliers(surface: Heightfield, threshold: float = 6.0, size: int = 5) -> Heightfield:
    """Outliers marked as missing (NaN): points far from the median of their neighbourhood (Hampel 1974 identifier).

    A point is an outlier where |z − median| > threshold · s over the size × size points around it. s is the spread of
    their heights, interquartile range / 1.349 (the standard deviation of Gaussian heights), but at least the median of
    that over the field: so edges and steep places keep their points, and single spikes of an instrument do not. Where
    most of the field is exactly flat, s is at least the interquartile range of all heights / 1.349.

    threshold : from 3 up;  size : odd, from 3 up; else InputError. The share removed is written into the history.
    """
    limit = checks.number("threshold", threshold, 3.0)
    if checks.number("size", size, 3.0) % 2 != 1:
        raise InputError(f"size = {size!r}: an odd whole number of points from 3 on is needed")
    from scipy.ndimage import percentile_filter

    z = _nearest_valid(surface.z, np.isnan(surface.z), surface) if surface.missing else surface.z
    mode = "wrap" if surface.periodic else "mirror"
    low, middle, high = (percentile_filter(z, share, int(size), mode=mode) for share in (25, 50, 75))
    spread = (high - low) / 1.349
    typical = np.median(spread) or np.subtract(*np.percentile(z, [75, 25])) / 1.349
    outlier = (np.abs(z - middle) > limit * np.maximum(spread, typical)) & np.isfinite(surface.z)
    step = f"outliers: {int(outlier.sum())} points ({outlier.mean():.3%}) beyond {limit:g} local deviations removed"
    return surface.with_history(np.where(outlier, np.nan, surface.z), step)


def fill(surface: Heightfield, method: str = "interpolate") -> Heightfield:
    """Missing points filled: "interpolate", "nearest" or "mean".

    "interpolate" solves Laplace's equation over each hole with its rim as boundary: planes are reproduced, nothing
    overshoots, and at an edge of the field the surface runs out level. "nearest" takes the nearest valid point, "mean"
    the mean height. The share goes into the history; above 10 % a VgonioWarning tells that much of the surface is
    invented. InputError for an unknown method.
    """
    if method not in FILLS:
        raise InputError(f"fill = {method!r}: {nearest(str(method), FILLS)}")
    missing = np.isnan(surface.z)
    share = missing.mean()
    if not share:
        return surface
    if share > 0.1:
        text = f"{surface.name or 'surface'}: {share:.1%} of the points are missing: what fills them is no measurement"
        warnings.warn(text, VgonioWarning, stacklevel=2)
    if method == "mean":
        z = np.where(missing, np.nanmean(surface.z), surface.z)
    else:
        z = _nearest_valid(surface.z, missing, surface)
        if method == "interpolate":
            z = _harmonic(z, missing, surface)
    return surface.with_history(z, f"filled: {int(missing.sum())} missing points ({share:.3%}) by {method}")


def _nearest_valid(z: Floats, missing: NDArray[np.bool_], surface: Heightfield) -> Floats:
    """Each missing point takes the height of the nearest valid one, across the seam of a periodic field."""
    from scipy.ndimage import distance_transform_edt

    pad = [(n // 2, n // 2) if surface.periodic else (0, 0) for n in z.shape]
    holes = np.pad(missing, pad, mode="wrap")
    rows, columns = distance_transform_edt(holes, surface.pitch_um, return_distances=False, return_indices=True)
    inside = tuple(slice(p[0], p[0] + n) for p, n in zip(pad, z.shape))
    source = [(i[inside][missing] - p[0]) % n for i, p, n in zip((rows, columns), pad, z.shape)]
    filled = z.copy()
    filled[missing] = z[source[0], source[1]]
    return filled


def _harmonic(start: Floats, missing: NDArray[np.bool_], surface: Heightfield) -> Floats:
    """Missing points at the weighted mean of their four neighbours (discrete Laplace equation), from a first guess."""
    import scipy.sparse as sp
    from scipy.sparse.linalg import cg

    number = np.full(missing.shape, -1)
    number[missing] = np.arange(missing.sum())
    count = int(missing.sum())
    where = np.argwhere(missing)
    diagonal, right = np.zeros(count), np.zeros(count)
    rows, columns, values = [], [], []
    for axis, n in enumerate(missing.shape):
        for side in (-1, 1):
            beside = where.copy()
            beside[:, axis] += side
            there = np.ones(count, bool) if surface.periodic else (beside[:, axis] >= 0) & (beside[:, axis] < n)
            beside[:, axis] %= n
            weight = np.where(there, surface.pitch_um[axis] ** -2.0, 0.0)
            other = number[beside[:, 0], beside[:, 1]]
            known, unknown = there & (other < 0), there & (other >= 0)
            diagonal += weight
            right[known] += (weight * start[beside[:, 0], beside[:, 1]])[known]
            rows.append(np.flatnonzero(unknown))
            columns.append(other[unknown])
            values.append(-weight[unknown])
    laplace = sp.csr_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(count, count)
    ) + sp.diags_array(diagonal)
    middle = start[missing].mean()
    # symmetric positive definite: conjugate gradients, from the nearest heights, until 1e-10 of the right-hand side
    solution, unfinished = cg(
        laplace,
        right - middle * (laplace @ np.ones(count)),
        x0=start[missing] - middle,
        rtol=1e-10,
        M=sp.diags_array(1 / diagonal),
        maxiter=20 * max(missing.shape),
    )
    if unfinished:
        text = f"filling stopped after {unfinished} iterations: the largest holes are not quite smooth"
        warnings.warn(text, VgonioWarning, stacklevel=3)
    filled = start.copy()
    filled[missing] = solution + middle
    return filled


def gaussian_filter(surface: Heightfield, s_um: float | None = None, l_um: float | None = None) -> Heightfield:
    """Areal Gaussian filters of ISO 16610-61: the S-filter removes waves shorter than `s_um`, then the L-filter those
    longer than `l_um`.

    s_um, l_um : nesting indices (cut-off wavelengths) in µm, at which a wave keeps 50 % of its amplitude. The weighting
        function is exp(−π(r/αλ)²)/(αλ)², α = √(ln 2/π), so that a wave of length λ' keeps exp(−π(αλ/λ')²).

    On a periodic field the convolution wraps and is exact. Elsewhere the weights are divided by their sum over the
    valid points within the field (end-effect correction of order 0: level first); missing points stay missing.
    Raises InputError for a cut-off below two pitches or s_um ≥ l_um.
    """
    if s_um is None and l_um is None:
        return surface
    for name, cutoff in (("s_um", s_um), ("l_um", l_um)):
        if cutoff is not None and checks.positive(name, cutoff) < 2 * max(_sampled(surface)) * (1 - 1e-9):
            raise InputError(f"{name} = {cutoff:g} µm is below two pitches ({2 * max(_sampled(surface)):g} µm)")
    if s_um is not None and l_um is not None and not s_um < l_um:
        raise InputError(f"s_um = {s_um:g} µm and l_um = {l_um:g} µm: the S-filter has to be the shorter one")
    z = surface.z
    steps = []
    if s_um is not None:
        z = _low_pass(z, surface, float(s_um))
        steps.append(f"S-filter {s_um:g} µm")
    if l_um is not None:
        z = z - _low_pass(z, surface, float(l_um))
        steps.append(f"L-filter {l_um:g} µm")
    return surface.with_history(z, "ISO 16610-61 Gaussian " + ", ".join(steps))


def _sampled(surface: Heightfield) -> list[float]:
    """Pitches of the axes that have more than one sample."""
    return [h for h, n in zip(surface.pitch_um, surface.shape) if n > 1]


def _low_pass(z: Floats, surface: Heightfield, cutoff: float) -> Floats:
    """Mean line of the Gaussian filter, NaN where z is."""
    valid = np.isfinite(z)
    if surface.periodic and valid.all():
        return _smoothed(z, surface, cutoff)
    middle = z[valid].mean()
    sums = _smoothed(np.where(valid, z - middle, 0.0), surface, cutoff)
    weights = _smoothed(valid.astype(float), surface, cutoff)
    return np.where(valid, sums / np.where(valid, weights, 1.0) + middle, np.nan)


def _smoothed(values: Floats, surface: Heightfield, cutoff: float) -> Floats:
    """Convolution with the Gaussian weighting function: wrapped on a periodic field, else with zeros around it."""
    from scipy import fft

    for axis, (n, h) in enumerate(zip(surface.shape, surface.pitch_um)):
        if n == 1:
            continue
        # beyond 1.2 cut-offs the weights are below 1e-9 of the largest
        length = n if surface.periodic else fft.next_fast_len(n + min(int(np.ceil(1.2 * cutoff / h)), n), real=True)
        f = np.fft.rfftfreq(length, h)
        transfer = np.exp(-np.pi * (GAUSSIAN_ALPHA * cutoff * f) ** 2)
        shape = (-1, 1) if axis == 0 else (1, -1)
        spectrum = fft.rfft(values, length, axis=axis) * transfer.reshape(shape)
        values = np.take(fft.irfft(spectrum, length, axis=axis), np.arange(n), axis=axis)
    return values
