"""A small version of the benchmark runs, and its figures make sense."""

from __future__ import annotations

import importlib.util
from pathlib import Path

FILE = Path(__file__).resolve().parents[3] / "benchmarks" / "full_wave.py"


def test_full_wave(capsys):
    spec = importlib.util.spec_from_file_location("full_wave_benchmark", FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    found = module.main(["--quick"])
    for row in found["work_precision"]:
        assert row["error"] < 2e-2
    for row in found["growth"]:
        assert abs(1 - row["balance"]) < 2e-3
    assert found["angles"]["finite"] < 4  # one factorisation for all
    assert "seconds grow as unknowns^" in capsys.readouterr().out
