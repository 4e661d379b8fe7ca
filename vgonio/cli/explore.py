"""The command that writes a page to explore a result."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..files import PAGE_ENDINGS
from .common import Quiet, Threads, say
from .results import require_one_point


def explore(
    result: Annotated[
        Path, typer.Argument(metavar="RESULT", help="A result of vgonio simulate (.nc).", show_default=False)
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="PAGE.html", help="The page.", show_default="RESULT_explore.html"),
    ] = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Write a page to explore a result in a browser.

    Sliders for angles and wavelength; lobe, spectra, colours, reflections, hemisphere. One file, nothing is fetched.

    Example: vgonio explore result.nc -o explore.html
    """
    from .. import measure
    from ..planning import check_output, with_folder

    path = output if output is not None else result.with_name(f"{result.stem}_explore.html")
    check_output(path, PAGE_ENDINGS, [result])
    tree = measure.open(result)
    require_one_point(tree, result)
    from ..report.explorer import explorer_page

    explorer_page(tree, with_folder(path))
    say(f"page: {path}")
