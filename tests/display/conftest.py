"""Displays that several tests use."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio import display as vd

# native gamma of an emissive panel; black and white of thesis table 5.1
EMISSIVE = {"tone": 2.6, "white_cd_m2": 130.0, "black_cd_m2": 0.04}
# together they make a mean model error of 0.5, as the thesis measured on both headsets
DEVIATIONS = {"crosstalk": 0.022, "loading": 0.02, "drift": 0.01, "noise": 0.005, "floor": 2e-7}


@pytest.fixture(scope="session")
def ideal() -> vd.VirtualDisplay:
    return vd.virtual_display("wide-gamut", tone="srgb")


@pytest.fixture(scope="session")
def ramps(ideal) -> vd.Readings:
    return ideal.measure(vd.ramp_colours(18), eye="left")


@pytest.fixture(scope="session")
def model(ramps) -> vd.DisplayModel:
    return vd.fit(ramps)


@pytest.fixture(scope="session")
def emissive() -> vd.Examined:
    """The wide-gamut display with realistic deviations, characterised with ten levels as in the thesis."""
    display = vd.virtual_display("wide-gamut", **EMISSIVE, **DEVIATIONS)
    return vd.examine_virtual(display, vd.patches("colorchecker"), levels=10, bits=8)[0]


@pytest.fixture
def signals(rng) -> np.ndarray:
    return rng.random((200, 3))
