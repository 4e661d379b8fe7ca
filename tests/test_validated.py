"""The table "validated against" and the tests it stands for say the same."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def table() -> ModuleType:
    spec = importlib.util.spec_from_file_location("validated", ROOT / "docs" / "validated.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_row_has_its_test_and_every_test_its_row(table) -> None:
    """`make test validated` puts right what this finds."""
    asked: dict[tuple[str, str], set[str]] = {}
    for row in table.registered():
        asked.setdefault((row.quantity, row.against), set()).add(row.file)
    assert len({quantity for quantity, _ in asked}) == len(asked), "a quantity is held against one thing"
    written = {(r["quantity"], r["against"]): {t.partition("::")[0] for t in r["tests"].split()}
               for r in table.stored().values()}  # fmt: skip
    assert set(written) - set(asked) == set(), "rows without a test"
    assert set(asked) - set(written) == set(), "tests without a row: `make test validated`"
    assert {k: v for k, v in written.items() if not v <= asked[k]} == {}, "rows that name another file"
    assert len(written) > 70


def test_tests_that_are_named_exist(table) -> None:
    for row in table.stored().values():
        for test in row["tests"].split():
            file, _, name = test.partition("::")
            assert f"def {name}(" in (ROOT / file).read_text(encoding="utf-8"), test


def test_figures_are_within_what_is_allowed(table) -> None:
    for row in table.stored().values():
        achieved, allowed = float(row["achieved"]), float(row["allowed"])
        if row["achieved_from"]:
            assert float(row["allowed_from"]) <= float(row["achieved_from"]) <= achieved, row["quantity"]
        # two and three digits are kept
        assert achieved <= allowed * (1 + 5e-3) + 5e-3 * abs(allowed), row["quantity"]
        assert row["date"] > "2026"
        assert row["machine"]


def test_pages_are_what_the_program_writes(table) -> None:
    """docs/validated_table.md and the README's table come from docs/validated.csv and were not written by hand."""
    rows = list(table.stored().values())
    assert table.TABLE.read_text(encoding="utf-8") == table.page(rows)
    readme = table.README.read_text(encoding="utf-8")
    assert table.spliced(readme, table.short(rows)) == readme
    assert readme.count("\n| ") > 10


# ---- the program
RECORD = {
    "quantity": "q", "against": "a|b", "unit": "", "cases": 2, "achieved_from": None, "achieved": 3e-7,
    "allowed_from": None, "allowed": 1e-6, "test": "tests/wave/test_kirchhoff.py::test_x", "date": "2026-11-22",
    "version": "0.1.0", "commit": "abc", "machine": "one",
}  # fmt: skip


def test_the_case_nearest_to_its_limit_is_shown(table) -> None:
    other = {**RECORD, "achieved": 5e-3, "allowed": 1e-2, "test": "tests/wave/test_kirchhoff.py::test_y"}
    row = table.merged([RECORD, other])
    assert (row["achieved"], row["allowed"], row["cases"], row["part"]) == ("0.005", "0.01", "4", "Waves")
    assert table.cells(row) == ["q", "a\\|b", "5e-3", "0.01 (1e-6 … 0.01)"]
    assert table.shortened(row["tests"]) == "`tests/wave/test_kirchhoff.py::test_x`, `::test_y`"


def test_ranges_are_joined(table) -> None:
    a = {**RECORD, "achieved_from": 0.9, "achieved": 1.0, "allowed_from": 0.5, "allowed": 1.5, "unit": "%"}
    row = table.merged([a, {**a, "achieved_from": 0.8, "date": "2026-11-23", "commit": "def"}])
    assert table.cells(row)[2:] == ["0.8 … 1 %", "0.5 … 1.5 %"]
    assert (row["date"], row["commit"]) == ("2026-11-23", "def")
    assert table.cells({**row, "allowed": "inf"})[3] == "0.5 % or more"


def test_a_figure_of_another_day_says_so(table) -> None:
    rows = [table.merged([RECORD]), table.merged([{**RECORD, "date": "2026-11-20", "quantity": "old"}])]
    text = table.page(rows)
    assert "at the commits that validated.csv names" in table.page([rows[0], {**rows[1], "commit": "def"}])
    assert "Measured 2026-11-22, vgonio 0.1.0 at commit abc, on one" in text
    assert "| old | a\\|b | 3e-7 (2026-11-20) | 1e-6 |" in text


def test_what_is_no_agreement_fails(agreement, request) -> None:
    """The fixture asserts, on numbers, arrays, ranges and what is no number, and records nothing then."""
    for achieved, allowed in ((2.0, 1.0), ([0.1, -2.0], 1.0), (float("nan"), 1.0), (0.4, (0.5, 1.0)), ([0, 1], [1, 0])):
        call = agreement  # so that the source of this test makes no row
        with pytest.raises(AssertionError):
            call("no row", "nothing", achieved, allowed)
    assert [v for k, v in request.node.user_properties if k == "agreement"] == []


def test_the_table_keeps_its_word(agreement, printed, request, monkeypatch) -> None:
    """Ten times the share of the limit that is in print fails, what is rounding does not; the record is kept."""
    call = agreement
    monkeypatch.setitem(printed, "q", 1e-3)
    call("q", "a", 9e-9, 1e-6)
    call("q", "a", 9e-3, 1.0)
    with pytest.raises(AssertionError, match="renews it"):
        call("q", "a", 2e-8, 1e-6)
    monkeypatch.setitem(printed, "q", 1e-16)
    call("q", "a", 1e-14, 1e-9)
    assert len(request.node.user_properties) == 4
    request.node.user_properties.clear()
