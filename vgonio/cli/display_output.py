"""What the display commands write and print: profile, table and lists of a calibration, facts of an examination."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..files import PAGE_ENDINGS
from .common import print_json, print_table, say

if TYPE_CHECKING:
    from ..display import DisplayModel, Examined


def calibration_files(
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
        listed = colour_list(folder / f"{name}_colours.csv", rgb, bits, quietly=True)
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


def colour_list(path: Path, rgb: Any, bits: int, quietly: bool = False) -> Path:
    from ..display.csv_files import write_colours
    from ..planning import check_output, with_folder

    check_output(path, (".csv",))
    written = write_colours(with_folder(path), rgb, bits)
    if not quietly:
        say(f"colours to show and to measure: {written}")
    return written


def make_folder(path: Path) -> None:
    from ..planning import with_folder

    with_folder(path / "profile.icc")


def tell(found: list[Examined], report: Path | None, as_json: bool, inputs: list[Path] | None) -> None:
    """Print the table, write the page."""
    if report is not None:
        from ..planning import check_output, with_folder

        check_output(report, PAGE_ENDINGS, inputs or ())
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
