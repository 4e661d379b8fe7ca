"""The command fit: shifts and models fitted to measured or simulated BRDFs."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import InputError, MaterialError, VgonioError, nearest
from .common import Json, Quiet, Threads, print_json, print_table, progress_bars, save_figure, say
from .results import known_material, load_all, load_one

_REMEDY = (
    " (no material was given: --material states the sample's own, perfect, or none for a dielectric such as plastic)"
)
SHIFT_COLUMNS = ("of", "quantity", "value", "error", "unit")


def fit(
    data: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="DATA…",
            help="Measured BRDFs, or results (.nc, FILE:GROUP for one group of it).",
            show_default=False,
        ),
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option(
            "--model", metavar="NAME", help="Of --list. Repeatable.", show_default="cook-torrance-1982, clausen-2022"
        ),
    ] = None,
    material: Annotated[
        str | None,
        typer.Option(
            "--material",
            metavar="NAME",
            help="Of the facets; none: a dielectric, whose index and k_d are fitted.",
            show_default="what DATA name, else Al",
        ),
    ] = None,
    exponent: Annotated[
        float, typer.Option("--exponent", metavar="W", help="w of the cost function: weight of steep incidence.")
    ] = 1.0,
    wavelengths: Annotated[
        str | None,
        typer.Option("--wavelengths", metavar="LOW:HIGH", help="Range in nm, as 400:700.", show_default="all"),
    ] = None,
    wavelength_n: Annotated[
        float, typer.Option("--wavelength-n", metavar="NM", help="Where the shift is 1, in nm.")
    ] = 600.0,
    p: Annotated[
        str, typer.Option("--p", metavar="fit|NUMBER", help="Exponent of Fresnel in the shift fits; 0 is without it.")
    ] = "fit",
    rays: Annotated[
        Path | None,
        typer.Option("--rays", metavar="RESULT", help="Traced result with reflections apart, for two shifts."),
    ] = None,
    errors: Annotated[str, typer.Option("--errors", help="Standard errors: sandwich, bootstrap or none.")] = "sandwich",
    scale: Annotated[
        str, typer.Option("--scale", help="Of the colour differences: reference-Y50, absolute, normalised.")
    ] = "reference-Y50",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FITS.nc", help="Keep the fits; .json for one fit alone.")
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="FOLDER", help="Draw figures as 4.7, 4.8, 4.11, 4.12 of the thesis."),
    ] = None,
    list_models: Annotated[bool, typer.Option("--list", help="Print the table of models and end.")] = False,
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Fit colour shifts and BRDF models, with their errors.

    Notes say what the data cannot tell. Several DATA are samples of one table (mean dE00 of each model per sample).

    Example: vgonio fit sample.json --model cook-torrance-1982 --model clausen-2022 -o fits.nc
    """
    if list_models:
        _list(as_json)
        return
    if not data:
        raise InputError("nothing to fit: give at least one measured BRDF or result, or --list for the models")
    from ..compare.colour import SCALE_WORDS
    from ..units import meant_nm

    if material is not None:
        known_material(material)
    if scale not in SCALE_WORDS:
        raise InputError(f"--scale {scale}: {nearest(scale, SCALE_WORDS)}")
    if not 100 <= wavelength_n <= 100_000:
        raise InputError(f"--wavelength-n {wavelength_n:g}{meant_nm(wavelength_n) or ': it is in nm, as 600'}")
    samples = load_all(data, one_point=True)
    material, assumed = (material, "") if material is not None else _material_of(samples)
    reflector = known_material(material)
    traced = None if rays is None else _traced(rays)
    limits, number = _limits(wavelengths), _exponent(p)
    names = tuple(model or ("cook-torrance-1982", "clausen-2022"))
    if "two-shifts" in names and traced is None:
        raise InputError("two-shifts needs the share of single reflections: give --rays RESULT.nc of the same surface")
    if output is not None:
        _check_output(output, len(samples) * len(names))
    from ..compare import broken_physics, fit_models, model_table
    from ..models import find

    options: dict[str, Any] = {"exponent": exponent, "wavelength_range_nm": limits, "errors": errors}
    options["only_where_known"] = {"wavelength_n_nm": wavelength_n, "single_share": traced}
    with progress_bars() as progress:
        report = None if progress is None else (lambda x: progress("fits", x))
        try:
            fits = fit_models(samples, names, reflector, report, **options)
        except MaterialError as e:
            raise MaterialError(f"{e}{_REMEDY if assumed else ''}") from None
    shift = [
        row
        for name, found in samples.items()
        for row in _shift_rows(name, found, reflector, number, wavelength_n, limits, traced)
    ]
    table = model_table(samples, fits, scale)
    for row in table:
        row["notes"] += broken_physics(fits[row["sample"]][row["model"]])
    looks = [row for name, found in fits.items() for row in _looks(name, found)]
    if output is not None:
        _save(fits, output)
    drawn = [] if figures is None else _draw(figures, samples, fits, reflector, number, wavelength_n, scale)
    if as_json:
        print_json({"shift": shift, "models": table, "appearance": looks, "delta_e_scale": scale})
        return
    if assumed and (number != 0 or any(find(m).takes_material for m in names)):
        say(assumed)
    _print(shift, table, looks, scale)
    for line in ([f"fits: {output}"] if output is not None else []) + drawn:
        say(line)


