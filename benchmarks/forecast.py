"""What `vgonio plan` expects of scenes and programs, beside what they take: seconds, memory of the process, errors.

    python benchmarks/forecast.py [NAME ...] [--threads 1 2] [--quick] [--references] [-o forecast.csv]
    python benchmarks/forecast.py --table forecast.csv [--update docs/howto/accuracy.md]

Names are scenes (files, those of this script, commands of README.md) and programs: examples, which are the notebooks
too, and the Python of README.md. Each runs in a process of its own with so many threads; every scene it simulates,
every point of its sweeps and every measurement is forecast by a calibration made at the start ("fresh") and by the
figures built in, and timed then. Ratios are expected over elapsed seconds, or over seconds of the processor where those
are fewer: by so much other programs were in the way. (With two threads seconds of the processor are mostly more.)
Memory is the largest of the process. Parts below 0.1 s and processes below 0.5 s are left out: nobody waits for them.
--references: waves once more with a tolerance ten times finer, for the error that was achieved.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
CHILD = ROOT / "benchmarks" / "forecast_run.py"
LEAST_SECONDS = 0.1
BUILT_IN = "built-in"
LIMIT_S = 900
COLUMNS = ("name", "threads", "part", "calls", "expected", "expected_built_in", "elapsed", "processor", "ratio",
           "ratio_built_in", "unit", "achieved")  # fmt: skip
README_PYTHON = "README.md"

LIGHT = {"wavelength_nm": [450, 550, 650], "theta_i_deg": [0, 30, 60], "coherence_um": 10}
CONES = {"theta_o_deg": {"start": -80, "stop": 80, "step": 5}, "aperture_deg": 2.0}


def scene(**tables: Any) -> dict[str, Any]:
    made: dict[str, Any] = {
        "surface": {
            "generate": {"kind": "gaussian", "rms_um": 0.3, "correlation_um": 4, "shape": [128, 128], "pitch_um": 0.5}
        },
        "material": {"name": "Al"},
        "light": LIGHT,
        "detector": CONES,
    }
    return {**made, **tables, "output": {"file": "x.nc", "report": "x.html"}}


def generated(kind: str, **more: Any) -> dict[str, Any]:
    return {"generate": {"kind": kind, **more}}


def cases() -> dict[str, Any]:
    """Scenes by name: files, or tables."""
    large = generated("gaussian", rms_um=1.0, correlation_um=10, shape=[1024, 1024], pitch_um=0.5)
    steep = generated("gaussian", rms_um=0.5, correlation_um=1.4, shape=[1, 400], pitch_um=0.1)
    few = {**LIGHT, "wavelength_nm": [550], "theta_i_deg": [30]}
    return {
        "init": str(ROOT / "vgonio" / "template.toml"),
        "demo": str(ROOT / "examples" / "demo" / "scene.toml"),
        "rays to 2 %": scene(geometric={"tol": 0.02, "rays": 10_000_000}),
        "steep rays": scene(
            surface=generated("gaussian", rms_um=2.0, correlation_um=4, shape=[256, 256], pitch_um=0.5),
            geometric={"rays": 500_000, "estimator": "binning"},
        ),
        "polarised": scene(geometric={"rays": 200_000, "polarised": True}, wave={"polarised": True, "tol": 1e-2}),
        "hemisphere": scene(
            light=few, detector={"kind": "hemisphere", "resolution_deg": 5}, geometric={"rays": 300_000}, wave={}
        ),
        "large map": scene(surface=large, geometric={"rays": 300_000}, wave={}, light={**LIGHT, "coherence_um": 30}),
        "fine tol": scene(wave={"tol": 1e-5}),
        "many windows": scene(wave={}, light={**LIGHT, "coherence_um": 3}),
        "shadows": scene(light={**few, "theta_i_deg": [70]}, wave={"shadowing": True, "tol": 1e-2}),
        "opencl": scene(light=few, wave={"method": "opencl"}),
        "grating": scene(
            surface=generated("lamellar", period_um=4, depth_um=0.2, shape=[80, 80], pitch_um=0.5),
            geometric={"rays": 200_000}, wave={},
        ),
        "full wave": scene(surface=steep, light={**few, "coherence_um": 3}, wave={"theory": "full-wave"}),
        "full wave, grating": scene(
            surface=generated("sinusoid", period_um=10, amplitude_um=0.4, shape=[1, 400], pitch_um=0.025),
            light={**few, "theta_i_deg": [0, 30]}, wave={"theory": "full-wave"},
        ),
        "iterated profile": scene(
            surface=steep, light={**few, "coherence_um": 3}, wave={"theory": "iterated-kirchhoff"}
        ),
        "iterated patch": scene(
            surface=generated("gaussian", rms_um=0.8, correlation_um=2.0, shape=[64, 64], pitch_um=0.2),
            light={**few, "coherence_um": 1.2}, wave={"theory": "iterated-kirchhoff", "window_um": 7},
        ),
    }  # fmt: skip


QUICK = ("init", "grating", "hemisphere")
# commands of README.md: scene, overrides, what was chosen by
COMMANDS: dict[str, dict[str, Any]] = {
    "simulate --set geometric.rays=200000": {"overrides": ["geometric.rays=200000"]},
    "simulate --max-seconds 60 --tol 0.02": {"chosen": {"max_seconds": 60, "tol": 0.02}},
}


def programs() -> dict[str, list[str]]:
    """Path below the project → arguments: the small version, and a folder or file for what it writes."""
    found = {}
    for path in sorted([*ROOT.glob("examples/[0-9]*.py"), *ROOT.glob("examples/14*/*.py")]):
        text = path.read_text(encoding="utf-8")
        quick = ["--quick"] if '"--quick"' in text else []
        out = re.search(r'add_argument\("-o", "--(\w+)"', text)
        written = (
            ["-o", "{folder}/figure.png" if "png" in text[out.start() : out.end() + 200] else "{folder}"] if out else []
        )
        found[str(path.relative_to(ROOT))] = quick + written
    found["examples/14_wavelength_shift/simulate.py"] = ["{folder}", "--quick"]
    return {**found, README_PYTHON: []}


def readme_python(folder: str) -> str:
    """The measurements of README.md's Python, on a surface that is there."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    block = re.search(r"```python\n(.*?)```", text, re.DOTALL)[1]  # type: ignore[index]
    lines = [line for line in block.splitlines() if re.match(r"import|surface =|gonio =|rays =|waves =|S =", line)]
    path, there = Path(folder, "readme.py"), ROOT / "heightfields" / "sample1.npz"
    path.write_text(re.sub(r'read\("[^"]*"\)', f'read("{there}")', "\n".join(lines)), encoding="utf-8")
    return str(path)


