"""Commands on results: compare, report."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import InputError, VgonioError, nearest
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
        typer.Option("--reference", metavar="NAME", help="The one held to be right.", show_default="the most trusted"),
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
    from ..compare import summary

    reflector = known_material(material)
    with busy("comparing"):
        comparison = run(data, reference=reference, material=reflector)
        rows = _with_errors(_with_colour_alone(summary(comparison), data), data)
    with busy("appearance"):
        looks = [row for name, found in data.items() for row in _appearance(name, found)]
    with busy("shares of the shift"):
        shares = _explained(data, str(comparison.attrs["reference"]), reflector, figures)
    apart = _unlike(data, str(comparison.attrs["reference"]))
    if as_json:
        print_json([_reference_row(comparison), *rows, *looks, *shares, *apart])
        return
    print_table(_title(comparison), list(rows[0]), [list(r.values()) for r in rows])
    covered = [r for r in looks if r["value"] is not None]
    if covered:
        print_table("Appearance", list(covered[0]), [list(r.values()) for r in covered])
    if shares:
        title = f"Explained share of the shift of {comparison.attrs['reference']}"
        print_table(title, list(shares[0]), [list(r.values()) for r in shares])
    for row in apart:
        print(f"{row['of']}: {row['unit']}")
    if figures is not None and (figures / "explained.png").is_file():
        say(f"figure: {figures / 'explained.png'}")


def _reference_row(comparison: Any) -> dict[str, Any]:
    name, why = (str(comparison.attrs[k]) for k in ("reference", "reference_chosen"))
    return {"of": name, "quantity": "reference", "value": None, "error": None, "unit": why}


def _title(comparison: Any) -> str:
    row = _reference_row(comparison)
    return f"Reference: {row['of']} ({row['unit']}; --reference NAME). Of A and B, B is held to be right."


def _with_colour_alone(rows: list[dict[str, Any]], data: dict[str, Any]) -> list[dict[str, Any]]:
    """Below each pair's colour difference with brightness that of the colour alone, as the page's verdict has it."""
    from ..compare.colour import SCALE_WORDS
    from ..report.quantities import colour_difference

    pairs = {f"{a} and {b}": (data[b], data[a]) for a in data for b in data if a != b}
    found = []
    for row in rows:
        found.append(row)
        if row["quantity"].startswith("largest dE00"):
            try:
                value = float(colour_difference(*pairs[row["of"]], "normalised").mean())
            except (VgonioError, KeyError):  # no 600 nm among the wavelengths, or a name that was made anew
                continue
            found.append({**row, "quantity": f"mean dE00, {SCALE_WORDS['normalised']}", "value": value})
    return found


def _with_errors(rows: list[dict[str, Any]], data: dict[str, Any]) -> list[dict[str, Any]]:
    """The rows of each pair with the errors that follow from those of both BRDFs."""
    from ..compare import align
    from ..compare.drawn_errors import standard_errors

    found: dict[str, dict[str, float]] = {}
    for a in data:
        for b in data:
            of = f"{a} and {b}"
            own = [r["quantity"] for r in rows if r["of"] == of and r["value"] is not None and r["error"] is None]
            if a != b and own:
                known = all("brdf_stderr" in data[name] for name in (a, b))
                errors = standard_errors(_pair_figures(own), *align(data[b], data[a])) if known else {}
                found[of] = errors
    return [r if r["error"] is not None else {**r, "error": found.get(r["of"], {}).get(r["quantity"])} for r in rows]


def _pair_figures(wanted: list[str]) -> Callable[..., dict[str, float]]:
    """The figures of a pair by the names of their rows, of those that are wanted."""
    import numpy as np

    from ..compare import delta_e_2000, nrmse, rmse
    from ..compare.colour import SCALE_WORDS, SCALES
    from ..report.quantities import colour_difference

    shown, alone = SCALE_WORDS[SCALES[0]], SCALE_WORDS["normalised"]

    def figures(reference: Any, predicted: Any) -> dict[str, float]:
        found = {"NRMSE of the BRDF": float(nrmse(reference, predicted))}
        found["RMSE of the BRDF"] = float(rmse(reference, predicted))
        if f"mean dE00, {shown}" in wanted:
            difference = delta_e_2000(reference, predicted).values
            found[f"mean dE00, {shown}"] = float(np.nanmean(difference))
            found[f"95th percentile of dE00, {shown}"] = float(np.nanpercentile(difference, 95))
            found[f"largest dE00, {shown}"] = float(np.nanmax(difference))
        if f"mean dE00, {alone}" in wanted:
            found[f"mean dE00, {alone}"] = float(colour_difference(reference, predicted, "normalised").mean())
        return found

    return figures


def _unlike(data: dict[str, Any], reference: str) -> list[dict[str, Any]]:
    """A row for each result that was not simulated like the reference: coherence length, windows, cones."""
    from ..report.agreement import unlike

    found = {name: unlike(d, data[reference]) for name, d in data.items() if reference in data and name != reference}
    return [
        {"of": f"{name} and {reference}", "quantity": "simulated alike", "value": None, "error": None, "unit": why}
        for name, why in found.items()
        if why
    ]


def _appearance(name: str, data: Any) -> list[dict[str, Any]]:
    from ..compare import appearance

    further = [d for d in data["brdf"].dims if d not in ("theta_i", "theta_o", "cell", "wavelength")]
    return [] if further else appearance(name, data)


def _explained(data: dict[str, Any], reference: str, reflector: Any, figures: Path | None) -> list[dict[str, Any]]:
    """Rows of the explained shares; the reason alone where the reference has no shift or too few wavelengths."""
    from ..compare import explained_shares
    from ..report.tables import significance

    others = {k: v for k, v in data.items() if k != reference}
    if reference not in data:
        return []
    try:
        found = explained_shares(data[reference], others, reflector)
    except VgonioError as e:
        return [{"of": reference, "quantity": "explained share", "value": None, "error": None, "unit": str(e)}]
    if figures is not None:
        from ..report.figures import explained

        figures.mkdir(parents=True, exist_ok=True)
        save_figure(explained(found), figures / "explained.png")
    rows = []
    for i, name in enumerate(found["explanation"].values):
        share, error, sigma = (float(found[k][i]) for k in ("share", "share_stderr", "significance"))
        text = f"{found['kind'].values[i]}, {significance(sigma)}"
        rows.append(
            {"of": str(name), "quantity": f"explained share ({text})", "value": share, "error": error, "unit": "1"}
        )
    return rows


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
