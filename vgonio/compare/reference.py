"""Which of several results the others are held against, and how that is said."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr

from ..errors import InputError, nearest
from .explained import kind_of

# in this order whatever the surface, so that one pair is compared one way round everywhere; what to trust on a surface
# the verdict of a result says (`report.trusted`). The most general first: Kirchhoff's theory lacks multiple
# reflections, the Harvey–Shack theories steep slopes as well
TRUST = (
    "measured", "full wave", "iterated Kirchhoff", "rays", "Kirchhoff", "generalized Harvey–Shack", "Harvey–Shack",
    "of unknown origin", "model",
)  # fmt: skip


def origin(name: str, data: xr.Dataset) -> str:
    """What a result is, a word of `TRUST`: by its attributes, "measured" by the last part of its name as well."""
    method, theory = str(data.attrs.get("method", "")), str(data.attrs.get("theory", ""))
    if method == "measured" or name.rpartition(":")[2] == "measured":
        return "measured"
    if kind_of(data) == "fitted model":
        return "model"
    words = {"full-wave": "full wave", "iterated-kirchhoff": "iterated Kirchhoff", "kirchhoff": "Kirchhoff",
             "generalized-harvey-shack": "generalized Harvey–Shack", "harvey-shack": "Harvey–Shack"}  # fmt: skip
    if theory == "iterated-kirchhoff" and kind_of(data) == "single-scatter waves":
        return "Kirchhoff"
    return words.get(theory, "rays" if kind_of(data) == "rays" else "of unknown origin")


def default_reference(results: Mapping[str, xr.Dataset]) -> str:
    """The name of the result that comes first in `TRUST`; among equals the last one."""
    rank = {name: TRUST.index(origin(name, data)) for name, data in results.items()}
    return min(reversed(list(results)), key=lambda name: rank[name])


def reference_last(a: str, b: str, results: Mapping[str, xr.Dataset], chosen: str) -> tuple[str, str]:
    """Two names, the one that the other is held against last: the chosen one, else the one that `TRUST` has first.

    So a pair has the same figures with a third result beside it as without.
    """
    if chosen in (a, b):
        return (a, b) if chosen == b else (b, a)
    rank = [TRUST.index(origin(name, results[name])) for name in (a, b)]
    return (a, b) if rank[1] <= rank[0] else (b, a)


def chosen_reference(results: Mapping[str, xr.Dataset], asked: str | None) -> tuple[str, str]:
    """The name that was asked for, or `default_reference`, and why in words; InputError for a name that no result has.

    The last part of a name, "waves" of "own:waves", is enough where only one ends so.
    """
    if asked is None:
        name = default_reference(results)
        return name, f"{origin(name, results[name])}, by default the first of measured, full wave, rays, …"
    if asked in results:
        return asked, "as asked for"
    ends = [name for name in results if name.rpartition(":")[2] == asked]
    if len(ends) != 1:
        raise InputError(f"reference {asked!r} is no result: {nearest(asked, results)}")
    return ends[0], "as asked for"
