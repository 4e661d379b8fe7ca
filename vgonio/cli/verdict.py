"""The command verdict: what a result says, in words."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .common import Json, Quiet, Threads, busy, print_json
from .results import require_one_point


def verdict(
    result: Annotated[
        Path, typer.Argument(metavar="RESULT", help="A result of vgonio simulate (.nc).", show_default=False)
    ],
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Say which method of a result to trust, and what to be wary of.

    Below that, how far the methods differ and why, multiple reflections, colour shifts and errors, as on the page.
    Lines with "!" are alarms, those with "?" cautions.

    Example: vgonio verdict result.nc
    """
    from .. import measure

    tree = measure.open(result)
    require_one_point(tree, result)
    from ..report.plots import verdict as run

    with busy("judging"):
        said = run(tree)
    if as_json:
        print_json({"alarms": said.alarms, "statements": said.statements, "cautions": said.cautions})
    else:
        print(said)
