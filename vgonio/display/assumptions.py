"""Which assumption of the display model fails, each tested by itself from readings, without the fitted model's help.

Constancy: a primary has the same spectrum at all levels. Tone: the curve goes through levels that it was not fitted to.
Independence: what a channel gives does not depend on a second one (colours of two channels against the sum of the two
shown alone). Additivity: greys are as bright and of the colour of the sum of their three channels. A supply that gives
way breaks the last two; crosstalk between neighbours the third, a white sub-pixel the fourth alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .colorimetry import delta_e, spectra_to_xyz
from .model import DisplayModel
from .readings import CHANNELS, SAME_SIGNAL, Readings

Floats = NDArray[np.float64]
# mean ΔE₀₀ that counts as a failure: about what is just seen side by side, as the thesis counts colours above 1
LIMIT = 1.0
MEANING = {
    "constancy": "the spectra of the primaries are the same at all levels",
    "tone": "the tone curves go through levels that they were not fitted to",
    "independence": "a channel's light does not depend on a second channel",
    "additivity": "greys are the sum of their three channels",
}


@dataclass(frozen=True)
class Assumptions:
    """Mean ΔE₀₀ that each failing assumption costs; NaN where the readings hold no colour to test it with.

    constancy, tone : (3,) by channel;  independence : of pairs;  additivity : of greys
    influence : (3, 3) relative change of the light of a channel (row) by another one (column) at the levels tested
    luminance : (n,) relative excess of the luminance of greys over the sum of their channels, at grey levels (n,)
    """

    constancy: Floats
    tone: Floats
    independence: float
    additivity: float
    influence: Floats
    luminance: Floats
    grey_levels: Floats

    def costs(self) -> dict[str, float]:
        """Mean ΔE₀₀ by assumption, of the worst channel where there are three."""
        worst = [float(np.max(v)) if not np.all(np.isnan(v)) else np.nan for v in (self.constancy, self.tone)]
        return dict(zip(MEANING, (*worst, self.independence, self.additivity)))

    def failing(self, limit: float = LIMIT) -> list[str]:
        """Names of the assumptions whose failure costs more than `limit` of ΔE₀₀ on average."""
        return [name for name, cost in self.costs().items() if cost > limit]


def assumptions(model: DisplayModel, ramps: Readings, tests: Readings) -> Assumptions:
    """Test the assumptions with the ramps that the model was fitted to and with test colours on a grid.

    Colours of two or three channels are tested where the channels alone are among `tests` too.
    """
    singles = [_alone(tests, c) for c in range(3)]
    pairs, influence = _pairs(model, tests, singles)
    greys, levels, luminance = _greys(model, tests, singles)
    return Assumptions(
        np.array([_constancy(model, ramps.ramp(c), c) for c in range(3)]),
        np.array([_tone(model, tests.ramp(c)) for c in range(3)]),
        _mean(pairs),
        _mean(greys),
        influence,
        luminance,
        levels,
    )


def _mean(values: Floats) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def _xyz(model: DisplayModel, spectra: Floats) -> Floats:
    return spectra_to_xyz(spectra, model.wavelength_nm)


def _alone(readings: Readings, channel: int) -> dict[int, Floats]:
    """Spectra above black of one channel alone, by level in units of the smallest difference of signals."""
    black = readings.index(np.zeros(3))[0]
    if black < 0:
        return {}
    ramp = readings.ramp(channel)
    zero = readings.spectra[black]
    return {_key(v): s - zero for v, s in zip(ramp.rgb[:, channel], ramp.spectra) if v > SAME_SIGNAL}


def _key(level: float) -> int:
    return round(float(level) / SAME_SIGNAL)


def _constancy(model: DisplayModel, ramp: Readings, channel: int) -> float:
    """ΔE₀₀ between the levels of a ramp and the primary's spectrum at the light that fits each level best."""
    lit = ramp.where(np.flatnonzero(ramp.rgb[:, channel] > SAME_SIGNAL))
    p = model.primaries[channel]
    light = np.clip((lit.spectra - model.black) @ p / (p @ p), 0, None)
    same = model.black + light[:, None] * p
    return _mean(delta_e(lit.xyz, _xyz(model, same), model.white_xyz))


