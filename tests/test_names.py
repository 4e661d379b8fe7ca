"""Names say what they hold: a public length, angle or wavelength carries its unit."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

NAMES = (Path(__file__).parent / "public_names.txt").read_text(encoding="utf-8").split()

# words for what has a unit, as parts of names
QUANTITY = re.compile(
    r"(^|_)(theta|phi|angle|angles|half|azimuth|aperture|divergence|blaze|repeatability|tilt|"
    r"wavelength|bandwidth|thickness|pitch|period|amplitude|depth|height|diameter|distance|coherence|correlation|"
    r"crop|cutoff|rms|sigma|spot|resolution|luminance|memory)(_|$)"
)
UNITS = re.compile(r"_(um|um2|nm|mm|deg|rad|cd_m2|seconds|bytes)$")
# no quantity, or one without a unit
OTHER = {
    "depth_spread": "a share of the depth",
    "height_unit": "the name of a unit",
    "wavelength_unit": "the name of a unit",
    "max_depth": "reflections of a path in Mitsuba",
    "points_per_wavelength": "a number",
    "tilt": "an object, its angles are sample_deg and detector_deg",
    "Speeds.height": "seconds for a height of the interpolated surface",
    "Assumptions.luminance": "a relative deviation for each tested colour",
}


def things() -> Iterator[tuple[str, Any]]:
    """Public functions and classes, those of modules handed out as a whole and the methods of classes included."""
    for name in NAMES:
        module, _, last = name.rpartition(".")
        found = getattr(importlib.import_module(module), last)  # `compare.gloss` is the function, not its module
        inner = vars(found).items() if inspect.ismodule(found) else ()
        own = [(n, v) for n, v in inner if n[0] != "_" and getattr(v, "__module__", "") == found.__name__]
        for where, thing in [(name, found)] if not inspect.ismodule(found) else [(f"{name}.{n}", v) for n, v in own]:
            yield where, thing
            if inspect.isclass(thing):
                methods = ((n, getattr(v, "__func__", v)) for n, v in vars(thing).items() if n[0] != "_")
                yield from ((f"{where}.{n}", f) for n, f in methods if inspect.isfunction(f))


def parameters_of(thing: Any) -> list[str]:
    try:
        return list(inspect.signature(thing).parameters) if callable(thing) else []
    except (TypeError, ValueError):
        return []


def without_unit(where: str, thing: Any) -> list[str]:
    """Parameters that have a unit which neither their name says, nor, for radians inside formulas, the docstring."""
    if "radian" in (thing.__doc__ or ""):
        return []
    bad = [p for p in parameters_of(thing) if QUANTITY.search(p) and not UNITS.search(p) and p not in OTHER]
    return [f"{where}({p})" for p in bad if f"{where.rpartition('.')[2]}.{p}" not in OTHER]


def test_public_parameters_say_their_unit():
    every = dict(things())
    assert len(every) > 250
    found = [p for where, thing in every.items() for p in without_unit(where, thing)]
    assert found == []


def test_a_parameter_without_its_unit_would_be_found():
    def turned(theta_i, phi_i_deg, pitch, points, aperture_rad):
        """Degrees."""

    def inside(theta_i):
        """θ_i in radians."""

    assert without_unit("vgonio.turned", turned) == ["vgonio.turned(theta_i)", "vgonio.turned(pitch)"]
    assert without_unit("vgonio.inside", inside) == []


def test_the_exceptions_are_in_use():
    used = {(where.rpartition(".")[2], p) for where, thing in things() for p in parameters_of(thing)}
    assert set(OTHER) <= {p for _, p in used} | {f"{of}.{p}" for of, p in used}


def test_what_results_hold_has_a_unit_where_its_name_has_none():
    """Dims and variables of results are named after the quantity alone: their unit is an attribute, never missing."""
    from vgonio.dataset import COORDINATES, VARIABLES

    for name, (unit, words) in (COORDINATES | VARIABLES).items():
        assert unit, name
        assert words, name
        assert not UNITS.search(name), name
        stderr = re.fullmatch(r"(.+)_stderr", name)
        if stderr:
            assert VARIABLES[stderr[1]][0] == unit, name
    assert not set(COORDINATES) & set(VARIABLES)


def test_the_glossary_names_what_is_there():
    """Names in the table of words are in the code; a renamed one would stay behind unseen."""
    root = Path(__file__).resolve().parents[1]
    table = (root / "CONVENTIONS.md").read_text(encoding="utf-8").split("\n## Words\n")[1].split("\n## ")[0]
    code = "\n".join(p.read_text(encoding="utf-8") for p in sorted((root / "vgonio").rglob("*.py")))
    named = {n for text in re.findall(r"`([^`]+)`", table) for n in re.findall(r"\w+", text)}
    assert len(named) > 25
    assert sorted(n for n in named if not re.search(rf"\b{n}\b", code) and not n.startswith("_")) == []
    words = re.findall(r"^\| ([^|`]+?)(?:, `\w+`)? \|", table, re.M)[1:]
    assert len(words) == len(set(words)) > 15
