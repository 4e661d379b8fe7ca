"""The house as a newcomer finds it: no circles, modules and functions of a size, the map, the public names."""

from __future__ import annotations

import ast
import importlib
import re
import statistics
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "vgonio"
NAMES = ROOT / "tests" / "public_names.txt"


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}


# ---- no circles
def imports_of(tree: ast.Module, package: list[str], inside_functions: bool) -> set[str]:
    """Modules of the package that run when this one does: those for type checkers alone are left out."""
    found: set[str] = set()

    def visit(node: ast.AST) -> None:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda) and not inside_functions:
            return
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            return
        if isinstance(node, ast.Import):
            found.update(a.name for a in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            origin = ".".join([*base, *(node.module or "").split(".")]).rstrip(".")
            found.update(
                f"{origin}.{a.name}" if f"{origin}.{a.name}" in MODULES else origin for a in node.names if origin
            )
        for child in ast.iter_child_nodes(node):
            visit(child)

    visit(tree)
    # of the package itself modules take the version only, which it sets before anything else
    return (found & set(MODULES)) - {"vgonio"}


def graph(inside_functions: bool) -> dict[str, set[str]]:
    """Module → modules it needs; to import a.b.c is to run a and a.b as well, unless they are running already."""
    needs: dict[str, set[str]] = {}
    for name, path in MODULES.items():
        parts = name.split(".")
        package = parts if path.name == "__init__.py" else parts[:-1]
        found = imports_of(ast.parse(path.read_text(encoding="utf-8")), package, inside_functions)
        if not inside_functions:
            above = {".".join(m.split(".")[:k]) for m in found for k in range(2, m.count(".") + 1)}
            found |= {p for p in above if not f"{name}.".startswith(f"{p}.")}
        needs[name] = found - {name}
    return needs


def circle(needs: dict[str, set[str]]) -> list[str]:
    try:
        TopologicalSorter(needs).prepare()
    except CycleError as e:
        return list(e.args[1])
    return []


@pytest.mark.parametrize("inside_functions", [False, True], ids=["as modules load", "anywhere"])
def test_modules_import_each_other_in_no_circle(inside_functions):
    assert circle(graph(inside_functions)) == []


def test_a_circle_would_be_found():
    assert set(circle({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": set()})) == {"a", "b", "c"}
    assert "vgonio.surface.checks" in graph(False)["vgonio.surface.heightfield"]
    tree = ast.parse("from . import checks\ndef f():\n    from .filter import level\n")
    assert imports_of(tree, ["vgonio", "surface"], False) == {"vgonio.surface.checks"}
    assert imports_of(tree, ["vgonio", "surface"], True) == {"vgonio.surface.checks", "vgonio.surface.filter"}


def test_the_order_of_imports_does_not_matter():
    """Every package from its last module to its first: what only works after another was imported fails here."""
    program = """
import importlib, sys
for names in (line.split() for line in sys.stdin):
    for loaded in [m for m in sys.modules if m.split(".")[0] == "vgonio"]:
        del sys.modules[loaded]
    for name in names:
        importlib.import_module(name)
"""
    packages = [name for name, path in MODULES.items() if path.name == "__init__.py"]
    lines = []
    for package in packages:
        own = [m for m in MODULES if m.rpartition(".")[0] == package and m not in packages and "__main__" not in m]
        lines.append(" ".join(reversed(own)))
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program], input="\n".join(lines), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-2000:]


# ---- sizes
LINES = 350
BODY = 56  # lines of a function below its docstring
# what may be longer, and why
LONGER = {
    "render/bsdf.py:_plain_class": "Mitsuba's base class exists only once a variant is set: the class is made inside",
}


def bodies(path: Path) -> dict[str, int]:
    """Lines of each function's code, without signature and docstring."""
    found = {}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            code = node.body[1:] if ast.get_docstring(node) is not None else node.body
            if code:
                found[node.name] = (code[-1].end_lineno or 0) - code[0].lineno + 1
    return found


def test_modules_and_functions_have_a_size():
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in MODULES.values()}
    long = {str(p.relative_to(PACKAGE)): n for p, n in lengths.items() if n > LINES}
    for path in MODULES.values():
        place = str(path.relative_to(PACKAGE))
        long |= {f"{place}:{name}": n for name, n in bodies(path).items() if n > BODY}
    assert set(long) == set(LONGER), f"split what is longer than {LINES} lines or {BODY} of code: {long}"
    assert 100 <= statistics.median(lengths.values()) <= 300


# ---- the map
def parts() -> set[str]:
    """Packages, at any depth, and the modules beside them."""
    packages = {p.parent for p in PACKAGE.rglob("__init__.py")} | {PACKAGE / "wave" / "kernels"}
    names = {str(p.relative_to(PACKAGE)) for p in packages} - {"."}
    return names | {p.stem for p in PACKAGE.glob("*.py")} - {"__init__"}


def test_the_map_shows_what_is_there():
    text = (ROOT / "docs" / "structure.md").read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if line.startswith("| `")]
    told = {name for row in rows for name in re.findall(r"`([a-z_0-9/]+)`", row) if name in parts() or "/" in name}
    first = {name for row in rows for name in re.findall(r"`([^`]+)`", row.split("|")[1])}
    assert told == parts()
    assert first <= parts()
    assert len(text.splitlines()) <= 40


