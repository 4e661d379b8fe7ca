"""Makes the tools beside it importable, and results that several files of tests damage."""

from __future__ import annotations

import sys
import tomllib
import warnings
from pathlib import Path

import pytest
import xarray as xr

sys.path.insert(0, str(Path(__file__).parent))

import hardening_tools

import vgonio as vg


@pytest.fixture(scope="session")
def surface_files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """One small surface file of each format that can be made here, by suffix."""
    return hardening_tools.surfaces(tmp_path_factory.mktemp("surfaces"))


@pytest.fixture(scope="session")
def result() -> xr.DataTree:
    """A result of rays and waves, small."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return vg.simulate(tomllib.loads(hardening_tools.SCENE) | {"wave": {"tol": 0.1}})
