"""Commands on measured BRDFs: measured info, convert, cross-validate, formats."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import InputError
from .common import Json, Quiet, Threads, print_json, print_table, say

app = typer.Typer(
    help="Look at a measured BRDF, change its format, compare instruments.\n\n"
    "Example: vgonio measured info sample.json",
    rich_markup_mode=None,
)
File = Annotated[
    Path, typer.Argument(metavar="FILE", help="BRDF of any known format; FILE:GROUP of a result.", show_default=False)
]
Format = Annotated[str | None, typer.Option("--format", help="Of FILE, where its content does not say it.")]
Options = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Of reading or writing, as in --set unit=percent. Repeatable."),
]


def _options(texts: list[str] | None) -> dict[str, Any]:
    from ..scene import parse_override

    given: dict[str, Any] = {}
    for text in texts or ():
        keys, value = parse_override(text)
        if len(keys) > 1:
            raise InputError(f"--set {text!r}: an option of reading or writing has no dots")
        given[keys[0]] = value
    return given


def _grouped(file: Path) -> Path | None:
    """The file of FILE:GROUP, None for the plain name of a file."""
    name, colon, _ = str(file).rpartition(":")
    return Path(name) if colon and not file.exists() and Path(name).is_file() else None


def _read(file: Path, format: str | None = None, given: dict[str, Any] | None = None) -> Any:
    """A BRDF of any format, or one group of a result."""
    from ..measure import formats
    from .results import load_one

    if _grouped(file) is not None:
        return load_one(file, lambda _: True, "values")
    return formats.read(file, format, **(given or {}))


@app.command()
def info(
    file: File,
    format: Format = None,
    options: Options = None,
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Print what a file holds and what was repaired.

    Of --set: unit, wavelength_unit, negative, duplicates; theta_i_deg, theta_o_deg or resolution_deg, wavelength_nm.

    Example: vgonio measured info alum-bronze.binary --set resolution_deg=5
    """
    from ..measure import formats

    data = _read(file, format, _options(options))
    facts = formats.facts(data)
    if as_json:
        print_json({"file": str(file), **facts})
    else:
        print_table("", ("quantity", "value"), list(facts.items()))


