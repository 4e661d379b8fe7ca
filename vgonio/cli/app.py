"""The commands of `vgonio`, gathered."""

from __future__ import annotations

from typing import Annotated

import typer

from . import (
    accuracy,
    display,
    doctor,
    examples,
    explore,
    fit,
    measured,
    render,
    results,
    simulate,
    surface,
    sweep,
    validate,
    verdict,
)

app = typer.Typer(
    name="vgonio",
    help="A virtual gonioreflectometer: how a measured surface scatters light, by rays and by waves.\n\n"
    "Example: vgonio init scene.toml && vgonio simulate scene.toml",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from .. import __version__

        print(f"vgonio {__version__}")
        raise typer.Exit


@app.callback()
def _all_commands(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


app.command("simulate")(simulate.simulate)
app.command("sweep")(sweep.sweep)
app.command("accuracy")(accuracy.accuracy)
app.command("plan")(simulate.plan)
app.command("init")(simulate.init)
app.command("examples")(examples.examples)
app.add_typer(surface.app, name="surface")
app.add_typer(measured.app, name="measured")
app.command("compare")(results.compare)
app.command("fit")(fit.fit)
app.command("verdict")(verdict.verdict)
app.command("report")(results.report)
app.command("explore")(explore.explore)
app.command("render")(render.render)
app.command("validate")(validate.validate)
app.add_typer(display.app, name="display")
app.command("doctor")(doctor.doctor)
