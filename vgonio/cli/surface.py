"""Commands on surfaces: surface info, make, convert."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import InputError, nearest
from .common import Json, Quiet, Threads, print_json, print_table, say

app = typer.Typer(
    help="Look at a height field, make one, or change its format.\n\nExample: vgonio surface info sample.x3p",
    rich_markup_mode=None,
)

File = Annotated[Path, typer.Argument(metavar="FILE", help="Height field of any known format.", show_default=False)]
Pitch = Annotated[
    float | None, typer.Option("--pitch-um", help="Overrides the file's pitch.", show_default="the file's")
]
HeightUnit = Annotated[
    str | None, typer.Option("--height-unit", help="Overrides the file's unit of heights: um, nm, m …")
]
Interpolation = Annotated[
    str | None, typer.Option("--interpolation", help="Between the samples: cubic, linear or nearest.")
]
Periodic = Annotated[bool | None, typer.Option("--periodic/--not-periodic", help="Does the field continue by itself?")]


@app.command()
def info(
    file: File,
    pitch_um: Pitch = None,
    height_unit: HeightUnit = None,
    interpolation: Interpolation = None,
    periodic: Periodic = None,
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Print size, pitch and roughness of a height field.

    Roughness is that of the heights without their plane (of a periodic field, as they are).
    Implausible figures are warned about; --pitch-um and --height-unit override what a file says.

    Example: vgonio surface info sample.x3p --pitch-um 0.438
    """
    from .. import surface

    field = surface.read(
        file, pitch_um=pitch_um, height_unit=height_unit, interpolation=interpolation, periodic=periodic
    )
    facts: dict[str, Any] = {
        "file": str(file),
        "points": f"{field.shape[1]} × {field.shape[0]}",
        "pitch_um": [field.dx, field.dy],
        "size_um": [field.size_um[1], field.size_um[0]],
        "periodic": field.periodic,
        "interpolation": field.interpolation,
        "missing": field.missing,
    }
    if "instrument_name" in field.meta:
        facts["instrument"] = field.meta["instrument_name"]
    facts |= _parameters(field)
    if as_json:
        print_json(facts | {"history": list(field.history)})
        return
    columns = ("quantity", "value", "unit", "what it is")
    print_table("", columns, [_row(name, value) for name, value in facts.items()])


# what the figures are, for whoever does not know ISO 25178-2 by heart
MEANINGS = {
    "points": "along x × along y",
    "pitch_um": "along x × along y",
    "size_um": "along x × along y",
    "missing": "points without a height",
    "Sq": "RMS height",
    "Sa": "mean absolute height",
    "Sz": "from the lowest point to the highest",
    "Ssk": "skewness of heights: below 0 pits, above 0 peaks",
    "Sku": "kurtosis of heights: 3 for Gaussian ones",
    "Sdq": "RMS gradient",
    "Sal": "autocorrelation length: down to 0.2 along the fastest decay",
    "alpha": "Beckmann's α: √2 times the RMS slope along one axis",
    "alpha_x": "the same of slopes along x",
    "alpha_y": "the same of slopes along y",
}


def _row(name: str, value: Any) -> tuple[str, Any, str, str]:
    from ..surface.statistics import UNITS

    unit = "µm" if name.endswith("_um") else UNITS.get(name, "").replace("1", "")
    shown = " × ".join(f"{x:g}" for x in value) if isinstance(value, list) else value
    return name.removesuffix("_um"), shown, unit, MEANINGS.get(name, "")


def _parameters(field: Any) -> dict[str, Any]:
    """Roughness of the levelled field; missing points are filled for the figures alone."""
    from .. import surface

    complete = surface.fill(field, "interpolate") if field.missing else field
    levelled = complete if complete.periodic else surface.level(complete, "plane")
    return {str(k): v for k, v in surface.parameters(levelled).items()}


@app.command()
def make(
    kind: Annotated[
        str | None,
        typer.Argument(
            metavar="KIND",
            help="flat, sinusoid, lamellar, blazed, gaussian, power_law or sandblasted.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Where it goes: .npz, .x3p, .stl, .csv, .vgms."),
    ] = None,
    parameters: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="A parameter, as in --set pitch_um=0.1. Repeatable."),
    ] = None,
    list_kinds: Annotated[bool, typer.Option("--list", help="Print the kinds and their parameters and end.")] = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Generate a surface.

    The parameters are the generator's, as TOML values; --list prints them, and a scene's
    generate = { kind = "sinusoid", … } takes the same.

    Example: vgonio surface make sinusoid --set period_um=2 --set amplitude_um=0.1 -o sinusoid.npz
    """
    from .. import surface
    from ..scene import GENERATORS, check_generator, parse_override
    from ..surface.plausible import warn_implausible

    if list_kinds:
        print_table("", ("kind", "parameter", "default", "what it is"), _kinds([kind] if kind else GENERATORS))
        return
    if kind is None or output is None:
        raise InputError("KIND and -o FILE are needed, or --list for the kinds and their parameters")
    if kind not in GENERATORS:
        raise InputError(f"kind {kind!r} is unknown: {nearest(kind, GENERATORS)}")
    given: dict[str, Any] = {}
    for text in parameters or ():
        keys, value = parse_override(text)
        if len(keys) > 1:
            raise InputError(f"--set {text!r}: a parameter of {kind} has no dots")
        given[keys[0]] = value
    check_generator({"kind": kind, **given})
    made = getattr(surface, kind)(**given)
    _write(made, output)
    warn_implausible(made, generated=True)


def _kinds(kinds: Iterable[str]) -> list[tuple[str, ...]]:
    """Rows of kind, parameter, default and what it is, from the generators' own signatures and docstrings."""
    import inspect

    from .. import surface
    from ..scene import GENERATORS

    rows: list[tuple[str, ...]] = []
    for kind in kinds:
        if kind not in GENERATORS:
            raise InputError(f"kind {kind!r} is unknown: {nearest(kind, GENERATORS)}")
        made = getattr(surface, kind)
        first = inspect.getdoc(made) or ""
        rows.append((kind, "", "", first.split("\n")[0]))
        for name, parameter in inspect.signature(made).parameters.items():
            if "Heightfield" in str(parameter.annotation):
                continue  # nothing that TOML could hold
            needed = parameter.default is parameter.empty
            rows.append(("", name, "needed" if needed else _toml(parameter.default), ""))
    return rows


def _toml(value: Any) -> str:
    """A default as it is written behind --set; "none" where it is not given."""
    if value is None:
        return "none"
    return json.dumps(list(value) if isinstance(value, tuple) else value)


@app.command()
def convert(
    file: File,
    output: Annotated[
        Path, typer.Argument(metavar="OUT", help="New file: .npz, .x3p, .stl or .csv.", show_default=False)
    ],
    pitch_um: Pitch = None,
    height_unit: HeightUnit = None,
    interpolation: Interpolation = None,
    periodic: Periodic = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Convert a height field to another format.

    The ending of OUT says into which.

    Example: vgonio surface convert sample.x3p sample.npz
    """
    from .. import surface

    if output.exists() and output.resolve() == file.resolve():
        raise InputError(f"{output} would overwrite the file that is read")
    field = surface.read(
        file, pitch_um=pitch_um, height_unit=height_unit, interpolation=interpolation, periodic=periodic
    )
    _write(field, output)


def _write(field: Any, output: Path) -> None:
    from .. import surface

    surface.write(field, output)
    say(f"{output}: {field!r}")
