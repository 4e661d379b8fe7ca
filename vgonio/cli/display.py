"""Commands on displays: display characterise, verify, calibrate."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from .common import Json, Quiet, Threads, print_json, print_table, say

if TYPE_CHECKING:
    from ..display import DisplayModel, Examined, Readings, VirtualDisplay

app = typer.Typer(
    help="Characterise a display from measured spectra, verify the model, calibrate.\n\n"
    "Example: vgonio display characterise readings.csv --report display.html",
    rich_markup_mode=None,
)

Files = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="[READINGS …]", help="Spectra of shown colours: CSV or CGATS (.ti3), one file or one for each eye."
    ),
]
Virtual = Annotated[
    str | None,
    typer.Option(
        "--virtual", metavar="NAME", help="Instead of files: wide-gamut, crt-brainard, lcd-apple or a CSV λ,R,G,B."
    ),
]
Deviations = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Of --virtual, as in --set crosstalk=0.02 --set black_cd_m2=0.21."),
]
Unit = Annotated[
    str | None, typer.Option("--unit", help="Of the spectra, overrides the file's: W/(sr m2 nm), mW/(sr m2 nm) …")
]
FullScale = Annotated[
    float | None, typer.Option("--full-scale", help="RGB of full signal, where the file does not say it: 255, 1023 …")
]
Report = Annotated[Path | None, typer.Option("--report", metavar="PAGE.html", help="Also write a page with figures.")]
Bits = Annotated[int, typer.Option("--bits", help="Bits of a channel's signal.")]
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
    levels: Annotated[int, typer.Option("--levels", help="Levels of each channel for --colours and --virtual.")] = 18,
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

    Colours on a grid of step 85 among the readings also tell whether it obeys the model.

    Example: vgonio display characterise --colours show.csv, then vgonio display characterise readings.csv
    """
    from .. import display as package

    if colours is not None:
        import numpy as np

        rgb = np.concatenate([package.ramp_colours(levels, bits), package.grid_colours()])
        _colour_list(colours, rgb, bits)
        return
    eyes = _readings(files, virtual, deviations, unit, full_scale, levels, bits)
    found = [package.examine(r) for r, _ in eyes]
    if save is not None:
        say(f"readings: {package.write(save, [r for r, _ in eyes], 2**bits - 1)}")
    _tell(found, report, as_json, files)


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
    levels: Annotated[int, typer.Option("--levels", help="Levels of each channel for --virtual.")] = 18,
    report: Report = None,
    unit: Unit = None,
    full_scale: FullScale = None,
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Does the display obey the model, does the calibration work?

    The first from colours on a grid (framework 1 of the thesis), the second, with --patches, from the colours that
    calibrate lists (framework 2).

    Example: vgonio display verify readings.csv --tests shown.csv --patches colorchecker --report display.html
    """
    from .. import display as package

    wanted = None if patches is None else package.patches(patches)
    eyes = _readings(files, virtual, deviations, unit, full_scale, levels, bits)
    if virtual is not None:
        found = [package.examine_virtual(d, wanted, levels, bits)[0] for _, d in eyes if d is not None]
    else:
        shown = _tests(
            [r for path in tests or () for r in package.read(path, full_scale, unit)], [r.eye for r, _ in eyes]
        )
        found = [package.examine(r, shown.get(r.eye), wanted, bits) for r, _ in eyes]
    if any(f.check is None for f in found):
        raise InputError(
            "no test colours: measure a grid (`--colours` of characterise lists it), or give them with --tests"
        )
    _tell(found, report, as_json, [*(files or ()), *(tests or ())])


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
    levels: Annotated[int, typer.Option("--levels", help="Levels of each channel for --virtual.")] = 18,
    unit: Unit = None,
    full_scale: FullScale = None,
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Write an ICC v4 profile, a 3-D LUT (.cube) and a list of colours to verify it with.

    Example: vgonio display calibrate readings.csv -o calibration --source "Adobe RGB"
    """
    from .. import display as package

    wanted = package.patches(patches or "colorchecker")
    eyes = _readings(files, virtual, deviations, unit, full_scale, levels, bits)
    made = [_calibration(package.fit(r), source, size, gamut, wanted, bits) for r, _ in eyes]
    _folder(output)
    rows = [write(output) for write in made]
    if as_json:
        print_json(rows)
    else:
        names = list(rows[0])
        print_table(
            "", ("", *(str(r["eye"] or "display") for r in rows)), [(n, *(r[n] for r in rows)) for n in names[1:]]
        )


