"""Methods and efforts of a scene for a time and an error: the cheapest that meet both, or the reason why none does.

What a scene asks is never changed: surface, light, detector, theories and their options are questions. What may change
is how they are answered: the number of rays and their estimator, the method and the tolerance of the waves, reflections
and larger patches of iterated Kirchhoff where the scene names none (`iterated_choice`) and, where the time is short,
the number of coherence windows. The size of the surface, its rows among it, is a question too: more of it brings
speckle down as one over the root, which is said where speckle is what stays.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ..accuracy.calibrating import Calibration
from ..errors import InputError, ToleranceError, relative_tolerance
from ..scene import Scene
from ..surface import Heightfield
from .candidates import Candidate, groups_of, wave_candidates, with_settings
from .forecast import Forecast
from .parts import forecasts
from .plans import duration, in_words, percent, rounded_up

SLACK = 1.05  # of the time advised, since the next forecast differs a little
MARGIN = 1.25  # forecasts are good to a factor of 2: so much less than the time is planned for


@dataclass(frozen=True)
class Choice:
    """The scene with what was chosen, the settings, and all candidates as rows.

    left_out : error of reflections and second hits that are left out, and where it is from
    """

    scene: Scene
    settings: dict[str, Any]
    alternatives: tuple[dict[str, Any], ...]
    left_out: tuple[float, str] = (0.0, "")


def choose(
    scene: Scene,
    surface: Heightfield | None,
    source: Heightfield | None,
    on: Calibration,
    max_seconds: float | None,
    tol: float | None,
    new_process: bool = False,
) -> Choice:
    """The cheapest settings that meet `tol` (and `max_seconds`); without a tolerance the most accurate in the time.

    tol : of rays the relative standard error, of waves the numerical error: what `tol` of their tables is

    Raises InputError for a time or tolerance that is none, and where nothing is simulated; ToleranceError, with what
    would be needed and what could be reached, where no settings do.
    """
    begin = time.process_time()
    if tol is not None:
        relative_tolerance(tol, "tol")
    if max_seconds is not None and not max_seconds > 0:
        raise InputError(f"max_seconds = {max_seconds!r}: a time above 0 is needed")
    if surface is None or (scene.geometric is None and scene.wave is None):
        raise InputError("max_seconds and tol are for scenes that simulate: this one has no [geometric] and no [wave]")
    groups = groups_of(scene, surface, on, tol)
    planning = time.process_time() - begin
    rest = _rest(scene, source, surface, on, new_process) + planning
    try:
        found = _found(groups, rest, max_seconds, tol)
    except ToleranceError as refused:
        smaller = _smaller(scene, surface, source, on, tol, groups, new_process)
        fits = ", ".join(f"{words} ({duration(s)})" for words, s in _that_fit(smaller, planning, max_seconds, tol))
        raise ToleranceError(f"{refused}{fits and '. What was asked for can be had '}{fits}") from None
    settings = {k: v for c in found for k, v in c.settings.items()}
    rows = tuple(c.row(c is one) for group, one in zip(groups, found) for c in _worth_telling(group, one))
    left_out = max(((c.error, c.why) for c in found if c.why), default=(0.0, ""))
    return Choice(with_settings(scene, settings), settings, rows, left_out)


def _worth_telling(group: list[Candidate], chosen: Candidate) -> list[Candidate]:
    """What was chosen, what is more accurate or quicker, and other methods at the same tolerance."""
    ladder = _ladder([c for c in group if _whole(c) or c is chosen])
    methods: dict[Any, Candidate] = {}
    for c in sorted((c for c in group if _whole(c) and c.error == chosen.error), key=lambda c: c.seconds):
        methods.setdefault(c.settings.get("wave.method", c.settings.get("geometric.estimator")), c)
    told = [c for c in group if c is chosen or c in ladder or c in methods.values()]
    return sorted(told, key=lambda c: c.seconds)


def _whole(c: Candidate) -> bool:
    return "wave.windows" not in c.settings


def _found(groups: list[list[Candidate]], rest: float, max_seconds: float | None, tol: float | None) -> list[Candidate]:
    """Of each group the one to take; ToleranceError where there is none."""
    if tol is None:
        assert max_seconds is not None
        best = _most_accurate(groups, max_seconds / MARGIN - rest)
        if best is None:
            raise ToleranceError(_too_short(groups, rest, max_seconds))
        return best
    found = _cheapest(groups, tol)
    if max_seconds is None or MARGIN * (rest + sum(c.seconds for c in found)) <= max_seconds:
        return found
    fewer = _cheapest(groups, tol, speckled=True)
    if MARGIN * (rest + sum(c.seconds for c in fewer)) > max_seconds:
        raise ToleranceError(_refusal(groups, found, rest, max_seconds, tol))
    return fewer


# ---- parts of the scene, where all of it cannot be had
Smaller = tuple[str, list[list[Candidate]], float]  # words, candidates of each group, seconds of all that is not chosen


def _smaller(
    scene: Scene, surface: Heightfield, source: Heightfield | None, on: Calibration, tol: float | None,
    groups: list[list[Candidate]], new_process: bool,
) -> Iterator[Smaller]:  # fmt: skip
    """The scene without one of its tables, and with one of its theories alone."""

    def rest(of: Scene) -> float:
        return _rest(of, source, surface, on, new_process)

    if scene.geometric is not None and scene.wave is not None:
        rays, waves = (scene.model_copy(update={name: None}) for name in ("wave", "geometric"))
        yield "without [wave]", groups[:1], rest(rays)
        yield "without [geometric]", groups[1:], rest(waves)
    for theory in scene.wave.theory if scene.wave is not None and len(scene.wave.theory) > 1 else ():
        alone = with_settings(scene, {"wave.theory": [theory]})
        of_theory = [*groups[:-1], list(wave_candidates(alone, surface, on, tol))]
        yield f'with theory = "{theory}" alone', of_theory, rest(alone)


def _that_fit(
    smaller: Iterator[Smaller], planning: float, max_seconds: float | None, tol: float | None
) -> Iterator[tuple[str, float]]:
    """Those that meet what was asked, and their seconds with the fifth kept in hand."""
    for words, groups, rest in smaller:
        try:
            found = _found(groups, rest + planning, max_seconds, tol)
        except ToleranceError:
            continue
        yield words, MARGIN * (rest + planning + sum(c.seconds for c in found))


def _rest(scene: Scene, source: Heightfield | None, surface: Heightfield, on: Calibration, new_process: bool) -> float:
    """Seconds of all that is not chosen: libraries, surface, comparison, page."""
    cheap = {"geometric.tol": None, "geometric.rays": 1, "wave.tol": 0.9}
    found: dict[str, Forecast] = forecasts(
        with_settings(scene, cheap), source, surface, on, solvers=False, new_process=new_process
    )
    return sum(f.seconds for f in found.values())


# ---- the choice
def _cheapest(groups: list[list[Candidate]], tol: float, speckled: bool = False) -> list[Candidate]:
    """Of each group the cheapest that meets the tolerance; with fewer windows only where their speckle does as well."""
    found = []
    for group in groups:
        fits = [c for c in group if c.error <= tol * 1.0001]
        fits = [c for c in fits if _whole(c) or (speckled and c.speckle is not None and c.speckle <= tol)]
        if not fits:
            best = min(group, key=lambda c: c.error)
            raise ToleranceError(
                f"tol = {tol:g} cannot be met: the {best.part} reach {percent(best.error)} at best "
                f"({_words(best)}, {duration(best.seconds)}{best.why and '; it is from '}{best.why}): take tol = "
                f"{rounded_up(best.error):g}, or another method or theory"
            )
        found.append(min(fits, key=lambda c: (c.seconds, -_tolerance(c), c.error)))  # at equal cost what was asked for
    return found


def _tolerance(c: Candidate) -> float:
    """The largest of those among its settings."""
    return max((v for k, v in c.settings.items() if k.endswith(".tol")), default=c.error)


def _most_accurate(groups: list[list[Candidate]], seconds: float) -> list[Candidate] | None:
    """The set with the smallest of the largest errors in so many seconds; None where nothing is quick enough.

    From the cheapest of each group on, the one with the largest error is made better as long as there is time. Windows
    are left out only where all of them, however coarsely summed, take too long.
    """
    for least in (True, False):
        ladders = [_ladder([c for c in group if _whole(c) or not least]) for group in groups]
        at = [0] * len(ladders)
        if sum(ladder[0].seconds for ladder in ladders) <= seconds:
            break
    else:
        return None
    open_ = set(range(len(ladders)))
    while open_:
        worst = max(open_, key=lambda g: total_error(ladders[g][at[g]]))
        spent = sum(ladder[i].seconds for g, (ladder, i) in enumerate(zip(ladders, at)) if g != worst)
        better = at[worst] + 1
        if better < len(ladders[worst]) and spent + ladders[worst][better].seconds <= seconds:
            at[worst] = better
        else:
            open_.discard(worst)
    return [ladder[i] for ladder, i in zip(ladders, at)]


def _ladder(group: list[Candidate]) -> list[Candidate]:
    """From the cheapest to the most accurate: none that another beats in seconds, error and speckle together."""
    rungs: list[Candidate] = []
    for c in sorted(group, key=lambda c: (c.seconds, total_error(c))):
        if not rungs or total_error(c) < total_error(rungs[-1]) * 0.999:
            rungs.append(c)
    return rungs


def total_error(c: Candidate) -> float:
    """Numerical error and the speckle that is added, where windows were left out or patches made larger."""
    return (c.error**2 + (c.added if _whole(c) else c.speckle or 0.0) ** 2) ** 0.5


# ---- words
def _words(c: Candidate) -> str:
    return in_words({k.split(".")[1]: v for k, v in c.settings.items()})


def _needs(found: list[Candidate], rest: float) -> str:
    each = ", ".join(f"{c.part} {duration(c.seconds)} ({_words(c)})" for c in found)
    total = rest + sum(c.seconds for c in found)
    with_margin = MARGIN * total
    kept = f"{math.ceil(10 * with_margin) / 10:.1f} s" if with_margin < 120 else duration(with_margin)
    return f"{each}, all else {duration(rest)}: {duration(total)} expected in all, {kept} with the fifth kept in hand"


def _allow(found: list[Candidate], rest: float) -> str:
    """A time that suffices, rounded up, in the seconds that `max_seconds` is given in."""
    enough = rounded_up(SLACK * MARGIN * (rest + sum(c.seconds for c in found)))
    return f"Allow {enough:.12g} s" + (f" ({duration(enough)})" if enough >= 120 else "")


def _refusal(groups: list[list[Candidate]], found: list[Candidate], rest: float, seconds: float, tol: float) -> str:
    reached = _most_accurate(groups, seconds / MARGIN - rest)
    instead = "nothing at all can be done"
    if reached is not None:
        fewer = [f"windows = {c.settings['wave.windows']}" for c in reached if not _whole(c)]
        speckled = f", its speckle included ({fewer[0]})" if fewer else ""
        instead = f"an error of {percent(min(max(total_error(c) for c in reached), 1.0))} is reached{speckled}"
    stays = [c.speckle for c in found if c.speckle is not None and c.speckle > tol]
    noise = (
        f". Speckle of {percent(max(stays))} stays at that: more surface, not more effort, brings it down"
        if stays
        else ""
    )
    return (
        f"{percent(tol)} in {duration(seconds)} cannot be had: needed are {_needs(found, rest)}; in "
        f"{duration(seconds)} {instead}. {_allow(found, rest)}, a larger tol, or ask for fewer angles or "
        f"wavelengths{noise}"
    )


def _too_short(groups: list[list[Candidate]], rest: float, seconds: float) -> str:
    found = [_ladder(group)[0] for group in groups]
    return (
        f"{duration(seconds)} is too short: needed are at least {_needs(found, rest)}. {_allow(found, rest)}, or "
        "ask for less: fewer angles or wavelengths, no page, one of the theories"
    )
