"""The tables of the page: error and seconds of each part, the surface's parameters, the plan, provenance."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from . import quantities as q
from .style import SUPERSCRIPT, angle, some

ROUNDING = 1e-6  # percent: what is smaller is left from rounding


@dataclass(frozen=True)
class Table:
    """Rows under a head; columns in `numeric` are set to the right, rows in `faded` are grey."""

    head: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    numeric: tuple[int, ...] = ()
    faded: tuple[int, ...] = ()
    caption: str = ""


def number(value: Any, digits: int = 3) -> str:
    """A number for people: significant digits, real minus, 4·10⁻⁴ for small ones; text as it is, – for nothing."""
    if value is None or value == "":
        return "–"
    try:
        x = float(value)
    except (TypeError, ValueError):
        return str(value)
    if math.isnan(x):
        return "–"
    if x == 0 or not math.isfinite(x):
        return f"{x:g}".replace("inf", "∞").replace("-", "−")
    x = float(f"{x:.{digits - 1}e}")  # rounded first: 9.999 has two digits before the point
    if 1e-3 <= abs(x) < 1e6:
        text = f"{x:,.{max(0, digits - 1 - math.floor(math.log10(abs(x))))}f}"
        return text.replace(",", "\u202f" if abs(x) >= 1e4 else "").replace("-", "−")
    mantissa, power = f"{x:.{digits - 1}e}".split("e")
    return f"{mantissa}·10{str(int(power)).translate(SUPERSCRIPT)}".replace("-", "−")


def plus_minus(value: float, error: float, digits: int = 3) -> str:
    """9.1 ± 0.3: the error with one digit, two where it begins with 1, the value to the same place.

    digits : of the value where the error is not known
    """
    if not (math.isfinite(error) and error > 0):
        return number(value, digits)
    if not 1e-3 <= error < 1e4:
        return f"{number(value, 2)} ± {number(error, 1)}"
    power = math.floor(math.log10(error))
    places = max(0, -power + (1 if error / 10.0**power < 1.95 else 0))
    return f"{value:.{places}f} ± {error:.{places}f}".replace("-", "−")


def percent(share: float, digits: int = 2) -> str:
    """0.123 → 12 %; below a thousandth of a percent in powers of ten, below ROUNDING as < 10⁻⁶ %."""
    if share is None or not math.isfinite(share):
        return "–"
    x = 100 * share
    if 0 < abs(x) < ROUNDING:
        return "< 10⁻⁶ %" if x > 0 else "0 % (to rounding)"
    if x == 0 or abs(x) >= 10**digits:
        return f"{x:.0f} %".replace("-", "−")
    return f"{number(x, digits)} %"


def first(attrs: Mapping[Any, Any], *names: str, default: Any = None) -> Any:
    """The first attribute of these names that is there."""
    return next((attrs[n] for n in names if n in attrs and attrs[n] != ""), default)


def whole(value: Any) -> str:
    """A count as it is, – for nothing."""
    return "–" if value in (None, "") else f"{int(value)}"


def time_text(seconds: Any) -> str:
    """Seconds with three digits, hundredths at most."""
    return "–" if seconds in (None, "") else f"{float(seconds):.{2 if float(seconds) < 9.995 else 1}f}"


def _estimate(attrs: Mapping[Any, Any]) -> str:
    """How the error was found; over a hemisphere also what the size of its cells does to the brightest."""
    said = str(first(attrs, "error_estimate", "error_estimated", default="–"))
    cells = attrs.get("cell_error")
    if cells is None:
        return said
    return f"{said}; beside it, cells as wide as these misjudge the brightest by up to {percent(float(cells), 2)}"


def errors_and_seconds(results: Mapping[str, xr.Dataset], seconds: Mapping[str, float]) -> Table:
    """Error and seconds of every part on one line, the error with how it was estimated."""
    head = ("Part", "Made by", "Standard error, median", "Error asked", "achieved", "estimated from", "Seconds", "Seed")
    rows = []
    for name, data in results.items():
        a = data.attrs
        parts = [str(x) for x in (first(a, "backend"), first(a, "device")) if x]
        made = ", ".join(parts) or str(first(a, "source", "method", default="–"))
        rows.append(
            (
                q.title(name, data),
                made,
                percent(q.relative_error(data)),
                number(first(a, "tolerance_asked", "tolerance", "tol"), 2),
                number(first(a, "error_achieved", "error"), 2),
                _estimate(a),
                time_text(first(a, "seconds", default=seconds.get(name))),
                whole(first(a, "seed")),
            )
        )
    known = {*results}
    for part, time in seconds.items():
        if part not in known:
            rows.append((part.capitalize(), "", "", "", "", "", time_text(time), ""))
    if seconds:
        rows.append(("All parts", "", "", "", "", "", time_text(sum(seconds.values())), ""))
    return Table(head, rows, numeric=(2, 3, 4, 6, 7))


def tallies(rays: xr.Dataset) -> Table:
    """Energy of the rays by angle of incidence in %, at the wavelength that the figure shows."""
    parts = q.near(q.tallies(rays.sortby("theta_i")))
    bounces = [f"{n}" for n in rays["bounce"].values.astype(int)]
    bounces[-1] += "+" if len(bounces) > 1 else ""
    columns = [100 * parts["by_bounce"].isel(bounce=i) for i in range(len(bounces))]
    further = [name for name in ("absorbed", "lost", "sum") if name in parts]
    columns += [100 * parts[name] for name in further]
    angles = some(parts["theta_i"].values, 12)
    rows = [(angle(t), *(f"{float(c.sel(theta_i=t)):.2f}" for c in columns)) for t in angles]
    head = ("θᵢ", *(f"{n} refl." for n in bounces), *further)
    return Table(head, rows, numeric=tuple(range(1, len(head))), caption="In % of the incident power")


# symbol: (what it is, unit)
PARAMETERS = {
    "Sq": ("root mean square height", "µm"),
    "Sa": ("arithmetic mean height", "µm"),
    "Ssk": ("skewness", ""),
    "Sku": ("kurtosis (3 for Gaussian heights)", ""),
    "Sdq": ("root mean square gradient", ""),
    "alpha": ("slope α of Beckmann, √2 · one-axis RMS slope", ""),
    "Sal": ("autocorrelation length", "µm"),
}


def surface_parameters(surface: xr.Dataset) -> Table:
    """ISO 25178-2 parameters and what the field is."""
    a = surface.attrs
    rows = [
        ("α" if name == "alpha" else name, what, f"{number(a[name], 4)} {unit}".strip())
        for name, (what, unit) in PARAMETERS.items()
        if name in a and np.isfinite(a[name])
    ]
    for name, what in (("points", "samples"), ("pitch", "pitch"), ("size", "size"), ("missing", "missing points")):
        if name in a:
            rows.append(("", what, str(a[name])))
    if a.get("interpolation"):
        rows.append(("", "between the samples", f"{a['interpolation']}{', periodic' if a.get('periodic') else ''}"))
    return Table(("Parameter", "", "Value"), rows, numeric=(2,))


def plan_table(
    plan: Mapping[str, Any], seconds: Mapping[str, float] | None = None, memory: Mapping[str, float] | None = None
) -> Table | None:
    """What was done and what was left out, with the reason, and what was expected beside what the part took; None for
    a plan without stages."""
    stages = plan.get("stages") or []
    if not stages:
        return None
    rows = [
        (
            s["name"],
            "done" if s.get("needed") else "left out",
            "; ".join(t for t in (s.get("cost"), s.get("why")) if t),
            s.get("library", ""),
            _took(s.get("seconds"), s.get("memory_bytes")),
            _took((seconds or {}).get(s["part"]), (memory or {}).get(s["part"])) if s.get("seconds") else "",
        )
        for s in stages
    ]
    faded = tuple(i for i, s in enumerate(stages) if not s.get("needed"))
    return Table(("Stage", "", "What and why", "Library", "Expected", "Took"), rows, faded=faded)


def _took(seconds: float | None, memory: float | None) -> str:
    parts = ["" if seconds is None else f"{seconds:.2g} s" if seconds < 100 else f"{seconds:.0f} s"]
    parts.append("" if not memory else f"{memory / 1e6:.0f} MB")
    return ", ".join(p for p in parts if p)


def provenance_table(provenance: Mapping[str, Any]) -> Table | None:
    """Versions, machine, date, inputs; None where nothing is known."""
    rows = []
    for key, value in provenance.items():
        if isinstance(value, Mapping):
            rows += [(f"{key}: {k}", str(v)) for k, v in value.items()] if key != "versions" else []
        elif value not in (None, ""):
            rows.append((key.replace("_", " "), str(value)))
    versions = provenance.get("versions")
    if isinstance(versions, Mapping):
        rows.insert(0, ("versions", ", ".join(f"{k} {v}" for k, v in versions.items())))
    return Table(("What", "Value"), rows) if rows else None


def attributes(data: xr.Dataset) -> str:
    """All attributes of a result as indented JSON, attributes that hold JSON unpacked."""
    plain = {str(k): v.item() if isinstance(v, np.generic) else q.text(v) for k, v in data.attrs.items()}
    return json.dumps(plain, indent=2, ensure_ascii=False, default=str)
