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


def test_multiple_scattering(capsys, monkeypatch, tmp_path):
    """Errors of the quick version's four profiles; iterated is well below single, and the figure is drawn."""
    monkeypatch.syspath_prepend(str(FOLDER))
    files = ["--figure", str(tmp_path / "figure.png"), "--page", str(tmp_path / "page.md")]
    found = load("multiple_scattering").main(["--quick", *files])
    steep = [r for r in found["rows"] if r["theta_i"] <= 20]
    assert len(steep) == 4
    for row in steep:
        assert row["balance"] < 0.05
        assert row["iterated 3"] < 0.6 * row["single"]
        assert abs(row["power iterated 3"] - 1) < 0.1
    assert (tmp_path / "figure.png").stat().st_size > 20_000
    assert "| 1 | 2 | 0.71 | TM | 20° |" in (tmp_path / "page.md").read_text(encoding="utf-8")
    assert "time grows as length^" in capsys.readouterr().out


def test_fits(capsys):
    found = load("fits").main(["--quick"])
    for name, row in found["cases"].items():
        assert row["chi2_per_dof"] < 5, name
    assert {name for name, _ in found["timings"]} >= {"local shift fits, p fitted", "model 4.8 (alpha, h, w)"}


def test_render(capsys):
    pytest.importorskip("mitsuba")
    found = load("render").main(["--quick"])
    for row in found["overhead"].values():
        assert row["plain_s"] > 0
        assert row["low"] <= row["overhead"] <= row["high"]
    assert "Mitsuba" in capsys.readouterr().out
    if "predictions" not in found:
        pytest.skip("no LLVM: the Normbox is not timed")
    assert found["predictions"]["count"] == 3
