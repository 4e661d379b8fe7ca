"""Autocorrelation and power spectral density of a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, nearest
from .heightfield import Heightfield

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Autocorrelation:
    """values (ny, nx), 1 at zero lag, over the lags y_um (ny,) and x_um (nx,), ascending."""

    y_um: Floats
    x_um: Floats
    values: Floats


def about_mean(z: Floats) -> Floats:
    """Heights about their mean; exactly 0 where all are equal, however large an offset they have in common."""
    first = z.ravel()[np.flatnonzero(np.isfinite(z).ravel())[0]]
    d = z - first
    return d - np.nanmean(d)


def autocorrelation(surface: Heightfield) -> Autocorrelation:
    """Autocorrelation ⟨z(r) z(r + d)⟩/Sq² of the heights about their mean, for lags up to half the sides.

    Circular on a periodic field. Elsewhere, and where points are missing, each lag is the mean over the pairs of valid
    points that are that far apart (no bias towards long lags; lags without pairs are NaN).
    Raises InputError for a flat field.
    """
    from scipy import fft

    valid = np.isfinite(surface.z)
    z = np.where(valid, about_mean(surface.z), 0.0)
    variance = (z**2).sum() / valid.sum()
    if variance == 0:
        raise InputError(f"{surface.name or 'the surface'} is flat: it has no autocorrelation")
    size = z.shape if surface.periodic else [fft.next_fast_len(n + n // 2 + 1, real=True) for n in z.shape]
    products, pairs = (fft.irfft2(np.abs(fft.rfft2(a, size)) ** 2, size) for a in (z, valid.astype(float)))
    with np.errstate(invalid="ignore", divide="ignore"):
        values = np.where(pairs > 0.5, products / np.rint(pairs), np.nan) / variance
    lags = [np.arange(-(n // 2), n - n // 2) if surface.periodic else np.arange(-(n // 2), n // 2 + 1) for n in z.shape]
    y, x = (lag * h for lag, h in zip(lags, surface.pitch_um))
    return Autocorrelation(y, x, values[np.ix_(lags[0] % size[0], lags[1] % size[1])])


@dataclass(frozen=True)
class PowerSpectrum:
    """Two-dimensional PSD, values (ny, nx) in µm⁴ over frequencies fy (ny,) and fx (nx,) in 1/µm, ascending.

    The sum of values · Δfx · Δfy over all frequencies of both signs is Sq².
    """

    fy: Floats
    fx: Floats
    values: Floats

    def radial(self) -> RadialSpectrum:
        """Mean over rings one frequency step wide, up to the corners of the frequency plane; zero is left out."""
        dfy, dfx = _step(self.fy), _step(self.fx)
        ring_width = max(d for d, f in ((dfy, self.fy), (dfx, self.fx)) if f.size > 1)
        f = np.hypot(self.fy[:, None], self.fx[None])
        ring = np.rint(f / ring_width).astype(np.int64)
        # frequencies nearer to zero than half a ring belong to the first one, zero itself to none
        ring = np.where(f > 0, np.maximum(ring, 1), 0)
        count = np.bincount(ring.ravel())
        total = np.bincount(ring.ravel(), self.values.ravel())
        moment = np.bincount(ring.ravel(), f.ravel())
        kept = np.flatnonzero(count[1:]) + 1
        area = np.asarray(count[kept] * dfy * dfx, np.float64)
        return RadialSpectrum(moment[kept] / count[kept], total[kept] / count[kept], area)


@dataclass(frozen=True)
class RadialSpectrum:
    """PSD averaged over rings: mean frequency f (n,) in 1/µm, values (n,) in µm⁴ and ring area (n,) in µm⁻².

    The sum of values · area is Sq², as the integral of values · 2πf df would be for a smooth spectrum.
    """

    f: Floats
    values: Floats
    area: Floats


def psd(surface: Heightfield, window: str = "auto") -> PowerSpectrum:
    """Two-sided two-dimensional power spectral density of the heights about their mean.

    window : "none"; "hann" against the leakage of a field that does not continue by itself, rescaled so that the
        integral is Sq² again; "auto": none on a periodic field, else hann

    Level a measured field first. Raises InputError where points are missing (Elson and Bennett 1995, Appl. Opt. 34).
    """
    surface.require_complete()
    if window not in ("auto", "none", "hann"):
        raise InputError(f"window = {window!r}: {nearest(str(window), ('auto', 'none', 'hann'))}")
    z = about_mean(surface.z)
    fy, fx = (np.fft.fftshift(np.fft.fftfreq(n, h)) for n, h in zip(z.shape, surface.pitch_um))
    scale = 1.0 / (z.size**2 * _step(fy) * _step(fx))
    if window == "hann" or (window == "auto" and not surface.periodic):
        variance = np.mean(z**2)
        wy, wx = (np.ones(1) if n == 1 else np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2 for n in z.shape)
        z = z * np.outer(wy, wx)
        scale *= float(variance / np.mean(z**2)) if variance > 0 else 1.0
    return PowerSpectrum(fy, fx, np.abs(np.fft.fftshift(np.fft.fft2(z))) ** 2 * scale)


def _step(f: Floats) -> float:
    """Frequency step of an axis; 1/µm for an axis of one sample, whose PSD is then per unit frequency."""
    return float(f[1] - f[0]) if f.size > 1 else 1.0