def _tone(model: DisplayModel, ramp: Readings) -> float:
    lit = ramp.rgb.max(axis=1) > SAME_SIGNAL
    if not lit.any():
        return float("nan")
    return _mean(delta_e(ramp.xyz[lit], model.xyz(ramp.rgb[lit]), model.white_xyz))


def _sums(model: DisplayModel, tests: Readings, singles: list[dict[int, Floats]], on: tuple[int, ...]) -> tuple:
    """Rows of the tests with exactly the channels `on`, and (n, len(on), n_λ) those channels alone."""
    lit = tests.rgb > SAME_SIGNAL
    rows, parts = [], []
    for row in np.flatnonzero(np.all(lit == np.isin(range(3), on), axis=1)):
        found = [singles[c].get(_key(tests.rgb[row, c])) for c in on]
        if all(s is not None for s in found):
            rows.append(int(row))
            parts.append(found)
    return rows, np.array(parts).reshape(len(rows), len(on), model.wavelength_nm.size)


def _pairs(model: DisplayModel, tests: Readings, singles: list[dict[int, Floats]]) -> tuple[Floats, Floats]:
    """ΔE₀₀ of all pairs against the sum of the two alone; (3, 3) relative influence."""
    differences: list[float] = []
    influence = np.full((3, 3), np.nan)
    unmix = np.linalg.pinv(model.primaries)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        rows, alone = _sums(model, tests, singles, (i, j))
        if not rows:
            continue
        black = tests.spectra[tests.index(np.zeros(3))[0]]
        together = tests.spectra[rows]
        expected = black + alone.sum(axis=1)
        differences += list(delta_e(_xyz(model, together), _xyz(model, expected), model.white_xyz))
        change = ((together - expected) @ unmix).sum(axis=0)
        own = (alone @ unmix).sum(axis=0)  # (2, 3): light of each of the two alone, unmixed
        influence[i, j], influence[j, i] = change[i] / own[0, i], change[j] / own[1, j]
    return np.array(differences), influence


def _greys(model: DisplayModel, tests: Readings, singles: list[dict[int, Floats]]) -> tuple[Floats, Floats, Floats]:
    """ΔE₀₀ of greys against the sum of their channels, their levels, and the relative excess of luminance."""
    rows, alone = _sums(model, tests, singles, (0, 1, 2))
    grey = [k for k, row in enumerate(rows) if np.ptp(tests.rgb[row]) < SAME_SIGNAL]
    if not grey:
        return np.array([]), np.array([]), np.array([])
    chosen = np.array(rows)[grey]
    black = tests.spectra[tests.index(np.zeros(3))[0]]
    together, added = tests.spectra[chosen], alone[grey].sum(axis=1)
    difference = delta_e(_xyz(model, together), _xyz(model, black + added), model.white_xyz)
    excess = _xyz(model, together - black)[:, 1] / _xyz(model, added)[:, 1] - 1
    order = np.argsort(tests.rgb[chosen, 0])
    return difference, tests.rgb[chosen, 0][order], excess[order]


def details(name: str, found: Assumptions) -> str:
    """The largest single departure that stands behind an assumption, in words; empty where there is none to tell."""
    if name == "additivity" and found.luminance.size:
        k = int(np.argmax(np.abs(found.luminance)))
        text = f"luminance off by {100 * found.luminance[k]:+.2g} % at grey {255 * found.grey_levels[k]:.0f}"
        return text.replace("-", "−")
    if name == "independence" and np.any(np.isfinite(found.influence)):
        i, j = np.unravel_index(np.nanargmax(np.abs(found.influence)), (3, 3))
        text = f"{CHANNELS[i]} changes by {100 * found.influence[i, j]:+.2g} % when {CHANNELS[j]} is on"
        return text.replace("-", "−")
    if name in ("constancy", "tone"):
        by_channel = found.constancy if name == "constancy" else found.tone
        if np.any(np.isfinite(by_channel)):
            return f"most in {CHANNELS[int(np.nanargmax(by_channel))]}"
    return ""
