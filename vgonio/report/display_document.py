"""The page of a display: what it is (thesis figure 5.4, table 5.1), whether it obeys the model and whether the
calibration works (figure 5.5)."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..files import written_whole
from . import display_figures as figures
from .document import filled
from .section import Section
from .tables import Table, number, percent
from .verdict import Card, Verdict

if TYPE_CHECKING:
    from ..display import Assumptions, Examined, ModelCheck

LEFT_OUT = (
    "The model describes one colour for the whole panel, seen without optics: the lens of a headset (its colour "
    "fringes, stray light and absorption, unless the meter looked through it) and differences from place to place on "
    "the panel are left out, as in the thesis. Each eye is a display of its own."
)
SHOWN = 4  # worst colours in the table


def display_page(displays: Sequence[Examined], path: str | os.PathLike[str], title: str = "Display") -> Path:
    """Write the report of a display, or of the eyes of a headset, as one self-contained HTML page; returns the path.

    Parts without measurements are left out on the page with the reason. Raises FileFormatError where it cannot be
    written.
    """
    path = Path(path)
    text = render_display(displays, title)
    with written_whole(path) as stream:
        stream.write(text.encode())
    return path


def render_display(displays: Sequence[Examined], title: str = "Display") -> str:
    """The page as a string; see `display_page`."""
    from ..display import summary

    named = {d.model.eye or figures.ALONE: d for d in displays}
    facts = {name: summary(d.model, d.check) for name, d in named.items()}
    sections = [_characteristics(named, facts), _tones(named), _model_check(named), _calibration(named)]
    sections.append(Section("limits", "What is left out", "Limits", text=[LEFT_OUT]))
    first = next(iter(facts.values()))
    lines = [
        f"{' and '.join(named)}" if len(named) > 1 or next(iter(named)) != figures.ALONE else "",
        f"white {number(first['white_cd_m2'])} cd/m²",
        f"{displays[0].model.wavelength_nm[0]:g} … {displays[0].model.wavelength_nm[-1]:g} nm",
    ]
    lines = [line for line in lines if line]
    return filled(
        title,
        lines,
        _verdict(named, facts),
        sections,
        kicker="display characterisation",
        numbers="the files of readings, the profile and the table",
    )


def _verdict(named: Mapping[str, Examined], facts: Mapping[str, Mapping[str, Any]]) -> Verdict:
    from ..display.verification import MEASURED

    made = Verdict()
    fact, one = next(iter(facts.values())), next(iter(named.values()))
    eye = f"{one.model.eye} eye, " if one.model.eye else ""
    contrast = f"{fact['contrast']:.0f} : 1" if fact["contrast"] else "without end: no light in black"
    made.cards.append(Card("White", f"{number(fact['white_cd_m2'])} cd/m²", f"{eye}x, y = {_pair(fact['white_xy'])}"))
    made.cards.append(Card("Black", f"{number(fact['black_cd_m2'], 2)} cd/m²", f"contrast {contrast}"))
    if one.check is not None:
        s = one.check.statistics()
        made.cards.append(Card("Model, mean ΔE₀₀", f"{s['mean']:.2f}", f"max. {s['max']:.1f} of {len(one.check.rgb)}"))
    if one.calibration is not None:
        s2 = one.calibration.statistics()
        note = f"sRGB {s2['sRGB']['mean']:.1f}, Adobe RGB {s2['Adobe RGB']['mean']:.1f}"
        made.cards.append(Card("Calibrated, mean ΔE₀₀", f"{s2[MEASURED]['mean']:.2f}", note))
    for name, d in named.items():
        head = f"{name.capitalize()}: " if len(named) > 1 else ""
        made.statements.append(head + _covers(facts[name]))
        if d.check is not None:
            made.statements.append(head + _obeys(d.check.assumptions))
        made.cautions += [head + note for note in d.model.notes]
    return made


def _obeys(found: Assumptions) -> str:
    """Which assumptions fail, in figures; one sentence where none does."""
    from ..display.assumptions import details

    costs, failing = found.costs(), found.failing()
    tested = {name: cost for name, cost in costs.items() if np.isfinite(cost)}
    if not tested:
        return "No test colours for the assumptions of the model."
    if not failing:
        name = max(tested, key=lambda n: tested[n])
        most = f"{name} costs most, a mean ΔE₀₀ of {tested[name]:.2f}"
        return f"The display obeys the model: {', '.join(tested)} hold; {most}."
    parts = [f"{n} fails (mean ΔE₀₀ {costs[n]:.2f}: {details(n, found)})" for n in failing]
    return f"The display departs from the model: {'; '.join(parts)}."


def _covers(fact: Mapping[str, Any]) -> str:
    shares = fact["coverage"]
    wider = "Adobe RGB" if shares["Adobe RGB"] > 0.9 else "sRGB"
    kind = f"close to or beyond {wider}" if shares[wider] > 0.9 else "smaller than sRGB"
    return (
        f"The gamut covers {percent(shares['sRGB'], 3)} of sRGB and {percent(shares['Adobe RGB'], 3)} of Adobe RGB "
        f"(in u′v′): {kind}."
    )


def _pair(xy: Sequence[float]) -> str:
    return f"{xy[0]:.3f}, {xy[1]:.3f}"


def _characteristics(named: Mapping[str, Examined], facts: Mapping[str, Mapping[str, Any]]) -> Section:
    made = Section("display", "What the display is", "Display")
    models = {name: d.model for name, d in named.items()}
    width = "wide" if len(models) > 1 else "half"
    caption = (
        "Primaries and white in the CIE 1931 diagram, with the triangles of sRGB (dashed) and Adobe RGB (dotted; as "
        "thesis figure 5.4 c). The colours of the background are those that your screen has."
    )
    made.draw(figures.chromaticity_diagram(models), caption, width)
    caption = (
        "White, measured, beside the sum of black and the three primaries (shaded): where the two part, the channels "
        "do not add up (as thesis figure 5.4 b)."
    )
    made.draw(figures.white_spectra(models), caption, width)
    made.draw(figures.black_spectra(models), "Black: what is left at signal 0 (as thesis figure 5.4 a).", width)
    if len(models) == 1:
        made.beside = _table_5_1(facts)
    else:
        made.tables.append(_table_5_1(facts))
    return made


def _table_5_1(facts: Mapping[str, Mapping[str, Any]]) -> Table:
    """Thesis table 5.1, one column for each eye, with what it leaves out."""
    rows: list[tuple[str, ...]] = []

    def row(name: str, text: Any) -> None:
        rows.append((name, *(str(text(f)) for f in facts.values())))

    row("Largest luminance, cd/m²", lambda f: number(f["white_cd_m2"]))
    row("of black + R + G + B, cd/m²", lambda f: number(f["white_simulated_cd_m2"]))
    row("Least luminance, cd/m²", lambda f: number(f["black_cd_m2"], 2))
    row("Contrast", lambda f: f"{f['contrast']:.0f} : 1" if f["contrast"] else "–")
    row("White x, y", lambda f: _pair(f["white_xy"]))
    for channel in ("red", "green", "blue"):
        row(f"{channel.capitalize()} x, y", lambda f, c=channel: _pair(f["primaries_xy"][c]))
    row("Covers of sRGB, Adobe RGB", lambda f: ", ".join(percent(v, 3) for v in f["coverage"].values()))
    row("Exponent of R, G, B", lambda f: ", ".join(number(v) for v in f["gamma"].values()))
    row("Levels measured of R, G, B", lambda f: ", ".join(str(v) for v in f["levels"].values()))
    row("Condition number of the primaries", lambda f: number(f["condition"], 2))
    if all("delta_e" in f for f in facts.values()):
        row("Mean ΔE₀₀", lambda f: f"{f['delta_e']['mean']:.2f}")
        row("Max. ΔE₀₀", lambda f: f"{f['delta_e']['max']:.2f}")
        row("ΔE₀₀ above 1, above 2", lambda f: ", ".join(percent(f["delta_e"][k]) for k in ("above_1", "above_2")))
    return Table(("", *facts), rows, numeric=tuple(range(1, 1 + len(facts))), caption="As thesis table 5.1")


def _tones(named: Mapping[str, Examined]) -> Section:
    made = Section("tone", "Tone curves", "Tone curves")
    models = {name: d.model for name, d in named.items()}
    caption = (
        "Light above black over the signal: measured levels (dots) and the rising curve nearest to them, which has an "
        "inverse by construction. The axis is a cube root, so that the dark end shows."
    )
    made.draw(figures.tone_curves(models), caption, "wide" if len(models) > 1 else "half")
    return made


def _model_check(named: Mapping[str, Examined]) -> Section:
    made = Section("model", "Does the display obey the model? (Framework 1)", "Framework 1")
    checks = {name: d.check for name, d in named.items() if d.check is not None}
    if not checks:
        made.missing = "no test colours beside those that the model was fitted to were measured."
        return made
    width = "wide" if len(checks) > 1 else "half"
    count = len(next(iter(checks.values())).rgb)
    caption = (
        f"ΔE₀₀ between {count} test colours as measured and as the model simulates them, relative to the measured "
        "white (as thesis figure 5.4 d). About 1 is just noticeable."
    )
    made.draw(figures.delta_e_histogram(checks), caption, width)
    caption = (
        "By how much the light of one channel changes when a second one is on, from the colours of two channels. The "
        "same loss everywhere: the supply gives way. Single large cells: crosstalk."
    )
    made.draw(figures.influence({name: c.assumptions.influence for name, c in checks.items()}), caption, width)
    made.tables += [_assumption_table(checks), _worst_table(checks)]
    return made


def _assumption_table(checks: Mapping[str, ModelCheck]) -> Table:
    from ..display.assumptions import LIMIT, MEANING, details

    rows = []
    for name, check in checks.items():
        costs, failing = check.assumptions.costs(), check.assumptions.failing()
        for assumption, cost in costs.items():
            verdict = "not tested" if np.isnan(cost) else "fails" if assumption in failing else "holds"
            eye = (name,) if len(checks) > 1 else ()
            text = "; ".join(t for t in (MEANING[assumption], details(assumption, check.assumptions)) if t)
            rows.append((assumption.capitalize(), *eye, number(cost, 2) if cost else "0", verdict, text))
    eye = ("Eye",) if len(checks) > 1 else ()
    caption = f"Mean ΔE₀₀ that each assumption costs by itself; it fails above {LIMIT:g}"
    return Table(
        ("Assumption", *eye, "ΔE₀₀", "", "What it says, and what was found"), rows, (1 + len(eye),), (), caption
    )


def _worst_table(checks: Mapping[str, ModelCheck]) -> Table:
    rows = []
    for name, check in checks.items():
        for i in np.argsort(check.delta_e)[::-1][:SHOWN]:
            colour = ", ".join(f"{255 * v:.0f}" for v in check.rgb[i])
            eye = (name,) if len(checks) > 1 else ()
            rows.append((colour, *eye, f"{check.delta_e[i]:.2f}", percent(float(check.spectral_error[i]))))
    eye = ("Eye",) if len(checks) > 1 else ()
    head = ("R, G, B of 255", *eye, "ΔE₀₀", "RMS error of the spectrum")
    return Table(head, rows, (1 + len(eye), 2 + len(eye)), (), "The test colours that the model meets worst")


def _calibration(named: Mapping[str, Examined]) -> Section:
    made = Section("calibration", "Does the calibration work? (Framework 2)", "Framework 2")
    found = {name: d.calibration for name, d in named.items() if d.calibration is not None}
    if not found:
        made.missing = (
            "no reproductions of patches were measured; `vgonio display calibrate` lists the colours to show."
        )
        return made
    for name, check in found.items():
        head = f"{name.capitalize()}: patches" if len(found) > 1 else "Patches"
        caption = (
            f"{head} as wanted (outer square) and as displayed (inner), under {check.targets.illuminant}, driven with "
            "sRGB values, with Adobe RGB values and through the measured profile; below, the colour differences (as "
            f"thesis figure 5.5). Squares are drawn in sRGB; bars at {figures.MOST_DELTA_E:g} hold what is beyond."
        )
        made.draw(figures.patches(check), caption)
        rows = [
            (
                p,
                f"{s['mean']:.2f}",
                f"{s['median']:.2f}",
                f"{s['max']:.2f}",
                percent(s["above_1"]),
                percent(s["above_2"]),
            )
            for p, s in check.statistics().items()
        ]
        columns = ("Driven by", "mean ΔE₀₀", "median", "max.", "above 1", "above 2")
        caption = (
            f"{name}: {len(check.targets.names)} patches" if len(found) > 1 else f"{len(check.targets.names)} patches"
        )
        made.tables.append(Table(columns, rows, numeric=(1, 2, 3, 4, 5), caption=caption))
        gamut = check.targets.controls.report()
        if gamut["out_of_gamut"]:
            made.text.append(
                f"{gamut['out_of_gamut']:.0f} of {gamut['colours']:.0f} patches are out of gamut; clipping costs them "
                f"{gamut['mean_cost']:.1f} of ΔE₀₀ on average, {gamut['largest_cost']:.1f} at most."
            )
    return made
