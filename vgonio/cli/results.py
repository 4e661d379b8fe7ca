"""Commands on results: compare, report."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import InputError, nearest
from ..files import PAGE_ENDINGS, RESULT_ENDINGS
from .common import Json, Quiet, Threads, busy, print_json, print_table, save_figure, say


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
        typer.Option("--reference", metavar="NAME", help="The one held to be right.", show_default="the most general"),
    ] = None,
    material: Annotated[
        str, typer.Option("--material", help="Of the Fresnel reflectance in the fits of the shift, or none.")
    ] = "Al",
    figures: Annotated[
        Path | None, typer.Option("--figures", metavar="FOLDER", help="Draw the explained shares of the shift.")
    ] = None,
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Compare BRDFs pair by pair.

    Colour difference, errors over the spectrum, slopes of the colour shift and how much of the reference's each
    explains, gloss, haze, scatter and reflectance of what covers them.

    Example: vgonio compare result.nc:rays result.nc:waves sample.json
    """
    data = load_all(files)
    if len(data) < 2:
        raise InputError(f"nothing to compare: {', '.join(map(str, files))} holds one BRDF, at least two are needed")
    from ..compare import compare as run
    from ..compare.summary import summary_tables

    reflector = known_material(material)
    with busy("comparing"):
        comparison = run(data, reference=reference, material=reflector)
    if figures is not None and "explained_share" in comparison:
        _draw_explained(comparison, figures)
    tables = summary_tables(comparison)
    if as_json:
        print_json([row for rows in tables.values() for row in rows])
        return
    ((name, why),) = ((row["of"], row["unit"]) for row in tables["reference"])
    told = "Of A and B, B is held to be right: NRMSE is RMSE over the mean of B."
    print_rows(f"Reference: {name} ({why}; --reference NAME). {told}", tables["figures"])
    print_rows("Appearance", [row for row in tables["looks"] if row["value"] is not None])
    print_rows(f"Explained share of the shift of {name}", tables["shares"])
    for row in tables["unlike"]:
        print(f"{row['of']}: {row['unit']}")
    if figures is not None and (figures / "explained.png").is_file():
        say(f"figure: {figures / 'explained.png'}")


def print_rows(title: str, rows: list[dict[str, Any]]) -> None:
    """Rows with the same keys as a table; nothing where there are none."""
    if rows:
        print_table(title, list(rows[0]), [list(row.values()) for row in rows])


def _draw_explained(comparison: Any, folder: Path) -> None:
    from ..report.figures import explained

    own = [name for name in comparison.data_vars if str(name).startswith("explained_")]
    found = comparison[own].rename({name: str(name).removeprefix("explained_") for name in own})
    folder.mkdir(parents=True, exist_ok=True)
    save_figure(explained(found), folder / "explained.png")


def known_material(name: str) -> str | None:
    """The name, None for "none"; MaterialError for one that nobody knows, before any work and not as a row of it."""
    if name == "none":
        return None
    from ..materials import material

    material(name)
    return name


def load_all(files: list[Path], one_point: bool = False) -> dict[str, Any]:
    """All BRDFs of several files by name, no two alike; with `one_point` InputError for those of a sweep."""
    data: dict[str, Any] = {}
    opened: dict[Path, Any] = {}
    for file in files:
        for name, found in _load(file, opened).items():
            if one_point:
                require_one_point(found, file)
            data[_unused(name, data)] = found
    return data


def require_one_point(data: Any, file: Path) -> None:
    """InputError for the tree or a dataset of a sweep, over swept keys, where one point of it is needed."""
    dims = data["brdf"].dims if "brdf" in data else data.dims
    further = [str(d) for d in dims if d not in ("theta_i", "theta_o", "cell", "wavelength")]
    if further:
        path = str(file) if file.exists() else str(file).rpartition(":")[0]
        raise InputError(
            f"{path} is the result of a sweep over {', '.join(further)}, and one point of it is needed here: in "
            f"Python, vg.save(vg.open({path!r}).isel({', '.join(f'{d}=0' for d in further)}), 'point.nc') keeps one"
        )


def load_one(file: Path, wanted: Callable[[Any], bool], what: str) -> Any:
    """The first BRDF of a file that is wanted; InputError where there is none."""
    found = [d for d in _load(file).values() if wanted(d)]
    if not found:
        raise InputError(f"{file} holds no BRDF with {what}")
    require_one_point(found[0], file)
    return found[0]


def _load(file: Path, opened: dict[Path, Any] | None = None) -> dict[str, Any]:
    """The BRDFs of a result (all groups or the one named after a colon) or of a measured file, by name.

    opened : groups of the results that were read before, so that none is read twice; those read now are added
    """
    from .. import measure
    from ..simulation import simulated

    name, _, group = str(file).rpartition(":")
    path = Path(name) if name and not file.exists() else file
    if path.suffix.lower() not in RESULT_ENDINGS:
        return {path.stem: measure.read(file)}
    opened = {} if opened is None else opened
    try:
        groups = opened[path] if path in opened else simulated(measure.open(path))
    except InputError as e:
        raise InputError(f"{path}: {e}") from None
    opened[path] = groups
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
    check_output(path, PAGE_ENDINGS, [result])
    require_one_point(tree, result)
    from ..report import page

    page(tree, with_folder(path))
    say(f"page: {path}")