def _calibration(
    model: DisplayModel, source: str, size: int, gamut: str, wanted: Any, bits: int
) -> Callable[[Path], dict[str, Any]]:
    """All that goes into the files of one eye, worked out; call it with the folder to write them."""
    import numpy as np

    from .. import display as package

    name = f"display_{model.eye}" if model.eye else "display"
    table = package.lut(model, source, size, gamut)
    error = package.lut_error(model, table, source, gamut)
    targets = package.targets(model, wanted, bits, gamut=gamut)
    rgb = np.concatenate([package.grid_colours(), targets.colours()])
    report = targets.controls.report()

    def write(folder: Path) -> dict[str, Any]:
        """What was written, and what the table is off by."""
        icc = package.write_icc(folder / f"{name}.icc", model, f"{name}, measured, {model.white_xyz[1]:.4g} cd/m2")
        cube = package.write_cube(folder / f"{name}.cube", table, f"{source} to {name}")
        listed = _colour_list(folder / f"{name}_colours.csv", rgb, bits, quietly=True)
        return {
            "eye": model.eye,
            "profile": str(icc),
            "LUT": str(cube),
            "colours to verify with": str(listed),
            "LUT, mean ΔE₀₀ of interpolation": error["mean"],
            "LUT, max. ΔE₀₀ of interpolation": error["max"],
            "patches out of gamut": f"{report['out_of_gamut']} of {report['colours']}",
            "their mean ΔE₀₀": report["mean_cost"],
            "condition number of the primaries": model.condition,
        }

    return write


def _readings(
    files: list[Path] | None,
    virtual: str | None,
    deviations: list[str] | None,
    unit: str | None,
    full_scale: float | None,
    levels: int,
    bits: int,
) -> list[tuple[Readings, VirtualDisplay | None]]:
    """Readings by eye, from files or of a virtual display (then with the display)."""
    from .. import display as package

    if (virtual is None) == (not files):
        raise InputError("readings are needed: files (CSV or CGATS), or --virtual NAME for a display to try things on")
    if virtual is not None:
        from ..scene import parse_override

        given = {".".join(keys): value for keys, value in map(parse_override, deviations or ())}
        display = package.virtual_display(virtual, **given)
        return [(package.examine_virtual(display, None, levels, bits)[1], display)]
    if deviations:
        raise InputError("--set holds deviations of a --virtual display; files are as they were measured")
    found: dict[str, Readings] = {}
    for path in files or ():
        for part in package.read(path, full_scale, unit):
            eye = part.eye or (path.stem if len(files or ()) > 1 else "")
            if eye in found:
                raise InputError(f"{path}: the eye {eye!r} is in another file already")
            found[eye] = package.Readings(part.rgb, part.spectra, part.wavelength_nm, eye)
    return [(r, None) for r in found.values()]


def _tests(found: list[Readings], eyes: list[str]) -> dict[str, Readings]:
    """Test colours by eye: by their names or, where they have none, in the order of the readings."""
    if found and len(found) == len(eyes) and not any(r.eye for r in found):
        return dict(zip(eyes, found))
    shown = {r.eye: r for r in found}
    missing = [eye for eye in eyes if found and eye not in shown]
    if missing:
        raise InputError(f"no test colours of the eye {missing[0]!r}: the tests have {', '.join(map(repr, shown))}")
    return shown


def _colour_list(path: Path, rgb: Any, bits: int, quietly: bool = False) -> Path:
    from ..display.csv_files import write_colours
    from ..planning import check_output, with_folder

    check_output(path, (".csv",))
    written = write_colours(with_folder(path), rgb, bits)
    if not quietly:
        say(f"colours to show and to measure: {written}")
    return written


def _folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise InputError(f"cannot make the folder {path}: {e.strerror or e}") from None


def _tell(found: list[Examined], report: Path | None, as_json: bool, inputs: list[Path] | None) -> None:
    """Print the table, write the page."""
    if report is not None:
        from ..planning import check_output, with_folder

        check_output(report, (".html", ".htm"), inputs or ())
    from ..display import summary

    facts = [summary(f.model, f.check) for f in found]
    for fact, one in zip(facts, found):
        if one.calibration is not None:
            fact["reproduction"] = one.calibration.statistics()
    if as_json:
        print_json(facts)
    else:
        rows = [_row(name, values) for name, values in _flat(facts)]
        print_table("", ("quantity", *(str(f["eye"] or "display") for f in facts)), rows)
    if report is not None:
        from ..report.display_document import display_page

        say(f"page: {display_page(found, with_folder(report))}")


def _flat(facts: list[dict[str, Any]]) -> list[tuple[str, list[Any]]]:
    """Rows of a table from nested facts; lists that hold words are left to the page and to JSON."""
    rows: list[tuple[str, list[Any]]] = []

    def walk(name: str, values: list[Any]) -> None:
        if isinstance(values[0], dict):
            for key in values[0]:
                walk(f"{name} {key}".strip(), [v[key] for v in values])
        else:
            rows.append((name, values))

    walk("", [{k: v for k, v in f.items() if k not in ("eye", "notes")} for f in facts])
    return rows


def _row(name: str, values: list[Any]) -> tuple[Any, ...]:
    shown = [
        ", ".join(f"{x:g}" if isinstance(x, float) else str(x) for x in v) if isinstance(v, list) else v for v in values
    ]
    return (name.replace("_cd_m2", ", cd/m²").replace("_", " "), *shown)
