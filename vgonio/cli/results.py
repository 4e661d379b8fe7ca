"""Commands on results: compare, report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import InputError, nearest
from .common import Json, Quiet, Threads, print_json, print_table, say

RESULT_ENDINGS = (".nc", ".nc4", ".h5")


def compare(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="A B [C …]",
            help="Results (.nc, FILE:GROUP for one group of it) or measured BRDFs.",
            show_default=False,
        ),
    ],
    reference: Annotated[
        str | None,
        typer.Option("--reference", metavar="NAME", help="What the others are measured against; else the last."),
    ] = None,
    material: Annotated[
        str, typer.Option("--material", help="Of the Fresnel reflectance in the fits of the shift, or none.")
    ] = "Al",
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Compare BRDFs pair by pair.

    Colour difference, errors over the spectrum, slopes of the colour shift.

    Example: vgonio compare result.nc:rays result.nc:waves sample.json
    """
    data: dict[str, Any] = {}
    for file in files:
        for name, found in _load(file).items():
            data[_unused(name, data)] = found
    if len(data) < 2:
        raise InputError(f"nothing to compare: {', '.join(map(str, files))} holds one BRDF, at least two are needed")
    from ..compare import compare as run
    from ..compare import summary

    rows = summary(run(data, reference=reference, material=None if material == "none" else material))
    if as_json:
        print_json(rows)
    else:
        print_table("", list(rows[0]), [list(r.values()) for r in rows])


def _load(file: Path) -> dict[str, Any]:
    """The BRDFs of a result (all groups or the one named after a colon) or of a measured file, by name."""
    from .. import measure
    from ..simulation import simulated

    name, _, group = str(file).rpartition(":")
    path = Path(name) if name and not file.exists() else file
    if path.suffix.lower() not in RESULT_ENDINGS:
        return {path.stem: measure.read(file)}
    groups = simulated(measure.open(path))
    if path is not file:
        if group not in groups:
            raise InputError(f"{path} has no group {group!r}: {nearest(group, groups)}")
        groups = {group: groups[group]}
    return {f"{path.stem}:{g}": d for g, d in groups.items()}


def _unused(name: str, taken: dict[str, Any]) -> str:
    return name if name not in taken else next(n for i in range(2, 1000) if (n := f"{name} ({i})") not in taken)


def report(
    result: Annotated[
        Path, typer.Argument(metavar="RESULT", help="A result of vgonio simulate (.nc).", show_default=False)
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="PAGE.html", help="The page.", show_default="RESULT.html")
    ] = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Write the page of a result, one HTML file.

    Example: vgonio report result.nc -o result.html
    """
    from .. import measure
    from ..planning import check_output, with_folder

    tree = measure.open(result)
    path = output if output is not None else result.with_suffix(".html")
    check_output(path, (".html", ".htm"), [result])
    from ..report import page

    page(tree, with_folder(path))
    say(f"page: {path}")