def names() -> list[str]:
    return [*cases(), *COMMANDS, *programs()]


# ---- runs
def environment(calibration: str, threads: int) -> dict[str, str]:
    from vgonio.cli.common import THREAD_VARIABLES

    return {**os.environ, "VGONIO_CALIBRATION": calibration, **dict.fromkeys(THREAD_VARIABLES, str(threads))}


def calibrated(path: str, threads: int = 1, processor_time: bool = False) -> None:
    """A calibration at `path`, for so many threads."""
    code = f"import vgonio as vg; vg.accuracy.calibrate(processor_time={processor_time})"
    subprocess.run([sys.executable, "-c", code], check=True, env=environment(path, threads))


def parts_of(name: str, calibration: str, threads: int, references: bool = False) -> list[dict[str, Any]]:
    """What a process of its own found out about a scene or program."""
    asked: dict[str, Any] = {"calibrations": {"fresh": calibration, BUILT_IN: "off"}, "references": references}
    with tempfile.TemporaryDirectory() as folder:
        if name in programs():
            asked["program"] = readme_python(folder) if name == README_PYTHON else str(ROOT / name)
            asked["arguments"] = [a.format(folder=folder) for a in programs()[name]]
        else:
            asked |= {"scene": cases().get(name, cases()["init"]), **COMMANDS.get(name, {})}
        done = subprocess.run(
            [sys.executable, str(CHILD), json.dumps(asked)],
            capture_output=True, text=True, check=False, timeout=LIMIT_S,
            env=environment(calibration, threads), cwd=folder,
        )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"{name}: {(done.stderr.strip() or 'no reason given').splitlines()[-1]}")
    return json.loads(done.stdout.splitlines()[-1])


def measured(name: str, calibration: str, threads: int = 1, references: bool = False) -> list[dict[str, Any]]:
    """Rows of one scene or program: its parts, all of them together, the memory and the errors."""
    found = parts_of(name, calibration, threads, references)
    timed = [r for r in found if "wall" in r]
    if not timed:
        return []
    whole = {
        "part": "all parts",
        "calls": max(r["calls"] for r in timed),
        **{k: sum(r[k] for r in timed) for k in ("wall", "cpu")},
        "expected": {n: sum(r["expected"][n] for r in timed) for n in timed[0]["expected"]},
    }
    rows = [_row(name, threads, r) for r in [*timed, whole] if min(r["wall"], r["cpu"]) >= LEAST_SECONDS]
    memory = max((r for r in found if "memory" in r), key=lambda r: r["memory"])
    ratio = memory["memory_expected"] / memory["memory"]
    rows.append(_plain(name, threads, "memory", memory["memory_expected"] / 1e6, memory["memory"] / 1e6, ratio, "MB"))
    for r in timed:
        if r.get("error_expected") is not None and r.get("error_stated"):
            achieved = r.get("error_achieved") or r["error_stated"]
            row = _plain(name, threads, f"{r['part']}, error", r["error_expected"], r["error_stated"],
                         r["error_expected"] / achieved, "")  # fmt: skip
            rows.append({**row, "achieved": achieved})
    return rows