def _print(shift: list[dict[str, Any]], table: list[dict[str, Any]], looks: list[dict[str, Any]], scale: str) -> None:
    print_table("Shift", SHIFT_COLUMNS, [[r[k] for k in SHIFT_COLUMNS] for r in shift])
    columns = {"sample": "sample", "model": "model", "delta_e": "mean dE00", "gain": "gain", "gain_stderr": "±"}
    columns |= {"nrmse": "NRMSE", "parameters": "parameters"}
    print_table(f"Models (dE00: {scale})", list(columns.values()), [[r[k] for k in columns] for r in table])
    if looks:
        print_table("Appearance of the models", SHIFT_COLUMNS, [[r[k] for k in SHIFT_COLUMNS] for r in looks])
    for row in table:
        for note in row["notes"]:
            say(f"{row['sample']}, {row['model']}: {note}")


def _material_of(samples: dict[str, Any]) -> tuple[str, str]:
    """The material that the data name, else Al, and a line that says which was taken."""
    from ..materials import material

    named = {str(d.attrs["material"]) for d in samples.values() if d.attrs.get("material")}
    if len(named) == 1:
        (name,) = named
        try:
            material(name)
        except VgonioError:
            pass  # a sample's own name for what it is made of
        else:
            return name, f"material: {name}, which the data name (--material NAME for another, none for a dielectric)"
    why = f"the data name {', '.join(sorted(named))}" if named else "none is given"
    return "Al", f"material: Al (aluminium) is assumed, {why}: --material NAME changes it, none is a dielectric"


def _list(as_json: bool) -> None:
    from ..models import table

    columns = ["model", "parameters", "what", "source"]
    rows = table()
    if as_json:
        print_json([dict(zip(columns, row)) for row in rows])
    else:
        print_table("", columns, rows)


def _traced(rays: Path) -> Any:
    from ..compare import single_share

    return single_share(load_one(rays, lambda d: "brdf_by_bounce" in d, "reflections apart (brdf_by_bounce)"))


