"""A small version of each benchmark runs: a benchmark that nobody runs rots."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"


def load(name: str):
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_waves(capsys):
    found = load("waves").main(["--quick"])
    for row in found["work_precision"]:
        assert row["achieved"] <= row["asked"]
    assert found["rates"]["nufft"] > 100 * found["rates"]["numpy"]
    for case in found["cases"]:
        assert case["error"] <= 1e-3
    if "opencl" not in found["rates"]:
        pytest.skip("no OpenCL: its rows are left out")
    assert found["rates"]["opencl"] > found["rates"]["numpy"]


def test_rays(capsys):
    load("rays").main(["--quick"])
    out = capsys.readouterr().out
    for words in ("processors, load", "intersection stage / bare embreex", "fewer rays by", "triangles", "reference"):
        assert words in out
