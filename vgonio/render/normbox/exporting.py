"""The data of a virtual scene as the files that measured data come in, with a scene that reads them."""

from __future__ import annotations

from pathlib import Path

import xarray as xr

from ...files import written_whole
from ...measure import write
from . import virtual
from .inputs import write_light, write_reference
from .settings import Settings

SCENE = """# The data beside this file are VIRTUAL: made by vgonio, nothing was measured.
title = "{title}"

[files]
light = "light.csv"
walls = "wall.json"
patches = "patch_{{number:02d}}.json"
reference = "reference.csv"

[render]
patches = {patches}
angles_deg = {angles}
wavelengths = {wavelengths}
samples = {samples}

[fit]
models = {models}

[errors]
repeats = {repeats}
"""


def write_inputs(settings: Settings, tree: xr.DataTree, folder: Path) -> int:
    """Write light.csv, wall.json, patch_NN.json, reference.csv and normbox.toml; the number of files.

    tree : the validation of the virtual scene, which holds the reference. Box and error path are those of the defaults.
    """
    v = settings.virtual
    assert v is not None
    folder.mkdir(parents=True, exist_ok=True)
    note = "virtual, made by vgonio: nothing was measured"
    write_light(folder / "light.csv", *virtual.light_spectra(settings.box.light_count, v.seed), note)
    names = {0: "wall.json"} | {n: f"patch_{n:02d}.json" for n in settings.render.patches}
    for number, name in names.items():
        write(virtual.measured_patch(number, v.slope, v.gonio_noise, v.seed), folder / name)
    write_reference(folder / "reference.csv", tree["reference"].to_dataset()["radiance"], note)
    r = settings.render
    text = SCENE.format(
        title=settings.title.replace('"', "'"),
        patches=list(r.patches),
        angles=[float(a) for a in r.angles_deg],
        wavelengths=r.wavelengths,
        samples=r.samples,
        repeats=settings.errors.repeats,
        models=str(list(settings.fit.models)).replace("'", '"'),
    )
    with written_whole(folder / "normbox.toml") as stream:
        stream.write(text.encode())
    return len(names) + 3
