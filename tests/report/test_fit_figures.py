"""Figures of fits: what they write is what the data say, and what they cannot draw is refused."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio import models
from vgonio.compare import delta_e_2000, explained_shares, fit_model, rgb_map
from vgonio.directions import Detector
from vgonio.errors import InputError
from vgonio.report import figures

GRID = np.arange(0.0, 81, 20), np.arange(-80.0, 81, 20), np.arange(400.0, 701, 25)


@pytest.fixture(scope="module")
def data():
    clean = models.evaluate("clausen-2022", *GRID, alpha=0.4, h=1.8e-3, w=3.0)
    return clean.assign(brdf=clean.brdf * (1 + 0.01 * np.random.default_rng(0).standard_normal(clean.brdf.shape)))


def test_models_beside_the_measurement(data):
    fits = {m: fit_model(data, m) for m in ("cook-torrance-1982", "clausen-2022")}
    figure = figures.models_beside(data, fits, "absolute")
    titles = [ax.get_title(loc="left") or ax.get_title() for ax in figure.axes[:3]]
    assert titles == ["measured", *fits]
    labels = " ".join(ax.get_xlabel() for ax in figure.axes)
    for fit in fits.values():
        assert f"mean {float(delta_e_2000(data, fit, 'absolute').mean()):.2f}" in labels
    words = " ".join(t.get_text() for ax in figure.axes for t in ax.texts).replace("\n", " ")
    assert "reflectance factor" in words
    assert f"exposure {rgb_map(data).attrs['exposure']:.3g}" in words


def test_parts_of_the_shift(data):
    figure = figures.shift_parts(data, wavelength_n_nm=550.0)
    titles = [ax.get_title(loc="left") or ax.get_title() for ax in figure.axes[:4]]
    assert titles == ["measured", "Fresnel term of the local fit", "local fit (4.2)", "global fit (4.5)"]
    means = [float(ax.get_xlabel().split("mean ")[1].split(",")[0]) for ax in figure.axes if "mean" in ax.get_xlabel()]
    # the Fresnel term alone has no colour of its own, both fits have the data's but for the noise
    assert means[0] > 4 > 1 > max(means[1:])
    assert "550 nm" in " ".join(t.get_text() for ax in figure.axes for t in ax.texts)


def test_explained_shares_are_written_beside_their_bars(data):
    half = models.evaluate("clausen-2022", *GRID, alpha=0.4, h=0.9e-3, w=3.0)
    shares = explained_shares(data, {"half": half}, p=1.0)
    figure = figures.explained(shares)
    (ax,) = figure.axes
    assert len(ax.patches) == 2
    for patch, value in zip(ax.patches, shares.share.values[::-1]):
        assert patch.get_width() == pytest.approx(100 * value)
    written = " ".join(t.get_text() for t in ax.texts)
    assert f"{100 * float(shares.share[0]):.1f} ± " in written
    assert [t.get_text() for t in ax.get_yticklabels()] == ["global shift\n(empirical model)", "half\n(fitted model)"]


def test_a_hemisphere_is_refused():
    cells = models.evaluate("lambert-1760", [0], Detector.hemisphere(20), GRID[2], k_d=0.5)
    for draw in (figures.shift_parts, lambda d: figures.models_beside(d, {})):
        with pytest.raises(InputError, match="plane of incidence"):
            draw(cells)