@app.command()
def convert(
    file: File,
    output: Annotated[
        Path, typer.Argument(metavar="OUT", help="New file: .json .csv .nc .binary .bsdf .astm", show_default=False)
    ],
    format: Format = None,
    to: Annotated[
        str | None, typer.Option("--to", metavar="FORMAT", help="Of OUT, as in --to zemax.", show_default="its ending")
    ] = None,
    fill: Annotated[
        str | None,
        typer.Option("--fill", help="Azimuths that in-plane data lack: half-angle (lobes), azimuth (diffuse)."),
    ] = None,
    options: Options = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Convert a BRDF to another format.

    The ending of OUT says into which; .bsdf is RGL, which Mitsuba's plug-in "measured" renders. Formats that hold
    all directions need --fill where the data are in plane only.

    Example: vgonio measured convert sample.json sample.bsdf --fill half-angle
    """
    from ..measure import formats

    if output.exists() and output.resolve() == file.resolve():
        raise InputError(f"{output} would overwrite the file that is read")
    given = _options(options) | ({} if fill is None else {"fill": fill})
    reading, writing = formats.divided(given, _grouped(file) or file, format, output, to)
    data = _read(file, format, reading)
    say(f"{formats.write(data, output, to, **writing)}: {formats.facts(data)['directions']}")


@app.command()
def calibrate(
    counts: Annotated[Path, typer.Argument(metavar="COUNTS", help="CSV of counts on the sample.", show_default=False)],
    white: Annotated[Path, typer.Option("--white", metavar="COUNTS", help="CSV of counts on the standard.")],
    standard: Annotated[Path, typer.Option("--standard", metavar="FILE", help="BRDF of the standard, any format.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT", help="BRDF: .json, .csv, .nc …")],
    theta_i: Annotated[float, typer.Option("--theta-i", help="θ_i at which the standard is averaged, degrees.")] = 10.0,
    standard_nm: Annotated[
        str, typer.Option("--standard-nm", help="Where the standard's BRDF is taken: nm, or all.")
    ] = "533",
    standard_uncertainty: Annotated[
        float | None,
        typer.Option(
            "--standard-uncertainty",
            "--standard-error",
            help="Relative, of the standard, as 0.02.",
            show_default="the file's",
        ),
    ] = None,
    tilted: Annotated[bool, typer.Option("--tilted", help="Sample and detector tilted by 4° and 8°.")] = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Turn counts of a spectrometer into a BRDF.

    Relative calibration against a diffuse standard, averaged over θ_o = −80 … 80°. A CSV of counts has the columns
    theta_i_deg, theta_o_deg, wavelength_nm, counts and, if known, counts_stderr.

    Example: vgonio measured calibrate counts.csv --white white.csv --standard spectralon.json -o calibrated.json
    """
    from .. import measure
    from ..measure.readers.plain_csv import read_counts

    try:
        nm = None if standard_nm == "all" else float(standard_nm)
    except ValueError:
        raise InputError(f"--standard-nm {standard_nm}: a wavelength in nm or all") from None
    factor = measure.calibration_factor(
        read_counts(white),
        _read(standard),
        theta_i_deg=theta_i,
        standard_nm=nm,
        standard_uncertainty=standard_uncertainty,
    )
    data = measure.calibrate(read_counts(counts), factor, tilt=measure.Tilt() if tilted else None)
    share = float((data["brdf_stderr"] / data["brdf"]).median())
    path = measure.write(data.drop_vars(["brdf_stderr_by_source", "source"]), output)
    say(f"{path}: standard averaged over {factor.attrs['angles']} angles, median standard error {share:.2%}")


@app.command("cross-validate")
def cross_validate(
    files: Annotated[list[Path], typer.Argument(metavar="A B [C …]", help="BRDFs of one sample.", show_default=False)],
    reference: Annotated[
        str | None, typer.Option("--reference", metavar="NAME", help="File name of it.", show_default="mean of all")
    ] = None,
    wavelength_nm: Annotated[
        float | None,
        typer.Option("--wavelength", metavar="NM", help="One wavelength, in nm.", show_default="all common"),
    ] = None,
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Compare instruments that measured one sample.

    At their common angles. Deviations are relative to the reference: mean, largest, and mean with sign.

    Example: vgonio measured cross-validate sample.json other.csv --reference other.csv --wavelength 550
    """
    from .. import measure

    data = {(f.name if [g.name for g in files].count(f.name) == 1 else str(f)): _read(f) for f in files}
    rows = measure.cross_validate(data, reference=reference, wavelength_nm=wavelength_nm)
    if as_json:
        print_json(rows)
        return
    columns = ("data", "θ_i", "angles", "mean", "largest", "bias", "largest at θ_o", "nm")
    percent = [[f"{r[k]:.2%}" for k in ("mean", "largest", "bias")] for r in rows]
    print_table(
        f"relative to {rows[0]['reference']}",
        columns,
        [
            (
                r["name"],
                "all" if r["theta_i_deg"] is None else f"{r['theta_i_deg']:g}°",
                r["angles"],
                *p,
                f"{r['largest_theta_o_deg']:g}°",
                f"{r['largest_wavelength_nm']:g}",
            )
            for r, p in zip(rows, percent)
        ],
    )


@app.command()
def formats(as_json: Json = False, quiet: Quiet = False) -> None:
    """List the formats that are read and written.

    Example: vgonio measured formats
    """
    from ..measure.formats import FORMATS

    rows = [
        (name, " ".join(entry.suffixes), "read, write" if entry.write else "read", entry.summary)
        for name, entry in FORMATS.items()
    ]
    if as_json:
        print_json([dict(zip(("format", "endings", "can", "what"), r)) for r in rows])
    else:
        print_table("", ("format", "endings", "can", "what"), rows)
