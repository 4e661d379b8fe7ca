"""The page of a Normbox validation: one HTML file with its verdict, figures and tables."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..files import written_whole
from . import normbox_figures as figures
from .document import filled
from .section import Section
from .tables import Table, number, percent
from .verdict import Card, Verdict


def normbox_page(tree: xr.DataTree, path: str | os.PathLike[str]) -> Path:
    """Write the page of a validation; returns the path. Raises FileFormatError where it cannot be written."""
    found = json.loads(tree.attrs["verdict"])
    sections = [_spectra(tree), _errors(tree), _model(tree, found), _colour(tree), _sources(tree), _facts(tree)]
    text = filled(
        str(tree.attrs["title"]), _head(tree), _verdict(tree, found), sections, kicker="Normbox, thesis chapter 3"
    )
    with written_whole(path) as stream:
        stream.write(text.encode())
    return Path(path)


def _head(tree: xr.DataTree) -> list[str]:
    sizes = tree["reference"].to_dataset().sizes
    return [
        f"{sizes['patch']} patches × {sizes['angle']} angles × {sizes['wavelength']} wavelengths",
        f"Mitsuba {tree.attrs['variant']}",
        f"{json.loads(tree.attrs['seconds'])['all']:.0f} s",
    ]


def _verdict(tree: xr.DataTree, found: dict[str, Any]) -> Verdict:
    made = Verdict()
    if tree.attrs["virtual"]:
        made.alarms.append(str(tree.attrs["note"]))
    names = list(found["models"])
    first = found["models"][names[0]]
    made.cards.append(Card("NRMSE", percent(first["nrmse"]), f"{names[0]}, mean of all"))
    made.cards.append(Card("ΔE₀₀", number(first["delta_e_2000"]), f"{names[0]}, mean of all"))
    for name, share in found["removed"].items():
        made.cards.append(Card("removed", percent(share), f"of the mean square error, by {name}"))
    made.statements += statements(found)
    return made


def statements(found: dict[str, Any]) -> list[str]:
    """The verdict in sentences, for the page and for the command line."""
    names = list(found["models"])
    plain = names[0]
    lines = []
    for name, values in found["models"].items():
        lines.append(
            f"{name}: NRMSE {percent(values['nrmse'])} on average, {percent(values['nrmse_small'])} up to 60° and "
            f"{percent(values['nrmse_large'])} beyond; ΔE₀₀ {number(values['delta_e_2000'])}."
        )
    if "fit" in found:
        share = found["fit_share"][plain]
        word = "dominates" if share > 0.5 else "does not dominate"
        lines.append(
            f"The fit {word} the error of {plain}: {percent(share)} of its mean square is there when the fitted BRDFs "
            f"are held against the true ones in the same rendering; the true BRDFs themselves miss the reference by "
            f"{percent(found['noise'])} (noise of the renderer, and what was perturbed)."
        )
    for name, share in found["removed"].items():
        lines.append(f"{name} removes {percent(share)} of the mean square error of {plain}.")
    modelled = found["modelled"]
    lines.append(
        f"NSE of the predictions follows NSE of the fits at the angles of direct light with a mean correlation of "
        f"{modelled['spectral_correlation']:.2f}; the two-term model correlates with the errors found by "
        f"{modelled['correlation']:.2f}."
    )
    if "path" in found:
        path, first = found["path"], found["models"][plain]
        largest = max(path["sources"], key=path["sources"].get)
        lines.append(
            f"All sources of error but the fits would make {percent(path['combined'])} RMS "
            f"({percent(path['combined_small'])} up to 60°, {percent(path['combined_large'])} beyond), "
            f"{largest} the most ({percent(path['sources'][largest])}); found with {plain} is "
            f"{percent(first['nrmse_rms'])} ({percent(first['nrmse_rms_small'])}, {percent(first['nrmse_rms_large'])})."
        )
    return lines


def _spectra(tree: xr.DataTree) -> Section:
    made = Section("spectra", "Reference and prediction", "Spectra")
    data = figures.predicted(tree, figures.models(tree)[0])
    order = data["patch"].values[np.argsort(data["nrmse"].mean("angle").values)]
    for patch, words in dict.fromkeys([(int(order[0]), "smallest"), (int(order[-1]), "largest")]):
        made.draw(figures.spectra(tree, patch), f"Patch {patch}, the one with the {words} NRMSE (thesis figure 3.4).")
    return made


def _errors(tree: xr.DataTree) -> Section:
    made = Section("errors", "Errors over patches and angles", "Errors")
    made.draw(figures.errors(tree, "rmse"), "RMSE over the spectrum (thesis figure 3.5 a).")
    made.draw(figures.errors(tree, "nrmse"), "The same over the mean of the reference (thesis figure 3.6 a).")
    made.draw(figures.correlation(tree), "Errors against radiance (thesis figures 3.5 b, c and 3.6 b, c), first model.")
    return made


def _model(tree: xr.DataTree, found: dict[str, Any]) -> Section:
    made = Section("model", "What the fits do", "Fits")
    made.draw(figures.fit_against_prediction(tree), "NSE of prediction and fit at the first angle (thesis figure 3.8).")
    made.draw(figures.two_terms(tree), "The two-term model: direct and indirect light (thesis figure 3.7).")
    m = found["modelled"]
    made.text.append(
        f"Regressed on the errors found: err_d = {percent(m['err_d'])}, err_i = {percent(m['err_i'])}, "
        f"which explains {percent(m['explained'])} of their variance."
    )
    return made


def _colour(tree: xr.DataTree) -> Section:
    made = Section("colour", "Colour differences", "Colour")
    made.draw(figures.errors(tree, "delta_e_2000"), "ΔE₀₀ (thesis figure 3.10).")
    caption = "ΔE₀₀ over the angles and ΔE₇₆ at 45° (thesis figures 3.10, 3.11 b); XYZ as shares of patch 19 at 30°."
    made.draw(figures.colour_differences(tree), caption)
    return made


def _sources(tree: xr.DataTree) -> Section:
    made = Section("sources", "The error path", "Sources")
    if "error_path" not in tree.children:
        made.missing = "errors.repeats is 0: no source of error was propagated."
        return made
    path = tree["error_path"].to_dataset()
    words = f"Each source drawn {path.attrs['repeats']} times; patches {_list(path['patch'].values)}."
    made.draw(figures.sources(tree), words)
    rows = []
    for k, name in enumerate(path["source"].values):
        rms = float(np.sqrt(np.mean(path["deviation"].values[k] ** 2)))
        size = f"{number(path['size'].values[k])} {path['unit'].values[k]}".removesuffix(" 1")
        rows.append((str(name), str(path["what"].values[k]), size, str(path["spread"].values[k]), percent(rms)))
    made.tables.append(Table(("source", "what", "size", "kind of size", "error of the radiance"), rows, (2, 4)))
    return made


def _facts(tree: xr.DataTree) -> Section:
    made = Section("facts", "The scene", "Scene")
    box = json.loads(tree.attrs["box"])
    made.tables.append(Table(("length or number", "value"), [(k, str(v)) for k, v in box.items()]))
    made.text.append(
        "Box, light and angles are the thesis'; sample, holder, post, distance and the shape of the field are chosen. "
        f"{tree.attrs['note']} Renderer: {tree.attrs['variant']} ({tree.attrs['variant_why']})."
    )
    seconds = json.loads(tree.attrs["seconds"])
    made.tables.append(Table(("part", "seconds"), [(k, f"{v:.1f}") for k, v in seconds.items()], (1,)))
    return made


def _list(values: Any) -> str:
    return ", ".join(str(v) for v in values)
