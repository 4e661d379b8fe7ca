"""Every numbered example runs, in a small version where the whole one takes long, and ends by checking itself.

Those that are notebooks too run in test_notebooks.py.
"""

from __future__ import annotations

import importlib.util
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from vgonio.wave.closed_forms import parting

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
NOTEBOOK = "# %% [markdown]\n"
# what each is run with; {folder} is an empty one
ARGUMENTS = {
    "07_grating_spectra": "-o {folder}/figure.png",
    "08_slightly_rough": "-o {folder}/figure.png",
    "09_roughness_of_rays": "--quick",
    "10_ptfe_tilt": "{shared}/data/nist_ptfe/PTFE.data.csv -o {folder}/figure.png",
    "11_two_shifts": "--quick -o {folder}/figure.png",
    "12_shift_preview": "--quick -o {folder}",
    "13_headset": "-o {folder}",
    "14_wavelength_shift/analyse": "--quick -o {folder}/figure.png",  # runs simulate as well
    "14_wavelength_shift/patches": "--quick",
    "14_wavelength_shift/rigorous": "--quick",
    "14_wavelength_shift/sampling": "--quick",
}
ALONE = sorted(set(ARGUMENTS) - {"09_roughness_of_rays", "10_ptfe_tilt", "12_shift_preview", "13_headset"})
Run = Callable[[str], Any]


def load(name: str) -> ModuleType:
    path = EXAMPLES / f"{name}.py"
    spec = importlib.util.spec_from_file_location(f"example_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def run(tmp_path, monkeypatch, capsys, request) -> Run:
    """Calls an example's main and returns what it returns. What it said, a check among it, is in request.node.said."""

    def call(name: str) -> Any:
        monkeypatch.syspath_prepend(str((EXAMPLES / name).parent))
        arguments = ARGUMENTS[name]
        shared = str(request.getfixturevalue("shared")) if "{shared}" in arguments else ""
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = load(name).main(arguments.format(folder=tmp_path, shared=shared).split())
        request.node.said = capsys.readouterr().out
        assert re.search(r"\bcheck: .{20,}", request.node.said)
        return found

    return call


@pytest.mark.parametrize("name", ALONE)
def test_example(name: str, run: Run, tmp_path) -> None:
    run(name)
    if "figure.png" in ARGUMENTS[name]:
        assert (tmp_path / "figure.png").stat().st_size > 15_000


def test_roughness_of_rays(run: Run, request) -> None:
    rows = run("09_roughness_of_rays")
    assert [r["sample"] for r in rows] == [4, 5]
    assert "0.364" not in request.node.said  # sample 1 was not asked for


def test_roughness_beside_what_others_fitted(shared) -> None:
    assert load("09_roughness_of_rays").reference()["ggx"]["al65"]["measured"] == pytest.approx(0.3638, abs=1e-4)


def test_ptfe(run: Run, tmp_path, request, agreement) -> None:
    """NIST's spectra of sintered PTFE tilt at grazing angles: forward red, backward blue, 3.7 standard errors apart."""
    found = run("10_ptfe_tilt")
    agreement(
        "NIST's PTFE, grazing forward minus backward slope of the spectra, per 100 nm (standard error 0.21)",
        "0, were there no shift; 0.76 was found first",
        found["difference"],
        (0.75, 0.77),
        "%",
    )
    assert found["difference"] > 3 * found["error"]
    assert (tmp_path / "figure.png").stat().st_size > 20_000
    assert "sigma_deg stopped at its bound 0" in request.node.said


def test_shift_preview(run: Run, tmp_path) -> None:
    pytest.importorskip("mitsuba", reason="Mitsuba is not installed: pip install vgonio[render]")
    from vgonio.render import choose

    if choose("auto").variant.startswith("scalar"):
        pytest.skip("no LLVM: this picture would take a minute")
    run("12_shift_preview")
    assert (tmp_path / "sample_1.png").stat().st_size > 15_000


def test_headset(run: Run, tmp_path) -> None:
    run("13_headset")
    assert {"display.html", "left.icc", "right.cube", "patches.png"} <= {p.name for p in tmp_path.iterdir()}


# ---- none is forgotten
def scripts() -> list[Path]:
    return sorted(p for p in EXAMPLES.glob("[0-9][0-9]_*") if p.suffix in ("", ".py"))


def test_numbers_follow_each_other_and_every_script_is_run() -> None:
    assert [p.name[:2] for p in scripts()] == [f"{n:02d}" for n in range(1, len(scripts()) + 1)]
    files = [f for p in scripts() for f in ([p] if p.suffix else sorted(p.glob("*.py")))]
    alone = [f for f in files if not f.read_text(encoding="utf-8").startswith(NOTEBOOK)]
    names = {f.relative_to(EXAMPLES).with_suffix("").as_posix() for f in alone}
    assert names == set(ARGUMENTS) | {"14_wavelength_shift/simulate"}


def test_the_table_lists_them_all() -> None:
    table = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| \[(\d\d)\]\((\S+?)\) \| (.+\?) \| (.+?) \| (.+) \|$", table, re.M)
    assert [r[1].rstrip("/") for r in rows] == [p.name for p in scripts()]
    assert all(r[0] == r[1][:2] for r in rows)
    for link in re.findall(r"\]\((?!http)([^)]+)\)", table):
        assert (EXAMPLES / link).exists(), link


def test_the_page_holds_the_factors() -> None:
    """docs/trust.md says what the function says."""
    page = (EXAMPLES.parent / "docs" / "trust.md").read_text(encoding="utf-8")
    for name, theta, out in (("retro", 60, 60), ("normal", 60, 0), ("retro", 75, 75), ("mirror", 30, -30)):
        values = " | ".join(f"{v[0]:.3g}" for v in parting(theta, [out]).values())
        assert f"| {name} | {theta}° | {values} |" in page.replace("*", "")
