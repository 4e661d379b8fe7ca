"""Fixtures that all tests share."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder with real measurements; tests that need it skip where it is absent."""
    folder = Path(os.environ.get("VGONIO_SHARED", ROOT / ".." / "shared")).resolve()
    if not (folder / "data").is_dir():
        pytest.skip(f"no measurements at {folder}: set VGONIO_SHARED to the folder that has data/")
    return folder


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20221101)
