"""The table of what was checked, from what the tests found: `make validated`, after `make test`.

A test states an agreement with the fixture of that name (tests/conftest.py), which asserts it; a run of the tests
leaves what it found in out/validated.json. This program merges the cases of one quantity into a row, keeps the last
figure, with its date, of rows whose test did not run (no measurements at hand), and writes docs/validated.csv,
docs/validated_table.md and the short table of README.md. tests/test_validated.py holds the files to the tests.

    python docs/validated.py
"""

from __future__ import annotations

import ast
import csv
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
RECORDS = ROOT / "out" / "validated.json"
STORE = ROOT / "docs" / "validated.csv"
TABLE = ROOT / "docs" / "validated_table.md"
README = ROOT / "README.md"
MARKS = "<!-- validated -->\n", "<!-- end -->"
COLUMNS = (
    "part", "quantity", "against", "achieved_from", "achieved", "allowed_from", "allowed", "unit", "cases", "tests",
    "date", "version", "commit", "machine",
)  # fmt: skip
# the first folder that a test's path begins with, and the heading of its rows
PARTS = {
    "tests/surface": "Surfaces",
    "tests/materials": "Materials",
    "tests/geometric": "Rays",
    "tests/wave/full_wave": "Full wave",
    "tests/wave/iterated": "Waves, multiple reflections",
    "tests/wave": "Waves",
    "tests/contracts": "Rays beside waves",
    "tests/measure": "Measurements",
    "tests/models": "Models of BRDFs",
    "tests/compare": "Comparison and fits",
    "tests/render": "Renderer",
    "tests/display": "Displays",
    "tests/test_benchmarks.py": "Long runs, by benchmarks",
    "tests": "Whole runs",
}
# the rows of the README: each another kind of proof
TELLING = (
    "|S|² of a sinusoid, orders −6 … 6, q_z a up to 6",
    "total integrated scatter, T = 5λ, 0 … 60°, three theories (4 standard errors + 1 %)",
    "Kirchhoff and GHS on aluminium sinusoids, depth 0.1 µm, period 2 and 5 µm, 3 … 58°, Σ|Δ|/Σ",
    "full wave: cylinders, perfect, glass, metal",
    "full wave: aluminium sinusoids, TE and TM, each order (the digits of the reference: 5e-7)",
    "iterated Kirchhoff with diffraction, steep profiles, 0 … 70°, Σ|Δ|/Σ",
    "energy of rays, loss-free, 0 … 89°, slopes 0 … 1.5, walls up to four times as deep as wide",
    "masked single reflections (4 standard errors + 0.3 %)",
    "λ → 0 with shadows, 70°, towards grazing (without shadows a third too much; 3 standard errors + 10 %)",
    "RGL `.bsdf`, random tables and written BRDFs",
    "counts with noise, calibrated, 200 seeds: χ² of each value",
    "fitted parameters of 18 synthetic cases, 50 seeds, up to 8 decades: χ²/dof (benchmarks/fits.py)",
    "Mitsuba plug-ins in plane, scalar and llvm",
    "mean irradiance of the closed white box (standard error up to 0.5 %)",
    "ICC v4 profile, 3,000 colours: mean ΔE₀₀",
)


class Registered(NamedTuple):
    """A row as the source of a test states it."""

    quantity: str
    against: str
    file: str


