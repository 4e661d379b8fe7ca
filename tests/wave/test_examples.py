"""The examples of the waves run, check themselves and draw something."""

from __future__ import annotations

import importlib.util
import warnings
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.mark.parametrize("name", ["grating_spectra", "slightly_rough"])
def test_example(name, tmp_path, capsys):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        module.main(["-o", str(tmp_path / "figure.png")])
    assert "check: " in capsys.readouterr().out
    assert (tmp_path / "figure.png").stat().st_size > 20_000


def test_the_page_holds_the_factors():
    """docs/trust.md says what the function says."""
    from vgonio.wave.closed_forms import parting

    page = (EXAMPLES.parent / "docs" / "trust.md").read_text(encoding="utf-8")
    for name, theta, out in (("retro", 60, 60), ("normal", 60, 0), ("retro", 75, 75), ("mirror", 30, -30)):
        values = " | ".join(f"{v[0]:.3g}" for v in parting(theta, [out]).values())
        assert f"| {name} | {theta}° | {values} |" in page.replace("*", "")
