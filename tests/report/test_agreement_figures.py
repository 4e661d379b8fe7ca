"""The figure of a law: what is drawn are the numbers found, their errors and what was expected."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from vgonio.errors import InputError
from vgonio.report import figures

X = xr.DataArray([1.0, 2.0, 4.0], dims="x", attrs={"units": "um", "long_name": "height"})
FOUND = xr.DataArray([[1.1, np.nan, 4.2], [0.9, 2.0, 3.9]], dims=("kind", "x"), coords={"kind": [10.0, 20.0]}, name="y")


def test_values_errors_and_law():
    figure = figures.agreement(FOUND, X**1.0, 0.5 * xr.ones_like(FOUND), along=X, by="kind")
    above, below = figure.axes
    points = [c.lines[0].get_xydata() for c in above.containers]
    np.testing.assert_allclose(points[0], [[1, 1.1], [4, 4.2]])  # what is not known is left out
    np.testing.assert_allclose(points[1], [[1, 0.9], [2, 2.0], [4, 3.9]])
    bars = above.containers[1].lines[2][0].get_segments()
    np.testing.assert_allclose(bars[0][:, 1], [0.4, 1.4])
    np.testing.assert_allclose(below.containers[1].lines[0].get_ydata(), [-0.1, 0.0, -0.1])
    law = next(line for line in above.lines if len(line.get_xdata()) == 2 and line.get_marker() == "None")
    np.testing.assert_allclose(law.get_ydata(), [1, 4])
    assert below.get_xlabel() == "height (µm)"
    legend = above.get_legend()
    assert legend.get_title().get_text() == "kind"
    assert [t.get_text() for t in legend.get_texts()] == ["law", "10", "20"]


def test_without_an_axis_the_law_is_the_diagonal():
    above, below = figures.agreement(FOUND.transpose("x", "kind"), X**1.0).axes
    np.testing.assert_allclose(np.sort(above.containers[0].lines[0].get_xdata()), [1, 1, 2, 4, 4])
    assert below.get_xlabel().startswith("expected")


def test_what_cannot_be_drawn_is_refused():
    with pytest.raises(InputError, match="'colour' is no dimension .* kind"):
        figures.agreement(FOUND, X, by="colour")
    with pytest.raises(InputError, match="no value is known"):
        figures.agreement(FOUND * np.nan, X)
