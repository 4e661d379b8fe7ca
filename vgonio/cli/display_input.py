"""Readings as the display commands take them: options that name files or a virtual display, eyes told apart."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InputError

if TYPE_CHECKING:
    from ..display import Readings, VirtualDisplay

Files = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="READINGS…", help="Spectra of shown colours: CSV or CGATS (.ti3), one file or one for each eye."
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
Levels = Annotated[int, typer.Option("--levels", help="Levels of each channel, of --virtual and of --colours.")]
Bits = Annotated[int, typer.Option("--bits", help="Bits of a channel's signal.")]


def readings_of(
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


def tests_by_eye(found: list[Readings], eyes: list[str]) -> dict[str, Readings]:
    """Test colours by eye: by their names or, where they have none, in the order of the readings."""
    if found and len(found) == len(eyes) and not any(r.eye for r in found):
        return dict(zip(eyes, found))
    shown = {r.eye: r for r in found}
    missing = [eye for eye in eyes if found and eye not in shown]
    if missing:
        raise InputError(f"no test colours of the eye {missing[0]!r}: the tests have {', '.join(map(repr, shown))}")
    return shown