def _limits(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    low, _, high = text.partition(":")
    try:
        limits = float(low), float(high)
    except ValueError:
        limits = float("nan"), float("nan")
    if not limits[0] < limits[1]:
        raise InputError(f"--wavelengths {text}: LOW:HIGH in nm is needed, as in 400:700")
    return limits


def _exponent(text: str) -> float | str:
    """p of the shift fits: "fit" or a number within its bounds."""
    if text == "fit":
        return text
    from ..compare import check_p

    try:
        p = float(text)
        check_p(p)
    except ValueError as e:
        raise InputError(f"--p {text}: {e if isinstance(e, InputError) else 'a number or fit is needed'}") from None
    return p


def _check_output(output: Path, count: int) -> None:
    from ..planning import check_output

    check_output(output, (".nc", ".h5", ".json"), [])
    if output.suffix.lower() == ".json" and count > 1:
        raise InputError(f"{output.name}: {count} fits do not fit into one JSON file, write .nc (a group for each)")


def _shift_rows(
    name: str, data: Any, reflector: Any, p: Any, wavelength_n: float, limits: Any, traced: Any
) -> list[dict[str, Any]]:
    from ..compare import delta_e_2000, fit_global_shift, fit_local_shift, fit_two_shifts, fitted_spectra
    from ..compare.exponent import FEWEST_FOR_P, bound_words
    from ..compare.significance import HEIGHT_OF, no_shift

    def row(quantity: str, value: Any, unit: str = "1", error: Any = None) -> dict[str, Any]:
        return {"of": name, "quantity": quantity, "value": value, "error": error, "unit": unit}

    def parameter(what: str, found: Any, key: str) -> dict[str, Any]:
        height, error = HEIGHT_OF.get(key, key), float(found[f"{key}_stderr"])
        why = no_shift(*(float(found[k]) for k in (height, f"{height}_stderr", "r2"))) if height[0] == "h" else ""
        if why and height != key:
            return row(f"{what} {key}", None, why)
        said = f": {why}" if why else bound_words(float(found[key])) if key == "p" and free_p else ""
        unit = str(found[key].attrs["units"])
        return row(f"{what} {key}{said}", float(found[key]), unit, error if isfinite(error) else None)

    common: dict[str, Any] = {"wavelength_n_nm": wavelength_n, "wavelength_range_nm": limits}
    rows = []
    free_p = p == "fit" and reflector is not None and data.sizes["wavelength"] >= FEWEST_FOR_P
    try:
        if p == "fit" and data.sizes["wavelength"] < FEWEST_FOR_P:
            p = 1.0 if reflector is not None else 0.0
        local = fit_local_shift(data, reflector, p, **common)
        for limit in ("0.95", "0.90"):
            rows.append(row(f"local fits with r2 > {limit}", local.attrs.get(f"r2_above_{limit}")))
        one = fit_global_shift(data, reflector, p, "fit", **common)
        rows += [parameter("global shift", one, key) for key in ("h", "w", "t_y", "p")]
        rows += [row("global shift r2", float(one["r2"])), row("global shift AIC", one.attrs["aic"])]
        if traced is not None:
            two = fit_two_shifts(data, traced, reflector, p, **common)
            rows += [parameter("two shifts", two, key) for key in ("h1", "w1", "h2", "w2", "p")]
            rows += [row("two shifts r2", float(two["r2"])), row("two shifts AIC", two.attrs["aic"])]
        for kind, found in (("local", local), ("global", one)):
            difference = delta_e_2000(data, fitted_spectra(data, found), "normalised", wavelength_n)
            rows.append(row(f"mean dE00 of the {kind} shift, colour alone", float(difference.mean())))
    except VgonioError as e:
        rows.append(row("left out", None, str(e)))
    return rows


def _looks(sample: str, fits: Any) -> list[dict[str, Any]]:
    """Gloss and haze of the fitted models; what cannot be had is left out."""
    from ..compare import appearance

    rows = []
    for model, found in fits.items():
        chosen = found.isel(theta_i=[0]) if "theta_i" in found.dims else found
        rows += [r for r in appearance(f"{sample}, {model}", chosen) if r["value"] is not None]
    return rows


def _save(fits: Any, output: Path) -> None:
    from ..compare import save_fit
    from ..measure import storage
    from ..planning import with_folder

    path = with_folder(output)
    only = [f for models in fits.values() for f in models.values()]
    if len(only) == 1:
        save_fit(only[0], path)
        return
    import xarray as xr

    groups = {
        f"{sample.replace('/', '_')}/{model}": f for sample, models in fits.items() for model, f in models.items()
    }
    storage.save(xr.DataTree.from_dict(groups), path)


def _draw(folder: Path, samples: Any, fits: Any, reflector: Any, p: Any, wavelength_n: float, scale: str) -> list[str]:
    """Draw the figures that the data allow, as PNG; returns a line on each, drawn or not."""
    from ..compare import fit_global_shift, fit_local_shift
    from ..planning import with_folder
    from ..report import figures

    with_folder(folder / "slopes.png")
    slopes: dict[str, Any] = {}
    drawn: list[str] = []

    def keep(name: str, make: Any) -> None:
        try:
            figure = make()
        except VgonioError as e:
            drawn.append(f"not drawn, {name}: {e}")
            return
        path = folder / f"{name}.png"
        save_figure(figure, path)
        drawn.append(f"figure: {path}")

    def slope_of(data: Any) -> Any:
        local = fit_local_shift(data, reflector, p, wavelength_n)
        return local.assign(slope_global=fit_global_shift(data, reflector, p, "fit", wavelength_n)["slope_global"])

    for name, data in samples.items():
        safe = "".join(c if c.isalnum() or c in "-_." else "_" for c in name)
        keep(f"{safe}_shift", lambda data=data: figures.shift_parts(data, reflector, p, wavelength_n))  # type: ignore[misc]
        keep(f"{safe}_models", lambda data=data, name=name: figures.models_beside(data, fits[name], scale))  # type: ignore[misc]
        try:
            slopes[name] = slope_of(data)
        except VgonioError as e:
            drawn.append(f"not drawn, slopes of {name}: {e}")
    if slopes:
        keep("slopes", lambda: figures.shift_slopes(slopes))
    return drawn