def test_the_map_stands_in_the_order_of_the_import_rule():
    from_file = (ROOT / "tests" / "test_imports.py").read_text(encoding="utf-8")
    layers = next(
        ast.literal_eval(node.value)
        for node in ast.parse(from_file).body
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "LAYERS"
    )
    rank = {name: i for i, layer in enumerate(layers) for name in layer}
    text = (ROOT / "docs" / "structure.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1] for line in text.splitlines() if line.startswith("| `")]
    order = [rank[name.split("/")[0]] for row in rows for name in re.findall(r"`([^`]+)`", row)]
    assert order == sorted(order)


def test_no_file_is_a_link():
    """Archives and Windows do not keep them."""
    folders = ("vgonio", "tests", "docs", "examples", "notebooks", "benchmarks", "heightfields")
    assert [p for name in folders for p in (ROOT / name).rglob("*") if p.is_symlink()] == []


# ---- public names
def public_names() -> list[str]:
    """Every name that a package, or a module which says so, hands out."""
    found = []
    for name in MODULES:
        module = importlib.import_module(name) if MODULES[name].name == "__init__.py" else None
        if module is not None and name.count(".") <= 1:
            found += [f"{name}.{one}" for one in getattr(module, "__all__", ())]
    return sorted(set(found))


def test_public_names_change_only_with_their_list():
    listed = NAMES.read_text(encoding="utf-8").split()
    now = public_names()
    assert listed == now, (
        f"new: {sorted(set(now) - set(listed))}, gone: {sorted(set(listed) - set(now))}. If that is meant, "
        "`python tests/test_structure.py` writes the list anew, and CHANGELOG.md says so"
    )


# what scripts outside the repository call: these stay
FIXED = """
open save simulate plan sweep
surface.read surface.Heightfield surface.sinusoid surface.gaussian surface.sandblasted surface.flat surface.lamellar
surface.blazed surface.power_law
measure.Gonioreflectometer measure.Gonioreflectometer.hemisphere measure.Gonioreflectometer.measure measure.read
geometric.RayOptics geometric.RayOptics.scatter
wave.Kirchhoff wave.Kirchhoff.scatter wave.Kirchhoff.orders wave.surface_fourier
directions.Incoming directions.Detector
""".split()
ARGUMENTS = {
    "surface.read": ["pitch_um", "height_unit"],
    "surface.Heightfield": ["pitch_um", "periodic", "interpolation"],
    "surface.sinusoid": ["period_um", "amplitude_um", "shape", "pitch_um"],
    "surface.gaussian": ["rms_um", "correlation_um", "shape", "pitch_um", "seed"],
    "measure.Gonioreflectometer": ["theta_i_deg", "theta_o_deg", "aperture_deg", "coherence_um", "phi_i_deg"],
    "measure.Gonioreflectometer.hemisphere": ["theta_i_deg", "resolution_deg"],
    "geometric.RayOptics": ["material", "wavelength_nm", "rays", "seed"],
    "wave.Kirchhoff": ["material", "wavelength_nm", "tol", "theory", "method", "shadowing", "polarised"],
    "wave.surface_fourier": ["surface", "q", "window", "method", "tol"],
    "wave.Kirchhoff.scatter": ["surface", "incoming", "detector"],
    "geometric.RayOptics.scatter": ["surface", "incoming", "detector"],
}
COMMANDS = "simulate plan init surface compare fit report accuracy sweep render validate display doctor".split()


def named(path: str):
    found = importlib.import_module("vgonio")
    for part in path.split("."):
        found = getattr(found, part)
    return found


@pytest.mark.parametrize("path", FIXED)
def test_fixed_names_exist_with_their_arguments(path):
    import inspect

    known = list(inspect.signature(named(path)).parameters)
    assert [a for a in ARGUMENTS.get(path, ()) if a not in known] == []


def test_fixed_commands_exist():
    from typer.main import get_command

    from vgonio.cli.app import app

    assert set(COMMANDS) <= set(get_command(app).commands)  # type: ignore[attr-defined]


# ---- one fact in one place
def option(command, name: str):
    import inspect

    return inspect.signature(command).parameters[name].default


def test_defaults_of_the_command_line_are_the_librarys():
    """The command line writes them out, since to look them up is to load what `--help` does without."""
    from vgonio import display
    from vgonio.cli import display as shown
    from vgonio.cli import measured
    from vgonio.measure import calibration

    assert option(measured.calibrate, "theta_i") == calibration.THETA_I_DEG
    assert float(option(measured.calibrate, "standard_nm")) == calibration.STANDARD_NM
    for command in (shown.characterise, shown.verify, shown.calibrate):
        for name in ("levels", "bits"):
            assert option(command, name) == option(display.ramp_colours, name) == option(display.examine_virtual, name)


def test_the_citation_names_the_version():
    import vgonio

    assert f"version: {vgonio.__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")


if __name__ == "__main__":
    NAMES.write_text("\n".join(public_names()) + "\n", encoding="utf-8")
