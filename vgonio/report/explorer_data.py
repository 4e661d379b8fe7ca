"""What the page to explore a result embeds: its numbers as base64, float32, and shares by reflections in 256 steps."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ..errors import InputError, VgonioError
from . import quantities as q
from .brdf_figures import bounce_names
from .content import Content
from .hemisphere_figures import cell_borders
from .style import bounce_colours, colours

LARGEST = 12_000_000  # bytes of numbers; of more, wavelengths and then angles of incidence are left out evenly
FEWEST = 8  # of either that are kept
UNKNOWN = 255  # share that too few rays tell; the others are whole numbers 0 … 254


def embedded(content: Content) -> dict[str, Any]:
    """Everything that the page's script needs, ready for JSON: the results, a colour scale and what was left out.

    Arrays are base64 of little-endian float32 (brdf and error (theta_i, detector, wavelength), linear sRGB
    (theta_i, detector, 3), borders of cells (cell, 4) in degrees) or uint8 (shares (bounce, theta_i, detector,
    wavelength)). Raises InputError for a result without a BRDF.
    """
    if not content.results:
        raise InputError("this result holds no BRDF: there is nothing to explore")
    colour = colours(list(content.results))
    kept, notes = {}, []
    room = LARGEST // len(content.results)
    for name, data in content.results.items():
        kept[name], note = thinned(data, room)
        notes += [f"{q.title(name, data)}: {note}"] if note else []
    results = [_result(name, data, colour[name]) for name, data in kept.items()]
    return {"results": results, "cividis": _scale() if content.sphere else "", "notes": notes}


def thinned(data: xr.Dataset, most: int) -> tuple[xr.Dataset, str]:
    """The result with every second wavelength or θᵢ left out until it fits into `most` bytes, and a note of it."""
    before = {dim: data.sizes[dim] for dim in ("wavelength", "theta_i")}
    for dim in before:
        while _bytes(data) > most and data.sizes[dim] >= 2 * FEWEST:
            data = data.isel({dim: slice(None, None, 2)})
    names = {"wavelength": "wavelengths", "theta_i": "angles of incidence"}
    left = [f"{data.sizes[d]} of {n} {names[d]}" for d, n in before.items() if data.sizes[d] < n]
    return data, f"{' and '.join(left)} are on this page" if left else ""


def _bytes(data: xr.Dataset) -> int:
    each = 4 + 4 * ("brdf_stderr" in data) + data.sizes.get("bounce", 0) * ("brdf_by_bounce" in data)
    return data["brdf"].size * each


def coded(values: ArrayLike, kind: str = "<f4") -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")


def _result(name: str, data: xr.Dataset, colour: str) -> dict[str, Any]:
    """One result: its grid, its numbers, and which detector elements make up the plane of incidence."""
    further = set(data["brdf"].dims) - {"theta_i", "theta_o", "cell", "wavelength"}
    if further:
        raise InputError(f"results over {', '.join(map(str, sorted(further, key=str)))} cannot be explored: select one")
    order = ("theta_i", "theta_o" if q.in_plane(data) else "cell", "wavelength")
    signed, index = plane_elements(data)
    rgb, exposure, reason = _linear_rgb(data, order[:2])
    return {
        "name": name,
        "title": q.title(name, data),
        "colour": colour,
        "theta_i": data["theta_i"].values.tolist(),
        "wavelength": data["wavelength"].values.tolist(),
        "theta_o": signed.tolist(),
        "index": index.tolist(),
        "detectors": data.sizes[order[1]],
        "phi_i": float(data.get("phi_i", 0.0)),
        "brdf": coded(data["brdf"].transpose(*order)),
        "error": coded(data["brdf_stderr"].transpose(*order)) if "brdf_stderr" in data else "",
        "rgb": rgb,
        "exposure": exposure,
        "no_rgb": reason,
        "bounces": _bounces(data, order) if "brdf_by_bounce" in data else None,
        "cells": "" if q.in_plane(data) else coded(cell_borders(data)),
    }


def plane_elements(data: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """(n,) signed angles θₒ, ascending, and the detector element of each.

    On a hemisphere these are the cells that the plane of incidence cuts, one for each ring and side.
    """
    if q.in_plane(data):
        return data["theta_o"].values, np.arange(data.sizes["theta_o"])
    theta = data["theta_o"].values
    away = np.deg2rad(data["phi_o"].values - float(data.get("phi_i", 0.0)))
    signed, index = [], []
    for ring in np.unique(np.round(theta, 6)):
        inside = np.flatnonzero(np.abs(theta - ring) < 1e-5)
        for side in (-1.0, 1.0) if inside.size > 1 else (1.0,):
            best = inside[np.argmax(side * np.cos(away[inside]))]
            signed.append(side * ring if inside.size > 1 else 0.0)
            index.append(best)
    order = np.argsort(signed)
    return np.array(signed)[order], np.array(index)[order]


def _linear_rgb(data: xr.Dataset, dims: tuple[str, str]) -> tuple[str, float, str]:
    """Linear sRGB, the exposure that brings the 98th percentile to white, and why there is none."""
    from ..compare.colour import linear_srgb, rgb_map, xyz

    if not q.spectral(data):
        return "", 1.0, f"colour needs three wavelengths, this result has {data.sizes['wavelength']}"
    try:
        values = xyz(data).transpose(*dims, "xyz").values
        return coded(linear_srgb(values)), float(rgb_map(data).attrs["exposure"]), ""
    except VgonioError as e:
        return "", 1.0, str(e)


def _bounces(data: xr.Dataset, order: tuple[str, ...]) -> dict[str, Any]:
    """Shares by number of reflections in 254ths, `UNKNOWN` where too few rays were caught."""
    shares, trusted = q.bounce_shares(data)
    steps = np.nan_to_num(np.rint(np.clip(shares, 0, 1) * (UNKNOWN - 1)).transpose("bounce", *order).values)
    known = trusted.transpose(*order).values
    return {
        "names": bounce_names(data),
        "colours": bounce_colours(data.sizes["bounce"]),
        "shares": coded(np.where(known, steps, UNKNOWN), "u1"),
    }


def _scale() -> str:
    """The colours of `cividis`, 256 × 3 bytes."""
    from matplotlib import colormaps

    return coded(np.rint(colormaps["cividis"](np.arange(256))[:, :3] * 255), "u1")
