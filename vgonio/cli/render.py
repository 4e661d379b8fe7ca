"""The command render: pictures of materials side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import FileFormatError, InputError, nearest
from ..files import json_of
from .common import Json, Quiet, Threads, print_json, print_table, progress_bars, say

if TYPE_CHECKING:
    from ..render import Appearance

Variant = Annotated[str, typer.Option("--variant", help="Of Mitsuba: auto, llvm, scalar or cuda.")]
Seed = Annotated[int, typer.Option("--seed", help="Of the random numbers, 0 or more.")]


def render(
    materials: Annotated[
        list[str],
        typer.Argument(
            metavar="MATERIAL …",
            help="Results (.nc, FILE:GROUP), measured BRDFs, fits, tables of RGL (.bsdf), or formulas such as "
            "clausen-2022:alpha=0.3,h=8e-4,w=2.2,material=Al.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FIGURE.png", help="The figure: pictures, ΔE₀₀ images, scale.")
    ] = Path("render.png"),
    images: Annotated[
        Path | None,
        typer.Option("--images", metavar="FOLDER", help="Also each picture, as EXR (colour and spectra) and PNG."),
    ] = None,
    names: Annotated[
        list[str] | None, typer.Option("--name", help="Titles of the materials, in their order. Repeatable.")
    ] = None,
    reference: Annotated[
        str | None, typer.Option("--reference", help="Material that ΔE₀₀ is against.", show_default="the first")
    ] = None,
    size: Annotated[int, typer.Option("--size", help="Width and height in pixels.")] = 256,
    samples: Annotated[int, typer.Option("--samples", help="Paths per pixel and four wavelengths in one pass.")] = 4,
    passes: Annotated[int, typer.Option("--passes", help="Independent passes, at least; the error is from them.")] = 4,
    target_error: Annotated[
        float | None,
        typer.Option("--target-error", help="Go on until the error of Y (RMS over the picture) is below, as 0.01."),
    ] = None,
    max_seconds: Annotated[
        float | None, typer.Option("--max-seconds", help="Go on, for each material, for so many at most.")
    ] = None,
    wavelengths: Annotated[
        str, typer.Option("--wavelengths", metavar="START:STOP:STEP", help="In nm, the stop included.")
    ] = "400:720:20",
    fill: Annotated[
        str, typer.Option("--fill", help="What in-plane data are outside their plane: half-angle or azimuth.")
    ] = "half-angle",
    mesh: Annotated[
        Path | None, typer.Option("--mesh", help="A shader ball of yours (.ply, .obj), within the unit sphere.")
    ] = None,
    variant: Variant = "auto",
    seed: Seed = 0,
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Render materials as spheres, side by side.

    Under a spot and a directional light, spectrally, to CIE XYZ under D65, with the colour differences between the
    pictures.

    Example: vgonio render cook-torrance-1982:alpha=0.3 clausen-2022:alpha=0.3,h=8e-4,w=2.2 -o shift.png
    """
    from ..planning import check_output, with_folder
    from ..render import Preview, choose, preview

    check_output(output, (".png",), [])
    chosen = choose(variant)
    options = Preview(
        size=size,
        samples=samples,
        passes=passes,
        wavelength_nm=wavelength_range(wavelengths),
        target_error=target_error,
        max_seconds=max_seconds,
        mesh=None if mesh is None else str(mesh),
        seed=seed,
    )
    found = gather(materials, fill, options.wavelength_nm, names)
    if reference is not None and reference not in [m.name for m in found]:
        raise InputError(f"--reference {reference!r} is none of the materials: {', '.join(m.name for m in found)}")
    say(f"Mitsuba {chosen.variant}: {chosen.why}")
    with progress_bars() as progress:
        data = preview(found, options, chosen, progress)
    _write(data, with_folder(output), images, reference)
    rows = _rows(data, found, reference)
    if as_json:
        print_json({"variant": chosen.variant, "exposure": data.attrs["exposure"], "materials": rows})
        return
    if not quiet:
        print_table("", list(rows[0]), [list(r.values()) for r in rows])
    for note in dict.fromkeys(m.note for m in found if m.note):
        say(note)
    say(f"figure: {output}" + ("" if images is None else f", pictures: {images}"))


