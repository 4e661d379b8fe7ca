"""The figures that characterise a display: thesis table 5.1, and how much of a standard's gamut it covers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .colorimetry import chromaticity, encoding
from .model import DisplayModel
from .readings import CHANNELS
from .verification import ModelCheck

Floats = NDArray[np.float64]
STANDARDS = ("sRGB", "Adobe RGB")


def coverage(model: DisplayModel, standard: str) -> float:
    """Share of a standard's triangle in (u′, v′) that lies within the display's (CIE 1976 uniform chromaticity)."""
    theirs = _uv(encoding(standard)[0])
    common = _clipped(theirs, _anticlockwise(_uv(chromaticity(model.matrix.T))))
    return _area(common) / _area(theirs)


def _uv(xy: Floats) -> Floats:
    x, y = xy[:, 0], xy[:, 1]
    return np.stack([4 * x, 9 * y], axis=1) / (-2 * x + 12 * y + 3)[:, None]


def _area(polygon: Floats) -> float:
    if len(polygon) < 3:
        return 0.0
    x, y = polygon.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)


def _anticlockwise(triangle: Floats) -> Floats:
    a, b = triangle[1] - triangle[0], triangle[2] - triangle[0]
    return triangle if a[0] * b[1] - a[1] * b[0] > 0 else triangle[::-1]


def _clipped(polygon: Floats, window: Floats) -> Floats:
    """The part of a convex polygon inside a convex anticlockwise window (Sutherland and Hodgman 1974)."""
    for p, q in zip(window, np.roll(window, -1, axis=0)):
        side = (q[0] - p[0]) * (polygon[:, 1] - p[1]) - (q[1] - p[1]) * (polygon[:, 0] - p[0])
        kept: list[Floats] = []
        for i in range(len(polygon)):
            j = (i + 1) % len(polygon)
            if side[i] >= 0:
                kept.append(polygon[i])
            if side[i] * side[j] < 0:
                kept.append(polygon[i] + side[i] / (side[i] - side[j]) * (polygon[j] - polygon[i]))
        polygon = np.array(kept)
        if len(polygon) < 3:
            break
    return polygon


def summary(model: DisplayModel, check: ModelCheck | None = None) -> dict[str, Any]:
    """Plain numbers for a table or JSON: luminances in cd/m², chromaticities, coverage, tone curves, ΔE₀₀."""
    black, white = float(model.black_xyz[1]), float(model.white_xyz[1])
    xy = chromaticity(model.matrix.T).round(4).tolist()
    found: dict[str, Any] = {
        "eye": model.eye,
        "white_cd_m2": white,
        "white_simulated_cd_m2": float(model.xyz(np.ones(3))[1]),
        "black_cd_m2": black,
        "contrast": white / black if black > 0 else None,
        "white_xy": chromaticity(model.white_xyz).round(4).tolist(),
        "primaries_xy": dict(zip(CHANNELS, xy)),
        "condition": model.condition,
        "coverage": {name: coverage(model, name) for name in STANDARDS},
        "gamma": {name: curve.power for name, curve in zip(CHANNELS, model.curves)},
        "levels": {name: int(curve.level.size) for name, curve in zip(CHANNELS, model.curves)},
        "notes": list(model.notes),
    }
    if check is not None:
        found["delta_e"] = {"colours": len(check.delta_e), **check.statistics()}
        # null in JSON where a part was not tested
        costs = check.assumptions.costs()
        found["assumptions"] = {name: cost if np.isfinite(cost) else None for name, cost in costs.items()}
        found["failing"] = check.assumptions.failing()
    return found
