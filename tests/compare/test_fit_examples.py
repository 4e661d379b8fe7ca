"""The examples on fits run and check themselves."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_ptfe(shared, tmp_path, capsys, agreement):
    """NIST's spectra of sintered PTFE tilt at grazing angles: forward red, backward blue, 3.7 standard errors apart."""
    found = load("ptfe_tilt").main(
        [str(shared / "data" / "nist_ptfe" / "PTFE.data.csv"), "-o", str(tmp_path / "a.png")]
    )
    agreement(
        "NIST's PTFE, grazing forward minus backward slope of the spectra, per 100 nm (standard error 0.21)",
        "0, were there no shift; 0.76 was found first",
        found["difference"],
        (0.75, 0.77),
        "%",
    )
    assert found["difference"] > 3 * found["error"]
    assert (tmp_path / "a.png").stat().st_size > 20_000
    assert "sigma_deg stopped at its bound 0" in capsys.readouterr().out


def test_two_shifts(tmp_path):
    rows = load("two_shifts").main(["--rays", "50000", "-o", str(tmp_path / "b.png")])
    assert [r["name"] for r in rows] == ["traced", "compensating", "control"]


def test_roughness_of_rays(shared, capsys):
    example = load("roughness_of_rays")
    rows = example.main(["--rays", "20000", "--samples", "4", "5"])
    # facets are what Beckmann's model is of: its alpha is that of the slopes, here within 8 %
    for row in rows:
        assert row["beckmann"] == pytest.approx(row["slope"], rel=0.08)
    assert example.reference()["ggx"]["al65"]["measured"] == pytest.approx(0.3638, abs=1e-4)
    assert "0.364" not in capsys.readouterr().out  # sample 1 was not asked for
