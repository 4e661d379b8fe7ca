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


def test_patches(capsys):
    """Blocks of points keep to their errors against all pairs, the more careful ones by far."""
    pytest.importorskip("pyopencl")
    found = load("patches").main(["--quick"])
    of = {part: [r for r in found["rows"] if r["part"] == part] for part in ("sight", "rules", "one", "whole")}
    assert [len(rows) for rows in of.values()] == [1, 1, 6, 2]
    for r in of["one"]:
        assert r["error"] <= {"pairs": 0.0, "blocks 0.01": 1e-2, "blocks 0.001": 1e-3}[r["case"][3]]
    assert of["rules"][0]["0.001"] < of["rules"][0]["0.01"] < 1e-2
    assert sum(of["sight"][0]["power"]) == pytest.approx(1)
    assert all(0.8 < r["energy"] < 1.1 for r in of["whole"])
    assert len(found["growth"]) == 3


def test_boss(capsys):
    """Second reflections near the exact answer, whatever the size: the figures are those of the test of patches."""
    pytest.importorskip("pyopencl")
    row = load("boss").main(["--sizes", "1", "--theta-i", "20"])[0]
    for one, two, wrong in zip(row["error 1"], row["error 2"], row["wrong sign"]):
        assert two < 0.8 * one < wrong


def test_multiple_scattering(capsys, monkeypatch, tmp_path):
    """Errors of the quick version's four profiles; iterated is well below single, diffraction well below that, and the
    figure and the page are made of the results."""
    monkeypatch.syspath_prepend(str(FOLDER))
    results = tmp_path / "results.json"
    found = load("multiple_scattering").main(["--quick", "-o", str(results)])
    steep = [r for r in found["rows"] if r["theta_i"] <= 20]
    assert len(steep) == 4
    for row in steep:
        assert row["balance"] < 0.05
        assert row["iterated 3"] < 0.6 * row["single"]
        assert row["diffraction"] < 0.01
        assert abs(row["power iterated 3"] - 1) < 0.1
        assert abs(row["power diffraction"] / row["power full wave"] - 1) < 0.005
    page = load("multiple_scattering_page")
    page.main([str(results), "--figure", str(tmp_path / "figure.png"), "--page", str(tmp_path / "page.md")])
    assert (tmp_path / "figure.png").stat().st_size > 20_000
    assert "| perfect | 1 | 2 | 0.71 | TM | 20° |" in (tmp_path / "page.md").read_text(encoding="utf-8")
    assert "time grows as length^" in capsys.readouterr().out


def test_causes_of_the_error_of_iterated_kirchhoff(capsys, monkeypatch, tmp_path):
    """Masks by themselves: what sight leaves out cancels in the exact field, either half of it alone does harm."""
    monkeypatch.syspath_prepend(str(FOLDER))
    found = load("multiple_scattering_causes").main(["--quick", "--figure", str(tmp_path / "figure.png")])
    assert (tmp_path / "figure.png").stat().st_size > 20_000
    for one in found.values():
        error = {name: values[0][0] for name, values in one.items()}  # normal incidence
        assert error["exact"] == 0
        assert error["exact, light on lit points alone"] < 0.01
        for half in ("exact, without pairs that a crest hides", "exact, without pairs behind tangent planes"):
            assert error[half] > error["iterated, all orders"] > error["exact, seen through the detector's mask"] > 0.01


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
    text = PAGE.read_text(encoding="utf-8").partition("## All figures")[2].partition("##")[0]
    lines = [line.strip("| ").split("|") for line in text.splitlines() if "|" in line[:1]]
    names = [n.strip() for n in lines[0]]
    last = max(n for n in names if n.startswith("iterated"))
    rows = [dict(zip(names, (c.strip() for c in line), strict=True)) for line in lines[2:]]
    agreement(
        "iterated Kirchhoff with diffraction, mean lobes, σ/λ 0.3 … 2, slopes 0.1 … 1, T < λ, Al and glass, 0 … 70°, "
        "Σ|Δ|/Σ (benchmarks/multiple_scattering.py)",
        "full wave, 16 profiles each",
        [100 * float(r["diffraction"]) for r in rows],
        8,
        "%",
    )
    agreement(
        "iterated Kirchhoff with diffraction on the same profiles, reflected power",
        "full wave, 16 profiles each: 1",
        [float(r["power diffraction"]) / float(r["power full wave"]) for r in rows],
        (0.94, 1.06),
    )
    steep = [
        r for r in rows
        if r["material"] == "perfect" and "T < λ" not in r["T/λ"]
        and float(r["slope"]) > 0.6 and r["θ_i"] in ("0°", "20°")
    ]  # fmt: skip
    assert len(steep) >= 12
    agreement(
        "iterated Kirchhoff, mean lobes, slope 0.7 … 1.0, 0 and 20°, Σ|Δ|/Σ (benchmarks/multiple_scattering.py)",
        "full wave, 16 profiles each",
        [100 * float(r[last]) for r in steep],
        15,
        "%",
    )
    agreement(
        "single Kirchhoff on the same profiles, where it does not hold, Σ|Δ|/Σ",
        "full wave, 16 profiles each",
        [100 * float(r["single"]) for r in steep],
        (25, 60),
        "%",
    )
    agreement(
        "iterated Kirchhoff on the same profiles, reflected power (TE at 0° too bright, TM too dark)",
        "full wave, 16 profiles each",
        [float(r[f"power {last}"]) for r in steep],
        (0.9, 1.15),
    )
