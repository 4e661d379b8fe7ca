"""The command validate: a renderer held against the Normbox."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from ..files import PAGE_ENDINGS, RESULT_ENDINGS
from .common import Json, Quiet, Threads, print_json, print_table, progress_bars, say

if TYPE_CHECKING:
    from ..render.normbox import Settings

TEMPLATE = """# A Normbox validation (thesis, chapter 3). Paths are relative to this file.
title = "Normbox, virtual ground truth"

[virtual]                            # nothing measured: known BRDFs with a spectral shift; remove this table and give
gonio_noise = 0.007                  # [files] for measured data
slope = 1.5e-3                       # typical slope h of the shift, 1/nm
samples = 256                        # of the reference
perturbed = false                    # true: every source of error drawn once, as a measured reference has them

# [files]
# light = "light.csv"                # wavelength_nm and the radiance at each of 25 points, W/(m² sr nm)
# walls = "wall.json"                # in-plane BRDFs, any format of `vgonio measured info`
# patches = "patch_{number:02d}.json"
# reference = "reference.csv"        # patch, angle_deg and the radiances; wavelengths in the header

[fit]                                # the first is the plain one
models = ["cook-torrance-1982", "cook-torrance-1982+k_s+c", "clausen-2022"]
exponent = 1.0                       # w of the cost function (thesis 3.2)

[render]
patches = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24]
angles_deg = [30, 35, 40, 45, 50, 55, 60, 65, 70, 75, 80, 85, 90]
samples = 64                         # paths per pixel and four wavelengths
wavelengths = 200
variant = "auto"                     # llvm where it works, else scalar

[errors]                             # the error path; repeats = 0 leaves it out
patches = [4, 19, 22]
repeats = 4
# sizes = { angle = 0.5, geometry = 1.0 }

# [box]                              # lengths in mm
# sample_mm = 40.0                   # what the thesis does not state is chosen: see `vgonio.render.normbox.Box`
# distance_mm = 1000.0
"""


def validate(
    scene: Annotated[
        Path | None, typer.Argument(metavar="SCENE", help="What to validate (TOML).", show_default=False)
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="RESULT.nc", help="The result.", show_default="SCENE.nc")
    ] = None,
    report: Annotated[Path | None, typer.Option("--report", metavar="PAGE.html", help="Also a page.")] = None,
    init: Annotated[
        Path | None, typer.Option("--init", metavar="SCENE", help="Only write a commented scene to start from.")
    ] = None,
    write_inputs: Annotated[
        Path | None,
        typer.Option("--write-inputs", metavar="FOLDER", help="Also the data of a virtual scene, as files."),
    ] = None,
    as_json: Json = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Hold the renderer against the Normbox.

    In-plane BRDFs are fitted, patches in a box predicted and compared with measured radiances, spectrally and in
    colour; errors are modelled and propagated. Finished predictions are kept beside the result until it is complete:
    an interrupted run goes on.

    Example: vgonio validate --init normbox.toml && vgonio validate normbox.toml --report normbox.html
    """
    if init is not None:
        _write_template(init)
        return
    if scene is None:
        raise InputError("nothing to validate: give SCENE, or --init SCENE to write one")
    from ..planning import check_output, with_folder

    result = scene.with_suffix(".nc") if output is None else output
    check_output(result, RESULT_ENDINGS, [scene])
    if report is not None:
        check_output(report, PAGE_ENDINGS, [scene])
    from ..render import choose
    from ..render.normbox import load
    from ..render.normbox import validate as run

    settings = load(scene)
    if write_inputs is not None and settings.virtual is None:
        raise InputError("--write-inputs writes the data of a virtual scene, and this one names files")
    chosen = choose(settings.render.variant)
    say(f"Mitsuba {chosen.variant}: {chosen.why}")
    if settings.virtual:
        say("virtual ground truth: nothing was measured")
    parts = result.with_name(result.name + ".parts")
    try:
        with progress_bars() as progress:
            tree = run(settings, parts, progress)
    except KeyboardInterrupt as e:
        if parts.is_dir():
            e.add_note(f"finished predictions are kept in {parts}, the same command goes on from there")
        raise
    from ..measure import save

    save(tree, with_folder(result))
    shutil.rmtree(parts, ignore_errors=True)
    if write_inputs is not None:
        _write_inputs(settings, tree, write_inputs)
    if report is not None:
        from ..report.normbox_document import normbox_page

        normbox_page(tree, with_folder(report))
    _tell(tree, as_json, quiet, result, report)


def _write_template(path: Path) -> None:
    from ..files import written_whole
    from ..planning import check_output, with_folder

    check_output(path, (".toml",))
    if path.exists():
        raise InputError(f"{path} is there already: choose another name, or remove it first")
    with written_whole(with_folder(path)) as stream:
        stream.write(TEMPLATE.encode())
    say(f"scene: {path}")


def _write_inputs(settings: Settings, tree: Any, folder: Path) -> None:
    """The virtual data in the files that measured data come in."""
    from ..render.normbox.exporting import write_inputs

    written = write_inputs(settings, tree, folder)
    say(f"data: {folder} ({written} files)")


def _tell(tree: Any, as_json: bool, quiet: bool, result: Path, report: Path | None) -> None:
    found = json.loads(tree.attrs["verdict"])
    if as_json:
        print_json(found)
        return
    if quiet:
        return
    from ..report.normbox_document import statements

    head = ("model", "NRMSE", "to 60°", "beyond", "ΔE₀₀", "ΔE₇₆")
    keys = ("nrmse", "nrmse_small", "nrmse_large", "delta_e_2000", "delta_e_1976")
    print_table("", head, [[name, *(values[k] for k in keys)] for name, values in found["models"].items()])
    for line in statements(found)[len(found["models"]) :]:
        print(line)
    print(f"result: {result}" + ("" if report is None else f", page: {report}"))