def _row(name: str, threads: int, r: dict[str, Any]) -> dict[str, Any]:
    took = min(r["wall"], r["cpu"])
    fresh, built_in = r["expected"]["fresh"], r["expected"][BUILT_IN]
    part = "sweep, " + r["part"] if r.get("group") == "sweep" else r["part"]
    figures = (
        name,
        threads,
        part,
        r["calls"],
        fresh,
        built_in,
        r["wall"],
        r["cpu"],
        fresh / took,
        built_in / took,
        "s",
    )
    return dict(zip(COLUMNS, (*figures, "")))


def _plain(
    name: str, threads: int, part: str, expected: float, found: float, ratio: float, unit: str
) -> dict[str, Any]:
    return dict(zip(COLUMNS, (name, threads, part, "", expected, "", found, "", ratio, "", unit, "")))


# ---- the table of the docs
def read_rows(path: str) -> list[dict[str, Any]]:
    with open(path, newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def table(rows: Iterable[dict[str, Any]]) -> str:
    """Markdown, a line for each scene or program: ratios with one and two threads, by both calibrations."""
    found: dict[str, dict[tuple[str, str], dict[str, Any]]] = {}
    for r in rows:
        found.setdefault(r["name"], {})[r["part"], str(r["threads"])] = r
    lines = ["| scene or program | s | fresh | built in | 2 threads | memory | error |", "|" + "---|" * 7]
    for name, of in found.items():
        one, two = (of.get(("all parts", n), {}) for n in "12")
        if not one and not two:
            continue
        took = min((float(one[k]) for k in ("elapsed", "processor") if one), default=None)
        cells = [name.removesuffix(".py"), _two(took), _two(one.get("ratio")), _two(one.get("ratio_built_in"))]
        cells.append(_two(two.get("ratio")))
        cells.append(_two(of.get(("memory", "1"), of.get(("memory", "2"), {})).get("ratio")))
        errors = {p.removesuffix(", error"): r for (p, n), r in of.items() if p.endswith("error") and n == "1"}
        cells.append(", ".join(f"{p.split(' ')[0]} {_two(r['ratio'])}" for p, r in errors.items()))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _two(value: Any) -> str:
    """Two digits, or nothing."""
    if value in (None, ""):
        return ""
    number = float(value)
    return f"{number:.2f}" if number < 9.95 else f"{float(f'{number:.2g}'):.0f}"


BEGIN, END = "<!-- forecasts -->", "<!-- end -->"


def update(path: str, rows: Iterable[dict[str, Any]]) -> None:
    """The table between its marks in a page."""
    text = Path(path).read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    Path(path).write_text(f"{before}{BEGIN}\n{table(rows)}\n{END}{rest.split(END, 1)[1]}", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="scenes and programs; all without any")
    parser.add_argument("--list", action="store_true", help="their names")
    parser.add_argument("--quick", action="store_true", help=f"{', '.join(QUICK)} alone")
    parser.add_argument("--threads", type=int, nargs="+", default=[1], help="one and two, say")
    parser.add_argument("--references", action="store_true", help="errors achieved, of waves")
    parser.add_argument("--calibration", help="a calibration that is there, instead of a new one")
    parser.add_argument("-o", "--output", help="a CSV file as well")
    parser.add_argument("--table", help="print the table of such a file, and run nothing")
    parser.add_argument("--update", help="put it between the marks of this page instead")
    asked = parser.parse_args()
    if asked.list:
        print("\n".join(names()))
    elif asked.table:
        update(asked.update, read_rows(asked.table)) if asked.update else print(table(read_rows(asked.table)))
    else:
        run(asked.names or (list(QUICK) if asked.quick else names()), asked)


def run(chosen: list[str], asked: argparse.Namespace) -> None:
    from vgonio.accuracy import machine

    print(machine(), flush=True)
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(asked.calibration or Path(folder, "calibration.json")).resolve())
        for threads in asked.threads:
            if not asked.calibration:
                calibrated(path, threads)
            for name in chosen:
                for row in measured(name, path, threads, asked.references):
                    rows.append(row)
                    print(in_line(row), flush=True)
                if asked.output:
                    write(asked.output, rows)
    for part in ("all parts", "memory"):
        ratios = [r["ratio"] for r in rows if r["part"] == part]
        if ratios:
            print(f"{part}: expected over measured {min(ratios):.2f} to {max(ratios):.2f}")


def in_line(r: dict[str, Any]) -> str:
    figures = " ".join(f"{r[k]:9.3g}" if r[k] != "" else " " * 9 for k in COLUMNS[4:8])
    ratios = " ".join(f"{r[k]:6.2f}" if r[k] != "" else " " * 6 for k in COLUMNS[8:10])
    return f"{r['name'][-36:]:36} {r['threads']} {r['part']:26} {figures} {ratios} {r['unit']:2} {r['achieved']}"


def write(path: str, rows: list[dict[str, Any]]) -> None:
    with open(path, "w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
