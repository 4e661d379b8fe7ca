"""A small version of each benchmark runs: a benchmark that nobody runs rots."""

from __future__ import annotations

import csv
import importlib.util
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"
PAGE = FOLDER.parent / "docs" / "multiple_scattering.md"


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
    for words in ("'load':", "intersection stage / bare embreex", "fewer rays by", "triangles", "reference"):
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


# ---- what long runs wrote, for the table of proofs
def test_the_long_run_of_fits(agreement):
    """`benchmarks/fits.csv` as `python benchmarks/fits.py --table benchmarks/fits.csv` wrote it, 50 seeds each."""
    with (FOLDER / "fits.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert {r["case"] for r in rows} == set(load("fits").cases())
    assert all(int(r["seeds"]) >= 50 for r in rows)
    agreement(
        "fitted parameters of 18 synthetic cases, 50 seeds, up to 8 decades: χ²/dof (benchmarks/fits.py)",
        "stated errors: 1",
        [float(r["chi2_per_dof"]) for r in rows],
        (0.6, 1.6),
    )


def test_the_long_run_of_multiple_scattering(agreement):
    """`docs/multiple_scattering.md` as the benchmark wrote it: perfect profiles of slope 0.7 and more, 0 and 20°."""
    lines = [line.strip("| ").split("|") for line in PAGE.read_text(encoding="utf-8").splitlines() if "|" in line[:1]]
    names = [n.strip() for n in lines[0]]
    last = max(n for n in names if n.startswith("iterated"))
    rows = [dict(zip(names, (c.strip() for c in line), strict=True)) for line in lines[2:]]
    steep = [r for r in rows if float(r["slope"]) > 0.6 and r["θ_i"] in ("0°", "20°")]
    assert len(steep) >= 12
    agreement(
        "iterated Kirchhoff, mean lobes, slope 0.7 … 1.0, 0 and 20°, Σ|Δ|/Σ (benchmarks/multiple_scattering.py)",
        "full wave, 30 profiles each",
        [100 * float(r[last]) for r in steep],
        15,
        "%",
    )
    agreement(
        "single Kirchhoff on the same profiles, where it does not hold, Σ|Δ|/Σ",
        "full wave, 30 profiles each",
        [100 * float(r["single"]) for r in steep],
        (30, 60),
        "%",
    )
    agreement(
        "iterated Kirchhoff on the same profiles, reflected power (TE at 0° too bright, TM too dark)",
        "full wave, 30 profiles each",
        [float(r[f"power {last}"]) for r in steep],
        (0.9, 1.15),
    )
