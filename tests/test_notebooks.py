"""The notebooks: each runs, is what its script says, was stored without a fault, ends with a check, and is listed."""

from __future__ import annotations

import ast
import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
LARGEST_KB = 400
by_name = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
nbformat = pytest.importorskip("nbformat", reason="no jupytext: pip install 'vgonio[dev]'")


@pytest.fixture(scope="module")
def maker() -> ModuleType:
    """The program `notebooks/make.py` as a module."""
    spec = importlib.util.spec_from_file_location("make_notebooks", ROOT / "notebooks" / "make.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def read(path: Path):
    return nbformat.read(path, as_version=4)


def cells(notebook) -> list[tuple[str, str]]:
    return [(cell.cell_type, cell.source) for cell in notebook.cells]


def code(notebook) -> list[str]:
    return [source for kind, source in cells(notebook) if kind == "code"]


def outputs(notebook) -> list:
    return [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]


def pictures(notebook) -> int:
    return sum("image/png" in output.get("data", {}) for output in outputs(notebook))


def test_there_are_six_and_a_script_for_each(maker: ModuleType) -> None:
    assert [p.stem[:3] for p in NOTEBOOKS] == [f"{n:02d}_" for n in range(1, 7)]
    assert [p.stem for p in maker.scripts()] == [p.stem for p in NOTEBOOKS]


@by_name
def test_runs(path: Path, maker: ModuleType) -> None:
    """From the stored cells, in a fresh kernel; a cell that raises, and so a check that fails, is an error here."""
    stored, notebook = read(path), read(path)
    maker.execute(notebook, timeout=900)
    assert [text for kind, text in maker.texts(notebook) if kind == "stderr"] == []
    assert pictures(notebook) == pictures(stored) > 0


@by_name
def test_is_what_its_script_says(path: Path, maker: ModuleType) -> None:
    made = maker.converted(ROOT / "examples" / f"{path.stem}.py")
    assert cells(read(path)) == cells(made), "make notebooks"


@by_name
def test_was_stored_executed_and_clean(path: Path, maker: ModuleType) -> None:
    notebook = read(path)
    assert maker.faults(notebook) == []
    assert path.stat().st_size < LARGEST_KB * 1000
    counts = [cell.execution_count for cell in notebook.cells if cell.cell_type == "code"]
    assert counts == list(range(1, len(counts) + 1))
    assert not [o for o in outputs(notebook) if o.output_type == "error"]


@by_name
def test_ends_with_a_check(path: Path) -> None:
    """The last cell of code asserts something with a message and prints how well it agrees."""
    last = ast.parse(code(read(path))[-1])
    asserted = [node for node in ast.walk(last) if isinstance(node, ast.Assert)]
    assert asserted
    assert all(node.msg is not None and not isinstance(node.test, ast.Constant) for node in asserted)
    assert any(
        isinstance(n, ast.Call) and isinstance(n.func, ast.Name) and n.func.id == "print" for n in ast.walk(last)
    )


@by_name
def test_draws_without_matplotlib(path: Path) -> None:
    """The usual pictures come from `vgonio.report`; nobody writes matplotlib for them."""
    assert not re.search(r"matplotlib|pyplot|\.savefig|subplots", "\n".join(code(read(path))))


@by_name
def test_is_listed_in_the_docs(path: Path) -> None:
    page = (ROOT / "docs" / "notebooks.md").read_text(encoding="utf-8")
    assert f"](../notebooks/{path.name})" in page
    assert f"\nnotebooks/{path.stem}\n" in page
    first = read(path).cells[0].source.splitlines()[0]
    assert re.search(rf"\[{path.stem[:2]} {re.escape(first.removeprefix('# '))}\]", page), first


@pytest.mark.parametrize("cell", ["1 / 0", "assert 1 == 2, 'no'"])
def test_a_cell_that_fails_is_noticed(cell: str, maker: ModuleType) -> None:
    from nbclient.exceptions import CellExecutionError

    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell)])
    with pytest.raises(CellExecutionError):
        maker.execute(notebook, timeout=900)


def test_what_must_not_be_stored_is_found(maker: ModuleType) -> None:
    program = f"import sys\nprint('bar', file=sys.stderr)\nprint({str(ROOT / 'x')!r})\nprint('fine')"
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(program)])
    maker.execute(notebook, timeout=900)
    assert [fault.partition(":")[0] for fault in maker.faults(notebook)] == ["standard error", "a path"]