def wavelength_range(text: str) -> list[float]:
    """ "400:720:20" as a list, or a list "450,550,650" as it is."""
    from ..scene.values import expand

    try:
        if ":" not in text:
            return [float(x) for x in text.split(",")]
        start, stop, step = (float(x) for x in text.split(":"))
    except ValueError:
        raise InputError(f"--wavelengths {text!r}: START:STOP:STEP in nm is needed, or a list as 450,550,650") from None
    return list(expand({"start": start, "stop": stop, "step": step}))


def gather(specs: list[str], fill: str, wavelength_nm: Any, names: list[str] | None) -> list[Appearance]:
    """The materials that the arguments name, with titles that differ."""
    from dataclasses import replace

    found = [m for spec in specs for m in _materials(spec, fill, wavelength_nm)]
    titles = list(names or [])
    if len(titles) > len(found):
        raise InputError(f"{len(titles)} titles for {len(found)} materials")
    titles += [m.name for m in found[len(titles) :]]
    unique: list[str] = []
    for title in titles:
        unique.append(title if title not in unique else f"{title} ({titles.index(title) + len(unique)})")
    return [replace(m, name=n) for m, n in zip(found, unique)]


def _materials(spec: str, fill: str, wavelength_nm: Any) -> list[Appearance]:
    from ..models import MODELS
    from ..render import of_dataset, of_fit, of_model, of_table

    model, _, given = spec.partition(":")
    if model in MODELS:
        return [of_model(model, formula(given), wavelength_nm, spec)]
    if not Path(model).suffix and not Path(spec).exists() and not Path(model).exists():
        raise InputError(f"{spec}: there is no such file, and no model {model!r}: {nearest(model, MODELS)}")
    if spec.lower().endswith(".bsdf"):
        return [of_table(spec)]
    fit = _fit(Path(spec))
    if fit is not None:
        return [of_fit(fit, Path(spec).stem)]
    from .results import _load, require_one_point

    found = _load(Path(spec))
    for data in found.values():
        require_one_point(data, Path(spec))
    return [of_dataset(data, name, fill) for name, data in found.items()]


def formula(text: str) -> dict[str, Any]:
    """ "alpha=0.3,material=Al" as a dictionary; what is no number stays a word."""
    found: dict[str, Any] = {}
    for part in filter(None, (p.strip() for p in text.split(","))):
        key, equals, value = part.partition("=")
        if not equals:
            raise InputError(f"{part!r} in a formula: name=value is needed, as in alpha=0.3")
        try:
            found[key.strip()] = float(value)
        except ValueError:
            found[key.strip()] = value.strip()
    return found


def _fit(path: Path) -> Any:
    """The fitted model in a file, None where it holds something else."""
    from ..compare.fit_files import FORMAT, open_fit

    if path.suffix.lower() == ".json" and path.is_file():
        try:
            content = json_of(path, "fit")
        except FileFormatError:
            return None
        return open_fit(path) if isinstance(content, dict) and content.get("format") == FORMAT else None
    if path.suffix.lower() in (".nc", ".h5") and path.is_file():
        from ..measure import open as open_result

        try:
            return open_fit(path) if open_result(path).attrs.get("method") == "fit" else None
        except FileFormatError:
            return None
    return None


def _write(data: Any, output: Path, images: Path | None, reference: str | None) -> None:
    from ..files import written_whole
    from ..render.images import write_exr, write_png
    from ..report.render_figures import previews

    figure = previews(data, reference)
    with written_whole(output) as stream:
        figure.savefig(stream, format="png", dpi=150)
    if images is None:
        return
    from ..planning import with_folder

    for name in map(str, data["material"].values):
        path = with_folder(images / f"{file_name(name)}.exr")
        write_exr(path, data, name)
        write_png(path.with_suffix(".png"), data, name)


def file_name(title: str) -> str:
    """A title as a file's name."""
    return "".join(c if c.isalnum() or c in "-_.=" else "_" for c in title)[:80]


def _rows(data: Any, found: list[Appearance], reference: str | None) -> list[dict[str, Any]]:
    """One row a material: how it was rendered, seconds, error, mean and 95th percentile of ΔE₀₀."""
    from ..render import delta_e

    difference = delta_e(data, reference)
    rows = []
    for i, m in enumerate(found):
        one, values = data.isel(material=i), difference.isel(material=i)
        rows.append(
            {
                "material": m.name,
                "route": m.route,
                "seconds": float(one["seconds"]),
                "samples": int(one["samples"]),
                "error of Y": float(one["error"]),
                "ΔE₀₀ mean": float(values.mean()),
                "ΔE₀₀ 95 %": float(values.quantile(0.95)),
            }
        )
    return rows