def registered(folder: Path = ROOT / "tests") -> Iterator[Registered]:
    """Every call `agreement("quantity", "against", …)` in the tests; both have to be plain strings, to be found."""
    for path in sorted(folder.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and "agreement" in (a.arg for a in node.args.args):
                for call in (n for n in ast.walk(node) if isinstance(n, ast.Call)):
                    if getattr(call.func, "id", "") == "agreement":
                        yield Registered(*_texts(call, path), path.relative_to(ROOT).as_posix())


def _texts(call: ast.Call, path: Path) -> list[str]:
    texts = [a.value for a in call.args[:2] if isinstance(a, ast.Constant) and isinstance(a.value, str)]
    if len(texts) != 2:
        raise ValueError(f"{path}:{call.lineno}: agreement() takes two plain strings first")
    return texts


def part(test: str) -> str:
    return next(name for start, name in PARTS.items() if test.startswith(start))


def merged(records: list[dict[str, Any]]) -> dict[str, str]:
    """One row from the cases of a quantity: of limits from above the case nearest to its limit, of ranges all of them.

    records : as the fixture makes them
    """
    first = records[0]
    tests = list(dict.fromkeys(r["test"] for r in records))
    row = {"part": part(tests[0]), "quantity": first["quantity"], "against": first["against"], "unit": first["unit"]}
    if first["allowed_from"] is None:
        worst = max(records, key=lambda r: r["achieved"] / r["allowed"] if r["allowed"] else r["achieved"])
        limits = sorted({r["allowed"] for r in records})
        row |= {"achieved_from": "", "achieved": f"{worst['achieved']:.2g}", "allowed": f"{worst['allowed']:.4g}"}
        row["allowed_from"] = f"{limits[0]:.4g} … {limits[-1]:.4g}" if len(limits) > 1 else ""
    else:
        low, high = min(r["achieved_from"] for r in records), max(r["achieved"] for r in records)
        row |= {"achieved_from": f"{low:.3g}", "achieved": f"{high:.3g}"}
        row |= {"allowed_from": f"{first['allowed_from']:.4g}", "allowed": f"{first['allowed']:.4g}"}
    newest = max(records, key=lambda r: r["date"])
    row |= {"cases": str(sum(r["cases"] for r in records)), "tests": " ".join(tests)}
    return row | {k: newest[k] for k in ("date", "version", "commit", "machine")}


def stored() -> dict[str, dict[str, str]]:
    """The rows of docs/validated.csv by quantity; none where there is no such file."""
    if not STORE.exists():
        return {}
    with STORE.open(encoding="utf-8", newline="") as stream:
        return {row["quantity"]: row for row in csv.DictReader(stream)}


def rows(found: list[dict[str, Any]]) -> list[dict[str, str]]:
    """The table: what was found now, else what is stored; in the order of PARTS, and of the tests in each part."""
    asked = {r.quantity: r for r in registered()}
    before, now = stored(), {}
    for quantity, entry in asked.items():
        records = [r for r in found if (r["quantity"], r["against"]) == entry[:2]]
        if records:
            now[quantity] = merged(records)
        elif quantity in before:
            now[quantity] = {**before[quantity], "against": entry.against}
        else:
            print(f"no figure for {quantity!r} ({entry.file}): run its test", file=sys.stderr)
    order = list(dict.fromkeys(PARTS.values()))
    return sorted(now.values(), key=lambda r: order.index(r["part"]))


def number(text: str) -> str:
    """Three digits, below a hundredth as 3.2e-7."""
    value = float(text)
    if not 0 < abs(value) < 0.01:
        return f"{value:.3g}"
    mantissa, exponent = f"{value:.2e}".split("e")
    return f"{float(mantissa):g}e{int(exponent)}"


def cells(row: dict[str, str]) -> list[str]:
    """Quantity, against, achieved and allowed as they are printed."""
    unit = row["unit"] and f" {row['unit']}"
    achieved, allowed = number(row["achieved"]) + unit, number(row["allowed"]) + unit
    if row["achieved_from"]:
        low, edge = number(row["achieved_from"]), number(row["allowed_from"])
        achieved = achieved if low + unit == achieved else f"{low} … {achieved}"
        allowed = f"{edge}{unit} or more" if row["allowed"] == "inf" else f"{edge} … {allowed}"
    elif row["allowed_from"]:
        low, high = (number(n) for n in row["allowed_from"].split(" … "))
        allowed += f" ({low} … {high})" if low != high else ""
    return [t.replace("|", "\\|") for t in (row["quantity"], row["against"], achieved, allowed)]


def shortened(tests: str) -> str:
    """Tests as code, the path of the file once."""
    by_file: dict[str, list[str]] = {}
    for test in tests.split():
        file, _, name = test.partition("::")
        by_file.setdefault(file, []).append(name)
    return ", ".join(f"`{file}::" + "`, `::".join(names) + "`" for file, names in by_file.items())


def linked(tests: str) -> str:
    """Names of tests with links to their files, for the README."""
    return ", ".join(f"[`{name}`]({file})" for file, _, name in (test.partition("::") for test in tests.split()))


def lines(chosen: list[dict[str, str]], date: str, named: Callable[[str], str] = shortened) -> list[str]:
    """A Markdown table; a row of another date than the rest says so."""
    out = ["| quantity | against | achieved | allowed | test |", "|---|---|---|---|---|"]
    for row in chosen:
        text = cells(row)
        text[2] += f" ({row['date']})" if row["date"] != date else ""
        out.append("| " + " | ".join([*text, named(row["tests"])]) + " |")
    return out


def page(table: list[dict[str, str]]) -> str:
    """The full table by part, with where and when it was measured."""
    newest = max(table, key=lambda r: r["date"])
    commits = {row["commit"] for row in table}
    commit = f"commit {newest['commit']}" if len(commits) == 1 else "the commits that validated.csv names"
    out = [
        f"Measured {newest['date']}, vgonio {newest['version']} at {commit}, on {newest['machine']}; "
        "a row of another day says so.\n"
    ]
    for name in dict.fromkeys(row["part"] for row in table):
        out += [f"## {name}\n", *lines([r for r in table if r["part"] == name], newest["date"]), ""]
    return "\n".join(out)


def short(table: list[dict[str, str]]) -> str:
    """The rows of the README."""
    chosen = {r["quantity"]: r for r in table if r["quantity"] in TELLING}
    return "\n".join(lines([chosen[q] for q in TELLING], max(r["date"] for r in table), linked)) + "\n"


def spliced(text: str, made: str) -> str:
    """The README with `made` between its marks."""
    before, rest = text.split(MARKS[0])
    return before + MARKS[0] + made + MARKS[1] + rest.split(MARKS[1], 1)[1]


def main() -> None:
    if not RECORDS.exists():
        sys.exit(f"no {RECORDS.relative_to(ROOT)}: `make test` writes it")
    found = [r for records in json.loads(RECORDS.read_text(encoding="utf-8")).values() for r in records]
    table = rows(found)
    with STORE.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(table)
    TABLE.write_text(page(table), encoding="utf-8")
    README.write_text(spliced(README.read_text(encoding="utf-8"), short(table)), encoding="utf-8")
    print(f"{len(table)} rows from {len(found)} figures: docs/validated.csv, docs/validated_table.md, README.md")


if __name__ == "__main__":
    main()
