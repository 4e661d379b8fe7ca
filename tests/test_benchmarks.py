"""The benchmarks run: in their quick form, to the end, naming the machine."""

from __future__ import annotations

import importlib.util
from pathlib import Path

FOLDER = Path(__file__).resolve().parent.parent / "benchmarks"


def test_benchmark_of_the_rays(capsys):
    spec = importlib.util.spec_from_file_location("benchmark_of_the_rays", FOLDER / "rays.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.main(["--quick"])
    out = capsys.readouterr().out
    for words in ("processors, load", "intersection stage / bare embreex", "fewer rays by", "triangles", "reference"):
        assert words in out
