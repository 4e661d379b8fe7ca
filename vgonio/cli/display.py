"""Commands on displays: display characterise, verify, calibrate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from .common import Json, Quiet, Threads, print_json, print_table, say
from .display_input import Bits, Deviations, Files, FullScale, Levels, Unit, Virtual, readings_of, tests_by_eye
from .display_output import calibration_files, colour_list, make_folder, tell

app = typer.Typer(
    help="Characterise, verify and calibrate a display.\n\n"
    "Example: vgonio display characterise readings.csv --report display.html",
    rich_markup_mode=None,
)

Report = Annotated[Path | None, typer.Option("--report", metavar="PAGE.html", help="Also write a page with figures.")]
PatchesOption = Annotated[
    str | None,
    typer.Option("--patches", metavar="NAME|FILE", help="Reflectances: colorchecker, cie-224 or a CSV file."),
]


@app.command()
def characterise(
    files: Files = None,
    virtual: Virtual = None,
    deviations: Deviations = None,
    colours: Annotated[
        Path | None,
        typer.Option("--colours", metavar="LIST.csv", help="Only write which colours to show and to measure."),
    ] = None,
    levels: Levels = 18,
    bits: Bits = 8,
    save: Annotated[
        Path | None,
        typer.Option("--save", metavar="READINGS.csv", help="Keep the readings (of --virtual, or converted)."),
    ] = None,
    report: Report = None,
    unit: Unit = None,
    full_scale: FullScale = None,
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Say what a display is: black, white, gamut, tone curves.

    --colours lists what to show and to measure. Colours on a grid of step 85 among the readings also tell whether it
    obeys the model.

    Example: vgonio display characterise readings.csv --report display.html
    """
    from .. import display as package

    if colours is not None:
        import numpy as np

        rgb = np.concatenate([package.ramp_colours(levels, bits), package.grid_colours()])
        colour_list(colours, rgb, bits)
        return
    eyes = readings_of(files, virtual, deviations, unit, full_scale, levels, bits)
    found = [package.examine(r) for r, _ in eyes]
    if save is not None:
        say(f"readings: {package.write(save, [r for r, _ in eyes], 2**bits - 1)}")
    tell(found, report, as_json, files)


@app.command()
def verify(
    files: Files = None,
    tests: Annotated[
        list[Path] | None,
        typer.Option(
            "--tests",
            metavar="TESTS",
            help="Readings of test colours, where they are in files of their own. Repeatable.",
        ),
    ] = None,
    virtual: Virtual = None,
    deviations: Deviations = None,
    patches: PatchesOption = None,
    bits: Bits = 8,
    levels: Levels = 18,
    report: Report = None,
    unit: Unit = None,
    full_scale: FullScale = None,
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Test whether the model and the calibration hold.

    The first from colours on a grid (framework 1 of the thesis), the second, with --patches, from the colours that
    calibrate lists (framework 2).

    Example: vgonio display verify readings.csv --tests shown.csv --patches colorchecker --report display.html
    """
    from .. import display as package

    wanted = None if patches is None else package.patches(patches)
    eyes = readings_of(files, virtual, deviations, unit, full_scale, levels, bits)
    if virtual is not None:
        found = [package.examine_virtual(d, wanted, levels, bits)[0] for _, d in eyes if d is not None]
    else:
        shown = tests_by_eye(
            [r for path in tests or () for r in package.read(path, full_scale, unit)], [r.eye for r, _ in eyes]
        )
        found = [package.examine(r, shown.get(r.eye), wanted, bits) for r, _ in eyes]
    if any(f.check is None for f in found):
        raise InputError(
            "no test colours: measure a grid (`--colours` of characterise lists it), or give them with --tests"
        )
    tell(found, report, as_json, [*(files or ()), *(tests or ())])


@app.command()
def calibrate(
    files: Files = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="Where profile, table and list go.")
    ] = Path("calibration"),
    virtual: Virtual = None,
    deviations: Deviations = None,
    source: Annotated[
        str, typer.Option("--source", help="Encoding that the 3-D LUT takes: sRGB, Adobe RGB or Display P3.")
    ] = "sRGB",
    size: Annotated[int, typer.Option("--size", help="Points along each edge of the 3-D LUT.")] = 33,
    gamut: Annotated[
        str,
        typer.Option(
            "--gamut", help="Colours out of gamut: clip (each channel) or desaturate (to grey of their luminance)."
        ),
    ] = "clip",
    patches: PatchesOption = "colorchecker",
    bits: Bits = 8,
    levels: Levels = 18,
    unit: Unit = None,
    full_scale: FullScale = None,
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Write an ICC profile, a 3-D LUT and colours to test them.

    The profile is ICC v4, the LUT a .cube; `display verify` takes what the display makes of the colours.

    Example: vgonio display calibrate readings.csv -o calibration --source "Adobe RGB"
    """
    from .. import display as package

    wanted = package.patches(patches or "colorchecker")
    eyes = readings_of(files, virtual, deviations, unit, full_scale, levels, bits)
    made = [calibration_files(package.fit(r), source, size, gamut, wanted, bits) for r, _ in eyes]
    make_folder(output)
    rows = [write(output) for write in made]
    if as_json:
        print_json(rows)
    else:
        names = list(rows[0])
        print_table(
            "", ("", *(str(r["eye"] or "display") for r in rows)), [(n, *(r[n] for r in rows)) for n in names[1:]]
        )
